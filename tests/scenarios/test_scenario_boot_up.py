"""Boot-up on a bus: the letters of CiA 302-2 by faulty drives, optional nodes, lost frames, a restarted master."""

from __future__ import annotations

import gc
import json
import re
import time
from contextlib import suppress

import pytest

from axisbus import eds
from axisbus.boot.stop_report import Watchdog
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.core import canlink, late_boot
from axisbus.eds.builtin import resolve
from axisbus.errors import BootError, DriveError, NodeError, NodeStateError, NodeTimeout, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.opening import boot
from axisbus.motion.states import AxisState
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from kit.cell import GENERIC
from kit.lossy_line import LossyLine
from kit.plant_probe import ENABLED, OFF
from kit.scenarios.simulated_bus import Line, enable, until


@pytest.fixture
def impatient(monkeypatch):
    """Nodes that are not there are given up soon, and asked for again soon."""
    monkeypatch.setattr(canlink, "FIND_TIME", 0.8)
    monkeypatch.setattr(late_boot, "POLL_PERIOD", 0.2)


def with_lines(line: Line, node: int, *lines: str) -> None:
    """Add lines to the table of a node."""
    head = f"[nodes.{node}]\n"
    text = line.file.read_text("utf-8")
    assert head in text
    line.file.write_text(text.replace(head, head + "".join(f"{each}\n" for each in lines)), encoding="utf-8")


def with_bus_line(line: Line, text: str) -> None:
    """Add a line to ``[bus]``."""
    line.file.write_text(line.file.read_text("utf-8").replace("[bus]\n", f"[bus]\n{text}\n"), "utf-8")


def refused(line: Line) -> BootError:
    """Open the machine, which must fail, and return why."""
    with pytest.raises(BootError) as caught:
        line.open()
    return caught.value


# -- letters -------------------------------------------------------------------------------------------------------------


def test_letter_b_no_node_is_there(tmp_path, impatient):
    with Line(tmp_path, present="") as line:
        error = refused(line)
    assert (error.letter, error.step, error.index) == ("B", "find", 0x1000)
    assert error.elapsed > 0.8


def test_letter_o_the_drive_was_exchanged(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].dictionary.set(0x1018 << 8 | 4, 4711)
        with_lines(line, 1, "serial = 4712")
        error = refused(line)
    assert (error.letter, error.index, error.subindex) == ("O", 0x1018, 4)
    assert error.observed == "1018h:04 is 0x1267, cell.toml says 0x1268"


def test_letter_n_the_firmware_is_another_one(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].dictionary.set(0x1018 << 8 | 3, 0x20001)
        with_lines(line, 1, "revision = 0x10001")
        assert refused(line).letter == "N"


def test_letter_j_the_drive_refuses_an_object(tmp_path):
    with Line(tmp_path, more='[nodes.1.objects]\n"6065" = 3000\n') as line:
        line.devices["x"].dials.sdo_write_aborts[0x6065, 0] = 0x0609_0030
        error = refused(line)
    assert (error.letter, error.index, error.abort) == ("J", 0x6065, 0x0609_0030)
    assert "leave the line out" in error.remedy


def test_letter_e_a_drive_that_reports_heartbeats_in_1017h_and_sends_none(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].write(0x1017, 0, 50)
        line.devices["x"].dials.heartbeat_stops = True
        error = refused(line)
    assert (error.letter, error.step) == ("E", "state")


def test_letter_k_no_heartbeat_is_received_after_1017h_was_written(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].dials.heartbeat_stops = True
        error = refused(line)
        assert line.devices["x"].nmt is NmtState.PRE_OPERATIONAL
    assert (error.letter, error.step) == ("K", "error control")


def test_letter_l_a_restarted_master_finds_its_nodes_operational_and_resets_none(tmp_path):
    with Line(tmp_path, "xy") as line:
        with line.open():
            pass
        for device in line.devices.values():  # as a master leaves them that was killed
            with line.simulated_nodes.lock:
                device.write(0x1017, 0, 100)
                device.nmt_command(NmtCommand.START)
        booted = {name: device.boot_ups for name, device in line.devices.items()}
        with line.open() as machine:
            assert [report.outcome.letter.name for report in machine.reports] == ["L", "L"]
            enable(machine["x"])
            machine["x"].move_relative(2.0).wait(10)
        assert booted == {name: device.boot_ups for name, device in line.devices.items()}


