"""The axes of one device: the objects of CiA 402 repeat every 800h, up to eight times (CiA 402-2 5)."""

from __future__ import annotations

OFFSET = 0x800
COUNT = 8
PROFILE_AREA = range(0x6000, 0x6000 + COUNT * OFFSET)
FIRST_AXIS = PROFILE_AREA[:OFFSET]


def axis_of(index: int) -> int:
    """Return the axis (from 1) that an object belongs to; 1 if all axes share it."""
    return 1 + (index - PROFILE_AREA.start) // OFFSET if index in PROFILE_AREA else 1


def first_axis(index: int) -> int:
    """Return the index of the same object on the first axis; an index outside the profile area is unchanged."""
    return index - offset(axis_of(index))


def own_index(index: int, axis: int) -> int:
    """Return the index of an object of the first axis on ``axis`` (from 1); other objects are shared by all axes."""
    return index + offset(axis) if index in FIRST_AXIS else index


def offset(axis: int) -> int:
    """Return the difference between the indices of ``axis`` (from 1) and those of the first axis."""
    return OFFSET * (axis - 1)


def indices_of(axis: int) -> range:
    """Return the indices of ``axis`` (from 1 to 8)."""
    return PROFILE_AREA[offset(axis) : offset(axis) + OFFSET]
