"""The frames of one node as a DBC file, written by cantools, an optional dependency."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from axisbus.eds.model import Eds
from axisbus.eds.report import overview
from axisbus.eds.report.frames import MASTER, PdoMessage, PdoSignal, frames, node_name
from axisbus.errors import ArgumentError, UserError

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal


@dataclass(frozen=True, slots=True)
class Dbc:
    """A DBC as text, and the parts that it cannot contain, a sentence each."""

    text: str
    left_out: tuple[str, ...]


def dumps(eds: Eds, node_id: int | None, *, switched_off: bool = False, words: bool = False) -> Dbc:
    """Return the DBC of a device as node ``node_id`` (1 to 127); with ``switched_off``, disabled PDOs are included.

    A statusword is one signal for each bit, or with ``words`` one signal of 16 bits.

    Raises:
        ArgumentError: ``node_id`` is None; the identifiers depend on it.
        UserError: cantools is not installed.
    """
    if node_id is None:
        raise ArgumentError(
            f"{eds.source}: the CAN identifiers of a DBC depend on the node ID", remedy="give it: --node 5"
        )
    kept, left_out = frames(eds, node_id, switched_off=switched_off, words=words)
    return Dbc(_text(eds, node_id, kept), left_out)


def _text(eds: Eds, node_id: int, kept: tuple[PdoMessage, ...]) -> str:
    try:
        from cantools.database.can import Database, Node
    except ImportError as error:
        raise UserError(
            "a DBC is written by cantools, which is not installed",
            observed=str(error),
            remedy='install it: pip install "axisbus[dbc]"',
        ) from error
    seen = overview.overview(eds, node_id)
    nodes = [Node(MASTER, "CANopen master"), Node(node_name(node_id), _ascii(seen.title))]
    messages = [_message(frame, node_id) for frame in kept]
    text: str = Database(messages, nodes, version="").as_dbc_string()
    return text


def _message(frame: PdoMessage, node_id: int) -> Message:
    from cantools.database.can import Message

    receiver = node_name(node_id) if frame.sender == MASTER else MASTER
    return Message(
        frame.identifier,
        frame.name,
        frame.size,
        [_signal(each, receiver) for each in frame.fields],
        comment=_ascii(frame.comment),
        senders=[frame.sender],
        is_extended_frame=frame.extended,
    )


def _signal(each: PdoSignal, receiver: str) -> Signal:
    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    return Signal(
        each.name,
        each.first_bit,
        each.bits,
        "little_endian",
        each.signed,
        minimum=each.low,
        maximum=each.high,
        unit=each.unit or None,
        conversion=BaseConversion.factory(choices=OrderedDict(each.choices) or None, is_float=each.real),
        comment=_ascii(each.comment) or None,
        receivers=[receiver],
    )


def _ascii(text: str) -> str:
    """Return a text that all readers of DBC accept: no quotation marks, ASCII only."""
    return text.replace('"', "'").replace("\\", "/").encode("ascii", "replace").decode()