def test_a_node_that_was_left_stopped_is_woken_and_booted(tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].write(0x1017, 0, 100)
        until(lambda: line.devices["x"].nmt is NmtState.PRE_OPERATIONAL)
        with line.simulated_nodes.lock:
            line.devices["x"].nmt_command(NmtCommand.STOP)
        with line.open() as machine:
            assert machine.node(1).nmt is NmtState.OPERATIONAL
            assert machine.reports[0].outcome.done[0].startswith("woken")


# -- a node that is there and does not start --------------------------------------------------------------------------------


def test_a_drive_that_refuses_to_start_names_its_errors_and_not_its_supply(tmp_path, golden):
    with Line(tmp_path) as line:
        line.devices["x"].dials.start_error = 0x8130
        error = refused(line)
        assert line.devices["x"].nmt is NmtState.PRE_OPERATIONAL
        assert (
            len(line.devices["x"].errors.entries) <= 3
        )  # it is not reported until its list holds nothing else
    assert error.step == "start"
    golden("boot_refuses_to_start", error, volatile=True)


def test_a_drive_that_refuses_to_start_and_reports_no_error(tmp_path, golden, monkeypatch):
    with Line(tmp_path) as line:
        device = line.devices["x"]
        device.dials.start_error = 0x8130
        monkeypatch.setattr(device.errors, "report", lambda *_: None)
        error = refused(line)
    golden("boot_refuses_to_start_in_silence", error, volatile=True)


def test_a_drive_that_refuses_to_start_in_virtual_time(tmp_path, golden):
    line = Line(tmp_path)
    made = device_from_eds(eds.load(resolve(GENERIC, tmp_path)), 1)
    made.dials.start_error = 0x8130
    with pytest.raises(BootError) as caught:
        Machine.simulated(line.file, {1: made})
    golden("boot_refuses_to_start_in_virtual_time", caught.value)


def test_a_node_that_does_not_start_again_names_its_errors(tmp_path):
    line = Line(tmp_path)
    with Machine.simulated(line.file) as machine:
        machine.node(1).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        machine.simulated_node(1).device.dials.start_error = 0x8120
        with pytest.raises(NodeTimeout, match="node 1 does not execute the NMT command 'start'") as caught:
            machine.node(1).command(NmtCommand.START)
        assert "1. 0x8120, CAN in error passive mode" in caught.value.observed
        assert "supply" not in str(caught.value)


def test_a_drive_in_fault_that_refuses_its_configuration_names_the_fault(tmp_path, golden):
    with Line(tmp_path, more='[nodes.1.objects]\n"6065" = 3000\n') as line:
        device = line.devices["x"]
        until(lambda: device.nmt is NmtState.PRE_OPERATIONAL)
        with line.simulated_nodes.lock:
            device.errors.report(0, 0x3220)
        device.dials.sdo_write_aborts[0x6065, 0] = 0x0800_0022
        error = refused(line)
    assert error.letter == "J"
    golden("boot_configuration_refused_in_fault", error, volatile=True)


# -- settings of the cell file -------------------------------------------------------------------------------------------


def eds_with_1020(folder) -> None:
    """Write the generic drive's EDS with 1020h (verify configuration)."""
    text = resolve(GENERIC, folder).read_text(encoding="ascii")
    text += "\n[1020]\nParameterName=Verify configuration\nObjectType=0x8\nSubNumber=3\n"
    text += "\n[1020sub0]\nParameterName=Highest sub-index supported\nObjectType=0x7\nDataType=0x0005\n"
    text += "AccessType=const\nDefaultValue=2\n"
    for subindex, name in ((1, "Configuration date"), (2, "Configuration time")):
        text += f"\n[1020sub{subindex}]\nParameterName={name}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0\n"
    (folder / "drive.eds").write_text(text, encoding="ascii")


def test_a_configuration_of_the_same_date_is_downloaded_once(tmp_path):
    """2026-03-31 is day 15430 after 1984-01-01, 14:30 is 52200000 ms after midnight (by hand)."""
    eds_with_1020(tmp_path)
    with Line(tmp_path, eds="drive.eds", more='[nodes.1.objects]\n"6065" = 3000\n') as line:
        with_lines(line, 1, "configuration_date = 2026-03-31", "configuration_time = 14:30:00")
        assert boot(line.file)[0].outcome.written > 0
        device = line.devices["x"]
        assert (device.read(0x1020, 1), device.read(0x1020, 2)) == (15_430, 52_200_000)
        device.write(0x6065, 0, 2999)
        report = boot(line.file)[0]
        assert report.outcome.written == 0
        assert "1020h" in report.configured
        assert device.read(0x6065) == 2999


