"""Object dictionary of a simulated node: values by index and sub-index, with the checks and abort codes of CiA 301."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia301.abort import describe
from axisbus.cia301.datatypes import DataType, Value, decode, encode, size_in_bytes
from axisbus.eds.model import Eds, Number, ObjectType, Variable
from axisbus.errors import AxisbusError, SdoAbort

# Abort codes (CiA 301 table 22).
WRITE_ONLY = 0x0601_0001
READ_ONLY = 0x0601_0002
NO_OBJECT = 0x0602_0000
LENGTH = 0x0607_0010
TOO_LONG = 0x0607_0012
TOO_SHORT = 0x0607_0013
NO_SUBINDEX = 0x0609_0011
INVALID_VALUE = 0x0609_0030
TOO_HIGH = 0x0609_0031
TOO_LOW = 0x0609_0032
UNSUPPORTED_ACCESS = 0x0601_0000
CANNOT_STORE = 0x0800_0020
DEVICE_STATE = 0x0800_0022

Read = Callable[[], int]
Hook = Callable[[int], None]


class Refused(Exception):
    """Rejection of a value by a check; the dictionary converts it to ``SdoAbort``, so that it never leaves the dictionary."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class Entry(NamedTuple):
    """Properties of one entry; ``size`` in bytes is None if it varies, ``low`` and ``high`` are None without a limit."""

    data_type: DataType
    size: int | None
    signed: bool
    readable: bool
    writable: bool
    mappable: bool
    access: str
    low: float | None
    high: float | None


