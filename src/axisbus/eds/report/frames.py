"""The CAN frames of one node as plain values: its PDOs with a field for each mapped object, and the other services."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from axisbus.cia301 import cob
from axisbus.cia301 import objects as cia301
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.pdo import MAX_BITS
from axisbus.cia402 import modes, value_texts
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import axis_of, first_axis, own_index
from axisbus.cia402.si_units import decoded
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout, PdoSlot
from axisbus.eds.model import Eds, Number
from axisbus.eds.report import naming, overview, pdo_text, wording
from axisbus.errors import ArgumentError, UserError
from axisbus.wording import counted

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal


MASTER = "Master"
_SYNC_COUNTER = 0x1019  # synchronous counter overflow value (CiA 301 7.5.2.22)
_MODE_OBJECTS = (cia402.MODES_OF_OPERATION, cia402.MODES_OF_OPERATION_DISPLAY)
_REALS = (DataType.REAL32, DataType.REAL64)


@dataclass(frozen=True, slots=True)
class PdoSignal:
    """One signal: ``first_bit`` counts from the least significant of byte 0 (Intel), factor 1, no offset.

    ``low`` and ``high`` are the object's limits, None if the file gives none; ``unit`` is the unit of one count, empty if neither
    the standard nor the file defines it.
    """

    name: str
    first_bit: int
    bits: int
    comment: str = ""
    signed: bool = False
    real: bool = False
    choices: Mapping[int, str] = field(default_factory=dict)
    low: float | None = None
    high: float | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True)
class PdoMessage:
    """One message: its CAN identifier, number of data bytes, sender, and signals."""

    name: str
    identifier: int
    size: int
    sender: str
    comment: str
    fields: tuple[PdoSignal, ...] = ()
    extended: bool = False


def frames(
    eds: Eds, node_id: int, *, switched_off: bool = False, words: bool = False
) -> tuple[tuple[PdoMessage, ...], tuple[str, ...]]:
    """Return the frames of a node (1 to 127): services, RPDOs, TPDOs; and a sentence about each PDO that is left out.

    A PDO is left out if its identifier is unknown or used by another frame, if it has more than 64 bits or none, or if it is
    disabled (unless ``switched_off`` is set). A statusword is one signal for each bit, or with ``words`` one signal.
    """
    accepted: dict[tuple[int, bool], PdoMessage] = {}
    left_out: list[str] = []
    for frame in _services(eds, node_id):
        accepted[frame.identifier, frame.extended] = frame
    for each in layout.layouts(eds, node_id):
        reason = _obstacle(each, accepted, switched_off)
        if reason:
            left_out.append(f"{each.name}: {reason}")
        else:
            frame = _pdo(eds, each, node_id, words)
            accepted[frame.identifier, frame.extended] = frame
    return tuple(accepted.values()), tuple(left_out)


def _obstacle(each: PdoLayout, accepted: Mapping[tuple[int, bool], PdoMessage], switched_off: bool) -> str:
    """Return the reason why a PDO is left out; empty if it is included."""
    if each.identifier is None:
        return "the file gives no COB-ID"
    if not each.valid and not switched_off:
        return "switched off (bit 31 of its COB-ID)"
    if not each.bits:
        return "maps nothing"
    if each.bits > MAX_BITS:
        return f"maps {counted(each.bits, 'bit')}, a CAN frame holds {MAX_BITS}"
    other = accepted.get((each.identifier, each.extended))
    return f"{each.identifier:03X}h is already the identifier of {other.name}" if other is not None else ""


def _pdo(eds: Eds, each: PdoLayout, node_id: int, words: bool) -> PdoMessage:
    slots = {number: slot for number, slot in enumerate(each.slots) if slot.bits and not slot.mapped.is_dummy}
    names = naming.unique(
        {number: _field_name(slot) for number, slot in slots.items()},
        lambda number: _suffix(each.slots, number),
    )
    return PdoMessage(
        f"{node_name(node_id)}_{each.name}",
        each.identifier or 0,
        each.size,
        MASTER if each.receive else node_name(node_id),
        f"{each.name} {'' if each.valid else 'switched off, '}{pdo_text.transmission(each)}",
        tuple(
            field_text
            for number, slot in slots.items()
            for field_text in _fields(eds, slot, names[number], node_id, words)
        ),
        each.extended,
    )


def _field_name(slot: PdoSlot) -> str:
    return naming.snake(slot.name) if naming.snake(slot.name)[:1].isalpha() else f"Object_{_address(slot)}"


def _suffix(slots: tuple[PdoSlot, ...], number: int) -> str:
    """Return the address, with the slot's number if the same object is mapped twice."""
    address = _address(slots[number])
    twice = sum(slot.mapped[:2] == slots[number].mapped[:2] for slot in slots) > 1
    return f"{address}_{number + 1}" if twice else address


