"""The events of a machine, collected once for all bridges."""

from __future__ import annotations

import pytest

from axisbus.bus.link.controller import CanErrorState, ControllerEvent
from axisbus.gateway.machine_events import MachineEventKind, MachineEventSource
from axisbus.gateway.opcua import event_mapping as opcua
from axisbus.gateway.zenoh import bridge as zenoh
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import Status
from axisbus.session import CommandSeen
from axisbus.wording import with_subject


def now(machine):
    return machine["x"].snapshot.now


def kinds(found):
    return [one.kind for one in found]


def faulty(machine, code=0x8611):
    machine["x"].enable().wait(5)
    machine.simulated_node(1).fault(code)
    machine.sleep(1.0)


def test_a_fault_is_reported_once_and_its_incident_at_begin_when_settled_and_at_its_end(machine):
    happenings = MachineEventSource()
    faulty(machine)
    found = {one.kind: one for one in happenings.poll(machine, now(machine))}
    assert set(found) == {
        MachineEventKind.FAULT,
        MachineEventKind.INCIDENT,
        MachineEventKind.SETTLED,
        MachineEventKind.EMCY,
    }
    assert {(one.about, one.axes) for one in found.values()} == {("node 1", ("x",)), ("x", ("x",))}
    assert found[MachineEventKind.EMCY].text.startswith("EMCY 0x8611")
    assert "error register" in found[MachineEventKind.EMCY].text
    assert found[MachineEventKind.SETTLED].cause
    assert found[MachineEventKind.FAULT].remedy
    assert happenings.poll(machine, now(machine)) == []
    machine["x"].reset().wait(5)
    machine.sleep(0.1)
    found = happenings.poll(machine, now(machine))
    assert set(kinds(found)) == {MachineEventKind.EMCY, MachineEventKind.OVER, MachineEventKind.WELL}
    assert {one.severity for one in found} == {"info"}
    assert happenings.poll(machine, now(machine)) == []


def test_events_are_in_the_order_of_time(machine):
    faulty(machine)
    machine.simulated_node(2).device.dials.dead = True
    machine.sleep(1.0)
    stamps = [one.stamp for one in MachineEventSource(commands=True).poll(machine, now(machine))]
    assert len(stamps) > 5
    assert stamps == sorted(stamps)


def test_an_incident_is_settled_only_after_its_messages_are_received(machine):
    happenings = MachineEventSource()
    machine["x"].enable().wait(5)
    machine.simulated_node(1).fault(0x8611)
    machine.sleep(0.05)
    assert MachineEventKind.SETTLED not in kinds(happenings.poll(machine, now(machine)))
    machine.sleep(0.5)
    assert kinds(happenings.poll(machine, now(machine))) == [MachineEventKind.SETTLED]


def test_the_same_fault_after_a_reset_is_reported_again(machine):
    happenings = MachineEventSource()
    for _ in range(2):
        faulty(machine)
        assert kinds(happenings.poll(machine, now(machine))).count(MachineEventKind.FAULT) == 1
        machine["x"].reset().wait(5)
        machine.sleep(0.1)
        happenings.poll(machine, now(machine))


def test_earlier_events_are_reported_only_if_they_still_apply(machine):
    faulty(machine)
    machine.sleep(1.0)
    assert kinds(MachineEventSource(now(machine), commands=True).poll(machine, now(machine))) == [
        MachineEventKind.FAULT
    ]


def test_a_late_event_with_an_earlier_time_is_reported_too(machine, monkeypatch):
    happenings = MachineEventSource()
    events = [ControllerEvent(now(machine) - 1.0, "can0", CanErrorState.PASSIVE)]
    monkeypatch.setattr(Machine, "bus_events", property(lambda _: events))
    assert len(happenings.poll(machine, now(machine))) == 1
    events.insert(0, ControllerEvent(now(machine) - 2.0, "can0", CanErrorState.WARNING))
    assert [one.severity for one in happenings.poll(machine, now(machine))] == ["warning"]


def test_a_lost_node_is_reported_with_its_axes(machine):
    machine.simulated_node(2).device.dials.dead = True
    machine.sleep(1.0)
    (lost,) = (
        one for one in MachineEventSource().poll(machine, now(machine)) if one.kind is MachineEventKind.NODE
    )
    assert (lost.severity, lost.about, lost.axes) == ("error", "node 2", ("y",))


@pytest.mark.parametrize(
    ("condition", "severity"),
    [(CanErrorState.OFF, "error"), (CanErrorState.PASSIVE, "warning"), (CanErrorState.ACTIVE, "info")],
)
def test_the_bus_has_a_remedy_unless_it_is_well_again(machine, monkeypatch, condition, severity):
    events = [ControllerEvent(now(machine), "can0", condition)]
    monkeypatch.setattr(Machine, "bus_events", property(lambda _: events))
    (one,) = MachineEventSource().poll(machine, now(machine))
    assert (one.kind, one.severity, bool(one.remedy)) == (MachineEventKind.BUS, severity, severity != "info")


def test_jogs_and_halts_of_the_core_are_reported_only_if_they_fail(machine, monkeypatch):
    names = ("x.jog(5.0) by process 7", "x.halt", "x.halt() by process 7 (a.py), which began at 10:00:00")
    seen = [
        CommandSeen(1.0, name, status, 2.0, "no" if status is Status.ERROR else "")
        for name in names
        for status in (Status.DONE, Status.ERROR)
    ]
    found = []
    for one in seen:
        with monkeypatch.context() as patched:
            patched.setattr(type(machine.session), "commands", property(lambda _, one=one: [one]))
            found.append(MachineEventSource(commands=True).poll(machine, now(machine)))
    assert [len(each) for each in found] == [0, 1, 0, 1, 2, 2]
    assert {one.about for each in found for one in each} == {"x"}
    assert [one.cause for one in found[1]] == [("no",)]


def test_without_commands_the_core_is_not_queried_for_them(machine, monkeypatch):
    monkeypatch.setattr(type(machine.session), "commands", property(lambda _: pytest.fail("asked")))
    machine["x"].enable().wait(5)
    assert MachineEventSource().poll(machine, now(machine)) == []


def test_each_kind_of_event_is_reported_by_a_bridge_and_commands_by_zenoh_only():
    by_opcua = {kind for kind, _ in opcua.SEVERITIES}
    assert by_opcua | set(zenoh.KINDS) == set(MachineEventKind)
    assert set(MachineEventKind) - by_opcua == {
        MachineEventKind.COMMAND,
        MachineEventKind.INCIDENT,
        MachineEventKind.OVER,
        MachineEventKind.WELL,
    }
    assert set(MachineEventKind) - set(zenoh.KINDS) == {MachineEventKind.SETTLED}


@pytest.mark.parametrize(
    ("about", "text", "whole"),
    [
        ("x", "it stands", "x: it stands"),
        ("x", "x.enable(): done", "x.enable(): done"),
        ("x", "x_2 is lost", "x: x_2 is lost"),
        ("node 1", "node 12 is lost", "node 1: node 12 is lost"),
        ("node 1", "node 1 is lost", "node 1 is lost"),
        ("x", "", "x: "),
        ("", "it stands", "it stands"),
    ],
)
def test_an_event_text_has_its_subject_in_front_unless_it_begins_with_it(about, text, whole):
    assert with_subject(about, text) == whole