def test_defaults_are_restored_before_the_configuration(tmp_path):
    with Line(tmp_path) as line:
        with_lines(line, 1, "restore_defaults = true")
        device = line.devices["x"]
        device.write(0x6081, 0, 12345)
        before = device.boot_ups
        with line.open() as machine:
            assert machine["x"].name == "x"
        assert device.read(0x6081) != 12345
        assert device.boot_ups > before


# -- optional nodes ------------------------------------------------------------------------------------------------------


def test_an_absent_optional_node_does_not_prevent_boot_up_and_its_axis_is_refused_with_the_reason(
    tmp_path, impatient
):
    with Line(tmp_path, "xy", present="x") as line:
        with_lines(line, 2, "optional = true")
        with line.open() as machine:
            assert [axis.name for axis in machine] == ["x"]
            with pytest.raises(
                StateError, match="axis y cannot be used: node 2 is optional and is not present"
            ):
                machine["y"]
            enable(machine["x"])
            machine["x"].move_relative(2.0).wait(10)
        assert line.stage() in OFF


def test_an_optional_node_that_appears_later_is_picked_up(tmp_path, impatient):
    with Line(tmp_path, "xy", more='[groups.xy]\naxes = ["x", "y"]\n') as line:
        with_lines(line, 2, "optional = true")
        late = line.devices["y"]
        late.dials.dead = True
        with line.open() as machine:
            assert "y" not in machine
            with pytest.raises(StateError, match="node 2 is optional"):
                machine.group("xy")
            enable(machine["x"])
            late.dials.dead = False
            until(lambda: "y" in machine, 20)
            enable(machine["y"])
            machine.group("xy").move_direct((2.0, -2.0), velocity=20.0).wait(20)
            assert line.where("y") == pytest.approx(-2.0, abs=1.5)
            assert [report.ok for report in machine.reports] == [True, True]
        assert late.read(0x1016, 1) == 0  # released like the others
        assert line.stage("y") in OFF


def test_an_optional_node_that_is_another_device_is_reported_and_not_used(tmp_path):
    with Line(tmp_path, "xy") as line:
        with_lines(line, 2, "optional = true", "serial = 99")
        with line.open() as machine, pytest.raises(StateError, match="did not boot") as caught:
            machine["y"]
        assert "serial number differs" in caught.value.observed
        assert line.devices["y"].nmt is not NmtState.OPERATIONAL


def test_boot_reports_an_optional_node_apart_from_one_that_must_be_there(axisbus, tmp_path, impatient):
    with Line(tmp_path, "xy", present="x") as line:
        with_lines(line, 2, "optional = true")
        code, out, _ = axisbus("boot", line.file)
    assert code == 0, out
    assert "node 2: not present; it is optional" in out
    assert "1 of 2 nodes came up" in out


def test_boot_prints_letter_step_object_expected_and_got(axisbus, tmp_path):
    with Line(tmp_path) as line:
        line.devices["x"].dictionary.set(0x1018 << 8 | 4, 16)
        with_lines(line, 1, "serial = 17")
        code, out, _ = axisbus("boot", line.file)
        code_of_json, plain, _ = axisbus("boot", "--json", line.file)
    assert code == code_of_json == 3
    assert re.search(
        r"boot-up +O: the serial number \(1018h:04\) is not the expected one; step identity, try 1",
        out,
    )
    assert re.search(r"object +1018h:04\n +expected +0x11 \(17\)\n +got +0x10 \(16\)", out)
    (node,) = json.loads(plain)
    facts = {
        key: node["boot"][key] for key in ("letter", "step", "object", "expected", "got", "abort", "tries")
    }
    assert facts == {
        "letter": "O",
        "step": "identity",
        "object": "1018h:04",
        "expected": 17,
        "got": 16,
        "abort": None,
        "tries": 1,
    }
    assert node["boot"]["elapsed"] > 0


