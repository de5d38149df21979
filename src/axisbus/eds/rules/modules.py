"""Rules for modular devices: the contents of each module, and the connected modules (DS 306 6)."""

from __future__ import annotations

import re
from collections.abc import Iterator

from axisbus.eds.io import values
from axisbus.eds.io.text import Section
from axisbus.eds.rules.context import Hit, RuleContext, finds, number, short

_OF_MODULE = re.compile(r"m([0-9]+)(moduleinfo|comments|fixedobjects|subextends|fixed.*|subext.*)")
_INFO = ("ProductName", "ProductVersion", "ProductRevision", "OrderCode")
_EXTENSION_COUNT = re.compile(r"(?:0[xX][0-9A-Fa-f]+|[0-9]+)(?:\s*;\s*(?:0[xX][0-9A-Fa-f]+|[0-9]+))?")


@finds("X001")
def missing_modules(context: RuleContext) -> Iterator[Hit]:
    """X001."""
    section = context.section("supportedmodules")
    if section is None:
        return
    count = number(section, "nrofentries")
    if count is None:
        yield context.at(section, "nrofentries", "[SupportedModules] does not say NrOfEntries")
        return
    for module in range(1, min(count, 0xFFFF) + 1):
        if context.section(f"m{module}moduleinfo") is None:
            text = (
                f"[SupportedModules] says NrOfEntries={count}, but there is no section [M{module}ModuleInfo]"
            )
            yield context.at(section, "nrofentries", text)
            break


@finds("X002")
def foreign_modules(context: RuleContext) -> Iterator[Hit]:
    """X002."""
    count = number(context.section("supportedmodules"), "nrofentries") or 0
    for name, section in context.document.sections.items():
        found = _OF_MODULE.fullmatch(name)
        if found and not 1 <= int(found[1]) <= count:
            yield context.at(
                section, "", f"[{section.name}] is of no module that [SupportedModules] counts ({count})"
            )


@finds("X003")
def module_info(context: RuleContext) -> Iterator[Hit]:
    """X003."""
    for _, section in _of_kind(context, "moduleinfo"):
        absent = [name for name in _INFO if not section.entries.get(name.lower())]
        if absent:
            yield context.at(section, "", f"[{section.name}] has no {', '.join(absent)}")


@finds("X004")
def counts(context: RuleContext) -> Iterator[Hit]:
    """X004."""
    lists = [section for kind in ("fixedobjects", "subextends") for _, section in _of_kind(context, kind)]
    connected = context.section("connectedmodules")
    for section in (*lists, *([connected] if connected is not None else ())):
        yield from context.miscounted(section, "NrOfEntries")


@finds("X005")
def missing_parts(context: RuleContext) -> Iterator[Hit]:
    """X005."""
    for kind, part in (("fixedobjects", "Fixed"), ("subextends", "SubExt")):
        for module, section in _of_kind(context, kind):
            for key, text in section.entries.items():
                index = values.plain(text) if key[:1].isdigit() else None
                if index is not None and context.section(f"m{module}{part.lower()}{index:04x}") is None:
                    message = f"[{section.name}] names {index:04X}, but there is no section [M{module}{part}{index:04X}]"
                    yield context.at(section, key, message, index)


@finds("X006")
def extension_counts(context: RuleContext) -> Iterator[Hit]:
    """X006."""
    for name, section in context.document.sections.items():
        found = _OF_MODULE.fullmatch(name)
        if found is None or not found[2].startswith("subext") or found[2] == "subextends":
            continue
        given = section.entries.get("count", "")
        if not _EXTENSION_COUNT.fullmatch(given):
            text = f"[{section.name}] Count={short(given)} is neither a number nor 0;bits"
            yield context.at(section, "count", text)


@finds("X007")
def unknown_connected(context: RuleContext) -> Iterator[Hit]:
    """X007."""
    connected = context.section("connectedmodules")
    count = number(context.section("supportedmodules"), "nrofentries") or 0
    for key, text in connected.entries.items() if connected is not None else ():
        module = values.plain(text)
        if key[:1].isdigit() and (module is None or not 1 <= module <= count):
            yield context.at(
                connected,
                key,
                f"[ConnectedModules] {key}={short(text)} is not one of the {count} supported modules",
            )


def _of_kind(context: RuleContext, kind: str) -> Iterator[tuple[int, Section]]:
    for name, section in context.document.sections.items():
        found = _OF_MODULE.fullmatch(name)
        if found and found[2] == kind:
            yield int(found[1]), section
