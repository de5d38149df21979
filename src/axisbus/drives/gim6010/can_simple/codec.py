"""Encode messages into CAN frames and decode frames into messages, driven by the message table.

Theory of operation. Both directions use the same identifier: a master's command or request and the module's answer differ only in
their sender. A receiver knows the sender, since it does not receive its own frames. Therefore ``decode`` has the sender as an
argument, and ``readings`` returns all possible meanings if the sender is unknown (in a recording). Sent frames always have eight
bytes, padded with zeros (manual v2.2, 4.1.1). Empty requests exist only for messages that a module answers: eight bytes of 0 under
Mit_Control would be full negative torque, so this module never encodes that message (``mit`` does).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple import messages
from axisbus.drives.gim6010.can_simple.fields import MessageField, Number
from axisbus.drives.gim6010.can_simple.identifier import Identifier, can_id, split
from axisbus.drives.gim6010.can_simple.messages import LENGTH, Message, MessageRequestMethod
from axisbus.errors import ArgumentError
from axisbus.wording import counted

# -- Results of decoding a frame: a message with its values, a request, or the reason why the frame is invalid ---------


class Reason(Enum):
    """Reason why a frame does not fit the message table."""

    NOT_STANDARD = "an identifier of 29 bits is not CAN Simple's"
    NO_COMMAND = "there is no such command"
    LENGTH = "it is too short"
    NOT_SENT = "that is not sent by this side"
    NOT_FINITE = "a value is not a finite number"
    WRONG_NODE = "the node that it names is not the node of its identifier"
    VALUE = "a value is not one that the manual lists"


@dataclass(frozen=True, slots=True)
class DecodedMessage:
    """A message of a node; ``values`` by the manual's field names, each in its field's unit and at its field's side of the gear."""

    node: int
    message: Message
    values: Mapping[str, Number]
    from_module: bool


@dataclass(frozen=True, slots=True)
class MessageRequest:
    """A master's request for a message, as a remote frame or a data frame of zeros."""

    node: int
    message: Message


@dataclass(frozen=True, slots=True)
class Unexpected:
    """A frame that does not fit the message table; returned, not raised, since a foreign frame must not end a cycle.

    ``node`` and ``command`` are the parts of its identifier in CAN Simple, independent of its sender; -1 for a 29-bit identifier.
    """

    node: int
    command: int
    data: bytes
    reason: Reason
    details: str = ""

    @property
    def words(self) -> str:
        """The reason as text: ``command 09h: it is too short (7 bytes where 8 are needed)``."""
        more = f" ({self.details})" if self.details else ""
        where = "a frame" if self.command < 0 else f"command {self.command:02X}h"
        return f"{where}: {self.reason.value}{more}"


# -- Decode and encode frames ------------------------------------------------------------------------------------------


Outcome = DecodedMessage | MessageRequest | Unexpected
_MIT = messages.named("Mit_Control").command
_OWN_ENCODERS = {"Mit_Control": "mit", "RxSdo": "endpoint_messages", "TxSdo": "endpoint_messages"}


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A classic CAN frame with an 11-bit identifier to be sent; a ``remote`` frame requests eight bytes and has no data.

    Raises:
        ArgumentError: it is Mit_Control with only zeros, or as a remote frame, whose data the module may assume to be anything.
            Zeros
            are full negative torque, so no caller can make such a frame by mistake.
    """

    can_id: int
    data: bytes = b""
    remote: bool = False

    def __post_init__(self) -> None:
        if self.can_id & 0x1F == _MIT and (self.remote or not any(self.data)):
            raise ArgumentError(
                "Mit_Control without data, or with zeros alone, is full negative torque and never sent",
                remedy="pack the intended command",
            )


def encode(node: int, message: Message, values: Mapping[str, Number] | None = None) -> Outgoing:
    """Return the frame that sends ``message`` to ``node`` (0 to 63) with the values of its fields, each in the field's unit.

    Mit_Control is encoded by ``mit``, endpoints by ``endpoint_messages``: they have rules that fields cannot express.

    Raises:
        ArgumentError: a field is missing or unknown, a value is not a number or not in the manual's list, the node ID is invalid,
            or
            the message is not one that a master sends with values.
        LimitError: a value is beyond its field's bounds or type.
    """
    if message.name in _OWN_ENCODERS:
        raise ArgumentError(
            f"{message.name} is not encoded field by field", remedy=f"use {_OWN_ENCODERS[message.name]}"
        )
    if message.answer and not message.sent:
        raise ArgumentError(f"{message.name} is sent by the module", remedy="a master can only ask for it")
    return Outgoing(can_id(node, message.command), packed(message, values or {}))


def packed(message: Message, values: Mapping[str, Number]) -> bytes:
    """Return the eight bytes of a message's sent fields; raises the same errors as ``encode``."""
    names = [each.name for each in message.sent]
    if set(values) != set(names):
        raise ArgumentError(
            f"{message.name} does not have these fields: {', '.join(values) or 'none'}",
            remedy=f"it has {', '.join(names)}" if names else "it has no fields",
        )
    return pack_places(each.place(values[each.name]) for each in message.sent)