def _address(slot: PdoSlot) -> str:
    return f"{slot.mapped.index:04X}_{slot.mapped.subindex:02X}"


def _fields(eds: Eds, slot: PdoSlot, name: str, node_id: int, words: bool) -> Iterator[PdoSignal]:
    """Yield the signal of a mapped object; of a statusword (without ``words``) one for each bit, with the meaning of 0 and 1."""
    complete = _field(eds, slot, name, node_id)
    if words or first_axis(slot.mapped.index) != cia402.STATUSWORD or slot.bits != len(_STATUS):
        yield complete
        return
    for bit, text in _STATUS.items():
        comment = f"{complete.comment}, bit {bit}: {text}"
        named = naming.snake(text.partition(" (")[0].partition(":")[0])
        choices = (
            {0: f"not_{named.lower()}", 1: named.lower()} if bit in _PLAIN_BITS else _QUICK_STOP.get(bit, {})
        )
        yield PdoSignal(f"{name}_{bit}_{named}", slot.first_bit + bit, 1, comment, choices=choices)


def _limits(slot: PdoSlot, node_id: int) -> tuple[float | None, float | None]:
    """Return the object's limits in the file, if the mapped length is that of the object."""
    if (
        slot.variable is None
        or slot.data_type is None
        or not slot.data_type.integer
        or slot.bits != slot.variable.bits
    ):
        return None, None
    low, high = (
        each.resolve(node_id) if isinstance(each, Number) else each
        for each in (slot.variable.low, slot.variable.high)
    )
    if low is None and high is None:
        return None, None
    bottom, top = slot.data_type.range  # a DBC has both or none
    return bottom if low is None else low, top if high is None else high


def _unit(eds: Eds, slot: PdoSlot, node_id: int) -> str:
    """Return the unit of one count: from CiA 402 if it is defined there, else the SI unit of the file (60A8h …)."""
    index = first_axis(slot.mapped.index)
    if index in _UNITS:
        return _UNITS[index]
    given = next(
        (
            _number(eds, own_index(unit, axis_of(slot.mapped.index)), node_id)
            for unit, of in _SI_UNITS.items()
            if index in of
        ),
        None,
    )
    found = decoded(given)
    return "" if found is None else found.text


def _field(eds: Eds, slot: PdoSlot, name: str, node_id: int) -> PdoSignal:
    return PdoSignal(
        name,
        slot.first_bit,
        slot.bits,
        f"{wording.address_text(slot.mapped.index, slot.mapped.subindex)} {slot.name}, {pdo_text.kind(slot)}",
        slot.signed and slot.data_type not in _REALS,
        slot.data_type in _REALS and slot.data_type is not None and slot.data_type.bits == slot.bits,
        _MODES if first_axis(slot.mapped.index) in _MODE_OBJECTS else {},
        *_limits(slot, node_id),
        _unit(eds, slot, node_id),
    )


_STATUS = {
    int(bit): text
    for each in value_texts.tables(cia402.STATUSWORD, 0)
    if each.key == "bit"
    for bit, text in each.rows
}
_PLAIN_BITS = frozenset(  # bits whose name is the meaning of 1
    bit for bit, text in _STATUS.items() if "specific" not in text and "(" not in text
)
_QUICK_STOP = {5: {0: "quick_stop_active", 1: "no_quick_stop"}}
# Units of one count that CiA 402-2 defines; thousandths are of the rated value (6075h, 6076h).
_UNITS = {
    **dict.fromkeys((0x6071, 0x6072, 0x6074, 0x6077, 0x60B2, 0x60E0, 0x60E1), "0.1% rated torque"),
    **dict.fromkeys((0x6073, 0x6078), "0.1% rated current"),
    0x6075: "mA",
    0x6076: "mNm",
    0x6079: "mV",
    **dict.fromkeys((0x6063, 0x60FC), "inc"),
}
# SI unit objects (CiA 402-2), each with the objects in that unit.
_SI_UNITS = {
    0x60A8: frozenset((0x6062, 0x6064, 0x6065, 0x6067, 0x607A, 0x607C, 0x60B0, 0x60F4)),
    0x60A9: frozenset((0x606B, 0x606C, 0x6080, 0x607F, 0x6081, 0x60B1, 0x60FF)),
}
_MODES = {mode.value: facts.short for mode, facts in modes.FACTS.items()}


