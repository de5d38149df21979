"""Planned faults: the begin and end of each, and its effect on a drive, in virtual time."""

from __future__ import annotations

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.eds import load
from axisbus.sim.device import Device
from axisbus.sim.fault_plan import FaultChange, FaultSetting, FaultTimer, FaultTiming, Plan, PlannedFault
from kit.pages import ROOT

STEP = 0.01
EDS = load(ROOT / "eds" / "generic-cia402.eds")


def played(moment: FaultTiming, seconds: float, values=lambda _: None) -> list[tuple[str, float]]:
    cue, told = FaultTimer(moment), []
    for number in range(round(seconds / STEP)):
        now = number * STEP
        turn = cue.step(now, values(now))
        if turn is not FaultChange.NOTHING:
            told.append((turn.name, pytest.approx(now, abs=1.5 * STEP)))
    return told


def test_a_fault_begins_at_its_time_and_lasts():
    assert played(FaultTiming(begin=0.0), 2.0) == [("BEGINS", 0.0)]
    assert played(FaultTiming(begin=0.5, duration=0.2), 2.0) == [("BEGINS", 0.5), ("ENDS", 0.7)]
    assert played(FaultTiming(begin=3.0), 2.0) == []


def test_a_fault_is_repeated_in_its_period():
    assert played(FaultTiming(begin=0.1, every=0.5, duration=0.1), 1.3) == [
        ("BEGINS", 0.1), ("ENDS", 0.2), ("BEGINS", 0.6), ("ENDS", 0.7), ("BEGINS", 1.1), ("ENDS", 1.2),
    ]  # fmt: skip


def test_missed_occurrences_are_not_repeated():
    cue = FaultTimer(FaultTiming(begin=0.1, every=0.1))
    assert cue.step(0.1, None) is FaultChange.BEGINS
    assert cue.step(5.0, None) is FaultChange.BEGINS
    assert cue.step(5.01, None) is FaultChange.BEGINS  # one that is due now
    assert cue.step(5.05, None) is FaultChange.NOTHING


def beats(now: float) -> bool:
    """True from 0.3 to 0.5 s of each second."""
    return 0.3 <= round(now % 1.0, 6) < 0.5


def test_a_condition_that_becomes_true_lets_a_fault_begin_once():
    when = FaultTiming(when=bool)
    assert played(when, 3.0, beats) == [("BEGINS", 0.3)]
    assert played(FaultTiming(when=bool, after=0.4, duration=0.1), 3.0, beats) == [
        ("BEGINS", 0.7),
        ("ENDS", 0.8),
    ]
    assert played(when, 1.0, lambda _: True) == []
    assert played(when, 1.0, lambda now: now < 0.2 or now > 0.6) == [("BEGINS", 0.6)]


def test_a_condition_starts_a_fault_again_after_its_period():
    assert [turn for turn, _ in played(FaultTiming(when=bool, every=0.5), 3.0, beats)] == ["BEGINS"] * 3
    assert played(FaultTiming(when=bool, every=1.5), 3.0, beats) == [("BEGINS", 0.3), ("BEGINS", 2.3)]


def device() -> Device:
    made = Device(EDS, 5)
    made.power_on()
    return made


def planned(**what) -> PlannedFault:
    return PlannedFault("it", "said", FaultTiming(begin=0.1, duration=0.2), 5, **what)


def test_fault_settings_are_set_and_restored():
    one = device()
    one.dials.reboot_time = 0.3
    one.dials.sdo_aborts = {(0x6040, 0): 1}
    dials = (
        FaultSetting("blocked", True, True),
        FaultSetting("reboot_time", 9.0, False),
        FaultSetting("sdo_aborts", {(0x6060, 0): 2}, False),
        FaultSetting("loss", 0.5, False, "lss"),
    )
    plan = Plan([planned(settings=dials)], {5: one})
    assert plan.step(0.0, None) == []
    assert not one.drive.dials.blocked
    assert plan.step(0.1, None) == ["it: said"]
    assert (one.drive.dials.blocked, one.dials.reboot_time, one.dials.lss.loss) == (True, 9.0, 0.5)
    assert one.dials.sdo_aborts == {(0x6060, 0): 2}
    one.dials.sdo_aborts[0x6061, 0] = 3
    assert plan.step(0.2, None) == []
    assert plan.step(0.31, None) == ["it is over"]
    assert (one.drive.dials.blocked, one.dials.reboot_time, one.dials.lss.loss) == (False, 0.3, 0.0)
    assert one.dials.sdo_aborts == {(0x6040, 0): 1}
    assert dials[2].value == {(0x6060, 0): 2}


def test_a_drive_falls_into_fault_and_a_node_restarts():
    one = device()
    plan = Plan([planned(code=0x2310, maker_bits=0x10)], {5: one})
    plan.step(0.1, None)
    one.step(0.02)
    assert (one.drive.error_code, one.drive.maker_bits) == (0x2310, 0x10)
    plan = Plan([planned(restart=True)], {5: one})
    plan.step(0.1, None)
    assert one.nmt is NmtState.INITIALISING
    one.step(0.1)
    assert (one.nmt, one.drive.error_code) == (NmtState.PRE_OPERATIONAL, 0)


# -- another specimen in the place of a drive ----------------------------------------------------------------------------------


def identity(device: Device) -> tuple[int, int, int]:
    return tuple(device.read(0x1018, subindex) for subindex in (2, 3, 4))


def passed(device: Device, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        device.step(STEP)


def test_another_specimen_has_its_own_identity_and_factory_parameters():
    device = Device(EDS, 5, serial=4711)
    device.power_on()
    device.write(0x6081, 0, 777)
    device.write(0x1010, 1, 0x6576_6173)
    Plan([PlannedFault("new", "", FaultTiming(begin=0.0), 5, swap={"serial": 4712})], {5: device}).step(
        0.0, None
    )
    passed(device, 0.5)
    assert (device.node_id, device.nmt) == (5, NmtState.PRE_OPERATIONAL)
    assert identity(device) == (0, 0, 4712)
    assert device.read(0x6081) == EDS.get(0x6081).initial(5)
    device.swap(4713, revision=2, software_version="2.0", product_code=9)
    passed(device, 0.5)
    assert identity(device) == (9, 2, 4713)
    assert device.upload(0x100A, 0).rstrip(b"\0") == b"2.0"
    device.swap(4714)
    passed(device, 0.5)
    assert identity(device) == (0, 0, 4714)
    assert device.upload(0x100A, 0).rstrip(b"\0") == b""


def test_a_specimen_without_a_node_id_answers_lss_only_and_keeps_its_identity_under_the_new_one():
    device = Device(EDS, 5)
    device.power_on()
    device.dials.unpowered = True
    passed(device, 0.1)
    device.swap(4712, 255, 2)
    device.dials.unpowered = False
    passed(device, 0.5)
    assert device.node_id == 255
    assert device.nmt is NmtState.INITIALISING
    assert device.accepts_lss
    for request in (b"\x04\x01", b"\x11\x05", b"\x17", b"\x04\x00"):
        device.lss_request(request.ljust(8, b"\0"), device.time)
    passed(device, 0.5)
    assert (device.node_id, device.nmt) == (5, NmtState.PRE_OPERATIONAL)
    assert identity(device) == (0, 2, 4712)
    assert device.read(0x1400, 1) == 0x205  # the defaults of its new node-ID