def pack_places(places: Iterable[int]) -> bytes:
    """Return eight bytes that contain the bits of all fields at their positions."""
    return sum(places).to_bytes(LENGTH, "little")


def request(node: int, message: Message, *, remote: bool = True) -> Outgoing:
    """Return the frame that requests a message from ``node`` (0 to 63): a remote frame, or a data frame of eight zeros.

    Owners saw modules answer both. For Get_Error use ``error_query``: its request contains the kind of error.

    Raises:
        ArgumentError: the node ID is invalid, or the message is not one that an empty request asks for.
    """
    if message.asked is not MessageRequestMethod.EMPTY:
        possible = [each.name for each in messages.MESSAGES if each.asked is MessageRequestMethod.EMPTY]
        raise ArgumentError(
            f"{message.name} is not sent in answer to an empty request",
            remedy=f"these are: {', '.join(possible)}",
        )
    return Outgoing(can_id(node, message.command), b"" if remote else bytes(LENGTH), remote)


def decode(
    identifier: int, data: bytes, *, from_module: bool, remote: bool = False, extended: bool = False
) -> Outcome:
    """Return the meaning of a frame whose sender is known; an invalid frame gives an ``Unexpected``.

    Data longer than the fields are accepted, because answers are padded to eight bytes; shorter data are not. Never raises for a
    frame that a CAN bus can carry.
    """
    if extended or not 0 <= identifier < 0x800:
        return Unexpected(-1, -1, data, Reason.NOT_STANDARD)
    place = split(identifier)
    message = messages.BY_COMMAND.get(place.command)
    if message is None:
        return _unexpected(place, data, Reason.NO_COMMAND)
    if remote:
        return _asked(place, message, data, from_module=from_module)
    return (_from_module if from_module else _to_module)(place, message, data)


def readings(
    identifier: int, data: bytes, *, remote: bool = False, extended: bool = False
) -> tuple[Outcome, ...]:
    """Return all possible meanings of a frame with unknown sender; a single ``Unexpected`` if it has none."""
    both = [
        decode(identifier, data, from_module=from_module, remote=remote, extended=extended)
        for from_module in (True, False)
    ]
    good = tuple(each for each in both if not isinstance(each, Unexpected))
    if good:
        return good
    told = [each for each in both if isinstance(each, Unexpected) and each.reason is not Reason.NOT_SENT]
    return tuple(told[:1] or both[:1])


def _asked(place: Identifier, message: Message, data: bytes, *, from_module: bool) -> Outcome:
    if from_module or message.asked is not MessageRequestMethod.EMPTY:
        return _unexpected(place, data, Reason.NOT_SENT, f"a remote frame of {message.name}")
    return MessageRequest(place.node, message)


def _from_module(place: Identifier, message: Message, data: bytes) -> Outcome:
    if not message.answer:
        return _unexpected(place, data, Reason.NOT_SENT, f"{message.name} by a module")
    needed = message.answer_bytes
    if len(data) < needed:
        return short(place, data, needed)
    return _read(place, message, message.answer, data.ljust(LENGTH, b"\0"), from_module=True)


def _to_module(place: Identifier, message: Message, data: bytes) -> Outcome:
    if message.asked is MessageRequestMethod.EMPTY:
        if any(data):
            return _unexpected(place, data, Reason.NOT_SENT, f"{message.name} with data")
        return MessageRequest(place.node, message)
    if message.answer and not message.sent:
        return _unexpected(place, data, Reason.NOT_SENT, f"{message.name} by a master")
    if len(data) < message.sent_bytes:
        return short(place, data, message.sent_bytes)
    return _read(place, message, message.sent, data, from_module=False)


def _read(
    place: Identifier, message: Message, fields: tuple[MessageField, ...], data: bytes, *, from_module: bool
) -> Outcome:
    values = {each.name: each.take(data) for each in fields}
    wild = [name for name, value in values.items() if not math.isfinite(value)]
    if wild:
        return _unexpected(place, data, Reason.NOT_FINITE, ", ".join(wild))
    wrong = [each.name for each in fields if each.values and values[each.name] not in each.values]
    if wrong:
        listed = ", ".join(f"{name} {values[name]}" for name in wrong)
        return _unexpected(place, data, Reason.VALUE, listed)
    if from_module and values.get("Node_ID", place.node) != place.node:
        return _unexpected(place, data, Reason.WRONG_NODE, f"node {values['Node_ID']}")
    return DecodedMessage(place.node, message, values, from_module)


def short(place: Identifier, data: bytes, needed: int) -> Unexpected:
    details = f"{counted(len(data), 'byte')} where {needed} are needed"
    return _unexpected(place, data, Reason.LENGTH, details)


def _unexpected(place: Identifier, data: bytes, reason: Reason, details: str = "") -> Unexpected:
    return Unexpected(place.node, place.command, data, reason, details)
