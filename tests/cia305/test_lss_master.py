"""Requests of the LSS master to a slave that it can name, against a slave typed from CiA 305, in virtual time."""

from __future__ import annotations

import pytest

from axisbus.cia305 import master
from axisbus.cia305.dialogue import AdaptiveLssTimeout
from axisbus.cia305.master import Inquired, NodeIdSet
from axisbus.cia305.services import LssAddress
from axisbus.errors import ArgumentError, LssError, LssRefused, LssTimeout
from kit.lss_line import HandSlave, Line

ADDRESS = LssAddress(0xC0B00, 8, 0x10002, 4711)


def slave(serial: int = 4711, node_id: int = 255) -> HandSlave:
    return HandSlave(0xC0B00, 8, 0x10002, serial, node_id)


def other(serial: int) -> LssAddress:
    return LssAddress(0xC0B00, 8, 0x10002, serial)


def test_the_dialogue_of_giving_a_node_id() -> None:
    one = slave()
    line = Line(one)
    assert line.run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=True)) == NodeIdSet(
        ADDRESS, 255, 5, True
    )
    assert [frame.hex(" ", 4) for frame in line.sent] == [
        "04000000 00000000",
        "04000000 00000000",
        "40000b0c 00000000",
        "41080000 00000000",
        "42020001 00000000",
        "43671200 00000000",
        "5d000000 00000000",
        "5e000000 00000000",
        "11050000 00000000",
        "17000000 00000000",
        "04000000 00000000",
        "04000000 00000000",
    ]
    assert (one.active, one.stored, one.booted_as, one.state) == (5, [5], [5], "waiting")


def test_only_the_slave_that_is_named_is_changed() -> None:
    first, second = slave(1), slave(2)
    Line(first, second).run(master.set_node_id(AdaptiveLssTimeout(), other(2), 9, store=False))
    assert (first.active, second.active, second.stored) == (255, 9, [])


def test_a_configured_slave_keeps_its_node_id_until_it_is_reset() -> None:
    one = slave(node_id=3)
    done = Line(one).run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=False))
    assert (done.old, done.at_once, one.active, one.pending) == (3, False, 3, 5)


@pytest.mark.parametrize("lost", range(30))
def test_any_frame_of_giving_a_node_id_may_be_lost(lost: int) -> None:
    one = slave()
    done = Line(one, lost=lambda number: number == lost).run(
        master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=True)
    )
    assert (done.node_id, one.active, one.stored[-1]) == (5, 5, 5)


def test_inquiring_by_name_and_as_the_only_one() -> None:
    assert Line(slave(node_id=3)).run(master.inquire(AdaptiveLssTimeout(), ADDRESS)) == Inquired(ADDRESS, 3)
    told = Line(slave()).run(master.inquire(AdaptiveLssTimeout(), None))
    assert (told.address, told.node_id, told.configured) == (ADDRESS, 255, False)


def test_an_older_slave_that_does_not_report_its_node_id() -> None:
    one = slave(node_id=3)
    one.deaf_for = {0x5E, 0x5D}
    assert Line(one).run(master.inquire(AdaptiveLssTimeout(), ADDRESS)) == Inquired(ADDRESS, None)


@pytest.mark.parametrize("second", [4711, 4712])
def test_the_only_slave_must_be_the_only_one(second: int) -> None:
    line = Line(slave(), slave(second))
    with pytest.raises(LssError, match="several LSS slaves answered inquire vendor-ID") as caught:
        line.run(master.set_node_id(AdaptiveLssTimeout(), None, 5, store=False))
    assert "identity" in caught.value.remedy
    assert all(one.pending == 255 for one in line.slaves)


def test_the_only_slave_must_be_the_only_one_to_be_stored_too() -> None:
    line = Line(slave(1), slave(2))
    with pytest.raises(LssError, match="several"):
        line.run(master.store(AdaptiveLssTimeout(), None))
    assert [one.stored for one in line.slaves] == [[], []]


def test_two_slaves_with_one_identity_are_refused_before_anything_is_changed() -> None:
    line = Line(slave(), slave())
    with pytest.raises(LssError, match="2 LSS slaves have the same identity 0xC0B00 0x8 0x10002 0x1267"):
        line.run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=True))
    assert all(one.pending == 255 and not one.stored for one in line.slaves)


def test_no_slave_with_that_identity() -> None:
    with pytest.raises(LssTimeout, match="no LSS slave has the identity 0xC0B00 0x8 0x10002 0x1") as caught:
        Line(slave()).run(master.inquire(AdaptiveLssTimeout(), other(1)))
    assert isinstance(caught.value, TimeoutError)
    assert "axisbus lss find" in caught.value.remedy


def test_a_slave_that_answers_with_another_serial_number_is_not_touched() -> None:
    one = slave()
    one.errors[0x5D] = (0x99, 0x99)
    with pytest.raises(LssError, match="an LSS slave other than") as caught:
        Line(one).run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=False))
    assert "0x9999" in caught.value.observed
    assert one.pending == 255


