"""The contents of an EDS or DCF, as frozen values with the line of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, cast

from axisbus.cia301.datatypes import DataType, Value

BAUD_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)  # kbit/s, of CiA 301
DEVICE_NUMBERS = (  # keys of [DeviceInfo] that have a number (DS 306 4.5)
    *("VendorNumber", "ProductNumber", "RevisionNumber", *(f"BaudRate_{rate}" for rate in BAUD_RATES)),
    *("SimpleBootUpMaster", "SimpleBootUpSlave", "Granularity", "DynamicChannelsSupported"),
    *("GroupMessaging", "NrOfRXPDO", "NrOfTXPDO", "LSS_Supported", "CompactPDO"),
)
DUMMIES = range(1, 8)  # data types in [DummyUsage] (DS 306 4.6.2)
# The access of objects that an RPDO may write, and a TPDO may read: rww may be mapped into RPDOs, rwr into TPDOs only (CiA 306).
RPDO_ACCESS = frozenset(("wo", "rw", "rww"))
TPDO_ACCESS = frozenset(("ro", "const", "rw", "rwr"))


class ObjectType(IntEnum):
    """Object code of CiA 301 table 42; an unknown code becomes a new member."""

    NULL = 0
    DOMAIN = 2
    DEFTYPE = 5
    DEFSTRUCT = 6
    VAR = 7
    ARRAY = 8
    RECORD = 9

    @classmethod
    def _missing_(cls, value: object) -> ObjectType | None:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"OBJECT_{value:02X}"
        member._value_ = value
        return member


class Severity(Enum):
    """The severity of a finding: an error makes a tool or device fail, a warning is a deviation, a note is only information."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"

    @property
    def rank(self) -> int:
        """Key to sort by: the worst is 0."""
        return _RANKS[self]


_RANKS = {severity: rank for rank, severity in enumerate(Severity)}


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """One error or oddity: ``line`` and ``column`` count from 1 (0: the whole file)."""

    rule: str
    severity: Severity
    line: int
    column: int
    message: str
    remedy: str = ""
    index: int | None = None
    subindex: int | None = None


@dataclass(frozen=True, slots=True)
class Number:
    """An integer of the file: a plain value, or one to which the node-ID is added."""

    value: int
    plus_node_id: bool = False

    def resolve(self, node_id: int | None) -> int:
        """Return the value for a node-ID (1 to 127); without a node-ID the formula's constant part."""
        return self.value + (node_id or 0) if self.plus_node_id else self.value


@dataclass(frozen=True, slots=True)
class Variable:
    """One readable or writable entry: a VAR, or a sub-index of an ARRAY or RECORD.

    ``low`` and ``high`` are None if the file gives no limit, or no meaningful one. ``default`` and ``parameter_value`` (DCF) are
    None if absent or not understood; integers are ``Number``, because they may depend on the node-ID. ``denotation`` is the name
    that a DCF gives the entry in addition to its ``name``. ``more`` holds the section's other keys in lower case, such as
    ``uploadfile`` and those of later drafts and other standards (``paramrefd``, ``srdomapping``, …).
    """

    index: int
    subindex: int
    name: str
    data_type: DataType
    access: str
    default: Number | float | str | bytes | None = None
    parameter_value: Number | float | str | bytes | None = None
    low: Number | float | None = None
    high: Number | float | None = None
    pdo_mapping: bool = False
    object_flags: int = 0
    line: int = 0
    object_type: ObjectType = ObjectType.VAR
    denotation: str = ""
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def readable(self) -> bool:
        """Whether SDO may read it (ro, rw, rwr, rww, const)."""
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        """Whether SDO may write it (wo, rw, rwr, rww)."""
        return self.access in ("wo", "rw", "rwr", "rww")

    @property
    def bits(self) -> int | None:
        """Size in bits, None if it varies."""
        return self.data_type.bits

    def initial(self, node_id: int | None) -> Value | None:
        """Return the value after power-up for a node: the DCF's parameter value, else the default, else None."""
        value = self.parameter_value if self.parameter_value is not None else self.default
        return value.resolve(node_id) if isinstance(value, Number) else value


class _Draft:
    """A Variable under construction: __init__ of a frozen class sets each field by a call, which takes five times as long."""

    __slots__ = Variable.__slots__


