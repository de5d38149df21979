"""Filter decoded frames by node, kind and object, given as ``KEY=VALUE,VALUE`` texts."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable

from axisbus.errors import ArgumentError
from axisbus.trace.decoded import Decoded, FrameKind, ObjectValue
from axisbus.trace.frame_formats import address

Wanted = Callable[[Decoded], bool]

_KINDS = {kind.value.lower().replace(" ", "-"): frozenset({kind}) for kind in FrameKind} | {
    "pdo": frozenset({FrameKind.TPDO, FrameKind.RPDO}),
    "boot-up": frozenset({FrameKind.BOOT_UP}),
}
_LAST_NODE = 127
_REMEDY = "write node=5 (or an axis: node=x), kind=sdo,emcy or object=6041; several are joined by commas"


def parse(texts: Iterable[str], axes: Collection[str] = ()) -> Wanted:
    """Return a test for frames: all texts must match (``node=1,2``, ``kind=sdo``, ``object=6041``), each by any of its values.

    A node is given by its ID or by one of ``axes``, an object by its index, with or without sub-index (hexadecimal: ``6041``,
    ``1018:1``), or by a part of its name.

    Raises:
        ArgumentError: a text is not a filter.
    """
    tests = [_test(text, axes) for text in texts]
    return lambda one: all(test(one) for test in tests)


def _test(text: str, axes: Collection[str]) -> Wanted:
    key, sign, rest = text.partition("=")
    values = [value.strip() for value in rest.split(",") if value.strip()]
    makers = {"node": lambda value: _node(value, axes), "kind": _kind, "object": _object}
    if not sign or key.strip() not in makers or not values:
        raise ArgumentError(f"{text!r} is not a filter", remedy=_REMEDY)
    tests = [makers[key.strip()](value) for value in values]
    return lambda one: any(test(one) for test in tests)


def _node(text: str, axes: Collection[str]) -> Wanted:
    if text.isdecimal() and int(text) <= _LAST_NODE:
        number = int(text)
        return lambda one: one.node == number
    if text in axes:
        return lambda one: text in one.name.split(",")
    known = f"axes of the cell are {', '.join(axes)}" if axes else "axes are known with a cell file only"
    raise ArgumentError(
        f"{text!r} is not a node", observed=known, remedy="give a node ID from 1 to 127, or an axis"
    )


def _kind(text: str) -> Wanted:
    kinds = _KINDS.get(text.lower())
    if kinds is None:
        near = difflib.get_close_matches(text.lower(), _KINDS, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ArgumentError(f"{text!r} is not a kind of frame", remedy=f"{hint}there are {', '.join(_KINDS)}")
    return lambda one: one.kind in kinds


def _object(text: str) -> Wanted:
    wanted_address = _address(text)
    if wanted_address is not None:
        index, subindex = wanted_address
        return lambda one: any(
            value.index == index and subindex in (None, value.subindex) for value in one.values
        )
    words = text.lower().split()
    return lambda one: any(_named(value, words) for value in one.values)


def _named(value: ObjectValue, words: list[str]) -> bool:
    name = address(value).lower()
    return all(word in name for word in words)


def _address(text: str) -> tuple[int, int | None] | None:
    index, sign, sub = text.lower().removeprefix("0x").partition(":")
    try:
        digits = index.removesuffix("h")
        return (int(digits, 16), int(sub, 16) if sign else None) if len(digits) == 4 else None
    except ValueError:
        return None
