"""The CAN frames of one node as plain values: its PDOs with a field for each mapped object, and the services around them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from axisbus.cia301 import cob
from axisbus.cia301 import objects as cia301
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.pdo import MAX_BITS
from axisbus.cia402 import modes
from axisbus.cia402 import objects as cia402
from axisbus.eds import layout, naming, pdo_text, wording
from axisbus.eds.layout import Layout, Slot
from axisbus.eds.model import Eds
from axisbus.wording import counted

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


def frames(eds: Eds, node_id: int) -> tuple[tuple[Frame, ...], tuple[str, ...]]:
    """Return the frames of a node (1 to 127), services, RPDOs, TPDOs, and a sentence about each PDO that cannot be among them.

    Left out is a PDO without a known identifier, one that is switched off or whose identifier another frame has, and one of more
    than 64 bits.
    """
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
        return f"maps {counted(each.bits, 'bit')}, a CAN frame holds {MAX_BITS}"
    other = kept.get((each.identifier, each.extended))
    return f"{each.identifier:03X}h is already the identifier of {other.name}" if other is not None else ""


def _pdo(each: Layout, node_id: int) -> Frame:
    slots = {number: slot for number, slot in enumerate(each.slots) if slot.bits and not slot.mapped.is_dummy}
    names = naming.unique(
        {number: _field_name(slot) for number, slot in slots.items()},
        lambda number: _suffix(each.slots, number),
    )
    return Frame(
        f"{node_name(node_id)}_{each.name}",
        each.identifier or 0,
        each.size,
        MASTER if each.receive else node_name(node_id),
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
    node = node_name(node_id)
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


def node_name(node_id: int) -> str:
    """Return what a node is called as sender and receiver."""
    return f"Node{node_id}"
