"""Convert the sections of an EDS to the objects of the model."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import TypeVar

from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import compact, values
from axisbus.eds.io.findings import Findings
from axisbus.eds.io.sections import SectionIndex
from axisbus.eds.io.text import EdsText, Section
from axisbus.eds.io.values import Default, ValueProblem
from axisbus.eds.model import Number, Object, ObjectType, Variable, object_of, variable, variable_like

ACCESS_TYPES = frozenset(("ro", "wo", "rw", "rwr", "rww", "const"))

_WITH_SUBS = frozenset((ObjectType.ARRAY, ObjectType.RECORD, ObjectType.DEFSTRUCT))
_KNOWN_TYPES = frozenset(ObjectType)
_KNOWN_DATA_TYPES = frozenset(DataType)
# In the spelling of nearly all files: 7, 0x7, 0x0007.
_PLAIN_DATA_TYPES = {
    text: kind for kind in DataType for text in (f"{kind:d}", f"0x{kind:X}", f"0x{kind:02X}", f"0x{kind:04X}")
}
_PLAIN_OBJECT_TYPES = {
    text: kind for kind in ObjectType for text in (f"{kind:d}", f"0x{kind:X}", f"0x{kind:02X}") if kind
}
_FIRST_OWN_TYPE = 0x40  # from here on, types are defined by a maker or a file (CiA 301 table 44)
_SPELLED = {
    key.lower(): key
    for key in (
        *("ObjectType", "DataType", "AccessType", "DefaultValue", "ParameterValue"),
        *("LowLimit", "HighLimit", "PDOMapping", "ObjFlags"),
    )
}
_MODELLED = frozenset(_SPELLED) | {"parametername", "denotation", "subnumber", "compactsubobj"}
_Built = TypeVar("_Built", Object, Variable)
_NOTHING: Mapping[str, str] = {}
_NO_SECTIONS: Mapping[int, Section] = {}
_BOTH_ZERO = "V018"
_DEFAULT = "defaultvalue"


class EdsObjectBuilder:
    """Builds objects one by one; problems go to ``findings`` if they are wanted, and nothing else changes."""

    def __init__(self, document: EdsText, parts: SectionIndex, findings: Findings | None = None) -> None:
        self._document = document
        self._parts = parts
        self._findings = findings
        # The result for the first section of each text (without its name), by that text: other sections with the same text reuse
        # it. There are three, because a text has another meaning alone, above sub-indices and in a sub-index.
        self._var_templates: dict[str | None, Variable] = {}
        self._records: dict[str | None, Object] = {}
        self._sub_templates: dict[str | None, Variable] = {}

    def object(self, index: int) -> Object:
        """Return the object at ``index``; it is a RECORD if only its sub-indices are described."""
        head = self._parts.heads.get(index)
        sub_sections = self._parts.subs.get(index)
        if head is None:
            return self._without_head(index, sub_sections or _NO_SECTIONS)
        if sub_sections is None:
            return self._without_subs(head, index)
        name, _, other_text = head.split_entries()
        like = self._records.get(other_text)
        if like is None:
            built = self._object(head, index, sub_sections)
            if built.object_type in _WITH_SUBS and "compactsubobj" not in head.entries:
                self._store_template(self._records, other_text, built)
            return built
        subs, links = self._subs(sub_sections, index), self._links(index)
        return object_of(index, name, like.object_type, subs, head.line, like.denotation, links, like.more)

    def _without_head(self, index: int, sub_sections: Mapping[int, Section]) -> Object:
        first = next(iter(sub_sections.values()))
        self._note("O005", f"[{first.name}] has no parent [{index:04X}]", first, "", index)
        name = f"{index:04X}"
        subs = self._subs(sub_sections, index, self._compact_subs(first, index, name))
        return object_of(index, name, ObjectType.RECORD, subs, first.line, "", self._links(index), _NOTHING)

    def _without_subs(self, head: Section, index: int) -> Object:
        name, text, other_text = head.split_entries()
        like = self._var_templates.get(other_text)
        if like is not None:
            default = values.parse(text, like.data_type).value if text else None
            return self._holding(variable_like(like, index, 0, name, default, head.line))
        built = self._object(head, index, _NO_SECTIONS)
        if built.object_type not in _WITH_SUBS and not _limits_hang_on_default(head.entries, built.subs[0]):
            self._store_template(self._var_templates, other_text, built.subs[0])
        return built

    def _object(self, head: Section, index: int, sub_sections: Mapping[int, Section]) -> Object:
        """Return the object of a section, with its entries parsed."""
        name = self._name(head, index)
        object_type = self._object_type(head, index, bool(sub_sections))
        if object_type in _WITH_SUBS:
            subs = self._subs(sub_sections, index, self._compact_subs(head, index, name))
            more, denotation = _more(head.entries), head.entries.get("denotation", "")
            return object_of(index, name, object_type, subs, head.line, denotation, self._links(index), more)
        only = self.variable(head, index, 0, name, object_type)
        if sub_sections:
            text = f"[{head.name}] is a {object_type.name}, but has sub-indices"
            self._note("O011", text, head, "objecttype", index)
        return self._holding(only)

    def _holding(self, only: Variable) -> Object:
        """Return the object that holds itself as sub-index 0."""
        index, name, line = only.index, only.name, only.line
        links, subs = self._links(index), {0: only}
        return object_of(index, name, only.object_type, subs, line, only.denotation, links, only.more)

    def _sub(self, section: Section, index: int, subindex: int) -> Variable:
        name, text, other_text = section.split_entries()
        like = self._sub_templates.get(other_text)
        if like is not None:
            default = values.parse(text, like.data_type).value if text else None
            return variable_like(like, index, subindex, name, default, section.line)
        kind = self._sub_type(section, index, subindex)
        built = self.variable(section, index, subindex, self._name(section, index, subindex), kind)
        if not _limits_hang_on_default(section.entries, built):
            self._store_template(self._sub_templates, other_text, built)
        return built

    def _store_template(
        self, templates: dict[str | None, _Built], other_text: str | None, entry: _Built
    ) -> None:
        """Store the result of a section for others with the same text, unless findings are wanted: then each section is parsed."""
        if other_text is not None and self._findings is None and _DEFAULT not in other_text.lower():
            templates[other_text] = entry

    def _links(self, index: int) -> tuple[int, ...]:
        """Return the indices of ``[xxxxObjectLinks]`` (DS 306 4.6.4)."""
        list_sections = self._parts.list_sections
        listed = (
            list_sections.get((index, "objectlinks")) if list_sections else None
        )  # few files have such a section
        if listed is None:
            return ()
        texts = [text for key, text in listed.entries.items() if key.isdecimal()]
        return tuple(number for number in map(values.plain, texts) if number is not None)

    def _subs(
        self, sub_sections: Mapping[int, Section], index: int, compacted: compact.SubIndices | None = None
    ) -> Mapping[int, Variable]:
        subs = {subindex: self._sub(section, index, subindex) for subindex, section in sub_sections.items()}
        list_sections = self._parts.list_sections
        for kind_of_list in ("value", "denotation") if list_sections else ():
            listed = list_sections.get((index, kind_of_list))
            if listed is not None:
                self._apply(subs, compacted or {}, listed, kind_of_list, index)
        if compacted is not None:
            return compacted.with_explicit(subs)
        order = sorted(subs)
        return subs if order == list(subs) else {subindex: subs[subindex] for subindex in order}

    def _compact_subs(self, head: Section, index: int, name: str) -> compact.SubIndices | None:
        text = head.entries.get("compactsubobj")
        if text is None:
            return None
        count = values.plain(text) if text else 0
        if count is None or not 0 <= count <= compact.MAX_ENTRIES:
            self._note(
                "O013", f"CompactSubObj={text} is not a number of entries", head, "compactsubobj", index
            )
            count = compact.MAX_ENTRIES if count == compact.MAX_ENTRIES + 1 else 0
        if count == 0:
            return None
        template = self.variable(head, index, 1, name, ObjectType.VAR)
        names = self._parts.list_sections.get((index, "name"))
        return compact.SubIndices(template, count, _NOTHING if names is None else names.entries)

    def _apply(
        self,
        subs: dict[int, Variable],
        compacted: Mapping[int, Variable],
        listed: Section,
        kind: str,
        index: int,
    ) -> None:
        """Apply ``[xxxxValue]`` or ``[xxxxDenotation]`` to the sub-indices, whose numbers are decimal there (DS 306 5)."""
        for key, text in listed.entries.items():
            subindex = values.plain(key)
            entry = None if subindex is None else subs.get(subindex) or compacted.get(subindex)
            if entry is None or subindex is None:
                if key != "nrofentries":
                    self._note("O013", f"[{listed.name}] names sub-index {key[:20]}", listed, key, index)
            elif kind == "denotation":
                subs[subindex] = compact.denoted(entry, text)
            else:
                value, problems = values.parse(text, entry.data_type)
                self._problems(problems, listed, key, index, subindex)
                subs[subindex] = compact.valued(entry, value)

    def variable(
        self, section: Section, index: int, subindex: int, name: str, object_type: ObjectType
    ) -> Variable:
        """Return the entry that a section describes; the caller provides ``name`` and ``object_type`` with their defaults."""
        # Checked before each helper is called: a file has tens of thousands of keys, most of them plain or missing.
        entries = section.entries
        get = entries.get
        type_text, access, default, value = (
            get("datatype", ""),
            get("accesstype"),
            get("defaultvalue"),
            get("parametervalue"),
        )
        low, high, mapping, flags = (
            get("lowlimit"),
            get("highlimit"),
            get("pdomapping", "0"),
            get("objflags", "0"),
        )
        data_type = _PLAIN_DATA_TYPES.get(type_text) or self._data_type(
            section, type_text, index, subindex, object_type
        )
        bottom, top = self._limits(section, data_type, index, subindex) if low or high else (None, None)
        return variable(
            index,
            subindex,
            name,
            data_type,
            access if access in ACCESS_TYPES else self._access(section, index, subindex, object_type),
            self._value(section, "defaultvalue", data_type, index, subindex) if default else None,
            self._value(section, "parametervalue", data_type, index, subindex) if value else None,
            bottom,
            top,
            mapping == "1" or (mapping != "0" and bool(self._flag(section, "pdomapping", index, subindex))),
            self._flag(section, "objflags", index, subindex) if flags != "0" else 0,
            section.line,
            object_type,
            get("denotation", ""),
            _more(entries),
        )

    def _name(self, section: Section, index: int, subindex: int | None = None) -> str:
        name = section.entries.get("parametername")
        if name is None:
            self._note("O001", f"[{section.name}] has no ParameterName", section, "", index, subindex)
            return section.name
        return name

    def _object_type(self, head: Section, index: int, has_subs: bool) -> ObjectType:
        text = head.entries.get("objecttype")
        if text:
            return _PLAIN_OBJECT_TYPES.get(text) or self._given_type(head, text, index, None)
        if has_subs or "compactsubobj" in head.entries:
            self._note("O006", f"[{head.name}] has no ObjectType", head, "", index)
            return ObjectType.RECORD
        return ObjectType.VAR  # DS 306 4.6.3.2

    def _sub_type(self, section: Section, index: int, subindex: int) -> ObjectType:
        text = section.entries.get("objecttype")
        kind = _PLAIN_OBJECT_TYPES.get(text) if text else ObjectType.VAR
        if kind is None:
            kind = self._given_type(section, text or "", index, subindex)
        return ObjectType.VAR if kind in _WITH_SUBS else kind

    def _given_type(self, section: Section, text: str, index: int, subindex: int | None) -> ObjectType:
        found, problems = _object_type(text)
        if problems:
            self._problems(problems, section, "objecttype", index, subindex)
        return found

    def _data_type(
        self, section: Section, text: str, index: int, subindex: int, object_type: ObjectType
    ) -> DataType:
        if not text and object_type is ObjectType.DOMAIN:
            return DataType.DOMAIN
        found, problems = _data_type(text)
        if found >= _FIRST_OWN_TYPE and found in self._parts.types:
            found, problems = _data_type(self._parts.types[found].entries.get("defaultvalue", ""))
        if problems:
            self._problems(problems, section, "datatype", index, subindex)
        return found

    def _access(self, section: Section, index: int, subindex: int, object_type: ObjectType) -> str:
        text = section.entries.get("accesstype")
        if text in ACCESS_TYPES:
            return text
        if text is None and object_type is ObjectType.DOMAIN:
            return "rw"  # DS 306 4.6.3.2
        found, problems = _access(text or "")
        self._problems(problems, section, "accesstype", index, subindex)
        return found

    def _value(self, section: Section, key: str, data_type: DataType, index: int, subindex: int) -> Default:
        text = section.entries.get(key)
        if not text:
            return None
        value, problems = values.parse(text, data_type)
        if problems:
            self._problems(problems, section, key, index, subindex)
        return value

    def _limits(
        self, section: Section, data_type: DataType, index: int, subindex: int
    ) -> tuple[values.Limit, values.Limit]:
        low, high = section.entries.get("lowlimit"), section.entries.get("highlimit")
        if not low and not high:
            return None, None
        bottom, top, problems = values.limits(low or "", high or "", data_type)
        if problems and problems[-1].rule == _BOTH_ZERO and self._only_zero(section, data_type):
            bottom, top, problems = values.limits(low or "", high or "", data_type, only_zero=True)
        if problems:
            self._problems(problems, section, "lowlimit" if low else "highlimit", index, subindex)
        return bottom, top

    def _only_zero(self, section: Section, data_type: DataType) -> bool:
        """Whether two limits of 0 are real: the default is 0 (as of 6086h, 1003h:00), and the file does not use 0 for none."""
        return _is_zero(section.entries.get("defaultvalue"), data_type) and not self._zeros_for_none

    @cached_property
    def _zeros_for_none(self) -> bool:
        """Whether the file uses two limits of 0 for "no limits": it has more than one default that they would not allow."""
        kind = DataType.INTEGER64
        found = sum(
            _is_zero(section.entries["lowlimit"], kind)
            and _is_zero(section.entries.get("highlimit"), kind)
            and _is_other(section.entries.get("defaultvalue"))
            for section in self._parts.described()
            if "lowlimit" in section.entries
        )
        return found > 1

    def _flag(self, section: Section, key: str, index: int, subindex: int) -> int:
        text = section.entries.get(key)
        if not text or text == "0":
            return 0
        number, problems = values.integer(text)
        if problems:
            self._problems(problems, section, key, index, subindex)
        return number.value if number is not None else 0

    def _problems(
        self, problems: tuple[ValueProblem, ...], section: Section, key: str, index: int, subindex: int | None
    ) -> None:
        for problem in problems:
            found = problem.key or key
            message = f"[{section.name}] {_SPELLED.get(found, found)}: {problem.text}"
            self._note(problem.rule, message, section, found, index, subindex)

    def _note(
        self, rule: str, message: str, section: Section, key: str, index: int, subindex: int | None = None
    ) -> None:
        if self._findings is None:
            return
        line, column = self._document.location(section, key) if key else (section.line, 1)
        self._findings.add(rule, message, line=line, column=column, index=index, subindex=subindex)


def _limits_hang_on_default(entries: Mapping[str, str], built: Variable) -> bool:
    """Whether the limits may change with another default: only two equal limits may; see ``EdsObjectBuilder._only_zero``."""
    return bool(entries.get("lowlimit") and entries.get("highlimit")) and built.low == built.high


def _is_zero(text: str | None, data_type: DataType) -> bool:
    value = values.parse(text or "", data_type).value
    return value == 0.0 or value == Number(0)


def _is_other(text: str | None) -> bool:
    """Whether a default is a number, and not 0."""
    value = values.parse(text or "", DataType.REAL64).value
    number = values.plain(text or "") if value is None else value
    return number is not None and number != 0


def _more(entries: Mapping[str, str]) -> Mapping[str, str]:
    """Return the keys that have no field in the model."""
    if entries.keys() <= _MODELLED:
        return _NOTHING
    return {key: text for key, text in entries.items() if key not in _MODELLED}


@lru_cache(maxsize=256)
def _object_type(text: str) -> tuple[ObjectType, tuple[ValueProblem, ...]]:
    number, problems = values.integer(text)
    if number is None or not 0 <= number.value <= 0xFF:
        return ObjectType.VAR, (ValueProblem("O004", f"{text[:40]} is not an object type"),)
    if ObjectType(number.value) not in _KNOWN_TYPES:
        problems = (*problems, ValueProblem("O004", f"{text[:40]} is an unknown object type"))
    return ObjectType(number.value), problems


@lru_cache(maxsize=256)
def _data_type(text: str) -> tuple[DataType, tuple[ValueProblem, ...]]:
    number, problems = values.integer(text)
    if number is None or not 0 < number.value <= 0xFFFF:
        what = f"{text[:40]} is not a data type" if text else "it is missing"
        return DataType(0), (ValueProblem("O002", what),)
    if number.value < _FIRST_OWN_TYPE and DataType(number.value) not in _KNOWN_DATA_TYPES:
        problems = (*problems, ValueProblem("O002", f"{text[:40]} is not a data type of CiA 301"))
    return DataType(number.value), problems


@lru_cache(maxsize=256)
def _access(text: str) -> tuple[str, tuple[ValueProblem, ...]]:
    """Parse an access type in any case, even with a comment after it."""
    words = text.lower().replace(";", " ").split()
    first = words[0] if words else ""
    if first not in ACCESS_TYPES:
        return "rw", (
            ValueProblem("O003", f"{text[:40]} is not an access type" if text else "it is missing"),
        )
    if len(words) > 1:
        return first, (ValueProblem("S011", f"text follows the access type: {text[:40]}"),)
    return first, ()