def variable(
    index: int,
    subindex: int,
    name: str,
    data_type: DataType,
    access: str,
    default: Number | float | str | bytes | None,
    parameter_value: Number | float | str | bytes | None,
    low: Number | float | None,
    high: Number | float | None,
    pdo_mapping: bool,
    object_flags: int,
    line: int,
    object_type: ObjectType,
    denotation: str,
    more: Mapping[str, str],
) -> Variable:
    """Return a ``Variable`` with these fields in a third of the time, for readers of large files."""
    made: Any = _Draft()
    made.index = index
    made.subindex = subindex
    made.name = name
    made.data_type = data_type
    made.access = access
    made.default = default
    made.parameter_value = parameter_value
    made.low = low
    made.high = high
    made.pdo_mapping = pdo_mapping
    made.object_flags = object_flags
    made.line = line
    made.object_type = object_type
    made.denotation = denotation
    made.more = more
    made.__class__ = Variable
    return cast("Variable", made)


def variable_like(
    like: Variable,
    index: int,
    subindex: int,
    name: str,
    default: Number | float | str | bytes | None,
    line: int,
) -> Variable:
    """Return a copy of ``like`` that differs only in these fields, much faster than ``dataclasses.replace``."""
    return variable(
        index,
        subindex,
        name,
        like.data_type,
        like.access,
        default,
        like.parameter_value,
        like.low,
        like.high,
        like.pdo_mapping,
        like.object_flags,
        line,
        like.object_type,
        like.denotation,
        like.more,
    )


@dataclass(frozen=True, slots=True)
class Object:
    """One index of the dictionary; a VAR or DOMAIN holds itself as sub-index 0.

    ``denotation`` is the name that a DCF gives it; ``links`` are the indices that belong to it ([xxxxObjectLinks], DS 306 4.6.4);
    ``more`` holds its section's other keys in lower case.
    """

    index: int
    name: str
    object_type: ObjectType
    subs: Mapping[int, Variable]
    line: int = 0
    denotation: str = ""
    links: tuple[int, ...] = ()
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_record(self) -> bool:
        """Whether it has sub-indices (ARRAY, RECORD, DEFSTRUCT)."""
        return self.object_type in (ObjectType.ARRAY, ObjectType.RECORD, ObjectType.DEFSTRUCT)


class _ObjectDraft:
    """An Object under construction, for the same reason as ``_Draft``."""

    __slots__ = Object.__slots__


