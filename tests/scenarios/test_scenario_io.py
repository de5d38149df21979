"""Inputs and outputs in the cycle: seen, set, lost with their node, and safe at every end."""

from __future__ import annotations

import math

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import (
    ArgumentError,
    DriveError,
    NodeError,
    SignalTimeout,
    StaleError,
    StateError,
    Stopped,
)
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.motion.stop.shutdown_stop import ShutdownStop
from kit.cell import Cell, cell_text
from kit.io_module import LEVEL, MODULE
from kit.plant_probe import ENABLED, OFF

IO = (
    MODULE
    + LEVEL
    + """
[io.clamp]
node = 5
object = "6200h:01"
bit = 7
safe = true
[io.valve]
node = 5
object = "6411h:01"
scale = 1000
unit = "V"
safe = 0.5
[io.switch]
node = 1
object = "60FDh"
bit = 1
[io.relay]
node = 1
object = "60FEh:01"
bit = 16
safe = 0
"""
)


def with_io(scenario, node: str = "", **changes: str) -> Cell:
    return scenario.simulated(text=cell_text("x", more=IO.format(node=node), **changes))


def module(cell: Cell):
    return cell.machine.simulated_node(5).device.io


def word(cell: Cell, index: int = 0x6200, subindex: int = 1) -> int:
    return module(cell).get(index, subindex)


def settle(cell: Cell) -> None:
    cell.run(0.05)


def test_an_input_is_seen_with_its_age(scenario):
    cell = with_io(scenario)
    part = cell.machine.io["part"]
    assert part.value is False
    module(cell).set_bit(0x6000, 1, 2, True)
    settle(cell)
    assert part.value is True
    assert 0.0 <= part.age <= 0.02
    module(cell).set(0x6000, 1, 0xFB)  # every other bit of the byte
    settle(cell)
    assert part.value is False


def test_a_number_is_in_its_unit(scenario):
    cell = with_io(scenario)
    module(cell).set(0x6401, 2, -250)
    settle(cell)
    assert cell.machine.io["level"].value == pytest.approx(-3.5)
    cell.machine.io["valve"].set(-2.25).wait(1)
    assert word(cell, 0x6411) == -2250


def test_an_output_reaches_the_plant_and_leaves_the_other_bits_alone(scenario):
    cell = scenario.simulated(text=cell_text("x", more=IO.format(node='[nodes.5.objects]\n"6200:01" = 0x15')))
    lamp = cell.machine.io["lamp"]
    assert (word(cell), lamp.value) == (0x15, False)
    lamp.set(True).wait(1)
    assert (word(cell), lamp.value) == (0x1D, True)
    lamp.set(False).wait(1)
    assert (word(cell), lamp.value) == (0x15, False)


def test_opening_and_closing_a_machine_sets_no_output(scenario):
    cell = with_io(scenario)
    for address in ((0x6200, 1), (0x6411, 1)):
        cell.machine.simulated_node(5).device.write(*address, 77)
    cell.run(1.0)
    cell.machine.close()
    assert (word(cell), word(cell, 0x6411)) == (77, 77)


def test_several_outputs_are_set_in_one_cycle_or_not_at_all(scenario):
    cell = with_io(scenario)
    io = cell.machine.io
    seen = set()
    cell.each_cycle(lambda *_: seen.add((word(cell) >> 3 & 1, word(cell, 0x6411), word_of_drive(cell))))
    io.set({"lamp": True, "valve": 1.0, "relay": True}).wait(1)
    assert seen == {(0, 0, 0), (1, 1000, 1 << 16)}
    with pytest.raises(ArgumentError, match=r"valve cannot be 1000000000\.0 V"):
        io.set({"lamp": False, "valve": 1e9})
    settle(cell)
    assert word(cell) & 8


def word_of_drive(cell: Cell) -> int:
    return cell.device().io.get(0x60FE, 1)


def test_the_inputs_and_outputs_of_a_drive_work_next_to_its_axis(scenario):
    cell = with_io(scenario)
    cell.machine.io["relay"].set(True).wait(1)
    assert word_of_drive(cell) == 1 << 16
    assert cell.device().io.get(0x60FE, 2) == 1 << 16  # the mask was opened
    cell.enabled()
    cell.x.move_relative(10.0).wait(5)
    cell.device().io.set(0x60FD, 0, 0b10)
    settle(cell)
    assert cell.machine.io["switch"].value is True


