"""What a file says of an entry beside what CiA 301 and CiA 402 say of it, for the rules and for a person."""

from __future__ import annotations

from axisbus.cia402 import dictionary
from axisbus.cia402 import objects as cia402
from axisbus.cia402.dictionary import StandardObject
from axisbus.eds.model import Variable

READ_ONLY = frozenset(("ro", "const"))
_WRITABLE = frozenset(("rw", "rww", "rwr"))
_FITTING = {  # what a file may say for an access of the standard: process data has names of its own, const is always ro
    "ro": READ_ONLY,
    "const": READ_ONLY,
    "rw": _WRITABLE,
    "wo": frozenset(("wo", *_WRITABLE)),
}

# What a master moves in PDOs on every cycle; the PDO attributes of the other objects are not public.
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
    """Whether what a file says means what the standard says."""
    return not wanted or any(access in _FITTING[each] for each in wanted)


def row(index: int, subindex: int) -> StandardObject | None:
    """Return what CiA 301 or CiA 402 (on any axis) says of an entry, None where it says nothing.

    The row of an ARRAY stands for each of its elements. Of PDO parameters and the like, which come in numbers, nothing is said.
    """
    whole = dictionary.whole(index)
    if whole is None or not whole.single:
        return None
    of_elements = whole.object_type == "ARRAY" and whole.data_types and 1 <= subindex < 255
    return whole if of_elements else dictionary.entry(index, subindex)


def words(index: int, subindex: int) -> str:
    """Return such as ``CiA 402: Statusword, UNSIGNED16, ro, TPDO, mandatory``; empty where the standards say nothing."""
    found = dictionary.entry(index, subindex)
    if found is None:
        return ""
    category = found.category.partition(":")[0]
    modes = f"modes {' '.join(found.modes)}" if found.modes and found.modes != ("all",) else ""
    parts = [found.name, found.type_text, found.access_text, found.mapping, category, modes]
    return f"{found.standard}: " + ", ".join(part for part in parts if part)


def agrees(entry: Variable) -> bool:
    """Whether type and access are those of the standard (a constant counts as read-only), or the standard says nothing."""
    found = dictionary.entry(entry.index, entry.subindex)
    if found is None:
        return True
    access = "ro" if entry.access == "const" else entry.access[:2]
    known = {"ro" if each == "const" else each for each in found.access}
    return entry.data_type in found.data_types and access in known