# -- the watch over us ---------------------------------------------------------------------------------------------------


def eds_without(folder, *sections: str) -> None:
    """Write the generic drive's EDS without some objects."""
    text = resolve(GENERIC, folder).read_text(encoding="ascii")
    for section in sections:
        text = re.sub(rf"\[{section}(?:sub[0-9A-F]+)?\]\n(?:(?!\[).*\n)*", "", text)
    (folder / "drive.eds").write_text(text, encoding="ascii")


def test_a_drive_that_can_only_monitor_its_rpdos_does_so_and_its_watch_ends_with_the_machine(tmp_path):
    eds_without(tmp_path, "1016", "100C", "100D")
    with Line(tmp_path, eds="drive.eds") as line:
        device = line.devices["x"]
        number = None
        with line.open() as machine:
            watchdog = machine.reports[0].watchdog
            assert watchdog.kind is Watchdog.ARMED
            number = int(
                re.search(r"(14\d\d)h:05 expects the master's RPDO within 600 ms", watchdog.text)[1], 16
            )
            assert device.read(number, 5) == 600
            enable(machine["x"])
            machine["x"].move_relative(30.0).wait(20)
        assert device.read(number, 5) == 0
        time.sleep(1.0)
        assert device.drive.error_code == 0


def test_a_drive_that_can_only_watch_its_rpdos_notices_that_they_end(tmp_path):
    eds_without(tmp_path, "1016", "100C", "100D")
    with Line(tmp_path, eds="drive.eds") as line:
        machine = line.open()
        try:
            enable(machine["x"])
            assert line.stage() == ENABLED
            machine._core.scan.quit()  # the scan ends, the drive gets no RPDO any more
            until(lambda: line.stage() != ENABLED)
        finally:
            machine.close()


# -- lost nodes ----------------------------------------------------------------------------------------------------------


def simulated(line: Line) -> Machine:
    """Open the cell in virtual time, in which a busy computer causes no delay."""
    described = eds.load(resolve(GENERIC, line.file.parent))
    made = {node: device_from_eds(described, node) for node, _ in enumerate(line.names, start=1)}
    return Machine.simulated(line.file, made)


@pytest.mark.parametrize(
    ("word", "stopped"), [("group", "y"), ("cell", "yzw"), ("report", "")], ids=["group", "cell", "report"]
)
def test_the_cell_file_selects_the_axes_that_a_lost_node_stops(tmp_path, word, stopped):
    """x and y are a group, z and w another: the loss of x stops y, all axes, or no other axis."""
    groups = '[groups.xy]\naxes = ["x", "y"]\n[groups.zw]\naxes = ["z", "w"]\n'
    line = Line(tmp_path, "xyzw", more=groups)
    with_bus_line(line, f'on_lost_node = "{word}"')
    machine = simulated(line)
    try:
        plants = {
            name: machine.simulated_node(node).drive().axis.motor for node, name in enumerate("xyzw", start=1)
        }
        for axis in machine:
            axis.enable().wait(5)
        for name in "yzw":
            machine[name].move_velocity(60.0).wait(5)
        machine.simulated_node(1).device.dials.dead = True
        machine.sleep(3.0)
        assert isinstance(machine["x"].error, NodeError)
        assert {name for name in "yzw" if plants[name].velocity == 0.0} == set(stopped)
    finally:
        with suppress(DriveError):  # closing reports that x could only be stopped by a harder stop
            machine.close()


# -- lost frames ---------------------------------------------------------------------------------------------------------


def test_sixteen_nodes_boot_although_two_percent_of_the_frames_are_lost(tmp_path):
    """``tests/lossy_boot.py`` does it fifty times."""
    names = "abcdefghijklmnop"
    line = Line(tmp_path, names)
    far = f"{line.channel}-far"
    line.simulated_nodes = SimulatedNetwork(far, list(line.devices.values()))
    with LossyLine(line.channel, far, 0.02, seed=302), line:
        reports = boot(line.file)
    assert [report.error for report in reports] == [None] * 16
    assert sum(report.outcome.retries for report in reports) > 0


def test_garbage_is_collected_before_the_bus_opens_and_not_while_heartbeats_are_expected(
    tmp_path, monkeypatch
):
    """A collection over a large program's heap takes longer than a drive waits for its master."""
    order, opening = [], canlink.open_channel
    monkeypatch.setattr(gc, "collect", lambda: order.append("heap"))
    with Line(tmp_path) as line:
        monkeypatch.setattr(canlink, "open_channel", lambda *given: order.append("bus") or opening(*given))
        with line.open():
            pass
    assert order == ["heap", "bus"]