def test_an_input_is_waited_for(scenario):
    cell = with_io(scenario)
    part = cell.machine.io["part"]
    cell.after(0.3, lambda: module(cell).set_bit(0x6000, 1, 2, True))
    began = cell.now
    assert part.wait(True, timeout=2.0) is True
    assert 0.29 < cell.now - began < 0.35
    with pytest.raises(SignalTimeout, match=r"part did not become False within 0.2 s") as caught:
        part.wait(False, timeout=0.2)
    assert isinstance(caught.value, TimeoutError)
    assert not isinstance(caught.value, DriveError)
    assert caught.value.signal == "part"
    module(cell).set(0x6401, 2, 500)
    assert cell.machine.io["level"].wait(lambda metres: metres > 3, timeout=1.0) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("part", True, "part cannot be set"),
        ("lamp", 2, "lamp cannot be 2"),
        ("lamp", "on", "lamp cannot be 'on'"),
        ("valve", math.nan, "valve cannot be nan"),
        ("valve", 33.0, "valve cannot be 33.0 V"),
        ("valve", True, "valve cannot be True"),
    ],
)
def test_an_invalid_output_value_is_refused_at_the_call(scenario, name, value, said):
    cell = with_io(scenario)
    with pytest.raises(ArgumentError, match=said):
        cell.machine.io[name].set(value)
    cell.run(0.1)
    assert (word(cell), word(cell, 0x6411)) == (0, 0)


def test_an_unknown_name_is_reported(scenario):
    with pytest.raises(StateError, match="no input or output 'lmap'"):
        with_io(scenario).machine.io["lmap"]


def test_an_output_is_noted_as_set_before_it_is_sent(scenario):
    """If the core dies between both, the watchdog process makes the output safe."""
    cell, noted = with_io(scenario), []
    cell.machine._core.scan.io.note = lambda readings: noted.append((readings["lamp"].set, word(cell)))
    cell.machine.io["lamp"].set(True).wait(1)
    assert (True, 0) in noted
    assert (False, 8) not in noted


def test_opening_the_mask_of_a_drive_switches_nothing_on(scenario):
    """A bit that did not act may have been left on by any program."""
    at_boot = '[nodes.1.objects]\n"60FE:01" = 0x50000\n'
    cell = scenario.simulated(text=cell_text("x", more=IO.format(node="") + at_boot))
    assert cell.device().io.get(0x60FE, 2) == 1 << 16
    assert word_of_drive(cell) == 0x40000  # the other bit is not named, and not opened
    assert cell.machine.io["relay"].value is False


def test_failsafe_values_that_the_cell_file_writes_are_kept(scenario):
    own = '[nodes.5.objects]\n"6444:01" = 0x1F40000\n"6207:01" = 0x7F\n"1029:01" = 2\n'
    cell = scenario.simulated(text=cell_text("x", more=IO.format(node="") + own))
    device = cell.machine.simulated_node(5).device
    assert device.read(0x6444, 1) == 0x1F40000
    assert device.read(0x1029, 1) == 2
    assert (
        device.read(0x6207, 1) == 0xF7
    )  # by bits: lamp and clamp are the cell's, the others as they were given
    (report,) = [each for each in cell.machine.reports if each.node_id == 5]
    assert any("as the cell file writes into 6444h:01" in line for line in report.io)


def test_a_module_may_not_stay_operational_without_us(scenario):
    """It would take its outputs again from the next frame."""
    cell = scenario.simulated(text=cell_text("x", more=IO.format(node='[nodes.5.objects]\n"1029:01" = 1')))
    assert cell.machine.simulated_node(5).device.read(0x1029, 1) == 0


# -- lost --------------------------------------------------------------------------------------------------------------


def test_a_lost_module_is_unknown_and_stops_the_cell(scenario):
    cell = with_io(scenario)
    cell.turning()
    module(cell).set_bit(0x6000, 1, 2, True)
    cell.machine.io["lamp"].set(True).wait(1)
    cell.machine.simulated_node(5).device.dials.dead = True
    cell.must_be_still("x", within=2.0, stages=ENABLED)
    for name in ("part", "lamp", "level"):
        with pytest.raises(StaleError) as caught:
            _ = cell.machine.io[name].value
        assert "heartbeat or guarding answer stays away" in caught.value.observed
    assert isinstance(cell.failure_of(cell.machine.io["lamp"].set(True)), NodeError)


