"""The contents of a device's reference, as values without mark-up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from axisbus.cia402 import value_texts
from axisbus.cia402.value_texts import Table
from axisbus.eds import layout
from axisbus.eds.layout import PdoLayout
from axisbus.eds.model import Eds, EdsFinding, Object, Variable
from axisbus.eds.report import overview, show, wording
from axisbus.eds.report.overview import Area, EdsOverview
from axisbus.wording import counted

Fact = tuple[str, str]


@dataclass(frozen=True, slots=True)
class ReferenceRow:
    """One entry, or a run of sub-indices that differ only in their number (``address`` ``01-08``); all texts may be empty.

    ``address`` is the sub-index, empty for an object without sub-indices. ``remarks`` are (title, text).
    """

    address: str
    name: str
    data_type: str
    access: str
    pdo: str
    value: str
    limits: str
    remarks: tuple[Fact, ...] = ()


@dataclass(frozen=True, slots=True)
class Explained:
    """Tables of bits and values of one entry; ``described_at`` is the index of the object that already shows the same tables."""

    name: str
    tables: tuple[Table, ...] = ()
    described_at: int | None = None


@dataclass(frozen=True, slots=True)
class ObjectPage:
    """One object: ``kind`` is its object type in words, empty for a plain variable."""

    index: int
    name: str
    kind: str
    rows: tuple[ReferenceRow, ...]
    explained: tuple[Explained, ...]
    line: int

    @property
    def anchor(self) -> str:
        """The target of links to the object."""
        return f"o{self.index:04X}"

    @property
    def address_text(self) -> str:
        """The object's index for display."""
        return wording.address_text(self.index)