# -- events of error control ---------------------------------------------------------------------------------------------


def kinds(machine: Machine) -> list[str]:
    return [event.kind.name for event in machine.node(1).events]


def states(machine: Machine) -> list[str]:
    """Return the events without late heartbeats, which a busy computer can cause."""
    return [kind for kind in kinds(machine) if kind not in ("LOST", "BACK")]


def test_a_node_that_is_lost_and_returns_is_reported_with_the_reaction_time(tmp_path):
    with Line(tmp_path) as line, line.open() as machine:
        line.devices["x"].dials.dead = True
        until(lambda: "LOST" in kinds(machine))
        line.devices["x"].dials.dead = False
        until(lambda: "BACK" in kinds(machine))
        lost = next(event for event in machine.events if event.kind.name == "LOST")
        assert lost.node == 1
        assert lost.silent >= 0.6  # three heartbeats of 200 ms
        assert lost.reaction == pytest.approx(lost.silent - 0.6, abs=0.02)
        assert "detected within" in str(lost)


def test_a_restart_and_another_nmt_state_are_reported(tmp_path):
    with Line(tmp_path) as line, line.open() as machine:
        machine.node(1).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        until(lambda: states(machine) == ["STATE"])
        machine.node(1).command(NmtCommand.START)
        until(lambda: states(machine) == ["STATE", "OPERATIONAL"])
        with line.simulated_nodes.lock:
            line.devices["x"].nmt_command(NmtCommand.RESET_NODE)
        until(lambda: "BOOT_UP" in kinds(machine))
        event = next(event for event in machine.node(1).events if event.kind.name == "BOOT_UP")
        assert 0.0 <= event.reaction < 2.0


@pytest.mark.parametrize(("word", "stops"), [("group", True), ("report", False)])
def test_a_node_without_axes_that_is_lost_stops_the_cell_or_is_only_reported(tmp_path, word, stops):
    with Line(tmp_path, "xy") as line:
        text = line.file.read_text("utf-8")
        line.file.write_text(text[: text.index("[axes.y]")], "utf-8")  # node 2 is there without an axis
        with_bus_line(line, f'on_lost_node = "{word}"')
        with line.open() as machine:
            enable(machine["x"])
            machine["x"].move_velocity(60.0).wait(10)
            line.devices["y"].dials.dead = True
            until(lambda: [event.kind.name for event in machine.node(2).events][-1:] == ["LOST"])
            if stops:
                until(lambda: line.speed() == 0.0)
            else:
                time.sleep(0.3)  # (on a busy computer x may stop for a reason of its own)
                assert line.speed() > 20.0 or machine["x"].error is not None
            line.devices["y"].dials.dead = False


def virtual_line(folder, *lines):
    """Two axes in virtual time, the second one's node optional and absent: the cell file, and the devices."""
    line = Line(folder, "xy", more='[groups.xy]\naxes = ["x", "y"]\n')
    with_lines(line, 2, "optional = true", *lines)
    made = {node: device_from_eds(eds.load(resolve(GENERIC, folder)), node) for node in (1, 2)}
    made[2].dials.dead = True
    return line.file, made


def test_an_optional_node_may_be_absent_in_virtual_time_too(tmp_path):
    path, made = virtual_line(tmp_path)
    with Machine.simulated(path, made) as machine:
        assert [axis.name for axis in machine] == ["x"]
        enable(machine["x"])
        machine["x"].move_relative(5.0).wait(5)
        with pytest.raises(StateError, match="node 2 is optional and is not present"):
            machine["y"]


def test_an_optional_node_that_appears_later_is_picked_up_in_virtual_time(tmp_path):
    """It is asked once a second, also while the program waits for something else."""
    path, made = virtual_line(tmp_path)
    with Machine.simulated(path, made) as machine:
        machine["x"].enable().wait(5)
        machine.sleep(3.0)
        assert "y" not in machine
        made[2].dials.dead = False
        moving = machine["x"].move_relative(60.0, velocity=20.0)
        machine.sleep(0.9)
        moving.wait(10)
        assert "y" in machine
        assert machine.reports[1].ok
        assert made[2].operational
        machine["y"].enable().wait(5)
        machine.group("xy").move_direct((62.0, -2.0), velocity=20.0).wait(10)
        assert made[2].drive.axis.motor.position == pytest.approx(-200, abs=5)
        assert made[2].read(0x1016, 1) == 127 << 16 | 600
    assert made[2].read(0x1016, 1) == 0  # released like the other
    assert made[2].drive.power.stage in OFF


