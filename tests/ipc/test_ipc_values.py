"""Values that cross between processes arrive as they were, and nothing else does."""

from __future__ import annotations

import dataclasses
import typing
from contextlib import suppress
from datetime import UTC, datetime
from enum import Enum
from fractions import Fraction
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus import errors
from axisbus.ipc import messages as m
from axisbus.ipc.errors import RemoteTraceback
from axisbus.ipc.values import Codec, NotSendable
from axisbus.motion.command_status import Status
from axisbus.motion.commands import (
    ControllerCommand,
    ControllerOutput,
    CyclicTorque,
    CyclicVelocity,
    EnableCommand,
    FollowTrajectory,
    Move,
    MoveVelocity,
    TargetReference,
)
from axisbus.motion.group.commands import ForEach, MovePath
from axisbus.motion.group.path import build_path
from axisbus.motion.group.path_builder import arc_through, polyline
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import AxisLimits, AxisParameters, Units, no_explanation
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, OnUnderrun, StreamSegment
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.session import CommandEvent
from axisbus.units import Scale

PIECES, STOPS = polyline([(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 0.0)], 1.0)
SPANS = (StreamSegment(0.01, 50.0, ((0.0, 1.0, 0.5, 0.0, 0.0, 0.0), (1.0, -1.0, 0.0, 0.0, 2.0, 0.0))),)
WAY = build_path(
    [*PIECES, arc_through((0.0, 0.0), (1.0, 1.0), (2.0, 0.0))],
    [AxisLimits(velocity=9.0), AxisLimits()],
    50.0,
    STOPS,
)
PROFILE = MoveProfile(1000, 2000, 2000, 10.0, 20.0, None, 20.0, 20.0)
PLAIN = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text()
    | st.binary()
)
VALUES = st.recursive(
    PLAIN,
    lambda inner: st.tuples(inner, inner) | st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


def crossed(value: object) -> Any:
    return m.CODEC.unpack(m.CODEC.pack(value))


@given(VALUES)
def test_plain_values_arrive_as_they_were(value):
    found = crossed(value)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    "value",
    [
        Fraction(131072, 360),
        datetime(2026, 1, 2, 3, 4, 5, 678, tzinfo=UTC),
        frozenset({1, 2, 3}),
        {(1, "x"): [2.5, None]},
        float("inf"),
        m.Submit(
            7,
            ("x", "y"),
            ForEach({"x": EnableCommand(), "y": Move(TargetReference.ABSOLUTE, -5, PROFILE)}, together=True),
            "xy",
        ),
        m.Submit(9, "xy", MovePath(("x", "y"), WAY, 50.0), "xy.move_path"),
        m.Submit(10, "xy", FollowPoints(("x", "y"), 2**47, OnUnderrun.ERROR), "xy.stream"),
        m.Submit(11, ("x", "y"), AddPoints(("x", "y"), 2**47, 3, SPANS, ends=True), "xy.stream, points"),
        m.Submit(8, "x", MoveVelocity(PROFILE, life=0.2), "x.jog"),
        m.Submit(8, "x", CyclicVelocity(-9000, 50000.5, 50000.0), "x.cyclic_velocity"),
        m.Submit(8, "x", CyclicTorque(-30, 500, None), "x.cyclic_torque"),
        m.Submit(8, "x", ControllerCommand(3, CyclicTorque(0, 500), 2), "x.controller"),
        m.Submit(8, "x", ControllerOutput(3, 10.004, -30), "x.controller, an answer"),
        m.CommandEvents((CommandEvent(7, Status.DONE, None, "seen by its position"),)),
    ],
)
def test_values_of_known_classes_arrive_unchanged(value):
    assert crossed(value) == value


@pytest.mark.parametrize("kind", [kind for kind in m.CODEC.classes.values() if issubclass(kind, Enum)])
def test_every_enum_arrives_whole(kind):
    assert [crossed(member) for member in kind] == list(kind)


def test_every_record_can_be_read_by_the_names_of_its_fields():
    """A field that its constructor does not take would be lost, or refused."""
    for kind in m.CODEC.classes.values():
        if dataclasses.is_dataclass(kind):
            assert {each.name for each in dataclasses.fields(kind) if each.init} <= set(
                typing.get_type_hints(kind)
            )


