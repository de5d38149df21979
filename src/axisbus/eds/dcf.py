"""Convert an EDS to the DCF of one node, and back: node-ID, bit rate, names, and parameter values (DS 306 5)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

from axisbus.eds import assign
from axisbus.eds.io import compact, edit, reader, values
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText, Section
from axisbus.eds.model import BAUD_RATES as BAUD_RATES
from axisbus.eds.model import Eds, Number, Variable
from axisbus.errors import ArgumentError, EdsError

_SECTION = "DeviceComissioning"  # the standard's own spelling
_MISSPELT = "devicecommissioning"
_OF_A_DCF = ("parametervalue", "denotation", "uploadfile", "downloadfile")
_MAX_U32 = 0xFFFF_FFFF


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of a DCF beside its values; None leaves a setting out, or leaves it unchanged.

    ``node_id`` is 1 to 127, ``baudrate`` in kbit/s one of CiA 301's. ``file_name`` and ``last_eds`` are the names of the DCF and of
    its EDS, for [FileInfo]. ``serial`` is the serial number of the one device that the DCF describes.
    """

    node_id: int
    baudrate: int | None = None
    node_name: str | None = None
    network_name: str | None = None
    net_number: int | None = None
    manager: bool | None = None
    serial: int | None = None
    file_name: str | None = None
    last_eds: str | None = None


def make(
    reading: EdsParseResult, settings: Settings, parameters: Iterable[tuple[Variable, str]] = ()
) -> EdsParseResult:
    """Return the DCF of a node: ``reading`` (an EDS or DCF) with the settings, and with each text as its entry's ParameterValue.

    All other lines stay as they are. The texts are in the format of ``assign.text_for``; the entries belong to this reading.

    Raises:
        ArgumentError: a setting is out of range, or an entry cannot be written or cannot have the value.
        LimitError: a value does not fit its type, or is outside the limits of its entry.
        EdsError: the device does not support the bit rate, by the file; or the file has no section for a value.
    """
    _check(reading, settings)
    chosen = {
        (variable.index, variable.subindex): assign.text_for(variable, given, settings.node_id)
        for variable, given in parameters
    }
    return _filled(reading, settings, chosen)


def record(
    reading: EdsParseResult, settings: Settings, texts: Mapping[tuple[int, int], str]
) -> EdsParseResult:
    """Return the DCF of a node with these values read from it, by index and sub-index, in the notation of an EDS.

    Unlike ``make``, it checks neither access nor limits, because the device already has these values.

    Raises:
        ArgumentError, EdsError: as ``make``, for settings and missing sections.
    """
    _check(reading, settings)
    return _filled(reading, settings, texts)


def _filled(
    reading: EdsParseResult, settings: Settings, chosen: Mapping[tuple[int, int], str]
) -> EdsParseResult:
    in_sections = {key: text for key, text in chosen.items() if _section(reading, *key) is not None}
    changes = [
        edit.set_value(reading.document, section, "ParameterValue", text)
        for key, text in in_sections.items()
        if (section := _section(reading, *key)) is not None
    ]
    document = edit.apply(reading.document, [*changes, *_file_info(reading.document, settings)])
    document = _commissioned(document, settings)
    listed: dict[int, dict[str, str]] = {}  # index -> sub-index as a key -> text
    for (index, subindex), text in chosen.items():
        if (index, subindex) not in in_sections:
            listed.setdefault(index, {})[str(subindex)] = text
    if listed:
        document = edit.apply(document, _lists(reading, document, listed))
    return reader.read_document(document, reading.eds.source)


def _check(reading: EdsParseResult, settings: Settings) -> None:
    for what, value, low, high in (
        ("a node ID", settings.node_id, 1, 127),
        ("a network number", settings.net_number or 0, 0, _MAX_U32),
    ):
        if not low <= value <= high:
            raise ArgumentError(
                f"{value} is not a {what.partition(' ')[2]}", remedy=f"give {what} of {low} to {high}"
            )
    rate = settings.baudrate
    if rate is None:
        return
    if rate not in BAUD_RATES:
        raise ArgumentError(
            f"{rate} kbit/s is not a bit rate of CiA 301", remedy=f"give one of {_list(BAUD_RATES)}"
        )
    device = reading.eds.info.get("deviceinfo", {})
    if values.plain(device.get(f"baudrate_{rate}", "")) == 0:
        has = [each for each in BAUD_RATES if values.plain(device.get(f"baudrate_{each}", ""))]
        raise EdsError(
            f"the device does not support {rate} kbit/s", file=reading.eds.source, observed=f"BaudRate_{rate}=0 in [DeviceInfo]",
            remedy=f"give one of {_list(has)}" if has else "correct [DeviceInfo]",
        )  # fmt: skip


def _list(numbers: Iterable[int]) -> str:
    return ", ".join(str(number) for number in numbers)


def _section(reading: EdsParseResult, index: int, subindex: int) -> Section | None:
    """Return the section of an entry, None if the file describes the entry only implicitly."""
    listed = reading.parts.list_sections.get((index, "value"))
    if listed is not None and str(subindex) in listed.entries:
        return None
    section = reading.parts.subs.get(index, {}).get(subindex)
    if section is None and subindex == 0 and not reading.eds.objects[index].is_record:
        section = reading.parts.heads.get(index)
    return section


