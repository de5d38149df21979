"""The display of values, types and addresses of an EDS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from axisbus.cia301 import cob
from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.eds.model import EdsFinding, Number, Object, ObjectType, Severity, Variable
from axisbus.wording import counted

Default = Number | float | str | bytes | None

# 32-bit objects of the communication area that are counts or times; the others are identifiers and bit fields.
_COUNTED = frozenset((0x1006, 0x1007, 0x1013, 0x1028))
# Objects of CiA 402 that are read bit by bit.
_BIT_FIELDS = frozenset(
    (
        *(0x603F, cia402.CONTROLWORD, cia402.STATUSWORD, cia402.POLARITY, cia402.SUPPORTED_DRIVE_MODES),
        *(0x60A8, 0x60A9, 0x60AA, 0x60AB, 0x60B8, 0x60B9, cia402.DIGITAL_INPUTS, 0x60FE, 0x67FF),
    )
)
_PDO_BY_ACCESS = {"ro": "TPDO", "rwr": "TPDO", "const": "TPDO", "wo": "RPDO", "rww": "RPDO"}


def address_text(index: int, subindex: int | None = None) -> str:
    """Return an address for display: ``6041h``, ``1018h:01``."""
    return f"{index:04X}h" if subindex is None else f"{index:04X}h:{subindex:02X}"


def number(value: int, entry: Variable) -> str:
    """Return an integer in hexadecimal if the entry is an identifier or a bit field, else in decimal."""
    if value < 0 or not in_hex(entry):
        return str(value)
    return f"0x{value:0{(entry.bits or 32) // 4}X}"


def in_hex(entry: Variable) -> bool:
    """Whether an entry's values are read as an identifier or bit by bit."""
    if entry.data_type.signed or not entry.data_type.integer or entry.data_type is DataType.BOOLEAN:
        return False
    if entry.index < 0x2000:
        return entry.data_type is DataType.UNSIGNED32 and entry.index not in _COUNTED
    return first_axis(entry.index) in _BIT_FIELDS and not (entry.index == 0x60FE and entry.subindex == 0)


def value(given: Default, entry: Variable, node_id: int | None) -> str:
    """Return a default, limit or parameter value as text; empty if absent.

    A formula is resolved for ``node_id`` (1 to 127) and shown after the value; without a node-ID only the formula is shown.
    """
    if given is None:
        return ""
    if isinstance(given, Number):
        if not given.plus_node_id:
            return number(given.value, entry)
        formula = f"$NODEID+0x{given.value:X}" if given.value else "$NODEID"
        return formula if node_id is None else f"{number(given.resolve(node_id), entry)} ({formula})"
    if isinstance(given, bytes):
        return given.hex(" ").upper()
    return f'"{given}"' if isinstance(given, str) else f"{given:g}"


def initial(entry: Variable, node_id: int | None) -> str:
    """Return the value after power-up as text: the parameter value of a DCF, with the default that it replaces."""
    default = value(entry.default, entry, node_id)
    if entry.parameter_value is None:
        return default
    configured = value(entry.parameter_value, entry, node_id)
    return f"{configured} (DCF; default {default or 'none'})" if configured != default else configured


def limits(entry: Variable, node_id: int | None, *, whole: bool = False) -> str:
    """Return the limits as ``low..high``; empty if there are none, or (unless ``whole``) only those of the data type."""
    if entry.low is None and entry.high is None:
        return ""
    if not whole and _only_of_type(entry):
        return ""
    low, high = value(entry.low, entry, node_id), value(entry.high, entry, node_id)
    if not high:
        return f">= {low}"
    return f"{low}..{high}" if low else f"<= {high}"


def _only_of_type(entry: Variable) -> bool:
    if not entry.data_type.integer:
        return False
    bottom, top = entry.data_type.range
    low = entry.low.resolve(None) if isinstance(entry.low, Number) else entry.low
    high = entry.high.resolve(None) if isinstance(entry.high, Number) else entry.high
    return (low is None or low <= bottom) and (high is None or high >= top)


def pdo_direction(entry: Variable) -> str:
    """Return the PDOs into which an entry may be mapped (DS 306 4.6.3.2: rwr from, rww to the device); empty if none."""
    return _PDO_BY_ACCESS.get(entry.access, "TPDO/RPDO") if entry.pdo_mapping else ""


def type_name(entry: Variable) -> str:
    """Return the name of the data type in CiA 301; for a maker's type, its number."""
    kind = entry.data_type
    if not kind:
        return "no type"
    return "DOMAIN" if entry.object_type is ObjectType.DOMAIN and kind == 0 else kind.name


def full_name(entry: Object, sub: Variable) -> str:
    """Return a name that identifies an entry: for a sub-index, the name of its object before its own."""
    name = sub.denotation or sub.name
    return f"{entry.name}: {name}" if entry.is_record else name or entry.name


def cob_id(identifier: int) -> str:
    """Return the CAN identifier in a COB-ID entry, without its flags: ``181h``."""
    mask = cob.ID_MASK_29 if identifier & cob.EXTENDED else cob.ID_MASK_11
    return f"{identifier & mask:03X}h"


def findings(found: Iterable[EdsFinding]) -> str:
    """Return the number of findings of each severity, in words; empty if there are none."""
    counts = Counter(finding.severity for finding in found)
    return ", ".join(counted(counts[each], each.value) for each in Severity if counts[each])
