"""The example cell is clean, and checking goes well with the EDS files of real drives."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cell import reader
from axisbus.cell.parameters import axis_parameters
from axisbus.check.run import check
from axisbus.eds import builtin
from axisbus.eds.model import Severity
from axisbus.errors import EdsError
from kit import cells
from kit.corpus import CORPUS

CHECKOUT = Path(__file__).parents[2]
EXAMPLE = CHECKOUT / "examples" / "cell.toml"
FILES = sorted([*CORPUS.glob("*.eds"), *CORPUS.glob("*.dcf")]) if CORPUS.is_dir() else []

# As in the first pages of the manual: no stop table, y without limits.
SHORT = """\
[bus]
interface = "sim"
bitrate = 1_000_000
master_id = 127
scan_period = "4ms"
sync = true
heartbeat = "100ms"
[nodes.1]
eds = "builtin:gim6010-8"
[nodes.2]
eds = "builtin:gim6010-8"
[axes.x]
node = 1
unit = "deg"
scale = 364.0888888888889
velocity_scale = 364.0888888888889
rated_torque = 5.0
position_limits = [-180.0, 180.0]
max_velocity = 360.0
[axes.x.defaults]
velocity = 90.0
acceleration = 720.0
[axes.x.homing]
method = 35
[axes.x.stop]
quick_stop = "ramp"
[axes.y]
node = 2
unit = "deg"
scale = 364.0888888888889
[axes.y.defaults]
velocity = 90.0
acceleration = 720.0
[axes.y.homing]
method = 35
"""


def test_the_example_has_neither_error_nor_warning() -> None:
    assert [str(problem) for problem in check(EXAMPLE) if problem.severity is not Severity.NOTE] == []


def test_the_example_is_three_axes_in_a_group() -> None:
    cell = reader.load(EXAMPLE)
    assert cell.bus.interface == "sim"
    assert {name: axis.node for name, axis in cell.axes.items()} == {"x": 1, "y": 2, "z": 3}
    assert cell.groups["xyz"].axes == ("x", "y", "z")
    x = axis_parameters(cell, "x", eds.load(builtin.resolve("builtin:gim6010-8", cell.folder)))
    assert x.units.position.to_increments(360.0) == 131_072  # 8 turns of the rotor, 16384 counts each


def test_a_short_cell_is_warned_that_its_drives_would_coast(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(SHORT)
    found = [problem for problem in check(path) if problem.severity is not Severity.NOTE]
    assert {problem.severity for problem in found} == {Severity.WARNING}
    coasting = [problem.message for problem in found if "the motor coasts" in problem.message]
    assert [message.split(":")[0] + ":" + message.split(":")[1] for message in coasting] == [
        "axis x: disable operation",
        "axis x: fault",
        "axis y: quick stop",
        "axis y: disable operation",
        "axis y: fault",
    ]
    assert any("the quick-stop ramp has a deceleration of 0" in problem.message for problem in found)


@pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
@pytest.mark.timeout(120)
def test_any_makers_file_can_be_checked_and_turned_into_parameters(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    for file in FILES:
        path.write_text(cells.CLEAN.replace('"drive.eds"', f"'{file}'"))
        problems = check(path)
        assert problems
        cell, _ = reader.read(path)
        assert cell is not None
        try:
            model = eds.load(file)
        except EdsError:
            assert any("cannot be used" in problem.message for problem in problems), file
            continue
        assert axis_parameters(cell, "x", model).modes is not None
