"""One file for the rules: the parse result, with each entry and the section that describes it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import PurePath
from typing import NamedTuple

from axisbus.cia301.objects import PDOS_OF_A_KIND
from axisbus.eds.io import values
from axisbus.eds.io.build import ACCESS_TYPES
from axisbus.eds.io.new_file import MANDATORY, MANUFACTURER
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText, Section
from axisbus.eds.model import Eds, Number, Object, ObjectType, Severity, Variable
from axisbus.wording import counted

DEVICE_INFO, FILE_INFO = "deviceinfo", "fileinfo"
LISTS = {
    "mandatoryobjects": "MandatoryObjects",
    "optionalobjects": "OptionalObjects",
    "manufacturerobjects": "ManufacturerObjects",
}

COMMISSIONING = ("devicecomissioning", "devicecommissioning")  # the spelling of DS 306, and the common one


class Hit(NamedTuple):
    """One breach of a rule: its location, and the observation.

    ``severity`` is None for the rule's own severity; a hit may be milder than its rule (an uncertain row of a table), never worse.
    """

    line: int
    column: int
    message: str
    index: int | None = None  # type: ignore[assignment]  # hides tuple.index, which is not used
    subindex: int | None = None
    severity: Severity | None = None


class Described(NamedTuple):
    """An entry of the model with the section that describes it (the object's section, if the object implies the entry)."""

    variable: Variable
    section: Section

    def text(self, key: str) -> str:
        """Return the file's text for ``key``, empty if there is none."""
        return text_of(self.section, key)

    @property
    def has_access(self) -> bool:
        """Whether the file gives a valid access; else an access is assumed, which no rule should check (O003 reports it)."""
        words = self.text("accesstype").lower().split()
        return bool(words) and words[0].rstrip(";") in ACCESS_TYPES


class RuleContext:
    """A parse result with look-ups for the rules; frozen, derived values are calculated once on first use."""

    def __init__(self, reading: EdsParseResult) -> None:
        self.reading = reading
        self.eds: Eds = reading.eds
        self.document: EdsText = reading.document
        self.heads: Mapping[int, Section] = reading.parts.heads
        self.subs: Mapping[int, Mapping[int, Section]] = reading.parts.subs

    def section(self, name: str) -> Section | None:
        """Return the section of this lower-case name."""
        return self.document.sections.get(name)

    @cached_property
    def text(self) -> str:
        """The whole text, for a quick search before each line is examined."""
        return self.document.newline.join(self.document.lines)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The lines at which sections begin, ascending; 0 as the first, for lines before all sections."""
        every = (*self.document.sections.values(), *self.document.repeated)
        return (0, *sorted(section.line for section in every))

    @cached_property
    def device(self) -> Section | None:
        """``[DeviceInfo]``."""
        return self.section(DEVICE_INFO)

    @cached_property
    def file_info(self) -> Section | None:
        """``[FileInfo]``."""
        return self.section(FILE_INFO)

    @cached_property
    def commissioning(self) -> Section | None:
        """``[DeviceComissioning]``, under either spelling."""
        return next((found for name in COMMISSIONING if (found := self.section(name)) is not None), None)

    @cached_property
    def is_dcf(self) -> bool:
        """Whether the file is the configuration of one node: by its sections, or by its name."""
        return self.commissioning is not None or self.named_dcf

    @cached_property
    def named_dcf(self) -> bool:
        """Whether the file's name ends in ``.dcf``."""
        return PurePath(self.eds.source).suffix.lower() == ".dcf"

    @cached_property
    def modular(self) -> bool:
        """Whether modules may add objects that the file does not describe directly (DS 306 6)."""
        return self.section("supportedmodules") is not None

    @cached_property
    def described(self) -> tuple[Described, ...]:
        """All entries that have a section of their own, in the order of the indices."""
        return tuple(self._described())

    def _described(self) -> Iterator[Described]:
        for entry in self.eds:
            head = self.heads.get(entry.index)
            if not entry.is_record:
                if head is not None:
                    yield Described(entry.subs[0], head)
                continue
            for subindex, section in self.subs.get(entry.index, {}).items():
                variable = entry.subs.get(subindex)
                if variable is not None:
                    yield Described(variable, section)

    @cached_property
    def blocks(self) -> Mapping[int, tuple[Object, ...]]:
        """The objects in blocks of 200h (the size of each PDO parameter area), by their index divided by 200h."""
        found: dict[int, list[Object]] = {}
        for index, entry in self.eds.objects.items():
            found.setdefault(index // PDOS_OF_A_KIND, []).append(entry)
        return {number: tuple(entries) for number, entries in found.items()}

    @cached_property
    def records(self) -> tuple[tuple[Object, Section], ...]:
        """Each ARRAY, RECORD and DEFSTRUCT that has a section of its own."""
        return tuple(
            (entry, self.heads[entry.index])
            for entry in self.eds
            if entry.is_record and entry.index in self.heads
        )

    def section_of(self, index: int, subindex: int = 0) -> Section | None:
        """Return the section that describes an entry: its own, else that of its object."""
        section = self.subs.get(index, {}).get(subindex)
        return section if section is not None else self.heads.get(index)

    def at(
        self,
        section: Section | None,
        key: str,
        message: str,
        index: int | None = None,
        subindex: int | None = None,
        severity: Severity | None = None,
    ) -> Hit:
        """Return a hit at the value of ``key``; at the section's line if it has no such key; at line 0 without a section."""
        if section is None:
            return Hit(0, 0, message, index, subindex, severity)
        line, column = self.document.location(section, key.lower()) if key else (section.line, 1)
        return Hit(line, column, message, index, subindex, severity)

    def on(self, entry: Described, key: str, message: str, severity: Severity | None = None) -> Hit:
        """Return a hit at the value of ``key`` of an entry; the message begins with the section's name."""
        variable = entry.variable
        text = f"[{entry.section.name}] {message}"
        return self.at(entry.section, key, text, variable.index, variable.subindex, severity)

    def at_value(self, entry: Variable, message: str, severity: Severity | None = None) -> Hit:
        """Return a hit at the value after power-up of an entry."""
        section = self.section_of(entry.index, entry.subindex)
        return self.at(section, start_key(entry), message, entry.index, entry.subindex, severity)

    def at_start(
        self,
        index: int,
        message: str,
        subindex: int = 0,
        *,
        missing: int | None = None,
        severity: Severity | None = None,
    ) -> Hit:
        """Return a hit at the value after power-up of an entry; it names ``missing``, an absent object, instead of the entry."""
        entry = self.eds.get(index, subindex)
        key = "" if entry is None else start_key(entry)
        named = (index, subindex or None) if missing is None else (missing, None)
        return self.at(self.section_of(index, subindex), key, message, *named, severity)

    def absent(self, section: Section | None, names: Iterable[str]) -> Iterator[Hit]:
        """Yield a hit if a section lacks some of these keys."""
        missing = [name for name in names if section is not None and name.lower() not in section.entries]
        if section is not None and missing:
            yield self.at(section, "", f"[{section.name}] has no {', '.join(missing)}")

    def overlong(self, section: Section | None, lengths: Mapping[str, int]) -> Iterator[Hit]:
        """Yield a hit for each value that is longer than allowed; ``lengths`` are in characters, by key."""
        for name, most in lengths.items():
            length = len(text_of(section, name))
            if length > most:
                text = f"{name} has {counted(length, 'character')}, at most {most} are allowed"
                yield self.at(section, name, text)

    def beyond(self, section: Section | None, names: Iterable[str], highest: int, what: str) -> Iterator[Hit]:
        """Yield a hit for each value of these keys that is no number from 0 to ``highest``."""
        for name in names:
            given, value = text_of(section, name), number(section, name)
            if given and (value is None or not 0 <= value <= highest):
                yield self.at(section, name, f"{name}={short(given)} {what}")

    def flags(self, section: Section | None, names: Iterable[str]) -> Iterator[Hit]:
        """Yield a hit for each value of these keys that is neither 0 nor 1."""
        return self.beyond(section, names, 1, "is neither 0 nor 1")

    def miscounted(self, section: Section, key: str, index: int | None = None) -> Iterator[Hit]:
        """Yield a hit if the value of ``key`` is not the number of the section's numbered lines."""
        there = sum(line[:1].isdigit() for line in section.entries)
        if number(section, key) != there:
            text = f"[{section.name}] says {key}={short(text_of(section, key))}, but has {there}"
            yield self.at(section, key, text, index)

    def where_missing(self, index: int) -> Section | None:
        """Return the section for reporting a missing object: the list that should contain it."""
        return self.section(list_of(index))

    def number(self, index: int, subindex: int = 0) -> int | None:
        """Return an entry's integer after power-up (without the node-ID), None if the file does not give it."""
        entry = self.eds.get(index, subindex)
        return None if entry is None else number_of(entry)


RuleFunction = Callable[[RuleContext], Iterable[Hit]]  # the function of a rule
RULE_FUNCTIONS: dict[
    str, RuleFunction
] = {}  # those of all families that were imported, by the id of their rule


def finds(rule: str) -> Callable[[RuleFunction], RuleFunction]:
    """Mark a function as the one that looks for the breaches of a rule, by the id of the rule; each rule has one."""

    def mark(function: RuleFunction) -> RuleFunction:
        if RULE_FUNCTIONS.setdefault(rule, function) is not function:
            raise ValueError(f"two functions look for {rule}")
        return function

    return mark


def list_of(index: int) -> str:
    """Return the list to which an object belongs, in lower case."""
    if index in MANDATORY:
        return "mandatoryobjects"
    return "manufacturerobjects" if index in MANUFACTURER else "optionalobjects"


def number_of(entry: Variable) -> int | None:
    """Return an entry's integer after power-up: the DCF's value, else the default; None if unknown."""
    value = start_value(entry)
    return value.value if value is not None else None


def start_value(entry: Variable) -> Number | None:
    """Return an entry's number (or formula) after power-up, None if unknown."""
    value = entry.parameter_value if entry.parameter_value is not None else entry.default
    return value if isinstance(value, Number) else None


def start_key(entry: Variable) -> str:
    """Return the key of the value after power-up."""
    return "parametervalue" if entry.parameter_value is not None else "defaultvalue"


def text_of(section: Section | None, key: str) -> str:
    """Return the value of a key in an information section, empty if it is absent."""
    return "" if section is None else section.entries.get(key.lower(), "")


def number(section: Section | None, key: str) -> int | None:
    """Return the number of a key in an information section, None if it is absent or no number."""
    return values.plain(text_of(section, key))


def short(text: str, length: int = 40) -> str:
    """Return a text from a file, shortened to fit into a message."""
    return text if len(text) <= length else text[: length - 3] + "..."


def an(kind: ObjectType) -> str:
    """Return an object type with its article, for messages."""
    return f"an {kind.name}" if kind is ObjectType.ARRAY else f"a {kind.name}"