def test_an_optional_node_that_appears_as_another_device_is_reported_in_virtual_time(tmp_path):
    path, made = virtual_line(tmp_path, "serial = 99")
    with Machine.simulated(path, made) as machine:
        made[2].dials.dead = False
        machine.sleep(2.5)
        assert "y" not in machine
        assert machine.reports[1].outcome.letter.name == "O"
        with pytest.raises(StateError, match="optional and did not boot"):
            machine["y"]
        assert not made[2].operational


def test_an_optional_node_that_was_booted_by_a_call_is_not_booted_once_more(tmp_path):
    path, made = virtual_line(tmp_path)
    with Machine.simulated(path, made) as machine:
        with pytest.raises(BootError, match="node 2 does not answer"):
            machine.node(2).boot()
        made[2].dials.dead = False
        machine.node(2).boot()
        machine.sleep(3.0)
        machine["y"].enable().wait(5)
        machine.sleep(3.0)
        assert machine["y"].error is None
        assert machine.reports[1].ok


def test_an_optional_node_that_did_not_boot_is_booted_by_the_call_that_the_error_names(tmp_path):
    path, made = virtual_line(tmp_path, "serial = 99")
    with Machine.simulated(path, made) as machine:
        made[2].dials.dead = False
        machine.sleep(2.5)
        with pytest.raises(StateError) as caught:
            machine["y"]
        assert caught.value.remedy.endswith(
            "then boot it (axisbus boot CELL --node 2; in a program: machine.node(2).boot())"
        )
        made[2].swap(99)
        machine.sleep(1.0)
        machine.node(2).boot()
        machine["y"].enable().wait(5)


def test_an_optional_node_that_appeared_late_is_booted_again_automatically_if_it_shall_be(tmp_path):
    path, made = virtual_line(tmp_path, 'rejoin = "automatic"')
    with Machine.simulated(path, made) as machine:
        made[2].dials.dead = False
        machine.sleep(3.0)
        machine.simulated_node(2).switch_off()
        machine.sleep(2.0)
        machine.simulated_node(2).switch_on()
        machine.sleep(4.0)
        machine["y"].reset().wait(5)
        machine["y"].enable().wait(5)


# -- reports of error control, in virtual time ---------------------------------------------------------------------------


def test_a_node_that_is_lost_and_returns_is_reported_in_virtual_time(tmp_path):
    line = Line(tmp_path)
    with Machine.simulated(line.file) as machine:
        device = machine.simulated_node(1).device
        machine.sleep(1.0)
        assert machine.events == []
        died = machine["x"].snapshot.now
        device.dials.dead = True
        machine.sleep(1.0)
        device.dials.dead = False
        machine.sleep(0.2)
        assert device.nmt is NmtState.PRE_OPERATIONAL  # it has missed the master's heartbeats, too
        machine.node(1).command(NmtCommand.START)
        machine.sleep(0.2)
        machine.node(1).command(NmtCommand.RESET_NODE)
        machine.sleep(2.0)
        # Since its restart it sends no heartbeat, because it has not been configured.
        assert kinds(machine) == ["LOST", "STATE", "BACK", "OPERATIONAL", "BOOT_UP", "LOST"]
        assert machine.node(1).nmt is NmtState.PRE_OPERATIONAL
        lost = machine.events[0]
        assert 0.4 < lost.stamp - died < 0.65  # three heartbeats of 200 ms after the last one
        assert lost.silent == pytest.approx(0.6, abs=0.03)
        assert lost.reaction < 0.03
        device.dials.dead = True
        with pytest.raises(NodeTimeout, match="node 1 did not confirm the NMT command 'start'"):
            machine.node(1).command(NmtCommand.START)


