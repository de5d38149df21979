"""Compare two EDS files by meaning: numbers by value, formulas as formulas, in any order.

Theory of operation. Each group has one function that walks both models side by side and yields differences; none compares texts.
The PDOs are compared as layouts first (which objects are in which frame), because a changed mapping also appears as many changed
defaults. Differences in the layouts are left out of the defaults. [FileInfo] describes the file, not the device, and is not
compared.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from axisbus.cia301.datatypes import DataType
from axisbus.eds import layout
from axisbus.eds.io import values
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import DEVICE_NUMBERS, Eds, Object, Variable
from axisbus.eds.report import compare_object, consequences, overview, pdo_text, wording
from axisbus.eds.report.consequences import DifferenceGroup, EdsDifference
from axisbus.wording import counted

_DEVICE = ("VendorName", "ProductName", "OrderCode")
_COMMISSIONING = {
    "NodeID": "made for another node ID",
    "Baudrate": "made for another bit rate",
    "NodeName": "",
}


def diff(a: Eds, b: Eds, node_id: int | None = None) -> tuple[EdsDifference, ...]:
    """Return the differences of ``b`` from ``a``, by group and object; empty if both mean the same.

    With ``node_id`` (1 to 127) values are compared for that node-ID, so that ``$NODEID+0x180`` equals 0x185 for node 5.
    """
    shared = [(a.objects[index], b.objects[index]) for index in a.objects if index in b.objects]
    mapped = frozenset(_mapping_entries(a, b, node_id))
    found = [
        *_identity(a, b, node_id),
        *_pdos(a, b, node_id),
        *_dummies(a, b),
        *_presence(a, b, DifferenceGroup.REMOVED),
        *_presence(b, a, DifferenceGroup.ADDED),
    ]
    for one, other in shared:
        found += compare_object.object_differences(one, other, node_id, mapped)
    order = list(DifferenceGroup)
    return tuple(
        sorted(found, key=lambda each: (order.index(each.group), each.index or 0, each.subindex or 0))
    )


def _identity(a: Eds, b: Eds, node_id: int | None) -> Iterator[EdsDifference]:
    first_values, second_values = a.info.get("deviceinfo", {}), b.info.get("deviceinfo", {})
    for title in _DEVICE:
        texts = (
            overview.text(first_values.get(title.lower())),
            overview.text(second_values.get(title.lower())),
        )
        if texts[0] != texts[1]:
            yield EdsDifference(
                DifferenceGroup.IDENTITY, title, *texts, matters=consequences.DEVICE.get(title, "")
            )
    yield from _numbers(
        first_values, second_values, {title: consequences.DEVICE.get(title, "") for title in DEVICE_NUMBERS}
    )
    yield from _commissioning(a, b)
    yield from _modes(a, b, node_id)


def _commissioning(a: Eds, b: Eds) -> Iterator[EdsDifference]:
    """Yield the differences of two DCFs in the settings of their node; nothing if one file is an EDS."""
    first_values, second_values = (
        eds.info.get("devicecomissioning") or eds.info.get("devicecommissioning") or {} for eds in (a, b)
    )
    if not first_values or not second_values:
        return
    yield from _numbers(first_values, second_values, _COMMISSIONING, "DCF: ")


def _numbers(
    first_values: Mapping[str, str],
    second_values: Mapping[str, str],
    meanings: Mapping[str, str],
    of: str = "",
) -> Iterator[EdsDifference]:
    """Yield the differences of the numbers in an information section; ``meanings`` are the consequences, by key."""
    for title, meaning in meanings.items():
        given = first_values.get(title.lower(), "").strip(), second_values.get(title.lower(), "").strip()
        if _device_number(given[0]) != _device_number(given[1]):
            yield EdsDifference(DifferenceGroup.IDENTITY, f"{of}{title}", *given, matters=meaning)


def _device_number(text: str) -> int | str | None:
    """Return a number by its value; an absent switch is off (DS 306 4.5)."""
    number = values.plain(text)
    return (text or 0) if number is None else number


def _modes(a: Eds, b: Eds, node_id: int | None) -> Iterator[EdsDifference]:
    """Yield the modes that only one of the files lists."""
    first_values, second_values = (
        {(claim.axis, claim.short) for claim in overview.overview(eds, node_id).claims if claim.claimed}
        for eds in (a, b)
    )
    if not first_values or not second_values:
        return  # 6502h without a value is a difference of defaults
    for modes, change in (
        (first_values - second_values, "no longer claimed"),
        (second_values - first_values, "newly claimed"),
    ):
        if modes:
            description = " ".join(
                short if axis == 1 else f"{short} (axis {axis})" for axis, short in sorted(modes)
            )
            texts = (description, "") if change.startswith("no") else ("", description)
            yield EdsDifference(
                DifferenceGroup.IDENTITY,
                f"modes {change} (6502h)",
                *texts,
                matters=consequences.modes(change),
            )


def _pdos(a: Eds, b: Eds, node_id: int | None) -> Iterator[EdsDifference]:
    first_values, second_values = (
        {each.name: each for each in layout.layouts(eds, node_id)} for eds in (a, b)
    )
    for name in [*first_values, *(name for name in second_values if name not in first_values)]:
        one, other = first_values.get(name), second_values.get(name)
        if one is not None and other is not None:
            yield from _mapping(one, other)
            continue
        texts = [pdo_text.heading(each) if each is not None else "" for each in (one, other)]
        yield EdsDifference(DifferenceGroup.PDO, name, texts[0], texts[1], matters=consequences.pdo(one))


def _mapping(one: PdoLayout, other: PdoLayout) -> Iterator[EdsDifference]:
    before, after = (tuple(slot.mapped for slot in each.slots) for each in (one, other))
    if before != after:
        texts = [
            ", ".join(f"{slot.mapped} {slot.name}".strip() for slot in each.slots) for each in (one, other)
        ]
        yield EdsDifference(
            DifferenceGroup.PDO,
            f"{one.name} mapping",
            texts[0] or "nothing",
            texts[1] or "nothing",
            one.mapping,
            matters=consequences.mapping(one, other),
        )


def _dummies(a: Eds, b: Eds) -> Iterator[EdsDifference]:
    """Yield the difference of the data types that may fill space in a PDO."""
    texts = [", ".join(DataType(number).name for number in sorted(eds.dummies)) for eds in (a, b)]
    if a.dummies != b.dummies:
        meaning = "a mapping that fills space with them is refused" if a.dummies - b.dummies else ""
        yield EdsDifference(DifferenceGroup.PDO, "DummyUsage", texts[0], texts[1], matters=meaning)


def _mapping_entries(a: Eds, b: Eds, node_id: int | None) -> Iterator[tuple[int, int]]:
    """Yield the entries whose values are compared as mappings: the counts, and the counted entries of both files."""
    counted: dict[int, list[int]] = {}
    for eds in (a, b):
        for each in layout.layouts(eds, node_id):
            counted.setdefault(each.mapping, []).append(len(each.slots))
    for index, counts in counted.items():
        yield index, 0
        yield from ((index, subindex) for subindex in range(1, max(counts) + 1))


def _presence(a: Eds, b: Eds, group: DifferenceGroup) -> Iterator[EdsDifference]:
    """Yield the objects and entries of ``a`` that ``b`` does not have."""
    for entry in a:
        other = b.objects.get(entry.index)
        if other is None:
            yield _one_sided(
                entry,
                None,
                group,
                consequences.presence(a, entry.index, None, group is DifferenceGroup.REMOVED),
            )
            continue
        for sub in entry.subs.values():
            if sub.subindex not in other.subs and entry.is_record == other.is_record:
                text = consequences.presence(a, entry.index, sub.subindex, group is DifferenceGroup.REMOVED)
                yield _one_sided(entry, sub, group, text)


def _one_sided(entry: Object, sub: Variable | None, group: DifferenceGroup, meaning: str) -> EdsDifference:
    description = _object_text(entry) if sub is None else _entry_text(sub)
    removed = group is DifferenceGroup.REMOVED
    line = entry.line if sub is None else sub.line
    return EdsDifference(
        group,
        entry.name if sub is None else wording.full_name(entry, sub),
        description if removed else "",
        "" if removed else description,
        entry.index,
        None if sub is None else sub.subindex,
        meaning,
        line if removed else 0,
        0 if removed else line,
    )


def _object_text(entry: Object) -> str:
    if entry.is_record or 0 not in entry.subs:
        return f"{entry.object_type.name} with {counted(len(entry.subs), 'sub-index', 'sub-indices')}"
    return _entry_text(entry.subs[0])


def _entry_text(sub: Variable) -> str:
    return f"{wording.type_name(sub)} {sub.access}"


# -- Differences between two EDS files as lines for a user, and as plain values for programs ---------------------------


_DIGITS = re.compile(r"\d+")


def lines(a: Eds, b: Eds, differences: Sequence[EdsDifference], node_id: int | None) -> Iterator[str]:
    """Yield the comparison as lines: the files, the differences that matter for a master, then all differences by group."""
    yield f"A  {_file(a)}"
    yield f"B  {_file(b)}"
    if node_id is not None:
        yield f"   values for node {node_id}"
    if not differences:
        yield "no difference in meaning"
        return
    relevant = [each for each in differences if each.matters]
    if relevant:
        yield ""
        yield f"Important for a master: {len(relevant)}"
        for run in _runs(relevant):
            yield f"  {_where(run)}{run[0].what}: {run[0].matters}"
    for group, members in groupby(differences, key=lambda each: each.group):
        found = list(members)
        yield ""
        yield f"{group.value}: {len(found)}"
        for run in _runs(found):
            yield f"  {_where(run)}{run[0].what}: {change(run[0])}{_address(run[0])}"


def change(each: EdsDifference) -> str:
    """Return both sides of a difference: ``10 -> 20``; an absent side is a dash."""
    if each.group is DifferenceGroup.ADDED:
        return each.b
    return each.a if each.group is DifferenceGroup.REMOVED else f"{each.a or '-'} -> {each.b or '-'}"


def plain(a: Eds, b: Eds, differences: Sequence[EdsDifference], node_id: int | None) -> dict[str, object]:
    """Return the comparison for JSON: counts by group, and each difference; lines count from 1 (0: none)."""
    counts = Counter(each.group for each in differences)
    return {
        "a": a.source,
        "b": b.source,
        "node_id": node_id,
        "different": bool(differences),
        "counts": {group.value: counts[group] for group in DifferenceGroup},
        "differences": [
            {
                "group": each.group.value,
                "index": each.index,
                "subindex": each.subindex,
                "what": each.what,
                "a": each.a,
                "b": each.b,
                "matters": each.matters,
                "line_a": each.line_a,
                "line_b": each.line_b,
            }
            for each in differences
        ],
    }


def _file(eds: Eds) -> str:
    info = eds.info.get("fileinfo", {})
    version = overview.file_version(info)
    date = info.get("modificationdate") or info.get("creationdate", "")
    about = ", ".join(
        part
        for part in (overview.overview(eds).title, f"file version {version}" if version else "", date)
        if part
    )
    return f"{eds.source} ({about})"


def _runs(found: Sequence[EdsDifference]) -> Iterator[list[EdsDifference]]:
    """Yield runs of neighbouring sub-indices with the same difference."""
    run: list[EdsDifference] = []
    for each in found:
        if run and not _follows(run[-1], each):
            yield run
            run = []
        run.append(each)
    if run:
        yield run


def _follows(one: EdsDifference, other: EdsDifference) -> bool:
    if one.subindex is None or other.index != one.index or other.subindex != one.subindex + 1:
        return False
    return _key(one) == _key(other)


def _key(each: EdsDifference) -> tuple[DifferenceGroup, str, str, str, str]:
    return each.group, _DIGITS.sub("#", each.what), each.a, each.b, each.matters


def _where(run: Sequence[EdsDifference]) -> str:
    first, last = run[0], run[-1]
    if first.index is None:
        return ""
    if len(run) == 1:
        return f"{wording.address_text(first.index, first.subindex)} "
    return f"{wording.address_text(first.index, first.subindex)}-{last.subindex:02X} "


def _address(each: EdsDifference) -> str:
    texts = [f"{side}:{line}" for side, line in (("A", each.line_a), ("B", each.line_b)) if line]
    return f"  ({', '.join(texts)})" if texts else ""
