"""Which tests are slow, and why; whatever is not named here is quick."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

TESTS = Path(__file__).parents[1]

# Why a test must run in real time, so that a computer which keeps it waiting can delay it. Each other test must not.
# Folders, files, and tests of a file (behind ``::``), from the folder of the tests.
REAL_TIME = {
    "a browser shows the page": (
        "web/test_web_browser.py",
        "web/test_web_browser_access.py",
        "web/test_web_browser_axis.py",
        "web/test_web_browser_config.py",
        "web/test_web_browser_connection_loss.py",
        "web/test_web_browser_objects.py",
        "web/test_web_browser_scope.py",
        "web/test_web_browser_tuning.py",
    ),
    "the kernel's CAN carries the frames, or the kernel stamps them": (
        "bus/test_bus_cyclic_frames.py::test_a_clock_that_is_set_makes_no_frame_older_than_the_last_look_or_of_the_future",
        "bus/test_bus_cyclic_frames.py::test_the_stamp_of_a_frame_is_its_reception_and_not_its_reading",
        "bus/test_bus_cyclic_frames.py::test_each_frame_has_its_own_receive_time_and_not_that_of_the_frame_before",
        "bus/test_bus_raw_sockets.py::test_frames_received_together_are_taken_together_with_the_kernels_time",
        "socketcan",
    ),
    "processes end, hang, or are killed, suspended or signalled, or belong to another user": (
        "cli/test_cli_attach_processes.py",
        "cli/test_cli_replace_processes.py",
        "core/test_core_listener.py::test_a_machine_of_another_user_is_found_and_neither_joined_nor_trusted",
        "core/test_core_listener.py::test_a_request_of_another_user_is_refused_whatever_it_contains",
        "core/test_core_listener.py::test_root_may_stop_a_machine_of_the_owner_of_the_cell_file",
        "core/test_core_faults.py::test_a_fault_that_a_program_dies_of_is_kept_with_its_stop",
        "core/test_core_attach_processes.py",
        "core/test_core_process.py",
        "drives/gim6010/test_mit_control.py::test_a_signal_switches_the_module_off",
        "machine/test_signal_wakeup.py",
        "scenarios/test_scenario_io_bus.py::test_a_killed_core_leaves_safe_outputs",
        "scenarios/test_scenario_io_bus.py::test_a_killed_program_leaves_safe_outputs_once_its_axis_is_off",
        "scenarios/test_scenario_killed_config.py",
        "scenarios/test_scenario_can_simple_processes.py",
        "scenarios/test_scenario_processes.py",
        "scenarios/test_scenario_second_master.py::test_ctrl_c_while_listening_for_another_master_leaves_nothing_behind",
        "scenarios/test_scenario_signals.py",
        "scenarios/test_scenario_suspended_master.py",
        "scenarios/test_scenario_virtual_axis.py::test_if_the_core_is_killed_a_virtual_axis_is_not_reported",
        "scenarios/test_scenario_program_end_processes.py",
    ),
    "the load of the computer is what it is about: floods, crowds, and threads that hold the interpreter": (
        "cli/test_cli_jitter.py",
        "core/test_core_listener.py::test_a_request_to_stop_is_taken_while_others_connect_repeatedly",
        "gateway/test_gateway_metrics.py::test_silent_connections_exclude_no_client_and_use_few_threads",
        "scenarios/test_scenario_flood.py::test_four_threads_that_command_without_a_pause_take_no_cycles_and_keep_no_stop_waiting",
        "scenarios/test_scenario_cpu_starvation.py::test_a_callback_that_holds_the_scan_up_is_named_and_no_adapter",
        "scenarios/test_scenario_cpu_starvation.py::test_a_thread_that_holds_the_interpreter_is_named_and_no_hardware",
        "scenarios/test_scenario_cpu_starvation.py::test_simulated_drives_that_are_given_no_time_are_named_and_no_node_is_called_lost",
        "scenarios/test_scenario_cpu_starvation.py::test_the_location_of_a_thread_is_found",
        "sim/test_sim_socketcand_server.py::test_a_client_that_does_not_read_or_sends_nonsense_is_disconnected_without_a_delay",
    ),
    "computing must take time, or its processor time is measured": (
        "scenarios/test_scenario_boot_up.py::test_boot_prints_letter_step_object_expected_and_got",
    ),
    "a program of its own, a kernel or a terminal is started, as users start it": (
        "cli/test_cli_check.py::test_monitor_keeps_one_table_on_a_terminal",
        "cli/test_cli_check.py::test_no_color_holds_for_trace_too",
        "cli/test_cli_check.py::test_scan_draws_a_table_on_a_terminal",
        "cli/test_cli_stop_processes.py",
        "cli/test_cli_record.py::test_a_moment_of_a_running_program_is_recorded",
        "cli/test_cli_record.py::test_the_recording_of_a_killed_program_can_be_read_up_to_its_last_second",
        "cli/test_cli_record.py::test_ctrl_c_is_the_usual_end",
        "cli/test_cli_sim.py",
        "cli/test_cli_continuous_motion.py::test_a_held_key_does_not_undo_a_halt_of_another_program",
        "cli/test_cli_continuous_motion.py::test_a_held_key_moves_the_axis_and_its_release_stops_it",
        "cli/test_cli_continuous_motion.py::test_closing_the_terminal_of_turn_stops_the_axis",
        "cli/test_cli_continuous_motion.py::test_a_halt_of_another_program_ends_the_command",
        "cli/test_cli_continuous_motion.py::test_beside_a_program_that_moves_an_axis_a_jog_is_refused_before_it_takes_a_key",
        "core/test_core_probe.py",
        "drives/test_drives_without_plugin.py",
        "gateway/test_gateway_metrics.py::test_the_bridge_follows_one_machine_after_the_other_and_changes_none",
        "gateway/test_gateway_opcua_processes.py",
        "mutation/test_mutation_trial.py::test_a_planted_mutant_that_no_test_notices_is_reported_as_a_survivor",
        "record/test_record_triggers_bus.py::test_another_program_keeps_the_moment_of_an_input_and_of_a_touch_probe",
        "test_examples.py::test_an_example_runs_as_a_program",
        "test_examples.py::test_the_demo_runs_as_printed_and_leaves_a_cell_file_to_continue_with",
        "test_examples.py::test_the_ten_line_program_runs_as_printed",
        "test_notebooks.py",
        "test_pages.py::test_each_command_line_beside_simulated_drives_runs_as_printed",
        "system/test_system_played.py::test_another_receiver_of_the_numbers_of_signals_gets_them_on_windows",
        "system/test_system_played.py::test_ctrl_c_stops_an_axis_while_the_program_is_in_a_long_call",
        "system/test_system_played.py::test_the_demo_moves_the_simulated_cell_at_real_speed",
        "web/test_web_attacks.py",
        "web/test_web_file_process.py",
        "web/test_web_machine_page.py",
    ),
    "a terminal of the kernel carries the bytes of a serial line, and pymodbus waits for them": (
        "drives/gim6010/test_cli_gim6010_modbus.py",
        "drives/gim6010/test_cli_modbus_cell.py",
        "drives/gim6010/test_machine_modbus.py",
    ),
    "a program or a library with threads of its own, that is not ours, is at the other end": (
        "bus/test_bus_tshark.py",
        "cli/test_cli_fleet.py",
        "fleet/test_fleet_cells.py",
        "fleet/test_fleet_network.py",
        "gateway/test_gateway_zenoh.py",
        "gateway/test_gateway_zenoh_tls.py",
        "gateway/test_ros_bridge.py",
        "sim/test_sim_network.py::test_canopens_own_402_master_enables_and_moves_a_simulated_drive",
        "sim/test_sim_network.py::test_canopens_own_402_master_sees_a_quick_stop_at_standstill",
    ),
}
VIRTUAL_TIME = "they run with all threads of a bus, in virtual time"
SLOW = {
    **REAL_TIME,
    VIRTUAL_TIME: (
        "boot/test_boot_cells.py",
        "boot/test_boot_dcf.py",
        "drives/gim6010/test_boot_can_simple_bus.py",
        "bus/test_bus_adapter.py::test_a_socketcand_server_that_reads_no_more_is_a_full_queue_and_gets_every_frame_whole",
        "bus/test_bus_bitrate_change.py",
        "drives/gim6010/test_bus_gim6010_endpoints.py",
        "drives/gim6010/test_bus_gim6010_messages.py",
        "bus/test_bus_node_discovery.py",
        "bus/test_bus_durand.py",
        "bus/test_bus_lss.py",
        "bus/test_bus_lss_simulated_drive.py",
        "bus/test_bus_nmt_confirm.py",
        "bus/test_bus_ownership.py",
        "bus/test_bus_parallel_nodes.py",
        "bus/test_bus_simulated_drive.py",
        "bus/test_bus_eds_verification.py",
        "cli/test_cli_input_validation.py",
        "cli/test_cli_code_cell.py",
        "cli/test_cli_commands.py",
        "cli/test_cli_config.py",
        "cli/test_cli_factory_protocols.py",
        "drives/gim6010/test_cli_gim6010_calibrate.py",
        "drives/gim6010/test_cli_gim6010_commissioning.py",
        "drives/gim6010/test_cli_gim6010_find.py",
        "drives/gim6010/test_cli_gim6010_modbus_arguments.py",
        "drives/gim6010/test_cli_gim6010_params.py",
        "drives/gim6010/test_cli_gim6010_settings.py",
        "drives/gim6010/test_cli_gim6010_tune.py",
        "cli/test_cli_headings.py",
        "cli/test_cli_init.py",
        "cli/test_cli_lss.py",
        "cli/test_cli_od.py",
        "cli/test_cli_gantry.py",
        "cli/test_cli_probe.py",
        "cli/test_cli_program.py",
        "cli/test_cli_record.py",
        "cli/test_cli_replace.py",
        "cli/test_cli_save.py",
        "cli/test_cli_sim_interface.py",
        "cli/test_cli_standard_streams.py",
        "cli/test_cli_continuous_motion.py",
        "cli/test_cli_progress.py",
        "cli/test_cli_virtual_axis.py",
        "drives/gim6010/test_core_can_simple.py",
        "core/test_core_listener.py",
        "core/test_core_faults.py",
        "core/test_core_user_kinematics.py",
        "core/test_core_stream_resume.py",
        "drives/gim6010/test_modbus_serial.py",
        "gateway/test_gateway_metrics.py",
        "machine/test_machine_services.py",
        "machine/test_machine_texts.py",
        "drives/gim6010/test_mit_control.py",
        "motion/test_motion_handles.py",
        "record/test_record_capture.py::test_in_real_time_the_capture_is_written_outside_the_cycle",
        "record/test_record_triggers_bus.py",
        "record/test_record_mcap_readers.py",
        "scenarios/test_scenario_external_stop.py",
        "scenarios/test_scenario_boot_up.py",
        "scenarios/test_scenario_bus_off.py",
        "scenarios/test_scenario_controller_bus.py",
        "scenarios/test_scenario_cyclic_bus.py",
        "scenarios/test_scenario_dead_bus.py",
        "scenarios/test_scenario_event_timer.py",
        "scenarios/test_scenario_exit.py",
        "scenarios/test_scenario_feed_forward_bus.py",
        "scenarios/test_scenario_first_fault.py",
        "scenarios/test_scenario_foreign_slaves.py",
        "scenarios/test_scenario_groups.py::test_several_threads_that_command_one_group_at_once_leave_no_handle_open",
        "scenarios/test_scenario_groups.py::test_the_handle_of_a_group_of_one_axis_ends_in_real_time_too",
        "scenarios/test_scenario_groups.py::test_an_exception_of_a_callback_in_the_scan_thread_does_not_end_the_scan",
        "scenarios/test_scenario_groups.py::test_an_exception_of_a_trajectory_in_the_scan_thread_does_not_end_the_scan",
        "scenarios/test_scenario_interpolated_bus.py",
        "scenarios/test_scenario_io_bus.py",
        "scenarios/test_scenario_gateway_delay.py",
        "scenarios/test_scenario_limits.py::test_in_real_time_on_a_bus_a_turning_axis_stops_within_its_limits",
        "scenarios/test_scenario_can_simple.py",
        "scenarios/test_scenario_monitor_listen.py",
        "scenarios/test_scenario_node_program.py",
        "scenarios/test_scenario_setpoint_without_ack.py",
        "scenarios/test_scenario_opening_errors.py",
        "scenarios/test_scenario_rpdo_on_arrival.py",
        "scenarios/test_scenario_second_master.py",
        "scenarios/test_scenario_set_point_edge.py",
        "scenarios/test_scenario_standstill.py",
        "scenarios/test_scenario_cpu_starvation.py",
        "scenarios/test_scenario_stop_matrix.py",
        "scenarios/test_scenario_two_axes.py",
        "scenarios/test_scenario_unreadable_objects.py",
        "scenarios/test_scenario_virtual_axis.py::test_on_a_bus_a_virtual_axis_is_moved_by_the_core_in_every_process",
        "scenarios/test_scenario_program_end.py",
        "sim/test_sim_lss.py",
        "sim/test_sim_network.py",
        "sim/test_sim_socketcand_server.py",
        "test_examples.py",
        "test_pages.py::test_each_command_line_runs_as_printed_and_without_hardware",
        "test_pages.py::test_each_program_runs_as_printed",
        "test_pages.py::test_the_excerpt_of_the_output_of_init_is_current",
        "test_pages.py::test_the_excerpts_of_the_output_of_boot_are_current",
        "test_pages.py::test_the_messages_that_are_explained_are_printed",
        "trace/test_trace_session.py::test_every_frame_is_decoded_without_complaint",
        "web/test_web_acceptor.py",
        "web/test_web_boot.py",
    ),
    "they try hundreds of random cases, or every combination": (
        "fuzz",
        "cia305/test_lss_scan.py",
        "core/test_core_command_queue.py::test_a_flood_of_jogs_is_one_jog_and_keeps_nothing_in_memory",
        "core/test_core_command_queue.py::test_commands_of_several_threads_are_taken_once_each_and_in_the_order_of_each_thread",
        "motion/test_motion_commands_by_state.py",
        "motion/test_motion_invariants.py",
        "motion/test_motion_lookahead.py",
        "motion/test_motion_position_limits.py",
        "motion/test_motion_command_transitions.py",
        "motion/test_motion_properties.py",
        "scenarios/test_scenario_groups.py",
        "scenarios/test_scenario_limits.py",
        "scenarios/test_scenario_plants.py",
        "cli/test_cli_fuzz.py",
        "eds/test_eds_fuzz.py",
        "eds/test_eds_reports_fuzz.py",
        "bus/test_bus_process_data_age.py",
        "bus/test_bus_frame_queue.py::test_a_hundred_thousand_waits_of_a_few_microseconds_all_end",
        "bus/test_bus_frame_queue.py::test_the_waits_of_sdo_and_lss_end_however_short",
        "check/test_check_damaged_files.py",
        "drives/gim6010/test_drive_factory_protocols.py",
    ),
    "axisbus is started as on another operating system": ("system/test_system_played.py",),
    "they take large files, or a whole program's text": (
        "bus/test_bus_frame_queue.py::test_no_module_waits_at_a_simple_queue",
        "cli/test_cli_eds_reports.py::test_show_and_diff_of_a_large_drive_start_and_end_within_half_a_second",
        "eds/test_eds_python_code.py::test_mypy_strict_accepts_the_modules",
        "eds/test_eds_device_doc.py",
        "eds/test_eds_files.py::test_a_monstrous_file_is_read_in_bounded_time",
        "mutation/test_mutation_trial.py",
        "test_pages.py",
    ),
    "they read every maker's file": (
        "bus/test_bus_pdo_plan_corpus.py",
        "check/test_check_machine_agreement.py",
        "check/test_check_example.py",
        "configuration/test_configuration_corpus.py",
        "eds/test_eds_check_corpus.py",
        "eds/test_eds_corpus.py",
        "eds/test_eds_python_code.py::test_every_real_file_gives_a_module_with_unique_names",
        "eds/test_eds_diff.py::test_real_files_of_one_maker_differ_alike_in_both_directions",
        "eds/test_eds_dcf.py::test_real_files_become_a_dcf_and_a_concise_dcf",
        "sim/test_sim_corpus.py",
    ),
}
# Quick tests, and tests that are slow for another reason, whose threads wait for each other.
ALSO_VIRTUAL_TIME = (
    "bus/test_bus_adapter.py",
    "bus/test_bus_detect_other_master.py",
    "bus/test_bus_channel.py",
    "bus/test_bus_can_controller.py",
    "bus/test_bus_cycle.py",
    "bus/test_bus_cyclic_frames.py",
    "bus/test_bus_emcy.py",
    "bus/test_bus_error_control.py",
    "bus/test_bus_raw_sockets.py",
    "bus/test_bus_frame_transport.py",
    "bus/test_bus_monitor.py",
    "bus/test_bus_nmt.py",
    "bus/test_bus_off.py",
    "bus/test_bus_pure_functions.py",
    "bus/test_bus_pdo.py",
    "bus/test_bus_port.py",
    "bus/test_bus_sdo.py",
    "bus/test_bus_sdo_block.py",
    "bus/test_bus_sdo_counts.py",
    "bus/test_bus_sync.py",
    "bus/test_bus_sdo_worker.py",
    "drives/gim6010/test_cli_gim6010_over_modbus.py",
    "drives/test_drive_vendors.py::test_init_writes_the_notes_of_the_make",
    "drives/test_drive_vendors.py::test_scan_names_the_make",
    "fuzz/test_fuzz_channel.py",
    "fuzz/test_fuzz_faulty_node.py",
    "fuzz/test_fuzz_dropped_frames.py",
    "record/test_record_triggers.py",
    "ipc/test_ipc_stream.py",
)
# Files in virtual time whose tests share a machine or a server, with its threads: the clock continues from test to test.
SHARED_VIRTUAL_TIME = (
    "cli/test_cli_stop.py",
    "cli/test_cli_attach.py",
    "cli/test_cli_program_attach.py",
    "cli/test_cli_reconnect.py",
    "core/test_core_attach.py",
    "core/test_core_client.py",
    "gateway/test_gateway_opcua.py",
)
# Slow tests of hundreds of cases each, which need no real time: ``make test-sweeps`` runs them, ``make test`` does not.
SWEEPS = (
    "bus/test_bus_frame_queue.py::test_a_hundred_thousand_waits_of_a_few_microseconds_all_end",
    "boot/test_boot_program_write.py::test_after_a_loss_of_the_supply_at_any_frame_the_next_write_succeeds",
    "cell/test_cell_schema.py::test_a_value_of_another_kind_is_refused",
    "cell/test_cell_schema.py::test_no_value_that_the_reader_accepts_is_refused_by_the_schema",
    "check/test_check_example.py::test_any_makers_file_can_be_checked_and_turned_into_parameters",
    "check/test_check_machine_agreement.py::test_check_and_machine_agree_on_a_drive_that_lacks_an_object",
    "check/test_check_machine_agreement.py::test_check_and_machine_agree_on_every_makers_file",
    "cia305/test_lss_exclusion.py",
    "cia305/test_lss_scan.py::test_any_single_frame_may_be_lost",
    "configuration/test_configuration_replacement.py::test_killed_before_any_frame_and_run_again",
    "drives/gim6010/test_can_simple_port_random.py",
    "drives/gim6010/test_gim6010_fuzz_readers.py",
    "eds/test_eds_check_planted_defects.py",
    "eds/test_eds_check_corpus.py::test_every_file_is_checked_and_findings_point_into_it",
    "eds/test_eds_corpus.py::test_every_file_reaches_canopen_as_we_read_it",
    "eds/test_eds_corpus.py::test_every_model_written_again_is_a_clean_file_that_canopen_reads",
    "eds/test_eds_corpus.py::test_files_that_canopen_reads_it_still_reads_after_a_fix_and_as_a_dcf",
    "eds/test_eds_dcf.py::test_real_files_become_a_dcf_and_a_concise_dcf",
    "eds/test_eds_device_doc.py::test_every_real_file_becomes_a_page_with_a_drawing_for_each_pdo",
    "eds/test_eds_diff.py::test_real_files_of_one_maker_differ_alike_in_both_directions",
    "eds/test_eds_fix.py::test_fix_repairs_findings_of_check",
    "eds/test_eds_fix.py::test_fixed_real_files_are_read_with_the_same_content",
    "eds/test_eds_python_code.py::test_every_real_file_gives_a_module_with_unique_names",
    "eds/test_eds_show.py::test_every_real_file_is_shown_with_each_of_its_objects",
    "eds/test_eds_time_and_memory.py",
    "fuzz",
    "motion/test_motion_blended_jerk_limited.py::test_random_legs_that_join_at_random_times_keep_their_jerk_and_pass_every_end",
    "motion/test_motion_blended_profile.py::test_random_legs_that_join_at_random_times_keep_their_limits_and_the_planned_path",
    "motion/test_motion_fast_path.py",
    "motion/test_motion_groups_random.py",
    "motion/test_motion_invariants.py",
    "motion/test_motion_jerk_limited_path.py::test_no_path_exceeds_velocity_acceleration_or_jerk",
    "motion/test_motion_remote_trajectory_axis.py",
    "record/test_record_foreign_files.py::test_any_mutation_of_a_recording_is_read_or_refused",
    "scenarios/test_scenario_arguments.py::test_no_absurd_number_ends_the_scan_or_raises_a_foreign_error",
    "scenarios/test_scenario_blended_moves.py::test_any_sequence_of_moves_keeps_the_limits_and_ends_at_the_last_target",
    "scenarios/test_scenario_coupling.py::test_random_commands_of_master_and_slave_cause_no_jolt_and_every_slave_can_be_stopped",
    "scenarios/test_scenario_feed_forward.py::test_random_plays_hold_the_rules_in_every_sync",
    "scenarios/test_scenario_gantry.py::test_random_commands_keep_the_beam_square_and_within_its_limits",
    "scenarios/test_scenario_groups.py::test_all_axes_are_energised_or_none_in_whichever_cycle_one_is_disabled",
    "scenarios/test_scenario_groups.py::test_all_axes_start_in_one_sync_from_any_modes_of_their_drives",
    "scenarios/test_scenario_groups.py::test_all_axes_start_or_none_in_whichever_cycle_one_is_removed",
    "scenarios/test_scenario_handshake.py::test_a_replacement_at_any_moment_of_the_handshake_ends_at_the_last_target",
    "scenarios/test_scenario_limits.py::test_a_trajectory_at_all_its_limits_is_followed_to_its_end",
    "scenarios/test_scenario_limits.py::test_an_axis_under_torque_keeps_its_limits_of_position_and_velocity",
    "scenarios/test_scenario_plants.py::test_after_a_completed_stop_the_axis_stays_at_standstill",
    "scenarios/test_scenario_random.py",
    "scenarios/test_scenario_random_cells.py",
    "scenarios/test_scenario_random_motion_limits.py",
    "scenarios/test_scenario_setpoint_without_ack.py::test_a_new_move_replaces_the_old_at_any_moment",
    "scenarios/test_scenario_streams_resumed.py::test_random_halts_overrides_pauses_and_resumes_stay_on_the_line_within_the_limits",
    "scenarios/test_scenario_superimposed.py::test_random_additions_never_make_the_sum_too_fast_or_too_hard",
    "scenarios/test_scenario_user_kinematics.py::test_random_paths_keep_to_the_tool_path_and_the_axis_limits",
    "scenarios/test_scenario_user_kinematics_streams.py::test_no_axis_exceeds_its_velocity_or_acceleration_in_random_streams",
    "sim/test_sim_sdo_block.py",
    "sim/test_sim_sdo_sweep.py",
    "system/test_system_played.py",
    "system/test_system_types.py",
)
# Folders in which a test of many cases moves machines: ``make test`` runs some of its cases, ``make test-sweeps`` the others.
MATRICES = ("scenarios", "drives/gim6010")
_SAMPLE = 3  # cases of each of these tests in ``make test``, spread over all of its cases
_SMALL = 6  # cases; a test with no more is run whole
NAMES = frozenset((*(name for names in SLOW.values() for name in names), *SHARED_VIRTUAL_TIME, *SWEEPS))
IN_REAL_TIME = frozenset(name for names in REAL_TIME.values() for name in names)
IN_VIRTUAL_TIME = frozenset((*SLOW[VIRTUAL_TIME], *ALSO_VIRTUAL_TIME, *SHARED_VIRTUAL_TIME))


def is_slow(path: Path, test: str = "") -> bool:
    """Whether a folder, a file or one of its tests (by its function's name) is named here, or is within a named one."""
    return bool(_names(path, test) & NAMES)


def is_sweep(path: Path, test: str = "") -> bool:
    """Whether a test tries hundreds of cases, and needs no real time."""
    return bool(_names(path, test) & set(SWEEPS)) and not is_real_time(path, test)


def swept_cases(path: Path, cases: int) -> frozenset[int]:
    """Return the positions of those cases of a test in ``MATRICES`` that are sweeps, because others like them are not."""
    if cases <= _SMALL or not set(_named(path)) & set(MATRICES):
        return frozenset()
    return frozenset(range(cases)) - {round(step * (cases - 1) / (_SAMPLE - 1)) for step in range(_SAMPLE)}


def is_real_time(path: Path, test: str = "") -> bool:
    """Whether a test runs in real time, so that a computer which keeps it waiting can fail it."""
    names = _names(path, test)
    return bool(names & IN_REAL_TIME) or (_beyond_threads() and bool(names & IN_VIRTUAL_TIME))


def is_virtual_time(path: Path, test: str = "") -> bool:
    """Whether a test runs in virtual time (kit/virtual_time.py); a test that is named as real time does not."""
    return bool(_names(path, test) & IN_VIRTUAL_TIME) and not is_real_time(path, test)


def shares_virtual_time(path: Path) -> bool:
    """Whether all tests of a file run in one virtual time."""
    return bool(set(_named(path)) & set(SHARED_VIRTUAL_TIME)) and not is_real_time(path)


def _beyond_threads() -> bool:
    """Whether the core runs in a process of its own, or the bus is the kernel's: virtual time reaches neither."""
    return os.environ.get("AXISBUS_PROCESS") == "own" or "AXISBUS_SOCKETCAN" in os.environ


def _names(path: Path, test: str) -> set[str]:
    """All the names by which a test may be named here."""
    names = _named(path)
    return {*names, f"{names[0]}::{test}"} if names else set()


@cache
def _named(path: Path) -> tuple[str, ...]:
    """A file and the folders that it lies in, from the folder of the tests; empty for one beside that."""
    if not path.is_relative_to(TESTS):
        return ()
    here = path.relative_to(TESTS)
    return tuple(map(str, (here, *here.parents)))