def test_a_function_stays_behind_and_the_other_end_has_its_own():
    scale = Scale.of("131072/360", "deg")
    sent = AxisParameters("x", Units(scale, scale, scale, True), explain_fault=lambda *_: ["secret"])
    found = crossed(sent)
    assert found.explain_fault is no_explanation
    assert found == dataclasses.replace(sent, explain_fault=no_explanation)


class Stranger:
    """Something of a user's."""


@pytest.mark.parametrize(
    "value",
    [Stranger(), FollowTrajectory(TrapezoidalTrajectory(0.0, 1.0, 1.0, 1.0)), object(), 1j, {2**70: 1}],
)
def test_values_of_unknown_classes_do_not_cross(value):
    with pytest.raises((NotSendable, OverflowError)):
        m.CODEC.pack(value)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        msgspec.msgpack.encode(["record", "os.system", {"command": "true"}]),
        msgspec.msgpack.encode(["record", "axisbus.ipc.messages.Leave", {"no": 1}]),
        msgspec.msgpack.encode(["enum", "axisbus.motion.command_status.Status", "NONE"]),
        msgspec.msgpack.encode(["error", ["SystemExit", {"message": "x"}, [], ""]]),
        msgspec.msgpack.encode(["no such kind"]),
        msgspec.msgpack.encode([]),
        msgspec.msgpack.encode(["fraction", 1, 0]),
        msgspec.msgpack.encode(["record", "axisbus.ipc.messages.Leave", 3]),
        b"\x91" * 100_000 + b"\xc0",
    ],
    ids=range(11),
)
def test_bytes_without_a_known_value_are_refused(data):
    with pytest.raises(NotSendable):
        m.CODEC.unpack(data)


@given(st.binary(max_size=200))
def test_no_bytes_do_anything_but_make_a_value_or_be_refused(data):
    with suppress(NotSendable):
        m.CODEC.unpack(data)


def test_two_codecs_know_their_own_classes_alone():
    codec = Codec([TargetReference])
    assert codec.unpack(codec.pack(TargetReference.RELATIVE)) is TargetReference.RELATIVE
    with pytest.raises(NotSendable, match=r"Status cannot be sent to another process"):
        codec.pack(Status.DONE)


# -- errors -----------------------------------------------------------------------------------------------------------------

FIELDS: dict[str, dict[str, object]] = {
    "NodeError": {"node": 5},
    "SdoError": {"node": 5, "index": 0x6041, "subindex": 0},
    "SdoAbort": {"node": 5, "index": 0x6041, "subindex": 0, "code": 0x0602_0000},
    "LssError": {"service": "identify"},
    "LssRefused": {"service": "identify", "slave": "x", "code": 255, "specific": 3},
    "BootError": {"node": 5, "step": "identity", "index": 0x1018},
    "SecondMasterError": {"heard": ("SYNC", "heartbeat of node 127")},
    "DriveFault": {"axis": "x", "code": 0x4310},
    "ConfigError": {"file": "cell.toml", "line": 7},
}


def made(name: str) -> errors.AxisbusError:
    kind = getattr(errors, name)
    fields = next((FIELDS[each.__name__] for each in kind.__mro__ if each.__name__ in FIELDS), {})
    error: errors.AxisbusError = kind(
        "what was asked", observed="what was seen", remedy="what to do", **fields
    )
    return error


@pytest.mark.parametrize("name", errors.__all__)
def test_every_error_arrives_as_the_same_with_its_fields_and_notes(name):
    error = made(name)
    error.add_note("while stopping: x")
    found = crossed(error)
    assert type(found) is type(error)
    assert vars(found) == vars(error)
    assert str(found) == str(error)


def test_the_cause_of_an_error_arrives_as_the_text_of_its_traceback():
    try:
        try:
            raise ValueError("of a library")
        except ValueError as cause:
            raise errors.CommandError("it broke off") from cause
    except errors.CommandError as error:
        found = crossed(error)
    assert isinstance(found.__cause__, RemoteTraceback)
    assert "ValueError: of a library" in str(found.__cause__)
    assert "test_ipc_values.py" in str(found.__cause__)


def test_an_error_of_a_programs_own_class_arrives_as_the_nearest_of_the_tree():
    class Special(errors.LimitError):
        pass

    found = crossed(Special("too much"))
    assert type(found) is errors.LimitError


def test_an_attribute_that_is_no_plain_value_arrives_as_text():
    error = errors.StateError("no")
    error.extra = Stranger()  # type: ignore[attr-defined]
    assert "Stranger" in crossed(error).extra
