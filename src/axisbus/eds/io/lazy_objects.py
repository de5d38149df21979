"""The objects of one file, each made on first access."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from axisbus.eds.io import compact, modules, sections, text, values
from axisbus.eds.io.build import EdsObjectBuilder
from axisbus.eds.io.findings import Findings
from axisbus.eds.io.sections import SectionIndex
from axisbus.eds.io.text import EdsText
from axisbus.eds.model import EdsFinding, Object


class FileObjects(Mapping[int, Object]):
    """The objects that a document describes, by index, ascending.

    Its only state are the objects and findings made so far. Several threads may access it at the same time: at worst each makes its
    own object, all are equal, and one of them is stored.
    """

    def __init__(self, document: EdsText, parts: SectionIndex) -> None:
        self.document = document
        self.parts = parts
        described = parts.heads.keys() | parts.subs.keys()
        self._implied = _implied(parts.info, described)
        self._indices = dict.fromkeys(sorted(described | self._implied.keys()))
        self._builder = EdsObjectBuilder(document, parts)
        self._objects_made: dict[int, Object] = {}
        self._findings: tuple[EdsFinding, ...] | None = None

    def __getitem__(self, index: int) -> Object:
        found = self._objects_made.get(index)
        if found is None:
            if index not in self._indices:
                raise KeyError(index)
            found = self._objects_made.setdefault(index, self._make(index, self._builder))
        return found

    def __contains__(self, index: object) -> bool:
        return index in self._indices

    def __iter__(self) -> Iterator[int]:
        return iter(self._indices)

    def __len__(self) -> int:
        return len(self._indices)

    def _make(self, index: int, builder: EdsObjectBuilder) -> Object:
        implied = self._implied.get(index)
        return builder.object(index) if implied is None else compact.pdo(index, implied)

    def findings(self) -> tuple[EdsFinding, ...]:
        """Return the oddities of the file, in the order of the lines; the first call goes through the whole file."""
        if self._findings is None:
            found = Findings()
            self.go_through(found)
            self._findings = found.all()
        return self._findings

    def go_through(self, found: Findings) -> None:
        """Add all oddities of the file to ``found``, in no particular order."""
        document = self.document
        text.report(document, found)
        sections.report(document.sections, self.parts, found)
        builder = EdsObjectBuilder(document, self.parts, found)
        for index in self._indices:
            self._objects_made.setdefault(index, self._make(index, builder))
        modules.modules(document, found)
        node_id(document, found)


def node_id(document: EdsText, findings: Findings | None = None) -> int | None:
    """Return the node-ID of a DCF, under either spelling of the section's name."""
    section = document.sections.get("devicecomissioning")
    if section is None:
        section = document.sections.get("devicecommissioning")
        if section is None:
            return None
        if findings is not None:
            findings.add("K001", f"section [{section.name}]", line=section.line)
    given = section.entries.get("nodeid", "")
    number = values.plain(given)
    if number is not None and 1 <= number <= 127:
        return number
    if findings is not None:
        line, column = document.location(section, "nodeid")
        findings.add("K003", f"NodeID={given[:40]} is not a node ID", line=line, column=column)
    return None


def _implied(info: Mapping[str, Mapping[str, str]], described: set[int]) -> dict[int, compact.Implied]:
    """Return the PDO parameters that CompactPDO implies."""
    device = info.get("deviceinfo", {})
    parts = values.plain(device.get("compactpdo", "")) or 0
    if parts <= 0:
        return {}
    rpdos = values.plain(device.get("nrofrxpdo", "")) or 0
    tpdos = values.plain(device.get("nroftxpdo", "")) or 0
    return compact.pdos(rpdos, tpdos, parts, described)