@dataclass(frozen=True, slots=True)
class AreaPage:
    """One area of the dictionary; ``anchor`` is the target of links to it."""

    title: str
    anchor: str
    objects: tuple[ObjectPage, ...]


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One mode of operation on one axis (from 1): its names, its bit in 6502h in words, and its missing objects."""

    axis: int
    short: str
    name: str
    claimed: str
    missing: str


@dataclass(frozen=True, slots=True)
class DeviceReference:
    """The whole reference; ``pdos`` are drawn, ``axes`` is 0 if the device is no drive."""

    title: str
    source: str
    facts: tuple[Fact, ...]
    axes: int
    modes: tuple[ModeRow, ...]
    pdos: tuple[PdoLayout, ...]
    areas: tuple[AreaPage, ...]
    findings: tuple[EdsFinding, ...]

    @property
    def verdict(self) -> str:
        """The number of findings, in words."""
        return wording.findings(self.findings) or "nothing was found wrong"


def reference(
    eds: Eds, node_id: int | None = None, findings: Sequence[EdsFinding] | None = None
) -> DeviceReference:
    """Return the reference of a device; values are those for ``node_id`` (1 to 127); without one, formulas are shown.

    ``findings`` are those of a check, else those of the reading.
    """
    summary = overview.overview(eds, node_id)
    pdos = layout.layouts(eds, node_id)
    return DeviceReference(
        summary.title,
        PurePath(eds.source).name,
        tuple(_facts(eds, summary, node_id)),
        summary.axes,
        tuple(_modes(summary)),
        pdos,
        tuple(_Pages(eds, node_id, pdos).areas()),
        tuple(eds.findings if findings is None else findings),
    )


def _facts(eds: Eds, summary: EdsOverview, node_id: int | None) -> Iterator[Fact]:
    device = eds.info.get("deviceinfo", {})
    identity = summary.identity
    for title, text in (
        ("Maker", summary.vendor),
        ("Product", summary.product),
        ("Order code", summary.order_code),
        ("Vendor-ID", _hex(identity.vendor_id)),
        ("Product code", _hex(identity.product_code)),
        ("Revision number", _hex(identity.revision)),
        (
            "Device type",
            f"{_hex(summary.device_type)}, {summary.kind}" if summary.device_type is not None else "",
        ),
        ("Axes", str(summary.axes) if summary.axes > 1 else ""),
        (
            "Bit rates",
            ", ".join(map(str, summary.bit_rates)) + " kbit/s" if summary.bit_rates else "none given",
        ),
        ("LSS", "supported" if device.get("lss_supported", "").strip() in ("1", "0x1", "0x01") else ""),
        ("Node ID", str(node_id) if node_id is not None else "not given: values with $NODEID are formulas"),
        ("Contents", overview.contents(eds)),
        ("File", _file(eds)),
    ):
        if text:
            yield title, text


def _hex(number: int | None) -> str:
    return "" if number is None else f"0x{number & 0xFFFF_FFFF:08X}"


def _file(eds: Eds) -> str:
    """Return name, version, date and author of the file."""
    info = eds.info.get("fileinfo", {})
    version = overview.file_version(info)
    date = overview.text(info.get("modificationdate")) or overview.text(info.get("creationdate"))
    author = overview.text(info.get("modifiedby")) or overview.text(info.get("createdby"))
    parts = (
        PurePath(eds.source).name,
        f"version {version}" if version else "",
        date,
        f"by {author}" if author else "",
    )
    return ", ".join(part for part in parts if part)


def _modes(summary: EdsOverview) -> Iterator[ModeRow]:
    claim_texts = {True: "yes", False: "no", None: "not said"}
    for claim in summary.claims:
        missing = ", ".join(wording.address_text(index) for index in claim.missing)
        yield ModeRow(claim.axis, claim.short, claim.mode.text, claim_texts[claim.claimed], missing)


class _Pages:
    """Makes the pages of the objects; holds the index of the object that shows each table, so that no table is printed twice."""

    def __init__(self, eds: Eds, node_id: int | None, pdos: tuple[PdoLayout, ...]) -> None:
        self._eds = eds
        self._node_id = node_id
        self._pdos = pdos
        self._printed: dict[tuple[Table, ...], int] = {}

    def areas(self) -> Iterator[AreaPage]:
        for number, area in enumerate(overview.areas(self._eds), 1):
            yield AreaPage(area.title, f"area{number}", tuple(self._objects(area)))

    def _objects(self, area: Area) -> Iterator[ObjectPage]:
        for entry in area.objects:
            yield ObjectPage(
                entry.index,
                entry.denotation or entry.name,
                _kind(entry),
                tuple(self._rows(entry)),
                tuple(self._explained(entry)),
                entry.line,
            )

    def _rows(self, entry: Object) -> Iterator[ReferenceRow]:
        for run in show.runs(list(entry.subs.values())):
            together = len({tuple(self._remarks(entry, sub)) for sub in run}) == 1
            for group in [run] if together else [[sub] for sub in run]:
                yield self._row(entry, group)

    def _row(self, entry: Object, run: list[Variable]) -> ReferenceRow:
        first, last = run[0], run[-1]
        address = f"{first.subindex:02X}" if entry.is_record else ""
        name = first.denotation or first.name
        if len(run) > 1:
            address, name = f"{address}-{last.subindex:02X}", f"{name} … ({len(run)} alike)"
        return ReferenceRow(
            address,
            name,
            wording.type_name(first),
            first.access,
            wording.pdo_direction(first),
            show.value_text(self._eds, first, self._node_id),
            wording.limits(first, self._node_id),
            tuple(self._remarks(entry, first)),
        )

    def _remarks(self, entry: Object, sub: Variable) -> Iterator[Fact]:
        return show.remarks(entry, sub, self._pdos)

    def _explained(self, entry: Object) -> Iterator[Explained]:
        described_at: dict[int, list[str]] = {}
        for sub in entry.subs.values():
            tables = value_texts.tables(sub.index, sub.subindex)
            if not tables:
                continue
            name = sub.name if entry.is_record else ""
            first = self._printed.setdefault(tables, entry.index)
            if first == entry.index:
                yield Explained(name, tables)
            else:
                described_at.setdefault(first, []).append(name)
        yield from (Explained(", ".join(names), described_at=index) for index, names in described_at.items())


def _kind(entry: Object) -> str:
    count = len(entry.subs)
    if entry.is_record:
        return f"{entry.object_type.name}, {counted(count, 'sub-index', 'sub-indices')}"
    return "" if entry.object_type.name == "VAR" else entry.object_type.name