class Dictionary:
    """Values of one node; ``live`` entries are read from the drive, ``hooks`` are called after every accepted write."""

    def __init__(self, eds: Eds, node_id: int) -> None:
        self.node_id = node_id
        self.entries: dict[int, Entry] = {}
        self.values: dict[int, Value] = {}
        self.live: dict[int, Read] = {}
        self.hooks: dict[int, list[Hook]] = {}
        self.checks: dict[int, list[Hook]] = {}
        self.byte_receivers: dict[
            int, Callable[[bytes], None]
        ] = {}  # they process the written bytes of an entry
        self.is_hidden: Callable[[int], bool] = lambda _: (
            False
        )  # by index: whether an object does not exist now
        self.with_default: set[int] = set()  # entries with a value in the file
        self.indices: set[int] = set()
        for item in eds:
            self.indices.add(item.index)
            for variable in item.subs.values():
                self._add(variable)
        self.defaults = dict(self.values)

    def __contains__(self, key: int) -> bool:
        return key in self.entries

    def has(self, index: int, subindex: int = 0) -> bool:
        """Whether the entry exists."""
        return index << 8 | subindex in self.entries

    def give_default(self, index: int, subindex: int, value: int) -> None:
        """Set the default of an existing entry for which the file has none."""
        key = index << 8 | subindex
        if key in self.entries and key not in self.with_default:
            self.values[key] = self.defaults[key] = value

    def on_write(self, key: int, hook: Hook) -> None:
        """Call ``hook`` with the integer after each accepted write."""
        self.hooks.setdefault(key, []).append(hook)

    def check_write(self, key: int, check: Hook) -> None:
        """Call ``check`` with the integer before each write; it may raise ``Refused``."""
        self.checks.setdefault(key, []).append(check)

    # Access by SDO.

    def upload(self, index: int, subindex: int) -> bytes:
        """Return the bytes of an entry as SDO reads it.

        Raises:
            SdoAbort: it does not exist or cannot be read.
        """
        try:
            entry = self._find(index, subindex)
            if not entry.readable:
                raise Refused(WRITE_ONLY)
        except Refused as refused:
            raise self.abort("read", index, subindex, refused.code) from None
        return self._encode(entry, self.get(index << 8 | subindex))

    def raw(self, index: int, subindex: int) -> bytes:
        """Return the bytes of an entry, even if it is not readable.

        Raises:
            SdoAbort: it does not exist.
        """
        try:
            entry = self._find(index, subindex)
        except Refused as refused:
            raise self.abort("read", index, subindex, refused.code) from None
        return self._encode(entry, self.get(index << 8 | subindex))

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write bytes as SDO does; hooks have run when it returns.

        Raises:
            SdoAbort: it does not exist, is read-only, has another size, or its value is out of range or rejected.
        """
        try:
            entry = self._find(index, subindex)
            if not entry.writable:
                raise Refused(READ_ONLY)
            if byte_receiver := self.byte_receivers.get(index << 8 | subindex):
                return byte_receiver(data)
            _check_size(entry, len(data))
            value = decode(data, entry.data_type)
            if isinstance(value, int):
                self.check(index << 8 | subindex, entry, value)
            self.set(index << 8 | subindex, value)
        except Refused as refused:
            raise self.abort("written", index, subindex, refused.code) from None

    def require_writable(self, index: int, subindex: int) -> None:
        """Check that an entry may be written, before a segmented transfer.

        Raises:
            SdoAbort: it does not exist or is read-only.
        """
        try:
            if not self._find(index, subindex).writable:
                raise Refused(READ_ONLY)
        except Refused as refused:
            raise self.abort("written", index, subindex, refused.code) from None

    def read(self, index: int, subindex: int = 0) -> int:
        """Read an integer with the checks of SDO (an entry of another type: its first eight bytes as an integer).

        Raises:
            SdoAbort: as ``upload``.
        """
        data = self.upload(index, subindex)
        value = decode(data, self.entries[index << 8 | subindex].data_type)
        return value if isinstance(value, int) else int.from_bytes(data[:8], "little")

    def write(self, index: int, subindex: int, value: int) -> None:
        """Write an integer with the checks of SDO.

        Raises:
            SdoAbort: as ``download``; an integer that the type cannot hold is *too high* or *too low*.
        """
        entry = self.entries.get(index << 8 | subindex)
        if entry is None or not entry.data_type.integer:
            size = 4 if entry is None or entry.size is None else entry.size
            self.download(index, subindex, (value % (1 << 8 * size)).to_bytes(size, "little"))
            return
        low, high = entry.data_type.range
        if value > high or value < low:
            code = TOO_HIGH if value > high else TOO_LOW
            raise self.abort("written", index, subindex, code)
        self.download(index, subindex, encode(value, entry.data_type))

    # Access by the drive.

    def get(self, key: int) -> Value:
        """Return the value without any check."""
        live = self.live.get(key)
        return live() if live is not None else self.values[key]

    def get_int(self, index: int, subindex: int = 0, absent: int = 0) -> int:
        """Return an integer value, or ``absent`` if the entry does not exist or is not an integer."""
        key = index << 8 | subindex
        if key not in self.entries:
            return absent
        value = self.get(key)
        return value if isinstance(value, int) else absent

    def set(self, key: int, value: Value) -> None:
        """Store a value and run its hooks, without checks."""
        self.values[key] = value
        if isinstance(value, int):
            for hook in self.hooks.get(key, ()):
                hook(value)

    def write_mapped(self, key: int, value: int) -> bool:
        """Write an integer as an RPDO does; False (and nothing changed) if the value is rejected."""
        entry = self.entries[key]
        try:
            if entry.high is not None or entry.low is not None or key in self.checks:
                self.check(key, entry, value)
            self.values[key] = value
            for hook in self.hooks.get(key, ()):
                hook(value)
        except Refused:
            return False
        return True

    def encoded_int(self, key: int) -> int:
        """Return the value as the unsigned number in a PDO (an entry of another type: its first eight bytes as an integer)."""
        value = self.get(key)
        if isinstance(value, int):
            return value
        return int.from_bytes(self._encode(self.entries[key], value)[:8], "little")

    def check(self, key: int, entry: Entry, value: int) -> None:
        """Raise ``Refused`` if the range in the file or a check of the drive forbids ``value``."""
        if entry.high is not None and value > entry.high:
            raise Refused(TOO_HIGH)
        if entry.low is not None and value < entry.low:
            raise Refused(TOO_LOW)
        for check in self.checks.get(key, ()):
            check(value)

    def snapshot(self) -> dict[int, Value]:
        """Return the values that 1010h stores: those of all writable entries."""
        return {key: value for key, value in self.values.items() if self.entries[key].writable}

    def load(self, values: dict[int, Value], low: int = 0, high: int = 0xFFFF) -> None:
        """Set all entries with an index in ``low`` to ``high`` to ``values``, or to their defaults, and run the hooks."""
        for key, default in self.defaults.items():
            if low <= key >> 8 <= high:
                self.set(key, values.get(key, default))

    def renumber(self, eds: Eds, node_id: int) -> None:
        """Take the defaults and limits of ``eds`` for another node-ID; values change with the next ``load``."""
        self.node_id = node_id
        for item in eds:
            for variable in item.subs.values():
                key = variable.index << 8 | variable.subindex
                self.entries[key] = entry = _entry(variable, node_id)
                value = variable.initial(node_id)
                if value is not None:
                    self.defaults[key] = _initial(entry, value)

    def _find(self, index: int, subindex: int) -> Entry:
        entry = self.entries.get(index << 8 | subindex)
        if self.is_hidden(index):
            raise Refused(NO_OBJECT)
        if entry is None:
            raise Refused(NO_SUBINDEX if index in self.indices else NO_OBJECT)
        return entry

    def abort(self, verb: str, index: int, subindex: int, code: int) -> SdoAbort:
        """Return the error for an entry that cannot be ``verb`` ("read", "written")."""
        return SdoAbort(
            f"node {self.node_id}: {index:04X}h:{subindex:02X} cannot be {verb}",
            node=self.node_id,
            index=index,
            subindex=subindex,
            code=code,
            observed=f"SDO abort {describe(code)}",
        )

    def _add(self, variable: Variable) -> None:
        key = variable.index << 8 | variable.subindex
        entry = _entry(variable, self.node_id)
        self.entries[key] = entry
        value = variable.initial(self.node_id)
        if value is not None:
            self.with_default.add(key)
        self.values[key] = _initial(entry, value)

    def _encode(self, entry: Entry, value: Value) -> bytes:
        if isinstance(value, int) and entry.size is not None and entry.data_type.integer:
            return (value % (1 << 8 * entry.size)).to_bytes(entry.size, "little")
        try:
            return encode(value, entry.data_type)
        except AxisbusError:  # a type without a codec, such as TIME_OF_DAY, to which the file gives a number
            return int(value).to_bytes(entry.size or 4, "little") if isinstance(value, int) else b""


def _entry(variable: Variable, node_id: int) -> Entry:
    data_type = variable.data_type
    domain = variable.object_type is ObjectType.DOMAIN
    low, high = _limit(variable.low, node_id), _limit(variable.high, node_id)
    if low is not None and high is not None and low >= high:
        low = high = None  # 0 and 0 in many files: means no limits
    return Entry(
        data_type,
        None if domain else size_in_bytes(data_type),
        data_type.signed,
        variable.readable,
        variable.writable,
        variable.pdo_mapping,
        variable.access,
        low if data_type.integer else None,
        high if data_type.integer else None,
    )


def _limit(value: Number | float | None, node_id: int) -> float | None:
    return value.resolve(node_id) if isinstance(value, Number) else value


def _initial(entry: Entry, value: Value | None) -> Value:
    if entry.data_type.integer:
        if not isinstance(value, (int, float)):
            return 0
        modulus = 1 << 8 * (entry.size or 1)
        number = int(value) % modulus
        return number - modulus if entry.signed and number >= modulus // 2 else number
    if value is not None:
        return value
    if entry.data_type in (DataType.REAL32, DataType.REAL64):
        return 0.0
    if entry.data_type in (DataType.VISIBLE_STRING, DataType.UNICODE_STRING):
        return ""
    return b"" if entry.size is None else bytes(entry.size)


def _check_size(entry: Entry, size: int) -> None:
    if entry.size is None or size == entry.size:
        return
    if not entry.data_type.integer:
        raise Refused(LENGTH)
    raise Refused(TOO_LONG if size > entry.size else TOO_SHORT)
