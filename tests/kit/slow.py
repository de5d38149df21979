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
        "mutation/test_mutation_trial.py",
    ),
    "they try hundreds of random cases, or every combination": (
        "fuzz",
        "stories/test_story_plants.py",
        "stories/test_story_random.py",
        "cli/test_cli_fuzz.py",
        "eds/test_eds_fuzz.py",
        "eds/test_eds_reports_fuzz.py",
        "eds/test_eds_check_planted.py",
        "sim/test_sim_sdo_sweep.py",
        "cia305/test_lss_exclude.py",
    ),
    "they read every maker's file": (
        "bus/test_bus_plan_corpus.py",
        "check/test_check_agrees.py",
        "check/test_check_example.py",
        "configuration/test_configuration_corpus.py",
        "eds/test_eds_check_corpus.py",
        "eds/test_eds_corpus.py",
        "sim/test_sim_corpus.py",
    ),
}
# Begun first: a long file that one process begins last is waited for by all the others.
LONG = (
    "test_pages.py",
    "test_examples.py",
    "test_story_random.py",
    "test_story_suspended.py",
    "test_story_plants.py",
    "test_eds_corpus.py",
    "test_story_bus_off.py",
    "test_story_signals.py",
    "test_story_dead_bus.py",
    "test_eds_reports_fuzz.py",
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