def test_a_node_that_leaves_operational_just_after_the_start_is_no_suspended_program(tmp_path):
    line = Line(tmp_path)
    with Machine.simulated(line.file) as machine:
        machine.node(1).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        machine.sleep(0.3)
        error = machine["x"].error
        assert isinstance(error, NodeError)
        assert error.observed.startswith("it still reports itself")
        assert "did not run" not in error.observed


@pytest.mark.parametrize("pause", [0.3, 0.301, 0.307, 0.319])  # wherever within a cycle
def test_an_axis_is_reset_as_soon_as_its_node_has_confirmed_the_start(tmp_path, pause):
    line = Line(tmp_path)
    with Machine.simulated(line.file) as machine:
        x, node = machine["x"], machine.node(1)
        node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        assert x.state is AxisState.ERRORSTOP  # the axes have the error when the command returns
        machine.sleep(pause)
        node.command(NmtCommand.START)
        x.reset().wait(5)
        x.enable().wait(5)
        x.move_relative(2.0).wait(10)
        assert x.error is None


@pytest.mark.parametrize(("word", "stops"), [("group", True), ("report", False)])
def test_a_node_without_axes_that_is_lost_in_virtual_time(tmp_path, word, stops):
    line = Line(tmp_path, "xy")
    text = line.file.read_text("utf-8")
    line.file.write_text(text[: text.index("[axes.y]")], "utf-8")
    with_bus_line(line, f'on_lost_node = "{word}"')
    with Machine.simulated(line.file) as machine:
        machine["x"].enable().wait(5)
        machine["x"].move_velocity(60.0).wait(5)
        heard = []
        machine.node(2).on_event(heard.append)  # a further subscriber: the cell is stopped all the same
        machine.simulated_node(2).device.dials.dead = True
        machine.sleep(5.0)
        assert heard == machine.node(2).events
        assert [event.kind.name for event in machine.node(2).events] == ["LOST"]
        speed = abs(machine.simulated_node(1).drive().axis.motor.velocity)
        assert (speed == 0.0) == stops


def test_a_fault_and_its_reset_are_an_incident_in_virtual_time(tmp_path):
    line = Line(tmp_path)
    with Machine.simulated(line.file) as machine:
        node = machine.node(1)
        machine["x"].enable().wait(5)
        assert (node.incidents, list(node.emcy)) == ((), [])
        machine.simulated_node(1).fault(0x2310, maker_bits=0x1234)
        machine.sleep(0.05)
        machine.simulated_node(1).device.errors.report(0, 0x4310)
        machine.sleep(0.5)
        (incident,) = node.incidents
        assert (incident.codes, incident.outcome.name) == ((0x2310, 0x4310), "UNRESOLVED")
        machine["x"].reset().wait(5)
        machine.sleep(0.1)
        (incident,) = node.incidents
        assert incident.outcome.name == "RECOVERED"
        assert 0.5 <= incident.lasted <= 1.0
        assert [emcy.code for emcy in node.emcy] == [0x2310, 0x4310, 0x0000]
        assert node.format_incident(incident)[0].startswith("incident 1: recovered after ")


def booted_again_after(line: Line, machine: Machine, silence: str = "its heartbeat has stopped") -> None:
    """Apply the remedy of a reset for a lost node: boot it while the machine runs, and reset its axis."""
    device = line.devices["x"]
    device.dials.dead = True
    until(lambda: machine["x"].error is not None)
    for _ in range(2):
        with pytest.raises(StateError, match="node 1 is lost, so there is no node to reset") as caught:
            machine["x"].reset().wait(5)
    assert silence in caught.value.observed
    assert "until axisbus scan shows it; then boot it (axisbus boot CELL --node 1" in caught.value.remedy
    device.dials.dead = False
    until(lambda: machine.node(1).nmt is not NmtState.UNKNOWN)
    time.sleep(0.5)
    assert machine.node(1).boot().ok
    machine["x"].reset().wait(10)
    enable(machine["x"])
    machine["x"].move_relative(2.0).wait(10)
    machine.close()


def test_the_remedy_of_a_reset_of_a_lost_node_works(tmp_path):
    with Line(tmp_path) as line:
        booted_again_after(line, line.open())


def test_the_remedy_of_a_reset_of_a_lost_node_works_with_node_guarding(tmp_path):
    with guarded_line(tmp_path) as line:
        booted_again_after(line, line.open(), "it does not answer node guarding")