def _services(eds: Eds, node_id: int) -> Iterator[PdoMessage]:
    """Yield the frames of NMT, SYNC, EMCY, SDO and heartbeat (CiA 301 7.2, 7.3.5)."""
    node = node_name(node_id)
    yield PdoMessage("NMT", cob.NMT, 2, MASTER, "node control (CiA 301 7.2.8.3.1)", _NMT)
    sync = _cob_id(eds, cia301.COB_ID_SYNC, node_id)
    if sync is not None:
        counter = _number(eds, _SYNC_COUNTER, node_id) or 0
        fields = (PdoSignal("Counter", 0, 8, "1 to the value of 1019h"),) if counter else ()
        yield PdoMessage("SYNC", sync[0], len(fields), MASTER, "SYNC (1005h)", fields, sync[1])
    emcy = _cob_id(eds, cia301.COB_ID_EMCY, node_id)
    if emcy is not None:
        yield PdoMessage(f"{node}_EMCY", emcy[0], 8, node, "emergency (1014h)", _EMCY, emcy[1])
    yield PdoMessage(f"{node}_SDO_response", cob.SDO_TX + node_id, 8, node, "SDO, server to client", _SDO)
    yield PdoMessage(f"{node}_SDO_request", cob.SDO_RX + node_id, 8, MASTER, "SDO, client to server", _SDO)
    yield PdoMessage(
        f"{node}_Heartbeat", cob.HEARTBEAT + node_id, 1, node, "boot-up, heartbeat, guarding", _STATE
    )


_NMT = (
    PdoSignal("Command", 0, 8, choices={each.value: each.name.lower() for each in NmtCommand}),
    PdoSignal("Node_ID", 8, 8, "0: all nodes"),
)
_EMCY = (
    PdoSignal("Error_code", 0, 16, "CiA 301 table 26 and 603Fh"),
    PdoSignal("Error_register", 16, 8, "1001h"),
    PdoSignal("Makers_field", 24, 40, "manufacturer-specific"),
)
_SDO = (
    PdoSignal("Command", 0, 8, "command specifier (CiA 301 7.2.4.3)"),
    PdoSignal("Object_index", 8, 16),
    PdoSignal("Object_subindex", 24, 8),
    PdoSignal("Object_data", 32, 32, "data, size, or abort code; segments have other fields"),
)
_STATE = (
    PdoSignal(
        "NMT_state",
        0,
        7,
        choices={each.value: each.text.replace("-", "_") for each in NmtState if each.value >= 0},
    ),
    PdoSignal("Toggle", 7, 1, "node guarding only"),
)


def _cob_id(eds: Eds, index: int, node_id: int) -> tuple[int, bool] | None:
    """Return the identifier and whether it has 29 bits; None if the file gives no value or the service is disabled."""
    given = _number(eds, index, node_id)
    if given is None or (index == cia301.COB_ID_EMCY and given & cob.INVALID):
        return None
    extended = bool(given & cob.EXTENDED)
    return given & (cob.ID_MASK_29 if extended else cob.ID_MASK_11), extended


def _number(eds: Eds, index: int, node_id: int) -> int | None:
    entry = eds.get(index)
    found = entry.initial(node_id) if entry is not None else None
    return found if isinstance(found, int) else None


def node_name(node_id: int) -> str:
    """Return the name of a node as sender and receiver."""
    return f"Node{node_id}"


# -- The frames of one node as a DBC file, written by cantools, an optional dependency ---------------------------------


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
    accepted, left_out = frames(eds, node_id, switched_off=switched_off, words=words)
    return Dbc(_text(eds, node_id, accepted), left_out)


def _text(eds: Eds, node_id: int, accepted: tuple[PdoMessage, ...]) -> str:
    try:
        from cantools.database.can import Database, Node
    except ImportError as error:
        raise UserError(
            "a DBC is written by cantools, which is not installed",
            observed=str(error),
            remedy='install it: pip install "axisbus[dbc]"',
        ) from error
    summary = overview.overview(eds, node_id)
    nodes = [Node(MASTER, "CANopen master"), Node(node_name(node_id), _ascii(summary.title))]
    messages = [_message(frame, node_id) for frame in accepted]
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