@pytest.mark.parametrize(
    ("command", "code", "specific", "words"),
    [
        (0x11, 1, 0, "refused configure node-ID: the node-ID is out of range"),
        (0x17, 1, 0, "refused store configuration: the slave cannot store its configuration"),
        (0x17, 2, 0, "could not write to its memory"),
        (0x17, 255, 7, "manufacturer-specific error 7"),
    ],
)
def test_refusals_name_service_slave_and_code(command: int, code: int, specific: int, words: str) -> None:
    one = slave()
    one.errors[command] = (code, specific)
    with pytest.raises(LssRefused, match=words) as caught:
        Line(one).run(master.set_node_id(AdaptiveLssTimeout(), ADDRESS, 5, store=True))
    error = caught.value
    assert (error.code, error.specific) == (code, specific)
    assert str(ADDRESS) in error.slave
    assert error.remedy


def test_a_service_that_the_slave_does_not_have() -> None:
    one = slave()
    one.deaf_for = {0x17}
    line = Line(one)
    with pytest.raises(LssTimeout, match="did not answer store configuration"):
        line.run(master.store(AdaptiveLssTimeout(), ADDRESS))
    assert line.now < 20.0


def test_a_bit_rate_is_reported_slave_by_slave_and_activated_together() -> None:
    slaves = [slave(serial) for serial in (1, 2, 3)]
    line = Line(*slaves)
    named = [other(1), other(3)]
    line.run(master.set_bit_rate(AdaptiveLssTimeout(), named, 500_000, store=True))
    assert [one.bit_timing for one in slaves] == [(0, 2), None, (0, 2)]
    assert [len(one.stored) for one in slaves] == [1, 0, 1]
    line.run(master.activate(AdaptiveLssTimeout(), named, 0.25))
    assert [one.activated for one in slaves] == [250, None, 250]


def test_every_slave_at_once() -> None:
    slaves = [slave(serial, node_id=serial) for serial in (1, 2)]
    line = Line(*slaves)
    line.run(master.set_bit_rate(AdaptiveLssTimeout(), None, 125_000, store=False))
    line.run(master.activate(AdaptiveLssTimeout(), None, 1.0))
    assert [(one.bit_timing, one.activated) for one in slaves] == [((0, 4), 1000)] * 2


def test_nothing_is_activated_if_a_named_slave_is_silent() -> None:
    there, gone = slave(1), slave(2)
    gone.silent = True
    with pytest.raises(LssTimeout, match="0x2"):
        Line(there, gone).run(master.activate(AdaptiveLssTimeout(), [other(1), other(2)], 0.5))
    assert there.activated is None


@pytest.mark.parametrize("lost", range(12))  # 12 is the activation itself, which all hear or none
def test_gathering_for_an_activation_survives_a_lost_frame(lost: int) -> None:
    slaves = [slave(1), slave(2)]
    line = Line(*slaves, lost=lambda number: number == lost)
    line.run(master.activate(AdaptiveLssTimeout(), [other(1), other(2)], 0.5))
    assert [one.activated for one in slaves] == [500, 500]


def test_a_bit_rate_that_one_refuses_is_reported_with_its_name() -> None:
    first, second = slave(1), slave(2)
    second.errors[0x13] = (1, 0)
    with pytest.raises(LssRefused, match="0x2 refused configure bit timing: the slave does not support"):
        Line(first, second).run(
            master.set_bit_rate(AdaptiveLssTimeout(), [other(1), other(2)], 500_000, store=False)
        )


@pytest.mark.parametrize("delay", [0.0, 0.009, 65.536, float("nan")])
def test_a_delay_that_cannot_be_sent_is_refused(delay: float) -> None:
    one = slave()
    with pytest.raises(ArgumentError, match="switch delay"):
        Line(one).run(master.activate(AdaptiveLssTimeout(), [ADDRESS], delay))
    assert one.activated is None


def test_an_lss_identification_sends_ranges_and_changes_nothing() -> None:
    one = slave(node_id=3)
    line = Line(one)
    found = line.run(
        master.identify(
            AdaptiveLssTimeout(), LssAddress(0xC0B00, 8, 0, 4700), LssAddress(0xC0B00, 8, 0xFFFFFFFF, 4711)
        )
    )
    missed = line.run(
        master.identify(
            AdaptiveLssTimeout(), LssAddress(0xC0B00, 8, 0, 4712), LssAddress(0xC0B00, 8, 0xFFFFFFFF, 9999)
        )
    )
    assert (found, missed, one.state) == (True, False, "waiting")
    with pytest.raises(ArgumentError, match="one vendor-ID"):
        line.run(master.identify(AdaptiveLssTimeout(), LssAddress(1, 8, 0, 0), LssAddress(2, 8, 0, 0)))


def test_any_unconfigured_reports_whether_a_slave_without_a_node_id_answers() -> None:
    assert Line(slave(1, node_id=3), slave(2)).run(master.any_unconfigured(AdaptiveLssTimeout()))
    assert not Line(slave(1, node_id=3)).run(master.any_unconfigured(AdaptiveLssTimeout()))