def test_a_lost_node_that_kept_its_configuration_works_again_after_the_remedy_of_enable_and_reset(tmp_path):
    """Both name the same remedy, and it is true: start the node, then reset the axis."""
    with Line(tmp_path) as line, line.open() as machine:
        machine.node(1).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        until(lambda: machine["x"].error is not None)
        with pytest.raises(NodeStateError, match="a reset alone is not enough") as caught:
            machine["x"].reset().wait(5)
        with pytest.raises(StateError, match="is in ErrorStop") as of_enable:
            machine["x"].enable().wait(5)
        assert of_enable.value.remedy == caught.value.remedy
        assert "start it (axisbus nmt start 1 --cell CELL" in caught.value.remedy
        assert "start it (axisbus nmt start 1 --cell CELL" in machine["x"].error.remedy
        assert caught.value.page == "node-lost"
        machine.node(1).command(NmtCommand.START)
        machine["x"].reset().wait(5)
        enable(machine["x"])
        machine["x"].move_relative(2.0).wait(10)


def test_the_remedy_for_a_node_that_restarted_is_to_boot_it_even_if_the_node_was_started(tmp_path):
    with Line(tmp_path) as line, line.open() as machine:
        with line.simulated_nodes.lock:
            line.devices["x"].nmt_command(NmtCommand.RESET_NODE)
        until(lambda: machine["x"].error is not None)
        for started in (False, True):
            if started:
                machine.node(1).command(NmtCommand.START)
            with pytest.raises(NodeStateError, match=r"has restarted|cannot be reset into service") as caught:
                machine["x"].reset().wait(5)
            assert caught.value.remedy.startswith("boot it (axisbus boot CELL --node 1")
        machine.node(1).boot()
        machine["x"].reset().wait(5)
        enable(machine["x"])


def test_each_reset_of_a_silent_node_reports_its_silence(tmp_path):
    with Line(tmp_path) as line, line.open() as machine:
        line.devices["x"].dials.dead = True
        for _ in range(2):
            with pytest.raises(NodeTimeout, match="node 1 is silent: it sent no boot-up message within"):
                machine.node(1).command(NmtCommand.RESET_NODE, 0.3)
        line.devices["x"].dials.dead = False


# -- node guarding -------------------------------------------------------------------------------------------------------


def guarded_line(folder) -> Line:
    """A drive that has guarding and neither sends nor consumes heartbeats."""
    eds_without(folder, "1016", "1017", "100C", "100D")
    with (folder / "drive.eds").open("a", encoding="ascii") as file:
        for index, name, kind in (("100C", "Guard time", 6), ("100D", "Life time factor", 5)):
            file.write(
                f"\n[{index}]\nParameterName={name}\nObjectType=7\nDataType={kind}\nAccessType=rw\nDefaultValue=0\n"
            )
    return Line(folder, eds="drive.eds")


def test_letter_f_a_drive_that_does_not_answer_node_guarding(tmp_path):
    with guarded_line(tmp_path) as line:
        line.simulated_nodes.nodes[0].slave._on_remote = lambda _: None
        error = refused(line)
    assert (error.letter, error.step) == ("F", "error control")
    assert "remote frames" in error.remedy


def test_a_guarded_drive_is_lost_when_its_answers_stay_away(tmp_path):
    with guarded_line(tmp_path) as line, line.open() as machine:
        assert machine.reports[0].outcome.control.name == "GUARDING"
        time.sleep(0.5)
        assert machine.node(1).events == []
        line.devices["x"].dials.dead = True
        until(lambda: kinds(machine) == ["UNANSWERED"])
        assert machine.node(1).events[0].silent < 1.0  # three periods of 0.1 s, on a busy computer
        assert "does not answer node guarding" in str(machine["x"].error)
        line.devices["x"].dials.dead = False


def test_a_drive_that_restarts_while_it_is_configured_is_not_started_with_half_of_it(tmp_path):
    with Line(tmp_path) as line:
        device = line.devices["x"]
        restart = []

        def blip(value: int) -> None:
            if not restart:
                restart.append(value)
                device.nmt_command(NmtCommand.RESET_NODE)

        device.dictionary.on_write(0x1016 << 8 | 1, blip)
        error = refused(line)
        assert device.nmt is not NmtState.OPERATIONAL
    assert "node 1, step restart: node 1 restarted while it was being configured" in str(error)
