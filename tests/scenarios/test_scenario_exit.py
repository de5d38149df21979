"""Every end of the program leaves the motors at standstill and the drives without monitoring of our heartbeat."""

from __future__ import annotations

import signal
import threading
import time
from typing import Any

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.cia402.port import Outputs
from axisbus.core.core import Core
from axisbus.errors import DriveFault, NodeError, ScanError, StateError
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import CommandStatus
from kit.plant_probe import ENABLED, OFF, SWITCH_ON_DISABLED, PlantMoves
from kit.scenarios.simulated_bus import Line, enable, turning, until


def let_go(cell, name: str = "x") -> None:
    """Make sure that a node was released: it monitors no heartbeat, is pre-operational, and stays without an error."""
    device = cell.device(name)
    assert device.read(0x1016, 1) == 0
    assert device.nmt is NmtState.PRE_OPERATIONAL
    cell.run(2.0)  # our heartbeat and SYNC have ended
    assert device.errors.register == 0
    assert not device.errors.entries
    if cell.speed(name) or cell.stage(name) not in OFF:
        raise PlantMoves(cell.told(name))


@pytest.mark.nets("the stop sequence")
def test_leaving_the_with_block_stops_disables_and_ends_the_node_watches(scenario):
    cell = scenario.simulated("xy")
    with cell.machine:
        cell.turning()
    for name in "xy":
        cell.must_be_still(name, within=0.01, stages=SWITCH_ON_DISABLED)
        let_go(cell, name)


@pytest.mark.nets("the stop sequence")
def test_an_exception_in_the_with_block_stops_everything_and_is_raised(scenario):
    cell = scenario.simulated("xy")
    with pytest.raises(ZeroDivisionError) as caught, cell.machine:
        cell.turning()
        _ = 1 / 0
    for name in "xy":
        cell.must_be_still(name, within=0.01, stages=SWITCH_ON_DISABLED)
        let_go(cell, name)
    assert not getattr(caught.value, "__notes__", [])


@pytest.mark.nets("the stop sequence")
def test_an_exception_has_notes_about_errors_during_the_stop(scenario, golden):
    cell = scenario.simulated("x", stop='halt_time = "300ms"')
    with pytest.raises(ZeroDivisionError) as caught, cell.machine:
        cell.travelling()
        cell.drive().dials.ignore_halt = True
        _ = 1 / 0
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    golden("exception_with_notes", caught.value)