def object_of(
    index: int,
    name: str,
    object_type: ObjectType,
    subs: Mapping[int, Variable],
    line: int,
    denotation: str,
    links: tuple[int, ...],
    more: Mapping[str, str],
) -> Object:
    """Return an ``Object`` with these fields in a quarter of the time, for readers of large files."""
    made: Any = _ObjectDraft()
    made.index = index
    made.name = name
    made.object_type = object_type
    made.subs = subs
    made.line = line
    made.denotation = denotation
    made.links = links
    made.more = more
    made.__class__ = Object
    return cast("Object", made)


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity of 1018h; None if the file does not contain it."""

    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None


@dataclass(frozen=True, slots=True)
class SubExtension:
    """Sub-indices that a module adds to an object of the bus coupler, all like ``variable`` (DS 306 6, [MxSubExtxxxx]).

    A module adds ``count`` of them; if ``count`` is 0, it uses ``bits`` bits of a sub-index that several modules share.
    ``object_extend`` is ObjExtend as written, 0 if the file gives none.
    """

    variable: Variable
    count: int
    bits: int = 0
    object_extend: int = 0


@dataclass(frozen=True, slots=True)
class Module:
    """One kind of module that a modular device may have (DS 306 6).

    ``info`` is [MxModuleInfo] by lower-case key, ``comments`` the lines of [MxComments]. ``fixed`` are the objects that the device
    has once, if it has such a module. ``extends`` are the objects that each such module extends. Both hold None for an index that
    the module lists but does not describe.
    """

    number: int
    info: Mapping[str, str]
    fixed: Mapping[int, Object | None]
    extends: Mapping[int, SubExtension | None]
    comments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DynamicChannel:
    """One segment of [DynamicChannels] (CiA 302, CiA 405): objects for network variables that a program makes at run time.

    ``indices`` are the indices of its objects. ``offset`` is the position of the first object in the process image, and ``step``
    the distance between two objects there, if the file gives it.
    """

    data_type: DataType
    access: str
    indices: range
    offset: int = 0
    step: int | None = None


@dataclass(frozen=True)
class Eds:
    """One EDS or DCF file: its objects, its information sections, and the oddities found while reading it.

    ``info`` maps a section's lower-case name (``fileinfo``, ``deviceinfo``, ``devicecomissioning``, …) to its entries by lower-case
    key. ``source`` is the path or name in messages. ``node_id`` (1 to 127) is the node-ID of a DCF. ``modules`` are the kinds of
    module that a modular device may have, by number; ``connected`` are those that the device has according to a DCF, in order.

    Frozen, and shared by all nodes that use the same file: do not change the mappings. Objects of a file are made on first access;
    access is allowed from any thread.
    """

    source: str
    objects: Mapping[int, Object]
    info: Mapping[str, Mapping[str, str]]
    node_id: int | None = None
    modules: Mapping[int, Module] = field(default_factory=dict)
    connected: tuple[int, ...] = ()
    dynamic_channels: tuple[DynamicChannel, ...] = ()
    _diagnose: Callable[[], tuple[EdsFinding, ...]] = field(default=tuple, compare=False, repr=False)
    _names: dict[str, tuple[int, int]] = field(default_factory=dict, compare=False, repr=False)
    _texts: dict[str, str] = field(default_factory=dict, compare=False, repr=False)  # made once on first use

    def _repr_html_(self) -> str:
        """Return the display of the file in a notebook."""
        from axisbus.eds.report.notebook_summary import html  # only a notebook needs it

        return html(self)

    @property
    def findings(self) -> tuple[EdsFinding, ...]:
        """The oddities found while reading, in the order of the lines; the first access goes through the whole file."""
        return self._diagnose()

    def __contains__(self, index: int) -> bool:
        return index in self.objects

    def __iter__(self) -> Iterator[Object]:
        return iter(self.objects.values())

    def get(self, index: int, subindex: int = 0) -> Variable | None:
        """Return the entry at ``index:subindex``, None if the file has none."""
        found = self.objects.get(index)
        return None if found is None else found.subs.get(subindex)

    def find(self, name: str) -> Variable | None:
        """Return the first entry of this name, case-insensitive; ``"Object.Sub-index name"`` names a sub-index."""
        if not self._names:
            self._names.update(_name_table(self.objects))
        key = self._names.get(name.strip().lower())
        return None if key is None else self.get(*key)

    @property
    def dummies(self) -> frozenset[int]:
        """Data types (1 to 7) that may fill space in a PDO, by [DummyUsage]."""
        usage = self.info.get("dummyusage", {})
        return frozenset(number for number in DUMMIES if _integer(usage.get(f"dummy{number:04x}")))

    @property
    def device_type(self) -> int | None:
        """Default of 1000h, None if the file gives none."""
        return self._default(0x1000, 0)

    @property
    def identity(self) -> Identity:
        """Identity by the defaults of 1018h, else by [DeviceInfo]."""
        device = self.info.get("deviceinfo", {})
        return Identity(
            self._default(0x1018, 1) or _integer(device.get("vendornumber")),
            self._default(0x1018, 2) or _integer(device.get("productnumber")),
            self._default(0x1018, 3) or _integer(device.get("revisionnumber")),
        )

    def _default(self, index: int, subindex: int) -> int | None:
        variable = self.get(index, subindex)
        return (
            variable.default.value if variable is not None and isinstance(variable.default, Number) else None
        )


def _integer(text: str | None) -> int | None:
    try:
        return int(text or "", 0) or None
    except ValueError:
        return None


def _name_table(objects: Mapping[int, Object]) -> dict[str, tuple[int, int]]:
    names: dict[str, tuple[int, int]] = {}
    for index, entry in objects.items():
        if entry.is_record:
            for subindex, sub in entry.subs.items():
                names.setdefault(f"{entry.name}.{sub.name}".lower(), (index, subindex))
        else:
            names.setdefault(entry.name.lower(), (index, 0))
    return names
