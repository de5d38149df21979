"""Which tests are slow, and why; whatever is not named here is quick."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).parents[1]

# Folders, files, and tests of a file (behind ``::``), from the folder of the tests.
SLOW = {
    "they run in real time, on a bus or in programs of their own": (
        "socketcan",
        "stories/test_story_beside.py",
        "stories/test_story_boot_up.py",
        "stories/test_story_bus_off.py",
        "stories/test_story_dead_bus.py",
        "stories/test_story_event_timer.py",
        "stories/test_story_exit.py",
        "stories/test_story_first_fault.py",
        "stories/test_story_flood.py",
        "stories/test_story_killed.py",
        "stories/test_story_monitor_listen.py",
        "stories/test_story_node_program.py",
        "stories/test_story_on_change.py",
        "stories/test_story_opening.py",
        "stories/test_story_rpdo_on_arrival.py",
        "stories/test_story_second_master.py",
        "stories/test_story_set_point_edge.py",
        "stories/test_story_signals.py",
        "stories/test_story_standing.py",
        "stories/test_story_starved.py",
        "stories/test_story_suspended.py",
        "stories/test_story_two_axes.py",
        "stories/test_story_ways_out.py",
        "test_pages.py",
        "test_examples.py",
        "test_start.py",
        "bus/test_bus_durand.py",
        "bus/test_bus_lss_stand_in.py",
        "bus/test_bus_parallel.py",
        "bus/test_bus_stand_in.py",
        "bus/test_bus_tshark.py",
        "bus/test_bus_verify.py",
        "cli/test_cli_config.py",
        "cli/test_cli_lss.py",
        "cli/test_cli_od.py",
        "cli/test_cli_save.py",
        "sim/test_sim_network.py",
        "mutation/test_mutation_trial.py",
        "cli/test_cli_commands.py::test_demo_writes_recording_and_picture",
        "cli/test_cli_commands.py::test_move_with_another_makers_eds",
    ),
    "they try hundreds of random cases, or every combination": (
        "fuzz",
        "motion/test_motion_commands_by_state.py",
        "stories/test_story_groups.py::test_all_start_or_none_does_in_whatever_cycle_one_is_taken_away",
        "stories/test_story_handshake.py::test_a_replacement_at_any_moment_of_the_handshake_ends_at_the_last_target",
        "stories/test_story_limits.py",
        "stories/test_story_plants.py",
        "stories/test_story_random.py",
        "cli/test_cli_fuzz.py",
        "eds/test_eds_fuzz.py",
        "eds/test_eds_reports_fuzz.py",
        "eds/test_eds_check_planted.py",
        "sim/test_sim_sdo_sweep.py",
        "cia305/test_lss_exclude.py",
        "bus/test_bus_inbox.py::test_a_hundred_thousand_waits_of_a_few_microseconds_all_end",
        "bus/test_bus_inbox.py::test_the_waits_of_sdo_and_lss_end_however_short",
        "cell/test_cell_schema.py::test_nothing_that_the_reader_takes_is_refused",
        "cell/test_cell_schema.py::test_a_value_of_another_kind_is_refused",
        "check/test_check_damage.py",
        "sim/test_sim_sdo_block.py::test_random_loss_never_gives_wrong_data",
        "sim/test_sim_sdo_block.py::test_whatever_is_lost_or_late_data_is_right_or_there_is_an_error",
        "stories/test_story_arguments.py::test_no_number_however_absurd_ends_the_scan_or_fails_in_any_way_but_ours",
    ),
    "they take large files, or a whole program's text": (
        "bus/test_bus_inbox.py::test_no_module_waits_at_a_simple_queue",
        "cli/test_cli_eds_reports.py::test_show_and_diff_of_a_large_drive_start_and_end_within_half_a_second",
        "eds/test_eds_code.py::test_mypy_strict_accepts_the_modules",
        "eds/test_eds_cost.py",
        "eds/test_eds_files.py::test_a_monstrous_file_is_read_in_bounded_time",
    ),
    "they read every maker's file": (
        "bus/test_bus_plan_corpus.py",
        "check/test_check_agrees.py",
        "check/test_check_example.py",
        "configuration/test_configuration_corpus.py",
        "eds/test_eds_check_corpus.py",
        "eds/test_eds_corpus.py",
        "eds/test_eds_code.py::test_every_real_file_gives_a_module_with_unique_names",
        "eds/test_eds_fix.py::test_fix_does_what_check_asks_for",
        "eds/test_eds_fix.py::test_real_files_say_the_same_when_mended",
        "eds/test_eds_diff.py::test_real_files_of_one_maker_differ_alike_in_both_directions",
        "eds/test_eds_doc.py::test_every_real_file_becomes_a_page_with_a_drawing_for_each_pdo",
        "eds/test_eds_show.py::test_every_real_file_is_shown_with_each_of_its_objects",
        "eds/test_eds_dcf.py::test_real_files_become_a_dcf_and_a_concise_dcf",
        "sim/test_sim_corpus.py",
    ),
}
# Begun first: a long file that one process begins last is waited for by all the others.
LONG = (
    "test_pages.py",
    "test_examples.py",
    "test_story_random.py",
    "test_story_plants.py",
    "test_eds_corpus.py",
    "test_story_bus_off.py",
    "test_story_signals.py",
    "test_story_dead_bus.py",
    "test_eds_reports_fuzz.py",
    "test_story_suspended.py",
    "test_eds_check_planted.py",
    "test_cli_commands.py",
    "test_cli_fuzz.py",
    "test_sim_sdo_sweep.py",
    "test_bus_inbox.py",
)
NAMES = frozenset(name for names in SLOW.values() for name in names)


def is_slow(path: Path, test: str = "") -> bool:
    """Whether a folder, a file or one of its tests (by its function's name) is named here, or stands in what is."""
    if not path.is_relative_to(TESTS):
        return False
    here = path.relative_to(TESTS)
    return any(name in NAMES for name in (*map(str, (here, *here.parents)), f"{here}::{test}"))