@pytest.mark.nets("the stop sequence")
def test_close_does_the_same_and_may_be_repeated(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    cell.machine.close()
    cell.machine.close()
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    let_go(cell)


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
@pytest.mark.nets("the stop sequence")
def test_ctrl_c_while_an_exception_leaves_the_block_is_not_lost(scenario, error):
    cell = scenario.simulated("x")
    scan, once = cell.machine._core.scan, cell.machine._core.scan.once

    def with_ctrl_c() -> None:
        scan.once = once
        signal.raise_signal(signal.SIGINT)
        once()

    with pytest.raises(KeyboardInterrupt) as caught, cell.machine:
        cell.turning()
        scan.once = with_ctrl_c  # the first cycle of closing
        raise error
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    assert isinstance(caught.value, error) or isinstance(caught.value.__context__, error)


@pytest.mark.nets("the stop sequence")
def test_a_signal_within_the_handler_of_another_makes_it_a_quick_stop_too(scenario):
    """Two that come together: the second is handled in the midst of the first."""
    cell = scenario.simulated("x")
    scan, asked = cell.machine._core.scan, cell.machine._core.scan.request_stop

    def interrupted(reason: str, quick: bool = False) -> None:
        scan.request_stop = asked
        signal.raise_signal(signal.SIGTERM)
        asked(reason, quick)

    with pytest.raises(KeyboardInterrupt), cell.machine:
        cell.turning(90.0)
        start = cell.where()
        scan.request_stop = interrupted
        signal.raise_signal(signal.SIGINT)
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    cell.must_have_moved("x", start, (3.0, 7.0))  # 4 deg by the ramp of the quick stop, 8 by that of the halt


def test_an_interrupted_opening_ends_the_node_watches_again(tmp_path, monkeypatch):
    """No program has the machine yet and could close it."""
    machines, begin = [], Machine._begin

    def interrupted(*_: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(Machine, "_begin", lambda machine: machines.append(machine) or begin(machine))
    monkeypatch.setattr(Core, "_have_values", interrupted)
    with Line(tmp_path) as line:
        with pytest.raises(KeyboardInterrupt):
            line.open()
        (machine,) = machines
        assert machine._core.scan.ended
        assert not machine._core._thread.is_alive()
        assert line.devices["x"].nmt is NmtState.PRE_OPERATIONAL
        assert line.devices["x"].read(0x1016, 1) == 0


def test_commands_after_closing_report_the_closed_machine(scenario, golden):
    cell = scenario.simulated("x").enabled()
    cell.machine.close()
    golden("command_after_close", cell.failure_of(cell.x.move_absolute(1.0)))


def test_a_command_from_another_thread_cannot_slip_in_while_the_machine_closes(scenario, golden):
    """It would enable a drive that nothing stops any more."""
    cell = scenario.simulated("xy")
    cell["x"].enable().wait(3)
    cell["x"].move_velocity(90.0).wait(3)
    handles = []
    once = cell.machine._core.scan.once

    def with_intruder() -> None:
        worker = threading.Thread(target=lambda: handles.append(cell["y"].enable()))
        worker.start()
        worker.join()
        once()

    cell.machine._core.scan.once = with_intruder
    cell.machine.close()
    assert cell.stage("x") == SWITCH_ON_DISABLED
    assert cell.stage("y") == SWITCH_ON_DISABLED
    assert all(isinstance(handle.exception(), StateError) for handle in handles)
    golden("command_while_closing", handles[0].exception())


def test_a_command_that_waits_in_the_queue_when_closing_begins_is_refused(scenario):
    cell = scenario.simulated("x")
    cell.run(0.1)
    handle = cell.x.enable()  # queued, not taken yet
    cell.machine.close()
    assert isinstance(handle.exception(), StateError)
    assert cell.stage() == SWITCH_ON_DISABLED


def test_a_drive_in_fault_is_no_hindrance_to_closing(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    cell.drive().fault(0x2310)
    cell.run(1.0)
    cell.machine.close()
    assert cell.stage() in OFF


@pytest.mark.nets("the stop sequence")
def test_a_fault_while_closing_is_reported(scenario, golden):
    cell = scenario.simulated("xy")
    cell.turning()
    scan = cell.machine._core.scan
    once = scan.once
    beginning = cell.now

    def then_fault() -> None:
        once()
        if cell.now > beginning + 0.05 and not cell.drive("x").error_code:
            cell.drive("x").fault(0x3210)

    scan.once = then_fault
    failure = None
    try:
        cell.machine.close()
    except DriveFault as error:
        failure = error
    cell.must_be_still("x", within=1.0, stages=OFF)
    cell.must_be_still("y", within=0.01, stages=SWITCH_ON_DISABLED)
    golden("fault_while_closing", failure)


@pytest.mark.nets("the drive's watchdog")
def test_a_node_that_is_lost_when_the_machine_closes_keeps_its_watch_over_us(scenario, golden):
    """Its stop could not be confirmed: releasing its watchdog now would remove the last means to stop it."""
    cell = scenario.simulated("xy", heartbeat="500ms")  # a slow one: it must still be armed after closing
    cell.turning()
    cell.device("x").dials.dead = True
    failures = []
    try:
        cell.machine.close()
    except NodeError as error:
        failures.append(error)
    except Exception as error:  # noqa: BLE001  # which one is for the golden message to say
        failures.append(error)
    cell.must_be_still("x", within=3.0, stages=OFF)
    cell.must_be_still("y", within=0.01, stages=SWITCH_ON_DISABLED)
    assert cell.device("x").read(0x1016, 1) != 0
    assert cell.device("y").read(0x1016, 1) == 0
    golden("closing_with_a_lost_node", *failures)


def test_an_axis_that_was_never_commanded_is_not_touched_at_the_end(scenario):
    cell = scenario.simulated("xy")
    cell["y"].enable().wait(3)
    sent = []
    port: Any = cell.port("x")
    write = port.write

    def watched(outputs: Outputs) -> None:
        sent.append(outputs.controlword)
        write(outputs)

    port.write = watched
    cell.machine.close()
    assert set(sent) == {None}
    let_go(cell, "x")
    let_go(cell, "y")


def test_handles_that_are_open_when_the_machine_closes_end(scenario):
    cell = scenario.simulated("x")
    (handle,) = cell.travelling()
    cell.machine.close()
    assert handle.aborted
    late = CommandStatus("x.late")
    cell.machine._core.scan.submit("x", None, late)
    assert isinstance(late.error, ScanError)
    assert cell.stage() != ENABLED


def test_on_a_bus_too_a_deliberate_exit_leaves_drives_that_bear_our_silence(tmp_path):
    with Line(tmp_path, "xy") as line:
        with line.open() as machine:
            turning(machine, line)
        time.sleep(2.0)  # twenty heartbeats of ours
        for name in "xy":
            device = line.devices[name]
            line.must_be_still(name, stages=SWITCH_ON_DISABLED, within=0.1, for_good=0.1)
            assert device.read(0x1016, 1) == 0
            assert device.nmt is NmtState.PRE_OPERATIONAL
            assert device.errors.register == 0
            assert not device.errors.entries


def test_a_drive_whose_watch_of_the_master_is_not_ended_reacts_to_our_silence(tmp_path):
    """The scenario above without the release: it proves that the drive's watchdog was armed."""
    with Line(tmp_path) as line:
        machine = line.open()
        enable(machine["x"])
        machine._core.runtime.link.leave = lambda _: None
        machine.close()
        until(lambda: bool(line.devices["x"].errors.entries))
