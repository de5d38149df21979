"""``axisbus od`` and ``axisbus nmt`` with simulated drives; above all objects that could move a drive."""

from __future__ import annotations

import json
import re

import pytest
from click.shell_completion import ShellComplete

from axisbus import Machine
from axisbus.bus.node import nmt_commands
from axisbus.cli.main import cli
from kit import command_line


@pytest.fixture
def axisbus(monkeypatch, capsys) -> command_line.Run:
    monkeypatch.setattr(nmt_commands, "LISTEN", 0.2)
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def bus():
    """Node 5 on a bus of its own: the options that reach it, and the drive."""
    with command_line.drives(5) as (simulated_nodes, channel):
        yield ("-i", "virtual", "-c", channel, "--eds", command_line.GENERIC), simulated_nodes


def _object(simulated_nodes, index, subindex=0):
    with simulated_nodes.lock:
        return simulated_nodes.devices[0].read(index, subindex)


def _enable(axisbus, options):
    for word in ("6", "7", "15"):
        assert axisbus("od", "write", "5:6040", word, "--may-move", *options).code == 0


# -- reading -----------------------------------------------------------------------------------------------------------


def test_by_name_number_and_record(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus(
        "od", "read", *options, "5:Statusword", "5:6064h", "5:position_actual_value", "5:1018"
    )
    assert code == 0
    lines = out.splitlines()
    assert "(switch on disabled" in lines[0]
    assert lines[1] == lines[2] == "6064h Position actual value = 0"
    assert sum(line.startswith("1018h") for line in lines) >= 4


def test_a_node_and_then_its_objects(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("od", "read", *options, "5", "1000", "1018:1", "--json")
    assert code == 0
    assert [(each["index"], each["subindex"], each["node"]) for each in json.loads(out)] == [
        (0x1000, 0, 5),
        (0x1018, 1, 5),
    ]


def test_an_axis_of_the_cell_and_its_unit(axisbus):
    code, out, _ = axisbus("od", "read", "--cell", command_line.CELL, "y:Position_actual_value")
    assert (code, out.strip()) == (0, "6064h Position actual value = 0 = 0 deg")


def test_without_an_eds_by_number_with_a_type(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("od", "read", *options[:4], "5:1017", "--type", "u16")
    assert code == 0
    assert "Producer heartbeat time" in out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("5:6041",), 2, "give a cell file with --cell, or the bus with -i and -c"),
        (("5", "--cell", command_line.CELL), 2, "name an object after the node"),
        (("q:6041", "--cell", command_line.CELL), 2, "axes of the cell are x, y, z"),
        (("x:Statuswort", "--cell", command_line.CELL), 2, "did you mean 'statusword'"),
        (("x:6041", "--cell", command_line.CELL, "--type", "u17"), 2, "'u17' is not a data type"),
        (("x:2FFF", "--cell", command_line.CELL), 3, "Object does not exist"),
        (("99:1000", "--cell", command_line.CELL), 3, "got no answer"),
    ],
)
def test_an_unreadable_object_is_one_clear_sentence(axisbus, arguments, code, words):
    result = axisbus("od", "read", *arguments)
    assert result.code == code
    assert words in result.err


def test_dump_holds_every_object_with_its_value(axisbus, bus, tmp_path):
    options, _ = bus
    code, out, _ = axisbus("od", "dump", "5", *options, "--json")
    found = json.loads(out)
    assert code == 0
    assert {0x1000, 0x1018, 0x6041, 0x6502} <= {each["index"] for each in found}
    assert not [each for each in found if "value" not in each and "refused" not in each]
    code, out, _ = axisbus("od", "dump", "5", *options, "-o", tmp_path / "dump.txt")
    assert code == 0
    assert "6041h Statusword = 0x" in (tmp_path / "dump.txt").read_text()


