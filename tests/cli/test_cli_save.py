"""``axisbus save``: 1010h:01 only without power, through a restart, and with values lost in the restart."""

from __future__ import annotations

import json

import pytest

from axisbus.configuration import store_parameters
from axisbus.machine.machine import Machine
from kit import command_line

NODE = 5
STORED = 0x1010 << 8 | 1


@pytest.fixture
def axisbus(monkeypatch, capsys, tmp_path) -> command_line.Run:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(store_parameters, "RESTART_DETECTION_TIME", 0.3)
    return command_line.runner(monkeypatch, capsys)


@pytest.fixture
def bus():
    with command_line.drives(NODE) as (simulated_nodes, channel):
        yield ("-i", "virtual", "-c", channel), simulated_nodes.devices[0], simulated_nodes.lock


def test_save_stores_the_parameters_and_the_values_are_kept(axisbus, bus):
    options, device, lock = bus
    with lock:
        device.write(0x6081, 0, 4321)
    code, out, _ = axisbus("save", NODE, *options, "--eds", command_line.GENERIC)
    assert code == 0
    assert "node 5: stored by 1010h:01 (Save all parameters) in" in out
    assert "restarted" not in out
    assert "next: keep a copy in a file: axisbus config backup 5" in out
    assert device.dictionary.snapshot()[0x6081 << 8] == 4321


def test_a_restart_is_waited_for_and_all_is_read_again(axisbus, bus):
    options, device, _ = bus
    device.dials.reboot_on_store, device.dials.reboot_time = True, 0.2
    code, out, _ = axisbus("save", NODE, *options, "--eds", command_line.GENERIC, "--json")
    found = json.loads(out)
    assert (code, found["restarted"], found["lost"]) == (0, True, [])
    assert found["compared"] > 50
    assert device.answers_sdo


def test_a_value_lost_in_a_restart_is_reported(axisbus, bus):
    options, device, lock = bus
    with lock:
        device.write(0x6083, 0, 777_777)
    device.dials.reboot_on_store = True
    whole = device.dictionary.snapshot
    device.dictionary.snapshot = lambda: {key: each for key, each in whole().items() if key >> 8 != 0x6083}
    code, out, err = axisbus("save", NODE, *options, "--eds", command_line.GENERIC)
    assert code == 1
    assert "6083h:00" in err
    assert "was 777777" in err
    assert "1 differ" in out


def test_without_an_eds_the_node_answers_again(axisbus, bus):
    options, device, _ = bus
    device.dials.reboot_on_store, device.dials.reboot_time = True, 0.2
    code, out, _ = axisbus("save", NODE, *options)
    assert (code, ", restarted, and answers" in out, "read again" in out) == (0, True, False)


@pytest.mark.parametrize("state", [0x06, 0x07, 0x0F])
def test_save_is_refused_while_a_drive_is_energised(axisbus, bus, state, monkeypatch):
    """By the statusword: ready to switch on and switched on have no torque, operation enabled has."""
    options, device, lock = bus
    with lock:
        for word in (0x06, 0x07, 0x0F)[: (0x06, 0x07, 0x0F).index(state) + 1]:
            device.write(0x6040, 0, word)
            for _ in range(100):
                device.step(0.004)
    before = device.dictionary.snapshot()
    told = []
    monkeypatch.setattr(
        store_parameters, "store", lambda *each: told.append(each) or store_parameters.Stored(False, 0.0)
    )
    code, _, err = axisbus("save", NODE, *options)
    if state != 0x0F:
        assert (code, len(told)) == (0, 1)
        return
    assert (code, told) == (1, [])
    assert "node 5 is energised: storing may restart it and release its load; nothing was sent" in err
    assert "6041h is 0x" in err
    assert device.dictionary.snapshot() == before


def test_a_refusal_is_reported_with_its_reason(axisbus, bus):
    options, device, _ = bus
    device.dials.sdo_write_aborts[0x1010, 1] = 0x0800_0022
    code, _, err = axisbus("save", NODE, *options)
    assert code == 3
    assert "1010h:01" in err
    assert "0x08000022" in err


@pytest.mark.parametrize(
    ("flags", "words"),
    [(0, "by 1010h:01 it does not store"), (2, "it stores automatically (1010h:01)")],
)
def test_a_node_that_does_not_store_on_command(axisbus, bus, flags, words):
    options, device, _ = bus
    device.dictionary.live[STORED] = lambda: flags
    code, _, err = axisbus("save", NODE, *options)
    assert code == 1
    assert f"node 5 cannot store its parameters: {words}; nothing was sent" in err


def test_a_node_that_is_not_there(axisbus, bus):
    code, _, err = axisbus("save", 9, *bus[0])
    assert code == 3
    assert "got no answer" in err


def test_a_simulated_cell_restarts_as_its_make_does(axisbus):
    """Of the reference module it is known that storing restarts it."""
    code, out, _ = axisbus("save", "x", "--cell", command_line.CELL)
    assert code == 0
    assert ", restarted, and answers" in out
    assert "read again after the restart, 0 differ" in out


def test_another_master_is_not_disturbed(axisbus, tmp_path):
    """A machine runs the node: it is refused, and the machine continues."""
    with command_line.drives(NODE) as (_, channel):
        cell = tmp_path / "cell.toml"
        cell.write_text(
            f'[bus]\ninterface = "virtual"\nchannel = "{channel}"\nscan_period = "10ms"\n'
            f'[nodes.{NODE}]\neds = "{command_line.GENERIC}"\n[axes.x]\nnode = {NODE}\nunit = "increments"\n'
        )
        with Machine.open(cell) as machine:
            code, _, err = axisbus("save", "x", "--cell", cell)
            assert (code, "another master is on the bus" in err) == (1, True)
            machine.sleep(0.2)
            assert machine["x"].error is None
