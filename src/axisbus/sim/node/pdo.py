"""PDOs of a simulated node: parameters with their rules (CiA 301 7.4.9), packing and unpacking bit by bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from axisbus.sim.dictionary import (
    INVALID_VALUE,
    NO_OBJECT,
    NO_SUBINDEX,
    UNSUPPORTED_ACCESS,
    Dictionary,
    Refused,
)
from axisbus.sim.fault_injection import NodeFaults

CANNOT_MAP = 0x0604_0041
TOO_MANY_BITS = 0x0604_0042

_INVALID = 0x8000_0000
_NO_RTR = 0x4000_0000
_FRAME_BITS = 0x2000_0000
_MOST_FIELDS = 64  # one bit each
_ID = 0x7FF
_DEFAULT_RPDO = (0x200, 0x300, 0x400, 0x500)
_DEFAULT_TPDO = (0x180, 0x280, 0x380, 0x480)
_DUMMIES = range(0x0001, 0x0008)
# COB-IDs that no PDO may have (CiA 301 7.3.5).
_RESTRICTED = (
    range(0x001),
    range(0x001, 0x081),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x700),
    range(0x701, 0x800),
)


class Field(NamedTuple):
    """One mapped entry; ``key`` None: unused bits; ``half``: weight of the sign bit, 0 for unsigned."""

    key: int | None
    shift: int
    mask: int
    half: int


class Pdo:
    """One PDO; holds its parameters and the compiled mapping."""

    def __init__(
        self,
        dictionary: Dictionary,
        number: int,
        transmit: bool,
        dials: NodeFaults,
        changed: Callable[[], None],
    ) -> None:
        """Make PDO ``number`` (from 0) and watch its objects; ``changed`` is called after a change of its parameters."""
        self._changed = changed
        self.number = number
        self.transmit = transmit
        self._dictionary = dictionary
        self._dials = dials
        self._comm = (0x1800 if transmit else 0x1400) + number
        self._map = (0x1A00 if transmit else 0x1600) + number
        self.cob_id = 0
        self.valid = False
        self.transmission_type = 255
        self.inhibit_time = 0.0  # s
        self.event_timer = 0.0  # s
        self.sync_start = 0  # value of the SYNC counter, 0: begin with any
        self.rtr = False
        self.fields: list[Field] = []
        self._used: list[tuple[int, int, int, int]] = []  # those with an entry
        self._by_kind: dict[bool, list[tuple[int, int, int, int]]] = {}  # by whether it is a controlword
        self.size = 0
        self._predefine()
        self._watch()
        self.reload()

    @property
    def on_request(self) -> bool:
        """Whether it is sent only on request by a remote frame (types 252 and 253)."""
        return self.transmission_type in (252, 253)

    @property
    def synchronous(self) -> bool:
        """Whether it is tied to SYNC (types 0 to 240)."""
        return self.transmission_type <= 240

    def pack(self) -> bytes:
        """Return the data for the present values of the objects."""
        raw = 0
        live, values = self._dictionary.live, self._dictionary.values
        for key, shift, mask, _ in self._used:
            get = live.get(key)
            value = values[key] if get is None else get()
            if not isinstance(value, int):
                value = self._dictionary.encoded_int(key)
            raw |= (value & mask) << shift
        return raw.to_bytes(self.size, "little")

    def unpack(self, data: bytes, *, commands: bool | None) -> None:
        """Write the mapped controlwords (``commands``), everything else, or all in the order of the mapping (None).

        A value that the drive does not accept is dropped; ``data`` has at least ``size`` bytes.
        """
        raw = int.from_bytes(data[: self.size], "little")
        write = self._dictionary.write_mapped
        for key, shift, mask, half in self._used if commands is None else self._by_kind[commands]:
            value = raw >> shift & mask
            write(key, value - (half << 1) if value & half else value)

    def reload(self, _value: int = 0) -> None:
        """Read the parameters from the dictionary."""
        get = self._dictionary.get_int
        cob = get(self._comm, 1, _INVALID) & 0xFFFF_FFFF
        self.cob_id = cob & _ID
        self.valid = not cob & (_INVALID | _FRAME_BITS) and self.cob_id != 0
        self.transmission_type = get(self._comm, 2, 255)
        self.inhibit_time = get(self._comm, 3) / 10_000.0
        self.event_timer = 0.0 if self._dials.event_timer_ignored else get(self._comm, 5) / 1000.0
        self.sync_start = get(self._comm, 6)
        self.rtr = self.transmit and self._dials.rtr and not cob & _NO_RTR
        self.fields = self._fields(get(self._map, 0))
        self._used = [(field.key, *field[1:]) for field in self.fields if field.key is not None]
        self._by_kind = {
            kind: [field for field in self._used if _is_controlword(field[0]) is kind]
            for kind in (False, True)
        }
        self._changed()

    def _predefine(self) -> None:
        """Set the COB-IDs of the first four PDOs if the file has none (CiA 301 7.3.5)."""
        defaults = _DEFAULT_TPDO if self.transmit else _DEFAULT_RPDO
        node_id = self._dictionary.node_id
        value = defaults[self.number] + node_id if self.number < len(defaults) else _INVALID
        self._dictionary.give_default(self._comm, 1, value)
        self._dictionary.give_default(self._comm, 2, 255)

    def _fields(self, count: int) -> list[Field]:
        fields, shift = [], 0
        for subindex in range(1, min(count, _MOST_FIELDS) + 1):
            entry = self._dictionary.get_int(self._map, subindex) & 0xFFFF_FFFF
            bits = entry & 0xFF
            if shift + bits > 64:
                break
            fields.append(self._field(entry, shift, bits))
            shift += bits
        self.size = (shift + 7) // 8
        return fields

    def _field(self, entry: int, shift: int, bits: int) -> Field:
        found = self._dictionary.entries.get(entry >> 8)
        if found is None or bits == 0:
            return Field(None, shift, 0, 0)
        half = 1 << bits - 1 if found.signed else 0
        return Field(entry >> 8, shift, (1 << bits) - 1, half)

    # Rules.

    def _watch(self) -> None:
        dictionary, comm, mapping = self._dictionary, self._comm, self._map
        dictionary.check_write(comm << 8 | 1, self._check_cob_id)
        dictionary.check_write(comm << 8 | 2, self._check_type)
        for subindex in (3, 6):
            dictionary.check_write(comm << 8 | subindex, self._check_off)
        for subindex in (1, 2, 3, 5, 6):
            dictionary.on_write(comm << 8 | subindex, self.reload)
        for subindex in range(65):
            if dictionary.has(mapping, subindex):
                check = self._check_entry if subindex else self._check_count
                dictionary.check_write(mapping << 8 | subindex, check)
                dictionary.on_write(mapping << 8 | subindex, self.reload)

    def _check_cob_id(self, value: int) -> None:
        value &= 0xFFFF_FFFF
        if value & _INVALID:
            return
        if value & _FRAME_BITS or any((value & _ID) in id_range for id_range in _RESTRICTED):
            raise Refused(INVALID_VALUE)
        if self.valid and value & _ID != self.cob_id:
            raise Refused(INVALID_VALUE)  # bits 0 to 29 may not change while the PDO exists

    def _check_type(self, value: int) -> None:
        on_request = self.transmit and self._dials.rtr and value in (252, 253)
        if (
            241 <= value <= 253 and not on_request
        ):  # reserved, or on request only, which this device does not support
            raise Refused(INVALID_VALUE)

    def _check_off(self, _value: int) -> None:
        """Reject a change of inhibit time or SYNC start value while the PDO is valid."""
        if self.valid:
            raise Refused(INVALID_VALUE)

    def _check_mapping_free(self) -> None:
        if self._dials.fixed_mapping:
            raise Refused(self._dials.fixed_mapping)
        if self.valid:
            raise Refused(UNSUPPORTED_ACCESS)

    def _check_count(self, value: int) -> None:
        self._check_mapping_free()
        if value == 0:
            return
        entries = []
        for subindex in range(1, value + 1):
            if value > _MOST_FIELDS or not self._dictionary.has(self._map, subindex):
                raise Refused(TOO_MANY_BITS)
            entries.append(self._dictionary.get_int(self._map, subindex) & 0xFFFF_FFFF)
        for entry in entries:
            self._check_mappable(entry)
        if sum(entry & 0xFF for entry in entries) > 64:
            raise Refused(TOO_MANY_BITS)

    def _check_entry(self, value: int) -> None:
        self._check_mapping_free()
        if self._dictionary.get_int(self._map, 0) != 0:
            raise Refused(UNSUPPORTED_ACCESS)
        if value:
            self._check_mappable(value & 0xFFFF_FFFF)

    def _check_mappable(self, entry: int) -> None:
        index, bits = entry >> 16, entry & 0xFF
        if index in _DUMMIES and not self.transmit:
            return
        found = self._dictionary.entries.get(entry >> 8)
        if found is None:
            raise Refused(NO_SUBINDEX if index in self._dictionary.indices else NO_OBJECT)
        access_allows = found.readable and found.access != "rww" if self.transmit else found.writable
        access_allows = access_allows and not (found.access == "rwr" and not self.transmit)
        size = found.data_type.bits
        if not found.mappable or not access_allows or size is None or bits != size:
            raise Refused(CANNOT_MAP)


class PdoTable:
    """All PDOs with communication parameters; ``version`` increases with each change of one, or of 1005h, 1006h, 1012h, 1019h."""

    def __init__(self, dictionary: Dictionary, dials: NodeFaults) -> None:
        self.version = 0
        receive, transmit = _numbers(dictionary, 0x1400), _numbers(dictionary, 0x1800)
        self.receive = [Pdo(dictionary, n, False, dials, self._count) for n in receive]
        self.transmit = [Pdo(dictionary, n, True, dials, self._count) for n in transmit]
        for index in (0x1005, 0x1006, 0x1012, 0x1019):
            dictionary.on_write(index << 8, lambda _: self._count())

    def _count(self) -> None:
        self.version += 1


def apply(received: list[tuple[Pdo, bytes]], in_order: bool) -> None:
    """Write RPDOs received at one instant: all values first, so that a controlword finds its target.

    ``in_order``: instead one entry after the other, in the order of the mapping and of the RPDOs' numbers.
    """
    if in_order:
        for pdo, data in sorted(received, key=lambda item: item[0].number):
            pdo.unpack(data, commands=None)
        return
    for pdo, data in received:
        pdo.unpack(data, commands=False)
    for pdo, data in received:
        pdo.unpack(data, commands=True)


def _is_controlword(key: int) -> bool:
    return key >= 0x60_0000 and (key - 0x60_4000) % 0x8_0000 == 0


def _numbers(dictionary: Dictionary, first: int) -> Iterator[int]:
    return (index - first for index in sorted(dictionary.indices) if first <= index < first + 0x200)