def test_watch_prints_changes(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("od", "watch", *options, "5:6041", "5:6060", "--count", "3", "--every", "0.02")
    assert code == 0
    assert len([line for line in out.splitlines() if "6060h" in line]) == 1
    code, out, _ = axisbus(
        "od", "watch", *options, "5:6060", "--count", "3", "--every", "0.02", "--all", "--json"
    )
    assert [json.loads(line)["index"] for line in out.splitlines()] == [0x6060] * 3


# -- writing -----------------------------------------------------------------------------------------------------------


def test_a_write_is_read_back_and_shows_before_and_after(axisbus, bus):
    options, simulated_nodes = bus
    code, out, _ = axisbus("od", "write", "5:Profile_velocity", "1200", *options)
    assert code == 0
    assert "-> 1200, read back" in out
    assert "next: it is in RAM only" in out
    assert _object(simulated_nodes, 0x6081) == 1200


def test_a_negative_number_is_a_value_and_no_option(axisbus, bus):
    options, simulated_nodes = bus
    assert axisbus("od", "write", *options, "5:607C", "-100").code == 0
    assert _object(simulated_nodes, 0x607C) == -100


def test_a_value_in_the_axes_unit(axisbus):
    """131072 increments are 360 degrees, so 90 degrees are 32768."""
    code, out, _ = axisbus("od", "write", "--cell", command_line.CELL, "x:607D:2", "90 deg", "--json")
    found = json.loads(out)
    assert code == 0
    assert (found["value"], found["after"], found["agrees"]) == (32768, 32768, True)


@pytest.mark.parametrize(
    ("target", "value", "code", "words"),
    [
        ("5:6041", "1", 2, "its access is ro"),
        ("5:2FFF", "1", 2, "node 5 has no object 2FFFh:00"),
        ("5:6083", "-1", 2, "-1 does not fit UNSIGNED32"),
        ("5:6083", "1.5", 2, "'1.5' is not a whole number, the object is UNSIGNED32"),
        ("5:6083", "5 mm/s", 2, "no unit is known for the object"),
        ("5:1018", "1", 2, "has 5 entries, name one of them"),
        ("5:6098", "300", 2, "300 does not fit INTEGER8"),
    ],
)
def test_an_invalid_write_is_refused_before_anything_is_sent(axisbus, bus, target, value, code, words):
    options, simulated_nodes = bus
    before = {index: _object(simulated_nodes, index) for index in (0x6083, 0x6098)}
    result = axisbus("od", "write", *options, target, value)
    assert result.code == code
    assert words in result.err
    assert {index: _object(simulated_nodes, index) for index in before} == before


def test_an_object_of_another_size_than_its_type_is_not_written(axisbus, bus):
    options, simulated_nodes = bus
    before = _object(simulated_nodes, 0x6081)
    code, _, err = axisbus("od", "write", *options, "5:6081", "7", "--type", "u8")
    assert code == 2
    assert "UNSIGNED8 has 1 byte, the device sends 4" in err
    assert _object(simulated_nodes, 0x6081) == before


def test_a_misspelt_option_is_no_value(axisbus, bus):
    options, _ = bus
    code, _, err = axisbus("od", "write", *options, "5:6083", "5", "--may-mov")
    assert code == 2
    assert "no such option: --may-mov" in err


def test_storing_is_an_order_and_not_read_back(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("od", "write", *options, "5:1010:1", "0x65766173")
    assert code == 0
    assert 'store ("save")), accepted, cannot be compared' in out


@pytest.mark.parametrize("target", ["6040", "6060", "607A", "60FF", "6071"])
def test_an_object_that_could_move_a_drive_needs_may_move(axisbus, bus, target):
    options, simulated_nodes = bus
    before = _object(simulated_nodes, int(target, 16))
    code, _, err = axisbus("od", "write", *options, f"5:{target}", "1")
    assert code == 1
    assert "nothing was sent" in err
    assert "--may-move" in err
    assert _object(simulated_nodes, int(target, 16)) == before


def test_an_energised_drive_is_reported_and_not_written(axisbus, bus):
    options, simulated_nodes = bus
    _enable(axisbus, options)
    code, out, _ = axisbus("od", "write", *options, "5:6060", "3", "--may-move")
    assert code == 0
    assert "node 5 is ENERGISED" in out
    before = _object(simulated_nodes, 0x6083)
    code, _, err = axisbus("od", "write", *options, "5:6083", str(before + 1))
    assert code == 1
    assert "node 5 is energised, and any write may move it; nothing was sent" in err
    assert _object(simulated_nodes, 0x6083) == before


def test_beside_another_master_no_controlword_is_written(axisbus, tmp_path):
    with command_line.drives(1, 2, 3) as (_, channel):
        path = tmp_path / "cell.toml"
        text = (
            (command_line.ROOT / "examples" / "cell.toml")
            .read_text()
            .replace("builtin:gim6010-8", command_line.GENERIC)
        )
        path.write_text(text.replace('interface = "sim"', f'interface = "virtual"\nchannel = "{channel}"'))
        with Machine.open(path):
            code, _, err = axisbus("od", "write", "-i", "virtual", "-c", channel, "1:6040", "6", "--may-move")
    assert code == 1
    assert "another master is on the bus of node 1; nothing was sent" in err
    assert "SYNC" in err


# -- completion --------------------------------------------------------------------------------------------------------


def _completions(arguments, incomplete):
    found = ShellComplete(cli, {}, "axisbus", "_AXISBUS_COMPLETE").get_completions(
        list(arguments), incomplete
    )
    return [(item.value, item.help) for item in found]


def test_names_and_numbers_are_completed_from_the_eds():
    options = ["od", "read", "--cell", command_line.CELL]
    assert ("x:", "axis of node 1") in _completions(options, "")
    assert ("x:Statusword", "6041h") in _completions(options, "x:stat")
    assert ("1:6041", "Statusword") in _completions(options, "1:604")
    assert ("Position_actual_value", "6064h") in _completions([*options, "1"], "Position_a")


def test_a_shell_that_splits_at_the_colon_is_served_too():
    assert ("Statusword", "6041h") in _completions(
        ["od", "read", "--cell", command_line.CELL, "x", ":"], "Stat"
    )


def test_completion_is_silent_if_a_file_is_invalid():
    assert _completions(["od", "read", "--cell", "no.toml"], "5:") == []


# -- NMT ---------------------------------------------------------------------------------------------------------------


def test_start_and_stop_are_confirmed_and_energise_nothing(axisbus, bus):
    options, simulated_nodes = bus
    code, out, _ = axisbus("nmt", "start", "5", *options)
    assert code == 0
    assert "node 5: operational" in out
    assert "confirmed by" in out
    assert simulated_nodes.devices[0].drives[0].statusword & 0x6F == 0x40  # switch on disabled, as before
    code, out, _ = axisbus("nmt", "stop", "5", *options)
    assert code == 0
    assert "node 5: stopped" in out
    code, out, _ = axisbus("nmt", "pre-operational", "5", *options)
    assert "node 5: pre-operational" in out
    assert code == 0


def test_the_heartbeat_confirms_if_there_is_one(axisbus, bus, monkeypatch):
    options, _ = bus
    monkeypatch.setattr(nmt_commands, "LISTEN", 10.0)  # ends with the first heartbeat
    assert axisbus("od", "write", *options, "5:1017", "50").code == 0
    code, out, _ = axisbus("nmt", "start", "5", *options, "--json")
    assert code == 0
    assert json.loads(out)[0] | {"seconds": 0} == {
        "node": 5,
        "ok": True,
        "before": "pre-operational",
        "state": "operational",
        "silent": False,
        "confirmed_by": "heartbeat",
        "seconds": 0,
        "errors": None,
    }


def test_a_reset_is_confirmed_by_the_boot_up_message(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("nmt", "reset-node", "5", *options)
    assert code == 0
    assert "confirmed by its boot-up message" in out


def test_all_nodes_of_a_bus_by_one_command(axisbus):
    with command_line.drives(3, 4) as (_, channel):
        code, out, _ = axisbus("nmt", "start", "all", "-i", "virtual", "-c", channel)
    assert code == 0
    assert "node 3: operational" in out
    assert "node 4: operational" in out


def test_a_node_that_is_not_there_is_not_confirmed(axisbus, bus):
    options, _ = bus
    code, out, _ = axisbus("nmt", "start", "9", *options)
    assert code == 3
    assert "node 9: SILENT: nothing came from it in 0.2 s before the command, nor any answer to SDO" in out
    assert "next: check the supply, cable, node ID and bit rate" in out


@pytest.mark.parametrize("node", [5, 9], ids=["fell silent", "never heard"])
def test_a_silent_node_is_reported_at_each_reset(axisbus, bus, monkeypatch, node):
    options, simulated_nodes = bus
    monkeypatch.setattr(nmt_commands, "BOOT_PATIENCE", 0.5)
    assert axisbus("nmt", "pre-operational", "5", *options).code == 0
    simulated_nodes.devices[0].dials.dead = True
    for _ in range(3):
        code, out, _ = axisbus("nmt", "reset-node", node, *options)
        assert code == 3
        assert f"node {node}: SILENT: nothing came from it in 0.2 s before the command" in out
        assert re.search(r"and nothing came in \d\.\d s after it \(expected: its boot-up message\)", out)
    (told,) = json.loads(axisbus("nmt", "reset-node", node, *options, "--json").out)
    assert (told["silent"], told["ok"]) == (True, False)


def test_a_node_that_falls_silent_with_the_command_is_distinguished(axisbus, bus, monkeypatch):
    options, simulated_nodes = bus
    device = simulated_nodes.devices[0]
    monkeypatch.setattr(nmt_commands, "BOOT_PATIENCE", 0.5)
    monkeypatch.setattr(device, "nmt_command", lambda _: setattr(device.dials, "dead", True))
    code, out, _ = axisbus("nmt", "reset-node", "5", *options)
    assert code == 3
    assert "node 5: SILENT: before the command it was pre-operational, and nothing came" in out


def test_a_node_that_does_not_start_names_its_errors(axisbus, bus, monkeypatch):
    options, simulated_nodes = bus
    monkeypatch.setattr(nmt_commands, "PATIENCE", 0.5)
    simulated_nodes.devices[0].dials.start_error = 0x8130
    code, out, _ = axisbus("nmt", "start", "5", *options)
    assert code == 3
    assert "node 5: NOT confirmed (was pre-operational): it still reports pre-operational" in out
    assert "error register (1001h) 0x11: generic error, communication" in out
    assert "its list of errors (1003h): 1. 0x8130, Life guard error or heartbeat error" in out


def test_an_energised_drive_keeps_its_bus_unless_forced(axisbus, bus):
    options, simulated_nodes = bus
    _enable(axisbus, options)
    code, _, err = axisbus("nmt", "reset-node", "5", *options)
    assert code == 1
    assert "node 5 is energised; nothing was sent" in err
    assert simulated_nodes.devices[0].drives[0].statusword & 0x6F == 0x27
    assert axisbus("nmt", "reset-node", "5", *options, "--force").code == 0


def test_an_unknown_command_is_misuse(axisbus):
    code, _, err = axisbus("nmt", "halt", "5", "--cell", command_line.CELL)
    assert code == 2
    assert "reset-communication" in err