def has_section_for(reading: EdsParseResult, index: int, subindex: int) -> bool:
    """Whether the file can give an entry a value of its own; it cannot if the entry is only implied, as by CompactPDO."""
    head = reading.parts.heads.get(index)
    compacted = head is not None and "compactsubobj" in head.entries
    return compacted or _section(reading, index, subindex) is not None


def _lists(
    reading: EdsParseResult, document: EdsText, listed: Mapping[int, Mapping[str, str]]
) -> Iterator[LineEdit]:
    """Yield the changes that put values into ``[xxxxValue]``, the section for compact sub-indices (DS 306 5).

    The sections are searched once, however many values there are.
    """
    after = {section.line: following for section, following in pairwise(document.sections.values())}
    for index, texts in listed.items():
        head = document.sections.get(f"{index:04x}")
        if head is None or "compactsubobj" not in head.entries:
            raise _no_section_error(reading, index, int(next(iter(texts))))
        section = document.sections.get(f"{index:04x}value")
        if section is None:
            entries = {"NrOfEntries": str(len(texts)), **texts}
            yield edit.add_section(document, f"{index:04X}Value", entries, after.get(head.line))
        else:
            count = len({key for key in section.entries if key[:1].isdigit()} | texts.keys())
            yield from edit.set_values(document, section, {**texts, "NrOfEntries": str(count)})


def _no_section_error(reading: EdsParseResult, index: int, subindex: int) -> EdsError:
    return EdsError(
        f"the file has no place for a value of {index:04X}h:{subindex:02X}",
        file=reading.eds.source,
        observed="the entry has no section of its own: CompactPDO or the section of its object implies it",
        remedy=f"describe it in a separate section, [{index:04X}sub{subindex:X}]",
    )


def _next(document: EdsText, section: Section) -> Section | None:
    following_sections = [each for each in document.sections.values() if each.line >= section.end]
    return min(following_sections, key=lambda each: each.line, default=None)


def _file_info(document: EdsText, settings: Settings) -> Iterator[LineEdit]:
    section = document.sections.get("fileinfo")
    for key, name in (("FileName", settings.file_name), ("LastEDS", settings.last_eds)):
        if section is not None and name is not None and name.isascii():
            yield edit.set_value(document, section, key, name)


def _commissioned(document: EdsText, settings: Settings) -> EdsText:
    entries = _entries(settings)
    misspelt = document.sections.get(_MISSPELT)
    section = document.sections.get(_SECTION.lower())
    if section is None and misspelt is not None:
        document = edit.apply(document, [edit.rename_section(document, misspelt, _SECTION)])
        section = document.sections[_SECTION.lower()]
    if section is not None:
        return edit.apply(
            document, [edit.set_value(document, section, key, text) for key, text in entries.items()]
        )
    before = document.sections.get("deviceinfo") or document.sections.get("fileinfo")
    after = _next(document, before) if before is not None else next(iter(document.sections.values()))
    return edit.apply(document, [edit.add_section(document, _SECTION, entries, after)])


def _entries(settings: Settings) -> Mapping[str, str]:
    given = {
        "NodeID": settings.node_id,
        "NodeName": settings.node_name,
        "Baudrate": settings.baudrate,
        "NetNumber": settings.net_number,
        "NetworkName": settings.network_name,
        "CANopenManager": None if settings.manager is None else int(settings.manager),
        "LSS_SerialNumber": settings.serial,
    }
    return {key: str(value) for key, value in given.items() if value is not None}


def to_eds(reading: EdsParseResult, file_name: str | None = None) -> EdsParseResult:
    """Return the EDS of a DCF: without node, values, denotations and files; all other lines stay as they are.

    ``file_name`` is the name of the EDS, for [FileInfo].
    """
    document, parts = reading.document, reading.parts
    dropped = [
        section for (_, kind), section in parts.list_sections.items() if kind in ("value", "denotation")
    ]
    dropped += [
        document.sections[name]
        for name in (_SECTION.lower(), _MISSPELT, "connectedmodules")
        if name in document.sections
    ]
    changes = [edit.remove_section(document, section) for section in dropped]
    for section in parts.described():
        changes += edit.remove_keys(document, section, _OF_A_DCF)
    info = document.sections.get("fileinfo")
    if info is not None:
        changes += edit.remove_keys(document, info, ("LastEDS",))
        changes += _file_info(document, Settings(1, file_name=file_name))
    return reader.read_document(edit.apply(document, changes), reading.eds.source)


def differing(eds: Eds, node_id: int | None = None) -> tuple[Variable, ...]:
    """Return the entries whose parameter value differs from their default, for a node-ID (1 to 127; else the file's own)."""
    node = eds.node_id if node_id is None else node_id
    return tuple(
        sub
        for entry in eds
        if any(like.parameter_value is not None for like, _ in compact.grouped(entry.subs))
        for sub in entry.subs.values()
        if sub.parameter_value is not None and sub.initial(node) != default(sub, node)
    )


def default(variable: Variable, node_id: int | None) -> int | float | str | bytes | None:
    """Return the default of an entry for a node-ID (1 to 127), None if the file gives none."""
    value = variable.default
    return value.resolve(node_id) if isinstance(value, Number) else value
