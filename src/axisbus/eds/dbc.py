"""The frames of one node as a DBC file: its PDOs with a signal for each mapped object, and the services of CiA 301 around them.

Theory of operation. Frames are first made as plain values here (``frames``), without any library; only ``dumps`` turns them into
the objects of cantools, an optional extra, which writes the text. What a DBC cannot hold (a PDO without a known identifier, two
frames of one identifier, more than 64 bits) is left out and named in ``left_out``: it never makes the whole fail.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from axisbus.cia301 import cob
from axisbus.cia301 import objects as cia301
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.pdo import MAX_BITS
from axisbus.cia402 import modes
from axisbus.cia402 import objects as cia402
from axisbus.eds import layout, naming, overview, pdo_text, wording
from axisbus.eds.layout import Layout, Slot
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, UserError

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

MASTER = "Master"
_SYNC_COUNTER = 0x1019  # synchronous counter overflow value (CiA 301 7.5.2.22)
_MODE_OBJECTS = (cia402.MODES_OF_OPERATION, cia402.MODES_OF_OPERATION_DISPLAY)
_REALS = (DataType.REAL32, DataType.REAL64)


@dataclass(frozen=True, slots=True)
class Field:
    """One signal: ``first_bit`` counts from the least significant of byte 0 (Intel), factor 1, no offset."""

    name: str
    first_bit: int
    bits: int
    comment: str = ""
    signed: bool = False
    real: bool = False
    choices: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Frame:
    """One message: its CAN identifier, data bytes, who sends it, and what is in it."""

    name: str
    identifier: int
    size: int
    sender: str
    comment: str
    fields: tuple[Field, ...] = ()
    extended: bool = False


@dataclass(frozen=True, slots=True)
class Dbc:
    """A DBC as text, and what it could not hold, a sentence each."""

    text: str
    left_out: tuple[str, ...]


def dumps(eds: Eds, node_id: int | None) -> Dbc:
    """Return the DBC of a device as node ``node_id`` (1 to 127).

    Raises:
        ArgumentError: ``node_id`` is None; the identifiers depend on it.
        UserError: cantools is not installed.
    """
    if node_id is None:
        raise ArgumentError(
            f"{eds.source}: the CAN identifiers of a DBC depend on the node ID", remedy="give it: --node 5"
        )
    kept, left_out = frames(eds, node_id)
    return Dbc(_text(eds, node_id, kept), left_out)


def frames(eds: Eds, node_id: int) -> tuple[tuple[Frame, ...], tuple[str, ...]]:
    """Return the frames of a node, in the order services, RPDOs, TPDOs, and sentences about what had to be left out."""
    kept: dict[tuple[int, bool], Frame] = {}
    left_out: list[str] = []
    for frame in _services(eds, node_id):
        kept[frame.identifier, frame.extended] = frame
    for each in layout.layouts(eds, node_id):
        reason = _obstacle(each, kept)
        if reason:
            left_out.append(f"{each.name}: {reason}")
        else:
            frame = _pdo(each, node_id)
            kept[frame.identifier, frame.extended] = frame
    return tuple(kept.values()), tuple(left_out)


def _obstacle(each: Layout, kept: Mapping[tuple[int, bool], Frame]) -> str:
    """Return why a PDO cannot be in the DBC; empty where it can."""
    if each.identifier is None:
        return "the file gives no COB-ID"
    if not each.valid:
        return "switched off (bit 31 of its COB-ID)"
    if not each.bits:
        return "maps nothing"
    if each.bits > MAX_BITS:
        return f"maps {each.bits} bits, a CAN frame holds {MAX_BITS}"
    other = kept.get((each.identifier, each.extended))
    return f"{each.identifier:03X}h is already the identifier of {other.name}" if other is not None else ""


def _pdo(each: Layout, node_id: int) -> Frame:
    slots = {number: slot for number, slot in enumerate(each.slots) if slot.bits and not slot.mapped.is_dummy}
    names = naming.unique(
        {number: _field_name(slot) for number, slot in slots.items()},
        lambda number: _suffix(each.slots, number),
    )
    return Frame(
        f"{_node_name(node_id)}_{each.name}",
        each.identifier or 0,
        each.size,
        MASTER if each.receive else _node_name(node_id),
        f"{each.name} {pdo_text.transmission(each)}",
        tuple(_field(slot, names[number]) for number, slot in slots.items()),
        each.extended,
    )


def _field_name(slot: Slot) -> str:
    return naming.snake(slot.name) if naming.snake(slot.name)[:1].isalpha() else f"Object_{_address(slot)}"


def _suffix(slots: tuple[Slot, ...], number: int) -> str:
    """Return the address, and the place too where one object is mapped twice."""
    address = _address(slots[number])
    twice = sum(slot.mapped[:2] == slots[number].mapped[:2] for slot in slots) > 1
    return f"{address}_{number + 1}" if twice else address


def _address(slot: Slot) -> str:
    return f"{slot.mapped.index:04X}_{slot.mapped.subindex:02X}"


def _field(slot: Slot, name: str) -> Field:
    return Field(
        name,
        slot.first_bit,
        slot.bits,
        f"{wording.place(slot.mapped.index, slot.mapped.subindex)} {slot.name}, {pdo_text.kind(slot)}",
        slot.signed and slot.data_type not in _REALS,
        slot.data_type in _REALS and slot.data_type is not None and slot.data_type.bits == slot.bits,
        _MODES if wording.first_axis(slot.mapped.index) in _MODE_OBJECTS else {},
    )


_MODES = {mode.value: facts.short for mode, facts in modes.FACTS.items()}


def _services(eds: Eds, node_id: int) -> Iterator[Frame]:
    """Return the frames of NMT, SYNC, EMCY, SDO and heartbeat (CiA 301 7.2, 7.3.5)."""
    node = _node_name(node_id)
    yield Frame("NMT", cob.NMT, 2, MASTER, "node control (CiA 301 7.2.8.3.1)", _NMT)
    sync = _cob_id(eds, cia301.COB_ID_SYNC, node_id)
    if sync is not None:
        counter = _number(eds, _SYNC_COUNTER, node_id) or 0
        fields = (Field("Counter", 0, 8, "1 to the value of 1019h"),) if counter else ()
        yield Frame("SYNC", sync[0], len(fields), MASTER, "SYNC (1005h)", fields, sync[1])
    emcy = _cob_id(eds, cia301.COB_ID_EMCY, node_id)
    if emcy is not None:
        yield Frame(f"{node}_EMCY", emcy[0], 8, node, "emergency (1014h)", _EMCY, emcy[1])
    yield Frame(f"{node}_SDO_response", cob.SDO_TX + node_id, 8, node, "SDO, server to client", _SDO)
    yield Frame(f"{node}_SDO_request", cob.SDO_RX + node_id, 8, MASTER, "SDO, client to server", _SDO)
    yield Frame(f"{node}_Heartbeat", cob.HEARTBEAT + node_id, 1, node, "boot-up, heartbeat, guarding", _STATE)


_NMT = (
    Field("Command", 0, 8, choices={each.value: each.name.lower() for each in NmtCommand}),
    Field("Node_ID", 8, 8, "0: all nodes"),
)
_EMCY = (
    Field("Error_code", 0, 16, "CiA 301 table 26 and 603Fh"),
    Field("Error_register", 16, 8, "1001h"),
    Field("Makers_field", 24, 40, "specific to the maker"),
)
_SDO = (
    Field("Command", 0, 8, "command specifier (CiA 301 7.2.4.3)"),
    Field("Object_index", 8, 16),
    Field("Object_subindex", 24, 8),
    Field("Object_data", 32, 32, "data, size, or abort code; segments have other fields"),
)
_STATE = (
    Field(
        "NMT_state",
        0,
        7,
        choices={each.value: each.text.replace("-", "_") for each in NmtState if each.value >= 0},
    ),
    Field("Toggle", 7, 1, "node guarding only"),
)


def _cob_id(eds: Eds, index: int, node_id: int) -> tuple[int, bool] | None:
    """Return identifier and whether it has 29 bits, None where the file gives no value or the service is switched off."""
    given = _number(eds, index, node_id)
    if given is None or (index == cia301.COB_ID_EMCY and given & cob.INVALID):
        return None
    extended = bool(given & cob.EXTENDED)
    return given & (cob.ID_MASK_29 if extended else cob.ID_MASK_11), extended


def _number(eds: Eds, index: int, node_id: int) -> int | None:
    entry = eds.get(index)
    found = entry.initial(node_id) if entry is not None else None
    return found if isinstance(found, int) else None


def _node_name(node_id: int) -> str:
    return f"Node{node_id}"


def _text(eds: Eds, node_id: int, kept: tuple[Frame, ...]) -> str:
    try:
        from cantools.database.can import Database, Node
    except ImportError as error:
        raise UserError(
            "a DBC is written by cantools, which is not installed",
            observed=str(error),
            remedy="install it: pip install 'axisbus[dbc]'",
        ) from error
    seen = overview.overview(eds, node_id)
    nodes = [Node(MASTER, "CANopen master"), Node(_node_name(node_id), _ascii(seen.title))]
    messages = [_message(frame, node_id) for frame in kept]
    text: str = Database(messages, nodes, version="").as_dbc_string()
    return text


def _message(frame: Frame, node_id: int) -> Message:
    from cantools.database.can import Message

    receiver = _node_name(node_id) if frame.sender == MASTER else MASTER
    return Message(
        frame.identifier,
        frame.name,
        frame.size,
        [_signal(each, receiver) for each in frame.fields],
        comment=_ascii(frame.comment),
        senders=[frame.sender],
        is_extended_frame=frame.extended,
    )


def _signal(each: Field, receiver: str) -> Signal:
    from collections import OrderedDict

    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    conversion: Callable[..., BaseConversion] = BaseConversion.factory
    return Signal(
        each.name,
        each.first_bit,
        each.bits,
        "little_endian",
        each.signed,
        conversion=conversion(choices=OrderedDict(each.choices) or None, is_float=each.real),
        comment=_ascii(each.comment) or None,
        receivers=[receiver],
    )


def _ascii(text: str) -> str:
    """Return a text that every reader of DBC takes: no quotation marks, ASCII only."""
    return text.replace('"', "'").replace("\\", "/").encode("ascii", "replace").decode()
