"""Invalid input is refused before the bus is opened: arguments, limits of the cell file, EDS files, and output paths."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from axisbus.bus.link import adapter
from axisbus.check.run import checked
from axisbus.core import canlink
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.errors import LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from kit import command_line

BUS = ("-i", "virtual", "-c", "nobody")
NODE = ("--eds", command_line.GENERIC, *BUS)
HARD = command_line.ROOT / "examples" / "cell.toml"


class Opened(BaseException):
    """The bus was opened."""


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path):
    """The command line; opening any bus ends the test."""

    def opened(*_, **__):
        raise Opened

    monkeypatch.setattr(adapter, "open_adapter", opened)
    monkeypatch.setattr(canlink, "simulated_channel", opened)  # of the demo
    monkeypatch.chdir(tmp_path)
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def hard(tmp_path):
    """The example on a bus that is not simulated."""
    path = tmp_path / "hard.toml"
    path.write_text(HARD.read_text("utf-8").replace('"sim"', '"virtual"\nchannel = "c"'), "utf-8")
    return path


def test_the_watch_over_the_bus_sees_it_opened(axisbus, hard):
    for arguments in (
        ("move", command_line.CELL, "x=10", "--home"),
        ("home", hard),
        ("demo", "--no-plot"),
        ("od", "read", "5:6041", *NODE),
        ("scan", *BUS),
    ):
        with pytest.raises(Opened):
            axisbus(*arguments)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("x=10", "--home", "--velocity", "-5"), 2, "velocity -5 must be above 0"),
        (("x=10", "--home", "--velocity", "0"), 2, "velocity 0 must be above 0"),
        (("x=10", "--home", "--velocity", "nan"), 2, "is not a finite number"),
        (("x=10", "--home", "--velocity", "400"), 2, "max_velocity is 360"),
        (("x=10", "--home", "--acceleration", "1e9"), 2, "max_acceleration is 3600"),
        (("x=10", "--home", "--acceleration", "-1"), 2, "acceleration -1 must be above 0"),
        (("x=10", "--home", "--timeout", "-1"), 2, "is not a valid time"),
        (("x=10", "--home", "--timeout", "nan"), 2, "is not a valid time"),
        (("x=181", "--home"), 2, "the allowed range is -180 to 180"),
        (("x=10", "y=91", "--home"), 2, "the allowed range is -90 to 90"),
        (("x=nan", "--home"), 2, "is not a finite number"),
        (("z=1e300", "--home"), 2, "does not fit INTEGER32"),
        (("x=10",), 2, "the axis is not homed"),
        (("x=181", "--home", "--relative"), 2, "the allowed range is -180 to 180"),  # homing by method 35 makes it 0
        (("x=10", "w=1", "--home"), 1, "the cell has no axis 'w'"),
        (("x=10", "x=20", "--home"), 2, "axis x is named twice"),
        (("x=", "--home"), 2, "write AXIS=POSITION"),
    ],
)  # fmt: skip
def test_a_move_that_cannot_be(axisbus, hard, arguments, code, words):
    for cell in (command_line.CELL, hard):
        found = axisbus("move", cell, *arguments)
        assert (found.code, found.out) == (code, "")
        assert words in found.err


def test_a_homing_that_cannot_be(axisbus, hard):
    hard.write_text(hard.read_text("utf-8").replace("method = 35", "method = 17", 1), "utf-8")
    assert "speed_switch is missing" in axisbus("home", hard).err
    assert "speed_switch is missing" in axisbus("move", hard, "x=1", "--home").err
    hard.write_text(hard.read_text("utf-8").replace("method = 17 ", "# none    ", 1), "utf-8")
    assert "method is missing" in axisbus("home", hard).err


@pytest.mark.parametrize("command", ["home", "reset"])
def test_axes_by_name(axisbus, hard, command):
    code, _, err = axisbus(command, hard, "x", "w")
    assert (code, "the cell has no axis 'w'" in err, "its groups are xyz" in err) == (1, True, True)
    assert "axisbus explain unknown-name" in err
    code, _, err = axisbus(command, hard, "xyz", "y")
    assert (code, "axis y is named twice" in err) == (2, True)


def test_the_demo_does_not_touch_hardware(axisbus, hard):
    code, _, err = axisbus("demo", hard)
    assert (code, "it runs on simulated cells only" in err) == (2, True)


PATHS = {
    "file/x": "is not a folder",
    "folder": "it is a folder",
    "/proc/x": "cannot be written",
    "x" * 300: "too long",
}


@pytest.mark.parametrize("path", PATHS, ids=["below a file", "a folder", "proc", "long"])
@pytest.mark.parametrize(
    "command",
    [
        ("demo",),
        ("init", *BUS, "--force"),
        ("config", "backup", "5", *NODE, "--force"),
        ("od", "dump", "5", *NODE),
        ("eds", "from-device", "5", *BUS),
        ("eds", "doc", command_line.GENERIC),
        ("eds", "export", command_line.GENERIC, "--csv"),
        ("eds", "dcf", command_line.GENERIC, "--node", "5"),
        ("eds", "fix", command_line.GENERIC),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_an_invalid_output_path_is_refused_and_changes_no_file(axisbus, tmp_path, command, path):
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder").mkdir()
    if command == ("demo",) and path == "folder":
        path = "file"
    code, out, err = axisbus(*command, "-o", path)
    assert (code, out) == (1, "")
    assert "cannot be written" in err
    assert PATHS.get(path, "is not a folder") in err
    assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "kept"
    assert not any((tmp_path / "folder").iterdir())


@pytest.mark.parametrize(
    "command",
    [
        ("init", *BUS),
        ("config", "backup", "5", *NODE),
        ("od", "dump", "5", *NODE),
        ("eds", "from-device", "5", *BUS),
        ("eds", "doc", command_line.GENERIC),
        ("eds", "export", command_line.GENERIC, "--csv"),
        ("eds", "code", command_line.GENERIC),
        ("eds", "dcf", command_line.GENERIC, "--node", "5"),
        ("eds", "fix", command_line.GENERIC),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_no_file_that_is_there_is_replaced_unasked(axisbus, tmp_path, command):
    name = "there.html" if command[1] == "doc" else "there.py" if command[1] == "code" else "there.eds"
    (tmp_path / name).write_text("kept")
    code, out, err = axisbus(*command, "-o", name)
    assert (code, out) == (1, "")
    assert f"{name} already exists; nothing was written" in err
    assert "give another name with -o, or --force to replace it" in err
    assert (tmp_path / name).read_text() == "kept"
    if command[0] == "eds" and command[1] != "from-device":
        axisbus(*command, "-o", name, "--force")
        assert (tmp_path / name).read_text() != "kept"


def test_a_default_name_is_not_replaced_unasked_either(axisbus, tmp_path):
    for command, name in (
        (("eds", "doc", command_line.GENERIC), "generic-cia402.html"),
        (("eds", "from-device", "5", *BUS), "node-5.eds"),
    ):
        (tmp_path / name).write_text("kept")
        assert "already exists" in axisbus(*command).err
        assert (tmp_path / name).read_text() == "kept"


def test_an_unwritable_output_names_its_own_option(axisbus, tmp_path):
    for command in (("eds", "dcf", command_line.GENERIC, "--node", "5"), ("config", "backup", "5", *NODE)):
        assert "give another path with --concise" in axisbus(*command, "--concise", "/proc/x").err
        (tmp_path / "there").write_text("kept")
        assert "another name with --concise" in axisbus(*command, "--concise", "there").err


def test_a_missing_recording_is_reported_before_a_missing_bit_rate(axisbus, tmp_path):
    for command in ("load", "trace"):
        code, out, err = axisbus(command, "none.log")
        assert (code, out) == (1, "")
        assert "there is no recording none.log" in err


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="everything may be read by root")
def test_an_unreadable_file_has_the_same_error_in_all_commands(axisbus, tmp_path):
    for name in ("cell.toml", "x.eds", "x.log"):
        (tmp_path / name).write_text("x")
        (tmp_path / name).chmod(0)
    for command in (
        ("check", "cell.toml"),
        ("boot", "cell.toml"),
        ("eds", "show", "x.eds"),
        ("trace", "x.log"),
    ):
        code, out, err = axisbus(*command)
        assert code == 1
        assert "cannot be read" in out + err
        assert "Permission denied" in out + err


def test_a_filter_names_nodes_that_there_may_be(axisbus, hard):
    for source in ((*BUS,), (hard,), ("none.log",)):
        for option in ("--filter", "--without"):
            code, out, err = axisbus("trace", *source, option, "node=1,q")
            assert (code, out) == (2, "")
            assert "'q' is not a node" in err
    assert "axes of the cell are x, y, z" in axisbus("trace", hard, "--filter", "node=q").err
    assert "'128' is not a node" in axisbus("trace", *BUS, "--filter", "node=128").err
    with pytest.raises(Opened):
        axisbus("trace", hard, "--filter", "node=1,x")


def test_a_schema_is_of_all_cell_files(axisbus):
    assert axisbus("check", "--schema", command_line.CELL).code == 2
    assert axisbus("check").code == 2


def test_restore_of_an_object_without_a_value_in_the_file_is_refused(axisbus):
    assert (
        axisbus("eds", "dcf", command_line.GENERIC, "--node", "5", "--set", "6081=7", "-o", "x.dcf").code == 0
    )
    code, _, err = axisbus("config", "restore", "x.dcf", "5", *NODE, "--include", "2105:1")
    assert (code, "gives no value for 2105h:01" in err) == (2, True)


def test_one_file_is_not_written_twice(axisbus):
    code, _, err = axisbus("config", "backup", "5", *NODE, "-o", "x.dcf", "--concise", "./x.dcf")
    assert (code, "is given for two files" in err) == (1, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("monitor", "CELL", "--every", "-1"), "is not a valid time"),
        (("monitor", "CELL", "--every", "nan"), "is not a valid time"),
        (("monitor", "CELL", "--every", "inf"), "is not a valid time"),
        (("monitor", "CELL", "--count", "0"), "0 is not in the range"),
        (("monitor", "CELL", "--count", "-1"), "-1 is not in the range"),
        (("od", "watch", "5:6041", *NODE, "--every", "0"), "is not a valid time"),
        (("trace", *BUS, "--seconds", "0"), "is not a valid time"),
        (("trace", *BUS, "--seconds", "nan"), "is not a valid time"),
        (("load", *BUS, "-b", "500000", "--seconds", "0"), "is not a valid time"),
        (("lss", "find", *BUS, "--timeout", "nan"), "is not a valid time"),
        (("lss", "find", *BUS, "--vendor", "-1"), "32 bits"),
        (("scan", *BUS, "-b", "500"), "give bit/s, such as 500000"),
        (("scan", *BUS, "-b", "-1"), "is not a bit rate"),
        (("scan", *BUS, "-O", "speed"), "write KEY=VALUE"),
        (("scan", *BUS, "-O", "channel=1"), "has a separate option, -c"),
        (("scan", "CELL", "-c", "can1"), "leave -c and -O out"),
        (("scan", "-i", "pcan", "-c", "PCAN_USBBUS1"), "add -b 1000000"),
        (("trace", "-i", "pcan", "-c", "PCAN_USBBUS1"), "add -b 1000000"),
        (("nmt", "start", "5", *BUS, "--eds", "none.eds"), "none.eds"),
        (("od", "dump", "x", "--cell", "BROKEN"), "none.eds"),
        (("nmt", "start", "x", "--cell", "BROKEN"), "none.eds"),
        (("nmt", "start", "all", "--cell", "BROKEN"), "none.eds"),
        (("config", "backup", "x", "--cell", "BROKEN"), "none.eds"),
    ],
)  # fmt: skip
def test_options_and_files(axisbus, hard, arguments, words):
    broken = hard.with_name("broken.toml")
    broken.write_text(hard.read_text("utf-8").replace("builtin:gim6010-8", "none.eds"), "utf-8")
    names = {"CELL": command_line.CELL, "BROKEN": str(broken)}
    code, out, err = axisbus(*(names.get(each, each) for each in arguments))
    assert (code in (1, 2), out) == (True, "")
    assert words in err


def test_with_a_cell_file_the_bus_can_be_opened_otherwise(monkeypatch, capsys, hard):
    seen = []

    def opened(*arguments, **_):
        seen.append(arguments)
        raise Opened

    monkeypatch.setattr(adapter, "open_adapter", opened)
    axisbus = command_line.runner(monkeypatch, capsys)
    for arguments in (("scan", hard), ("trace", hard), ("od", "read", "x:6041", "--cell", hard)):
        with pytest.raises(Opened):
            axisbus(*arguments, "-c", "other", "-b", "500000", "-O", "key=7")
        assert seen.pop() == ("virtual", "other", 500_000, {"key": 7})


def test_a_letter_means_one_thing_in_all_commands(axisbus):
    from axisbus.cli.main import cli

    letters: dict[str, set[str]] = {}
    for command in _commands(cli):
        for option in command.params:
            for short in (each for each in option.opts if re.fullmatch("-[A-Za-z]", each)):
                letters.setdefault(short, set()).add(max(option.opts, key=len))
    assert letters.pop("-s") == {"--slave"}
    assert letters == {
        "-o": {"--output"}, "-O": {"--option"}, "-i": {"--interface"}, "-c": {"--channel"}, "-b": {"--bitrate"},
    }  # fmt: skip


def _commands(group):
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        yield from _commands(command) if hasattr(command, "list_commands") else [command]


def test_with_one_axis_in_fault_none_is_enabled(monkeypatch, capsys, tmp_path):
    with command_line.drives(5, 6) as (simulated_nodes, channel):
        cell = tmp_path / "cell.toml"
        bus = f'[bus]\ninterface = "virtual"\nchannel = "{channel}"\nscan_period = "10ms"\n'
        nodes = "".join(
            f'[nodes.{node}]\neds = "{command_line.GENERIC}"\n[axes.{name}]\nnode = {node}\nunit = "increments"\n'
            f"[axes.{name}.defaults]\nvelocity = 5000\nacceleration = 50000\n[axes.{name}.homing]\nmethod = 35\n"
            for node, name in ((5, "x"), (6, "y"))
        )
        cell.write_text(bus + nodes)
        axisbus = command_line.runner(monkeypatch, capsys)
        seen = []
        enable = Axis.enable
        monkeypatch.setattr(Axis, "enable", lambda axis: seen.append(axis.name) or enable(axis))
        SimulatedNode(simulated_nodes.devices[1], simulated_nodes.lock).fault(0x4310)
        for command in (("move", cell, "x=10", "y=10"), ("home", cell)):
            code, _, err = axisbus(*command)
            assert (code, seen) == (1, [])
            assert "y: the axis is in fault; no axis was enabled" in err
            assert f"reset it: axisbus reset {cell} y" in err


# -- a dry run alone ---------------------------------------------------------------------------------------------------


def test_a_dry_run_checks_an_axis_at_its_observed_position():
    rehearsal = DryRun(checked(command_line.CELL))
    x, here = rehearsal["x"], rehearsal["x"].snapshot
    assert x.move_relative(300.0).done  # it may be at -180, and is not homed
    x.home()
    with pytest.raises(LimitError, match="would end beyond"):
        x.move_relative(300.0)
    rehearsal.see("x", here._replace(position=round(-170 * 131072 / 360), homed=True))
    assert x.move_relative(300.0).done
    with pytest.raises(LimitError, match="at 190 deg"):
        x.move_relative(360.0)
    rehearsal.see("x", here._replace(position=None, homed=True))
    assert x.move_relative(300.0).done


def test_a_drive_without_the_objects_is_not_enabled_for_them(tmp_path):
    text = (command_line.ROOT / "eds" / "gim6010-8.eds").read_text("ascii")
    (tmp_path / "poor.eds").write_text(
        re.sub(r"(?s)\[607A\].*?(?=\n\[)", "", text).replace("=0x607A", "=0x607C"), "ascii"
    )
    cell = tmp_path / "cell.toml"
    cell.write_text(
        Path(command_line.CELL).read_text("utf-8").replace("builtin:gim6010-8", "poor.eds", 1), "utf-8"
    )
    from axisbus.cell import reader

    rehearsal = DryRun(reader.load(cell))
    rehearsal["x"].home()
    with pytest.raises(StateError, match="cannot run"):
        rehearsal["x"].move_absolute(1.0)
