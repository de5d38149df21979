"""Small object dictionaries written by hand, so that the simulated drive is tested without a file reader."""

from __future__ import annotations

from axisbus.cia301.datatypes import DataType
from axisbus.eds.model import Eds, Number, Object, ObjectType, Variable

U8, U16, U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
I8, I16, I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER32

Row = tuple[int, int, DataType, str, int | None]

# index, sub-index, type, access, default. The objects of a complete drive.
DRIVE: list[Row] = [
    (0x6007, 0, I16, "rw", 1),
    (0x603F, 0, U16, "ro", 0),
    (0x6040, 0, U16, "rw", 0),
    (0x6041, 0, U16, "ro", None),
    (0x605A, 0, I16, "rw", 2),
    (0x605B, 0, I16, "rw", 0),
    (0x605C, 0, I16, "rw", 1),
    (0x605D, 0, I16, "rw", 1),
    (0x605E, 0, I16, "rw", 2),
    (0x6060, 0, I8, "rw", 0),
    (0x6061, 0, I8, "ro", 0),
    (0x6062, 0, I32, "ro", None),
    (0x6064, 0, I32, "ro", None),
    (0x6065, 0, U32, "rw", 5000),
    (0x6066, 0, U16, "rw", 20),
    (0x6067, 0, U32, "rw", 10),
    (0x6068, 0, U16, "rw", 0),
    (0x606B, 0, I32, "ro", None),
    (0x606C, 0, I32, "ro", None),
    (0x606D, 0, U16, "rw", 100),
    (0x606E, 0, U16, "rw", 10),
    (0x606F, 0, U16, "rw", 50),
    (0x6070, 0, U16, "rw", 10),
    (0x6071, 0, I16, "rw", 0),
    (0x6072, 0, U16, "rw", 2000),
    (0x6074, 0, I16, "ro", None),
    (0x6077, 0, I16, "ro", None),
    (0x607A, 0, I32, "rw", 0),
    (0x607C, 0, I32, "rw", 0),
    (0x607D, 1, I32, "rw", 0),
    (0x607D, 2, I32, "rw", 0),
    (0x607E, 0, U8, "rw", 0),
    (0x607F, 0, U32, "rw", 0),
    (0x6080, 0, U32, "rw", 0),
    (0x6081, 0, U32, "rw", 20000),
    (0x6082, 0, U32, "rw", 0),
    (0x6083, 0, U32, "rw", 100000),
    (0x6084, 0, U32, "rw", 50000),
    (0x6085, 0, U32, "rw", 400000),
    (0x6087, 0, U32, "rw", 1000),
    (0x6098, 0, I8, "rw", 0),
    (0x6099, 1, U32, "rw", 5000),
    (0x6099, 2, U32, "rw", 500),
    (0x609A, 0, U32, "rw", 50000),
    (0x60B0, 0, I32, "rw", 0),
    (0x60B1, 0, I32, "rw", 0),
    (0x60B2, 0, I16, "rw", 0),
    (0x60C2, 1, U8, "rw", 10),
    (0x60C2, 2, I8, "rw", -3),
    (0x60C5, 0, U32, "rw", 0),
    (0x60C6, 0, U32, "rw", 0),
    (0x60F2, 0, U16, "rw", 0),
    (0x60F4, 0, I32, "ro", None),
    (0x60FD, 0, U32, "ro", None),
    (0x60FF, 0, I32, "rw", 0),
    (0x6502, 0, U32, "ro", 0x3AD),  # pp pv tq hm csp csv cst
]
# The communication profile: identity, heartbeat in both directions, storing, two PDOs in each direction.
NODE: list[Row] = [
    (0x1000, 0, U32, "ro", 0x00020192),
    (0x1001, 0, U8, "ro", 0),
    (0x1003, 0, U8, "rw", 0),
    *[(0x1003, sub, U32, "ro", None) for sub in range(1, 5)],
    (0x1005, 0, U32, "rw", 0x80),
    (0x1008, 0, DataType.VISIBLE_STRING, "const", None),
    (0x1010, 1, U32, "rw", 1),
    (0x1011, 1, U32, "rw", 1),
    (0x1014, 0, U32, "rw", 0x80),
    (0x1016, 1, U32, "rw", 0),
    (0x1016, 2, U32, "rw", 0),
    (0x1017, 0, U16, "rw", 0),
    (0x1018, 1, U32, "ro", 0x1234),
    (0x1029, 1, U8, "rw", 0),
]


def _pdo_rows() -> list[Row]:
    rows: list[Row] = []
    mappings = {
        0x1600: (0x60400010, 0x607A0020),
        0x1601: (0x60400010, 0x60FF0020),
        0x1A00: (0x60410010, 0x60640020),
        0x1A01: (0x60410010, 0x606C0020),
    }
    for index, entries in mappings.items():
        number = index & 0x1FF
        transmit = index >= 0x1A00
        base = (0x180 if transmit else 0x200) + 0x100 * number
        rows.append((index - 0x200, 1, U32, "rw", base))
        rows.append((index - 0x200, 2, U8, "rw", 255))
        rows.append((index - 0x200, 3, U16, "rw", 0))
        rows.append((index - 0x200, 5, U16, "rw", 0))
        rows.append((index, 0, U8, "rw", len(entries)))
        padded = (*entries, *[0] * (8 - len(entries)))
        rows.extend((index, sub, U32, "rw", entry) for sub, entry in enumerate(padded, 1))
    return rows


NODE += _pdo_rows()
_PLUS_NODE_ID = {(0x1014, 0), (0x1400, 1), (0x1401, 1), (0x1800, 1), (0x1801, 1)}
_NOT_MAPPABLE = {0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E}
_RECORDS = {0x607D, 0x6099, 0x60C2, 0x1003, 0x1010, 0x1011, 0x1016, 0x1018, 0x1029}


def make_eds(rows: list[Row], **changes: int) -> Eds:
    """Make a dictionary of rows; ``x6083=0`` changes a default, ``x6083_1=0`` that of a sub-index."""
    objects: dict[int, dict[int, Variable]] = {}
    for index, sub, data_type, access, default in rows:
        key = f"x{index:04X}_{sub}" if f"x{index:04X}_{sub}" in changes else f"x{index:04X}"
        value = changes.get(key, default)
        number = None if value is None else Number(value, (index, sub) in _PLUS_NODE_ID)
        mappable = index >= 0x2000 and index not in _NOT_MAPPABLE
        objects.setdefault(index, {})[sub] = Variable(
            index, sub, f"{index:04X}:{sub}", data_type, access, number, pdo_mapping=mappable
        )
    for index, subs in objects.items():
        if max(subs) > 0 and 0 not in subs:
            subs[0] = Variable(index, 0, "highest", U8, "ro", Number(max(subs)))
    made = {
        index: Object(index, f"{index:04X}", ObjectType.RECORD if max(subs) else ObjectType.VAR, subs)
        for index, subs in objects.items()
    }
    return Eds("by hand", made, {})


def drive_eds(**changes: int) -> Eds:
    """A drive's objects with both profiles."""
    return make_eds(NODE + DRIVE, **changes)


def without(*indices: int) -> Eds:
    """The same without some objects."""
    return make_eds([row for row in NODE + DRIVE if row[0] not in indices])


def two_axes() -> Eds:
    """A device of two axes, the second at +800h."""
    second = [(index + 0x800, sub, kind, access, default) for index, sub, kind, access, default in DRIVE]
    return make_eds(NODE + DRIVE + second)
