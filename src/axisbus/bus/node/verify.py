"""Compare an EDS with the live device: read every object, write nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

from axisbus.bus.sdo.access import SdoObjectAccess, try_upload, why_unread
from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, Value, decode, size_in_bytes
from axisbus.eds.model import Eds, ObjectType, Severity, Variable
from axisbus.errors import SdoAbort, SdoError
from axisbus.wording import counted

_REFUSES_SCAN = 2  # ObjFlags bit 1: not to be read on a scan (DS 306 4.6.3.2)
_MISSING = frozenset({abort.OBJECT_MISSING, abort.SUBINDEX_MISSING})
_PDO_AREAS = (range(0x1400, 0x1C00),)
_IDENTITY = (
    (o.DEVICE_TYPE, 0),
    (o.IDENTITY, o.VENDOR_ID),
    (o.IDENTITY, o.PRODUCT_CODE),
    (o.IDENTITY, o.REVISION_NUMBER),
)
_NO_FIXED_VALUE = frozenset({o.ERROR_REGISTER, o.PREDEFINED_ERROR_FIELD})


class VerifiedAspect(Enum):
    """Compared property."""

    IDENTITY = "identity"
    EXISTENCE = "existence"
    ACCESS = "access"
    TYPE = "type"
    PDO = "PDO"
    DEFAULT = "default"
    UNREAD = "not read"


@dataclass(frozen=True, slots=True)
class EdsMismatch:
    """One entry of the EDS that differs from the device; a different default is only a note."""

    kind: VerifiedAspect
    severity: Severity
    index: int
    subindex: int
    name: str
    line: int
    message: str


@dataclass(frozen=True, slots=True)
class Verification:
    """Result of comparing an EDS with a device: number of entries read and left out, and the differences."""

    read: int
    left_out: int
    differences: tuple[EdsMismatch, ...]

    @property
    def agrees(self) -> bool:
        """Whether no difference is more severe than a note."""
        return all(each.severity is Severity.NOTE for each in self.differences)


def verify(
    sdo: SdoObjectAccess, eds: Eds, progress: Callable[[int, int], None] | None = None
) -> Verification:
    """Read every entry of ``eds`` from the device and compare; blocks for one transfer per entry, writes nothing.

    ``progress(done, all)`` is called after each. Entries whose ObjFlags refuse reading, and DOMAINs, are left out.

    Raises:
        SdoTimeout: the device answers for no object. AdapterError: the channel failed.
    """
    entries = [variable for entry in eds for variable in entry.subs.values()]
    wanted = [variable for variable in entries if may_read(variable)]
    found: list[EdsMismatch] = []
    for number, variable in enumerate(wanted, start=1):
        found += _compare(sdo, variable)
        if progress is not None:
            progress(number, len(wanted))
    return Verification(len(wanted), len(entries) - len(wanted), tuple(found))


def may_read(variable: Variable) -> bool:
    """Whether the entry may be read without an explicit request; its access is not considered."""
    return not variable.object_flags & _REFUSES_SCAN and not is_domain(variable)


def is_domain(variable: Variable) -> bool:
    """Whether the entry may contain a whole program, or a table of any length."""
    return variable.data_type is DataType.DOMAIN or variable.object_type is ObjectType.DOMAIN


def _compare(sdo: SdoObjectAccess, variable: Variable) -> Iterator[EdsMismatch]:
    data = try_upload(sdo, variable.index, variable.subindex)
    if isinstance(data, SdoAbort):
        yield from _refused(variable, data.code)
        return
    if isinstance(data, SdoError):
        text = f"could not be read: {why_unread(data)}"
        yield _difference(VerifiedAspect.UNREAD, Severity.WARNING, variable, text)
        return
    if not variable.readable:
        yield _difference(
            VerifiedAspect.ACCESS, Severity.WARNING, variable, "is wo in the EDS, and can be read"
        )
    size = size_in_bytes(variable.data_type)
    if size is not None and len(data) != size:
        text = f"is {variable.data_type.name} ({counted(size, 'byte')}) in the EDS, the device sends {counted(len(data), 'byte')}"
        yield _difference(VerifiedAspect.TYPE, Severity.ERROR, variable, text)
        return
    yield from _value(sdo, variable, decode(data, variable.data_type))


def _refused(variable: Variable, code: int) -> Iterator[EdsMismatch]:
    if code in _MISSING:
        yield _difference(VerifiedAspect.EXISTENCE, Severity.ERROR, variable, "is not in the device")
    elif code == abort.WRITE_ONLY:
        if variable.readable:
            text = f"is {variable.access} in the EDS, and cannot be read"
            yield _difference(VerifiedAspect.ACCESS, Severity.ERROR, variable, text)
    else:
        yield _difference(
            VerifiedAspect.UNREAD, Severity.NOTE, variable, f"could not be read: {abort.describe(code)}"
        )


def _value(sdo: SdoObjectAccess, variable: Variable, value: Value) -> Iterator[EdsMismatch]:
    expected = variable.initial(sdo.node_id)
    if expected is None or expected == value or variable.index in _NO_FIXED_VALUE:
        return
    kind, severity = _weight(variable, expected)
    yield _difference(kind, severity, variable, f"is {_shown(value)}, the EDS has {_shown(expected)}")


def _weight(variable: Variable, expected: Value) -> tuple[VerifiedAspect, Severity]:
    """Return kind and severity of a different value: identity and fixed PDO maps must agree, writable entries may differ."""
    if (variable.index, variable.subindex) in _IDENTITY:
        return VerifiedAspect.IDENTITY, Severity.ERROR if expected else Severity.NOTE
    if any(variable.index in area for area in _PDO_AREAS):
        return VerifiedAspect.PDO, Severity.NOTE if variable.writable else Severity.ERROR
    if variable.access == "const":
        return VerifiedAspect.DEFAULT, Severity.WARNING
    return VerifiedAspect.DEFAULT, Severity.NOTE


def _shown(value: Value) -> str:
    return (
        f"0x{value:X}"
        if isinstance(value, int) and value >= 0x100
        else repr(value)
        if isinstance(value, str)
        else str(value)
    )


def _difference(kind: VerifiedAspect, severity: Severity, variable: Variable, message: str) -> EdsMismatch:
    return EdsMismatch(
        kind, severity, variable.index, variable.subindex, variable.name, variable.line, message
    )
