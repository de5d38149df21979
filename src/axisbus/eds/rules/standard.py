"""Compare entries of a file with CiA 301 and CiA 402, for the rules and for display."""

from __future__ import annotations

from axisbus.cia402 import dictionary
from axisbus.cia402 import objects as cia402
from axisbus.cia402.dictionary import StandardObject
from axisbus.eds.model import Variable

READ_ONLY = frozenset(("ro", "const"))
_WRITABLE = frozenset(("rw", "rww", "rwr"))
_FITTING = {  # accesses in a file that match one of the standard: process data has names of its own, const is always ro
    "ro": READ_ONLY,
    "const": READ_ONLY,
    "rw": _WRITABLE,
    "wo": frozenset(("wo", *_WRITABLE)),
}

# Objects that a master transfers in PDOs in every cycle; the PDO attributes of the other objects are not public.
CYCLIC = frozenset(
    (
        *(
            cia402.CONTROLWORD,
            cia402.STATUSWORD,
            cia402.MODES_OF_OPERATION,
            cia402.MODES_OF_OPERATION_DISPLAY,
        ),
        *(cia402.POSITION_ACTUAL, cia402.VELOCITY_ACTUAL, cia402.TORQUE_ACTUAL),
        *(cia402.TARGET_POSITION, cia402.TARGET_VELOCITY, cia402.TARGET_TORQUE),
    )
)


def access_fits(access: str, wanted: frozenset[str]) -> bool:
    """Whether a file's access is equivalent to the standard's."""
    return not wanted or any(access in _FITTING[each] for each in wanted)


def row(index: int, subindex: int) -> StandardObject | None:
    """Return the row of CiA 301 or CiA 402 (on any axis) for an entry, None if there is none.

    The row of an ARRAY applies to each of its elements. PDO parameters and other objects that exist many times have no row.
    """
    whole = dictionary.whole(index)
    if whole is None or not whole.single:
        return None
    of_elements = whole.object_type == "ARRAY" and whole.data_types and 1 <= subindex < 255
    return whole if of_elements else dictionary.entry(index, subindex)


def words(index: int, subindex: int) -> str:
    """Return a text such as ``CiA 402: Statusword, UNSIGNED16, ro, TPDO, mandatory``; empty if the entry is not in a standard."""
    found = dictionary.entry(index, subindex)
    if found is None:
        return ""
    category = found.category.partition(":")[0]
    modes = f"modes {' '.join(found.modes)}" if found.modes and found.modes != ("all",) else ""
    parts = [found.name, found.type_text, found.access_text, found.mapping, category, modes]
    return f"{found.standard}: " + ", ".join(part for part in parts if part)


def agrees(entry: Variable) -> bool:
    """Whether type and access match the standard (a constant counts as read-only), or the standard does not define the entry."""
    found = dictionary.entry(entry.index, entry.subindex)
    if found is None:
        return True
    access = "ro" if entry.access == "const" else entry.access[:2]
    known = {"ro" if each == "const" else each for each in found.access}
    return entry.data_type in found.data_types and access in known
