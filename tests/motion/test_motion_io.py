"""Inputs and outputs of one node, cycle by cycle: sent values, end of a command, and known values."""

from __future__ import annotations

import math

import pytest

from axisbus.cia401.port import IoInputs, SignalValidity
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.port import Sample
from axisbus.errors import ArgumentError
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.io import NodeIo

LAMP = IoPoint("lamp", 5, 0x6200, 1, 8, False, output=True, bit=3)
CLAMP = IoPoint("clamp", 5, 0x6200, 1, 8, False, output=True, bit=7, safe=1)
VALVE = IoPoint("valve", 5, 0x6411, 1, 16, True, output=True, scale=None)
PART = IoPoint("part", 5, 0x6000, 1, 8, False, output=False, bit=0)


class Port:
    """A port with its outputs as found, and their values without a master."""

    inputs = ((0x6000, 1),)
    outputs = ((0x6200, 1), (0x6411, 1))
    max_age = (0.1,)
    found = (0x15, 7)
    alone = (0x00, 7)

    def read(self, now):
        raise AssertionError

    def write(self, words):
        raise AssertionError


def node() -> NodeIo:
    return NodeIo(5, (LAMP, CLAMP, VALVE, PART), Port())


def there(value: int = 1, stamp: float = 0.0) -> IoInputs:
    return IoInputs(SignalValidity.YES, (Sample(value, stamp),))


def test_nothing_is_sent_before_an_output_is_set():
    assert node().step(0.0, there()) == (None, None)


def test_the_frame_of_an_output_keeps_its_other_bits():
    one = node()
    one.step(0.0, there())
    one.set({"lamp": 1}, CommandStatus("lamp"))
    assert one.step(0.01, there()) == (0x1D, None)
    one.set({"valve": -3}, CommandStatus("valve"))
    assert one.step(0.02, there()) == (0x1D, -3)


@pytest.mark.parametrize(
    ("heard", "done_at"),
    [
        (
            (math.inf, math.inf, math.inf),
            0.02,
        ),  # of a node without a required sign of life: once it has been sent
        ((0.01, 0.02, 0.03), 0.02),
        ((0.01, 0.015, 0.019), None),  # all of this was in transit before the output could act
        ((0.01, 0.01, 0.025), 0.03),
    ],
)
def test_a_command_is_done_once_the_node_reported_after_the_command_was_sent(heard, done_at):
    one, ticket, done = node(), CommandStatus("lamp"), []
    one.step(0.0, there())
    one.set({"lamp": 1}, ticket)
    assert not one.is_idle
    for now, sign in zip((0.01, 0.02, 0.03), heard, strict=True):
        one.step(now, there()._replace(heard=sign))
        done += [now] if ticket.status is Status.DONE else []
    assert done[:1] == ([] if done_at is None else [done_at])
    assert one.is_idle


def test_a_command_that_was_sent_fails_as_soon_as_the_loss_is_known():
    one, ticket = node(), CommandStatus("lamp")
    one.step(0.0, there())
    one.set({"lamp": 1}, ticket)
    for now in (0.01, 0.02, 0.03, 0.04):
        one.step(now, there()._replace(heard=0.01))
    assert ticket.busy
    one.step(0.05, IoInputs(SignalValidity.SILENT, (None,)))
    assert ticket.status is Status.ERROR
    assert "not confirmed" in ticket.error.message


@pytest.mark.parametrize(
    ("known", "sent"),
    [
        (SignalValidity.SILENT, (0x80, None)),
        (SignalValidity.NOT_OPERATIONAL, (0x80, None)),
        (SignalValidity.RESTARTED, (None, None)),
        (SignalValidity.BUS_OFF, (None, None)),
    ],
)
def test_a_loss_ends_commands_and_makes_safe(known, sent):
    one, ticket = node(), CommandStatus("lamp")
    one.step(0.0, there())
    one.set({"lamp": 1}, ticket)
    one.step(0.01, there())
    assert one.step(0.02, IoInputs(known, (None,))) == sent
    assert ticket.status is Status.ERROR
    assert one.step(0.03, there()) == (0x80, None)
    assert one.refusal("lamp", "lamp = True") is None


def test_an_input_from_before_a_loss_is_unknown_after_it():
    one = node()
    for now, inputs, known in [
        (0.00, IoInputs(SignalValidity.YES, (None,)), SignalValidity.NOT_YET),
        (0.01, there(stamp=0.005), SignalValidity.YES),
        (0.20, there(stamp=0.005), SignalValidity.OLD),
        (0.21, there(stamp=0.205), SignalValidity.YES),
        (0.22, IoInputs(SignalValidity.SILENT, (Sample(1, 0.205),)), SignalValidity.SILENT),
        (0.23, there(stamp=0.205), SignalValidity.NOT_YET),
        (0.24, there(stamp=0.235), SignalValidity.YES),
    ]:
        one.step(now, inputs)
        reading = one.readings(now, inputs)["part"]
        assert reading.known is known, now
        assert (reading.value is not None) is (known is SignalValidity.YES)


def test_the_sign_bit_of_a_word_can_be_set():
    sign = IoPoint("sign", 5, 0x2000, 1, 16, True, output=True, bit=15)
    assert sign.into(0, 1) == -0x8000
    assert sign.into(-1, 0) == 0x7FFF
    assert sign.of(-0x8000) == 1


@pytest.mark.parametrize("value", [math.nan, math.inf, True, 1.5, 1 << 15, -(1 << 15) - 1, "1", None])
def test_a_number_that_its_object_cannot_hold_is_refused(value):
    with pytest.raises(ArgumentError):
        VALVE.raw(value)
