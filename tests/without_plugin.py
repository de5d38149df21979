"""Run the tests on a copy of the sources without the plug-in of the GIM6010-8: ``make test-generic``.

The copy is in ``build/generic``. The folders of the plug-in and of its tests are left out, and the tests of ``NEED_IT``, which test
the product as a whole. Arguments are those of pytest.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPY = ROOT / "build" / "generic"
LEFT_OUT = ("src/axisbus/drives/gim6010", "tests/drives/gim6010")
# Files and tests that need the plug-in, and why.
NEED_IT = {
    "the documentation, its examples and the lists of names and files contain the make": (
        "tests/cell/test_cell_documentation.py",
        "tests/cell/test_cell_schema.py::test_good_cells_are_good[can_simple.toml]",
        "tests/cell/test_cell_schema.py::test_the_excerpts_on_the_pages_are_good",
        "tests/system/test_system_names.py::test_only_the_modules_of_a_need_use_names_that_a_system_lacks",
        "tests/test_names.py",
        "tests/test_pages.py",
        "tests/test_public_names.py",
        "tests/test_structure.py",
    ),
    "examples/cell.toml has drives of the make, whose modes the plug-in knows": (
        "tests/cli/test_cli_check.py::test_each_finding_of_a_clean_cell_is_printed_once",
        "tests/machine/test_notebook_interrupts.py",
        "tests/record/test_record_capture.py::test_the_stop_after_an_error_of_the_program_may_be_the_moment",
        "tests/record/test_record_last_motion.py::test_a_motion_that_has_not_ended_is_drawn_until_now",
        "tests/record/test_record_recording_files.py::test_the_stop_that_follows_an_error_is_recorded_too",
    ),
    "a module of the make is beside the drives": (
        "tests/scenarios/test_scenario_can_simple.py",
        "tests/scenarios/test_scenario_can_simple_processes.py",
        "tests/web/test_web_objects.py::test_a_node_without_a_dictionary_is_reported",
    ),
    "a fault is explained in the words of the make": tuple(
        f"tests/scenarios/test_scenario_faults.py::test_{name}"
        for name in (
            "a_fault_in_mid_move_stops_the_group_and_is_reported_in_the_makers_words",
            "bits_in_the_high_word_are_decoded_too",
            "a_fault_while_disabled_is_reported_and_stops_no_axis_at_standstill",
            "a_drive_in_fault_at_boot_up_is_opened_and_the_fault_is_reported",
            "a_reset_that_does_not_work_names_the_fault_that_stays",
        )
    ),
}


def copied() -> Path:
    """Make the copy of the files that git knows; return its folder."""
    shutil.rmtree(COPY, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)
    for name in filter(None, listed.stdout.split("\0")):
        if not name.startswith(LEFT_OUT) and (ROOT / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, COPY / name)
    return COPY


def main() -> int:
    """Return the exit code of pytest in the copy, which must import the copy's package."""
    folder = copied()
    environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
    show = [sys.executable, "-c", "import axisbus; print(axisbus.__file__)"]
    imported = subprocess.run(show, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    if not Path(imported.stdout.strip()).is_relative_to(folder):
        print(f"the tests would run on {imported.stdout.strip()}, not on the copy")
        return 1
    named = [name for names in NEED_IT.values() for name in names]
    left_out = [f"--{'deselect' if '::' in name else 'ignore'}={name}" for name in named]
    command = [sys.executable, "-m", "pytest", *left_out, *sys.argv[1:]]
    return subprocess.run(command, cwd=folder, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