def test_an_output_set_while_its_module_dies_does_not_succeed(scenario):
    """Its death is known three heartbeats later; until then the output cannot be confirmed."""
    cell = with_io(scenario)
    cell.machine.simulated_node(5).device.dials.dead = True
    handle = cell.machine.io["lamp"].set(True)
    cell.run(0.2)
    assert handle.busy
    error = cell.failure_of(handle)
    assert isinstance(error, NodeError)
    assert error.message == "lamp = True is not confirmed: its node was lost before it answered"


def test_on_lost_may_only_report(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    cell.turning()
    cell.machine.simulated_node(5).device.dials.dead = True
    cell.run(1.0)
    cell.must_move("x")
    assert any("node 5 is lost" in str(event) for event in cell.machine.events)
    with pytest.raises(StaleError):
        _ = cell.machine.io["part"].value


def test_a_wait_for_an_input_of_a_lost_node_ends_with_an_error(scenario):
    cell = with_io(scenario)
    cell.after(0.2, lambda: setattr(cell.machine.simulated_node(5).device.dials, "dead", True))
    with pytest.raises(StaleError):
        cell.machine.io["part"].wait(True, timeout=5.0)
    assert cell.now < 1.5


def test_a_module_that_sends_no_heartbeat_but_receives_gets_its_safe_state(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    cell.machine.io["lamp"].set(True).wait(1)
    cell.machine.simulated_node(5).device.dials.heartbeat_stops = True
    cell.run(0.6)
    assert word(cell) == 0x80
    cell.machine.simulated_node(5).device.dials.heartbeat_stops = False
    cell.run(0.6)
    assert word(cell) == 0x80
    assert cell.machine.io["lamp"].value is False


def test_after_a_loss_no_output_is_switched_on_without_a_command(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    io = cell.machine.io
    io.set({"lamp": True, "clamp": False}).wait(1)
    cell.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 5)
    cell.run(0.3)
    with pytest.raises(StaleError, match="lamp"):
        _ = io["lamp"].value
    cell.nmt(NmtCommand.START, 5)
    cell.run(0.3)
    assert word(cell) == 0x80  # the safe state of both
    assert (io["lamp"].value, io["clamp"].value) == (False, True)
    with pytest.raises(StaleError, match="valve"):  # never set: its state in the module is unknown
        _ = io["valve"].value
    io["lamp"].set(True).wait(1)
    assert word(cell) == 0x88


def test_after_a_loss_no_frame_restores_outputs_that_were_never_set(scenario):
    """The module has made all bits of the byte safe: those beside the one that was set, too, named or not."""
    cell = with_io(scenario, node='on_lost = "report"\n[nodes.5.objects]\n"6200:01" = 0x15')
    cell.machine.io["lamp"].set(True).wait(1)
    cell.faults.heartbeat_lost = True
    cell.run(0.6)
    assert word(cell) == 0x80  # clamp, which was never set, is on when safe; the rest is off
    cell.faults.heartbeat_lost = False
    cell.nmt(NmtCommand.START, 5)
    cell.run(0.6)
    assert word(cell) == 0x80
    assert cell.machine.io["clamp"].value is True


def test_a_restarted_module_gets_nothing_more(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    cell.machine.io["lamp"].set(True).wait(1)
    cell.nmt(NmtCommand.RESET_NODE, 5)
    cell.run(0.5)
    cell.nmt(NmtCommand.START, 5)
    cell.run(0.5)
    assert word(cell) == 0
    refused = cell.failure_of(cell.machine.io["lamp"].set(True))
    assert isinstance(refused, NodeError)
    assert "restarted" in refused.observed
    assert "axisbus boot CELL --node 5" in refused.remedy
    with pytest.raises(StaleError) as caught:
        _ = cell.machine.io["part"].value
    assert "restarted" in caught.value.observed
    assert "axisbus boot CELL --node 5" in caught.value.remedy


def test_a_master_that_falls_silent_leaves_outputs_to_the_module(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    cell.machine.io.set({"lamp": True, "clamp": False, "valve": 5.0}).wait(1)
    cell.faults.heartbeat_lost = True
    cell.run(0.6)
    assert (word(cell), word(cell, 0x6411)) == (0x80, 500)
    assert cell.machine.simulated_node(5).device.nmt is NmtState.PRE_OPERATIONAL


# -- leaving -----------------------------------------------------------------------------------------------------------


def test_at_the_end_outputs_become_safe_after_the_axes_are_at_standstill(scenario):
    cell = with_io(scenario)
    cell.turning()
    cell.machine.io.set({"lamp": True, "clamp": False, "valve": 3.0, "relay": True}).wait(1)
    states = []
    cell.each_cycle(lambda *_: states.append((cell.stage() in OFF, word(cell) >> 3 & 1)))
    assert cell.ctrl_c(10.0) == []
    settle(cell)  # the frames are still in transit
    assert (word(cell), word(cell, 0x6411), word_of_drive(cell)) == (0x80, 500, 0)
    assert (False, 0) not in states  # on until the axis was off
    assert (True, 1) in states
    assert isinstance(cell.failure_of(cell.machine.io["lamp"].set(True)), Exception)


def test_an_output_command_that_waited_is_not_executed_once_outputs_are_safe(scenario):
    cell = with_io(scenario)
    cell.machine.io["lamp"].set(True).wait(1)
    scan = cell.machine._core.scan
    scan.io.leave()
    error = cell.failure_of(cell.machine.io["lamp"].set(True))
    assert isinstance(error, Stopped)
    settle(cell)
    assert word(cell) == 0


def test_outputs_become_safe_though_an_axis_cannot_be_stopped(scenario):
    cell = with_io(scenario)
    cell.turning()
    cell.machine.io["lamp"].set(True).wait(1)
    cell.device("x").dials.dead = True
    assert cell.ctrl_c(15.0) != []
    assert word(cell) == 0


def test_outputs_become_safe_when_the_wait_for_the_axes_has_timed_out(scenario, monkeypatch):
    """Otherwise the scan would keep sending them unchanged, and undo the values written by SDO."""
    cell = with_io(scenario)
    cell.machine.io["lamp"].set(True).wait(1)
    monkeypatch.setattr(ShutdownStop, "over", False)
    sent = []
    cell.each_cycle(lambda *_: sent.append(word(cell)))
    cell.machine.close()
    assert cell.machine._core.scan.io.outputs_left  # in its own last frames, not by SDO alone
    assert word(cell) == 0
    assert 8 in sent


def test_the_end_of_the_with_block_leaves_safe_outputs_and_a_pre_operational_module(scenario):
    with with_io(scenario).machine as machine:
        device = machine.simulated_node(5).device
        machine.io["lamp"].set(True).wait(1)
        assert device.io.get(0x6200, 1) == 8
    assert device.io.get(0x6200, 1) == 0
    assert device.nmt is NmtState.PRE_OPERATIONAL


def test_an_output_that_cannot_be_made_safe_is_named(scenario):
    cell = with_io(scenario, node='on_lost = "report"')
    cell.machine.io["lamp"].set(True).wait(1)
    cell.machine.simulated_node(5).device.dials.dead = True
    with pytest.raises(NodeError, match="lamp could not be confirmed as safe"):
        cell.machine.close()


def test_a_scan_that_died_leaves_safe_outputs(scenario):
    cell = with_io(scenario)
    cell.machine.io["lamp"].set(True).wait(1)
    cell.faults.commit = RuntimeError("the adapter is gone")
    with pytest.raises(RuntimeError):
        cell.machine.sleep(0.1)
    with pytest.raises(Exception, match="scan of the bus had failed"):
        cell.machine.close()
    assert word(cell) == 0


def test_a_halt_and_a_fault_leave_outputs_as_they_are(scenario):
    cell = with_io(scenario)
    cell.turning()
    cell.machine.io["lamp"].set(True).wait(1)
    cell.machine.simulated_node(1).fault(0x7500)
    cell.run(1.0)
    assert cell.x.state is AxisState.ERRORSTOP
    assert word(cell) == 8


# -- without SYNC, without axes ----------------------------------------------------------------------------------------


def test_without_sync_inputs_and_outputs_are_sent_on_change(scenario):
    cell = with_io(scenario, bus="sync = false")
    module(cell).set_bit(0x6000, 1, 2, True)
    cell.machine.io["lamp"].set(True).wait(1)
    assert word(cell) == 8
    cell.run(3.0)
    assert (
        cell.machine.io["part"].value is True
    )  # with its age: silence of a value sent on change is no information
    cell.ctrl_c(10.0)
    assert word(cell) == 0


def test_a_cell_may_have_no_axis(scenario, tmp_path):
    text = cell_text("", more=IO.format(node="").partition("[io.switch]")[0])
    with Machine.simulated(scenario.file(text)) as machine:
        device = machine.simulated_node(5).device
        machine.io["lamp"].set(True).wait(1)
        assert (device.io.get(0x6200, 1), machine.io["lamp"].value, machine.io["part"].value) == (
            8,
            True,
            False,
        )
    assert device.io.get(0x6200, 1) == 0


def test_a_drive_found_enabled_keeps_its_outputs(scenario):
    text = cell_text("x", more=IO.format(node=""))
    devices = {}

    def found():
        from axisbus.eds import builtin, load
        from axisbus.sim.build import device_from_eds

        for node_id, name in ((1, "generic-cia402"), (5, "generic-cia401")):
            devices[node_id] = device_from_eds(
                load(builtin.resolve(f"builtin:{name}", scenario.folder)), node_id
            )
        device = devices[1]
        device.power_on()
        for control in (6, 7, 15):
            device.write(0x6040, 0, control)
            device.step(0.1)
        return devices

    cell = scenario.simulated(text=text, devices=found)
    refused = cell.failure_of(cell.machine.io["relay"].set(True))
    assert isinstance(refused, StateError)
    assert "found with an enabled drive" in refused.observed
    assert "disable a drive that is enabled; then boot the node" in refused.remedy
    cell.machine.io["lamp"].set(True).wait(1)
    assert word(cell) == 8
    cell.machine["x"].disable().wait(5)
    assert cell.machine.node(1).boot().ok
    cell.machine.io["relay"].set(True).wait(1)
    assert devices[1].io.get(0x60FE, 1) == 1 << 16


@pytest.mark.parametrize("supply", ["stays", "fails"])
def test_outputs_of_a_node_that_is_booted_again_are_safe_until_they_are_set_again(scenario, supply):
    cell = with_io(scenario, node='on_lost = "report"')
    io, node = cell.machine.io, cell.machine.simulated_node(5)
    io.set({"lamp": True, "clamp": False, "valve": 2.0}).wait(1)
    if supply == "fails":
        node.switch_off()
        cell.run(1.0)
        node.switch_on()
        cell.run(1.0)
    for _ in range(2):
        assert cell.machine.node(5).boot().ok
        settle(cell)
        assert (word(cell) >> 3 & 1, word(cell) >> 7 & 1, word(cell, 0x6411)) == (0, 1, 500)
        module(cell).set_bit(0x6000, 1, 2, True)
        settle(cell)
        assert io["part"].value is True
        io.set({"lamp": True, "clamp": False, "valve": 2.0}).wait(1)
        assert (word(cell) >> 3 & 1, word(cell) >> 7 & 1, word(cell, 0x6411)) == (1, 0, 2000)
        module(cell).set_bit(0x6000, 1, 2, False)
        settle(cell)
        assert io["part"].value is False
    cell.machine.close()
    assert (word(cell) >> 3 & 1, word(cell) >> 7 & 1, word(cell, 0x6411)) == (0, 1, 500)


def test_a_module_that_lost_its_supply_is_booted_as_its_error_says_and_the_axes_are_used_again(scenario):
    """The loss of the module stops the cell. The part leaves while the module has no supply."""
    cell = with_io(scenario)
    io, node = cell.machine.io, cell.machine.simulated_node(5)
    module(cell).set_bit(0x6000, 1, 2, True)
    io["lamp"].set(True).wait(1)
    cell.turning()
    node.switch_off()
    cell.must_be_still("x", within=2.0, stages=ENABLED)
    module(cell).set_bit(0x6000, 1, 2, False)
    node.switch_on()
    cell.run(1.0)
    for name in ("part", "lamp"):
        with pytest.raises(StaleError) as caught:
            _ = io[name].value
        assert "axisbus boot CELL --node 5" in caught.value.remedy
    assert cell.machine.node(5).boot().ok
    settle(cell)
    assert (io["part"].value, io["lamp"].value, word(cell)) == (False, False, 0)
    assert 0.0 <= io["part"].age <= 0.02
    module(cell).set_bit(0x6000, 1, 2, True)
    io["lamp"].set(True).wait(1)
    settle(cell)
    assert (io["part"].value, io["lamp"].value, word(cell)) == (True, True, 8)
    axis = cell.machine["x"]
    axis.reset().wait(5)
    axis.enable().wait(5)
    axis.move_relative(3.0).wait(5)
