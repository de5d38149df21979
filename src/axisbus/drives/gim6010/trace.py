"""Decode frames of CAN Simple to text, for the nodes that the user has named; a frame does not say what sent it.

Theory of operation
-------------------
An identifier of CAN Simple is a valid one of CANopen too, so only the named nodes are decoded. If the bytes fit both a request and
its answer, both are reported. Values of MIT control use the ranges of the manual, and the text says so.
"""

from __future__ import annotations

from collections.abc import Collection

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple import endpoint_messages, heartbeat, mit
from axisbus.drives.gim6010.can_simple.codec import (
    DecodedMessage,
    MessageRequest,
    Outcome,
    Unexpected,
    readings,
)
from axisbus.drives.gim6010.can_simple.fields import MessageField, Number
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import NODES, can_id, split
from axisbus.drives.gim6010.can_simple.messages import command_name, state_words
from axisbus.errors import ArgumentError
from axisbus.trace.other_protocols import NodeFrameText, TracePart
from axisbus.trace.services import Words
from axisbus.wording import counted

_MIT = mit.MIT_CONTROL.command


class CanSimpleDecoder:
    """The named nodes; holds state: the last heartbeat of each."""

    def __init__(self, nodes: Collection[int] = ()) -> None:
        self._beats: dict[int, Heartbeats] = {node: Heartbeats() for node in nodes}

    def decode(self, frame: CanFrame) -> NodeFrameText | None:
        """Return the text of a frame; None if it belongs to none of the named nodes."""
        if not self._beats or frame.error or frame.extended or frame.can_id >= NODES.stop << 5:
            return None
        node, command = split(frame.can_id)
        if node not in self._beats:
            return None
        if command == heartbeat.COMMAND and not frame.remote:
            return NodeFrameText(node, _named(command, self._beat(node, frame.data)), True)
        found = readings(frame.can_id, frame.data, remote=frame.remote)
        said = " or ".join(filter(None, (_one(each, frame.data) for each in found)))
        wrong = [each.words for each in found if isinstance(each, Unexpected)]
        from_module = any(isinstance(each, DecodedMessage) and each.from_module for each in found)
        text = said or frame.data.hex(" ").upper() or "no data"
        return NodeFrameText(
            node, _named(command, Words(text, problem="; ".join(wrong))), from_module or bool(wrong)
        )

    def _beat(self, node: int, data: bytes) -> Words:
        heard = self._beats[node].after(node, data)
        if isinstance(heard, Unexpected):
            return Words(data.hex(" ").upper() or "no data", problem=heard.words)
        self._beats[node] = heard
        assert heard.last is not None  # it was just heard
        gap = f"{counted(heard.gap, 'heartbeat')} missed before it, by its life counter" if heard.gap else ""
        return _heartbeat(heard.last)._replace(problem=gap)


def nodes_of(text: str) -> tuple[int, ...]:
    """Return the nodes in a text such as ``0,1,5``. Raises ArgumentError: one of them is not a node ID of CAN Simple."""
    found = []
    for each in text.split(","):
        word = each.strip()
        if not (word.isascii() and word.isdecimal() and int(word) in NODES):
            raise ArgumentError(
                f"{word or text!r} is not a node ID of CAN Simple",
                remedy=f"give numbers from 0 to {NODES.stop - 1}, joined by commas: --can-simple 0,1,5",
            )
        found.append(int(word))
    return tuple(found)


def _named(command: int, words: Words) -> Words:
    return words._replace(what=f"CAN Simple, {command_name(command)}: {words.what}")


def _heartbeat(beat: Heartbeat) -> Words:
    parts = [state_words(beat.state)]
    parts += faults.words("axis", beat.axis_error)
    flags = [each for each in beat.faults if each != "axis"]
    parts += [f"fault of {', '.join(flags)}"] if flags else []
    parts += ["trajectory done"] if beat.trajectory_done else []
    parts += [] if beat.life is None else [f"life {beat.life}"]
    parts += [] if beat.layouts else ["flags as no known firmware has them"]
    return Words("; ".join(parts), error=bool(beat.faults))


def _one(found: Outcome, data: bytes) -> str:
    """Return the text for one interpretation of a frame; empty for an ``Unexpected``."""
    if isinstance(found, Unexpected):
        return ""
    if isinstance(found, MessageRequest):
        return "asked for"
    if found.message.command == _MIT:
        return _mit(found, data)
    if found.message.command in endpoint_messages.COMMANDS:
        return _endpoint(found, data)
    fields = found.message.answer if found.from_module else found.message.sent
    who = "answer" if found.message.sent and found.message.answer and found.from_module else ""
    shown = ", ".join(_shown(each, found.values[each.name]) for each in fields)
    return f"{who} {shown}".strip() or "no data"


def _shown(field: MessageField, value: Number) -> str:
    number = str(value) if isinstance(value, int) else f"{value:.6g}"
    meaning = field.values.get(value) if isinstance(value, int) else None
    side = f" ({field.side.value})" if field.side.value else ""
    return f"{field.name} {number}" + (f" ({meaning})" if meaning else f" {field.unit}{side}".rstrip())


def _mit(found: DecodedMessage, data: bytes) -> str:
    if found.from_module:
        answer = mit.read(found.node, data)
        assert not isinstance(answer, Unexpected)  # it was read already
        values = f"answer position {answer.position:.6g} rad, velocity {answer.velocity:.6g} rad/s, torque {answer.torque:.6g} N·m"
    else:
        command = mit.unpack(found.node, data)
        assert not isinstance(command, Unexpected)  # it was read already
        values = (
            f"command position {command.position:.6g} rad, velocity {command.velocity:.6g} rad/s, kp {command.kp:.6g}, "
            f"kd {command.kd:.6g}, torque {command.torque:.6g} N·m"
        )
    return f"{values} (by the manual's ranges)"


def _endpoint(found: DecodedMessage, data: bytes) -> str:
    """Return the text of an endpoint access: a request and its answer may have the same bytes, and are then reported once."""
    if not found.from_module:
        return ""
    act = "write" if found.values["opcode"] else "read"
    return f"{act} of endpoint {found.values['Endpoint_ID']} or its answer: {data[4:8].hex(' ').upper()}"


PART = TracePart(CanSimpleDecoder, heartbeat=lambda node: can_id(node, heartbeat.COMMAND))
