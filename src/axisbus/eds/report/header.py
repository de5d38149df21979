"""A C header: the address and type of each entry of an EDS, and functions that pack and unpack each PDO of a device or a cell.

Theory of operation. The text depends only on the arguments. The header needs only ``stdint.h``, and compiles without a warning as
C99 and as C++. It uses shifts instead of bit fields and packed structures, whose order of bits and bytes depends on the compiler.
The names of entries are those of ``codegen``, with a prefix for their file. In the header of a cell, the names of PDOs begin with
the cell and the node. One source may include several headers. Parts that are in two of them are compiled once. If two headers
define one name differently, the compiler reports an error; it never silently takes the first definition.
"""

from __future__ import annotations

import itertools
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import NamedTuple

from axisbus.cia301.datatypes import DataType
from axisbus.eds.layout import PdoLayout, PdoSlot, layouts
from axisbus.eds.model import Eds
from axisbus.eds.report import codegen, naming, overview

_WIDTHS = (8, 16, 32, 64)
_REALS = {DataType.REAL32: ("float", 32), DataType.REAL64: ("double", 64)}
_NONE = 1 << 31  # of a COB-ID: not valid
_MAX_TYPE = 0xFF
_UNPRINTABLE = re.compile(r"[^ -~]|\*/|/\*")
# Forbidden names of structure members: words of C and C++.
_OF_C = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const constexpr continue decltype default
delete do double else enum explicit export extern false float for friend goto if inline int long mutable namespace new noexcept not
not_eq nullptr operator or or_eq private protected public register restrict return short signed sizeof static struct switch template
this thread_local throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor xor_eq
char8_t char16_t char32_t co_await co_return co_yield concept consteval constinit requires typeof typeof_unqual i386 linux unix
"""
_KEYWORDS = frozenset(_OF_C.split())
_HELPERS = """
static inline uint64_t {lower}_get(const uint8_t *data, unsigned first, unsigned bits)
{{
    uint64_t value = 0u;
    unsigned bit;
    for (bit = 0u; bit < bits; bit++)
        value |= (uint64_t)(((unsigned)data[(first + bit) / 8u] >> ((first + bit) % 8u)) & 1u) << bit;
    return value;
}}

static inline int64_t {lower}_get_signed(const uint8_t *data, unsigned first, unsigned bits)
{{
    const uint64_t value = {lower}_get(data, first, bits), sign = (uint64_t)1u << (bits - 1u);
    return (value & sign) ? -(int64_t)((sign - 1u) - (value & (sign - 1u))) - 1 : (int64_t)value;
}}

static inline void {lower}_put(uint8_t *data, unsigned first, unsigned bits, uint64_t value)
{{
    unsigned bit;
    for (bit = 0u; bit < bits; bit++) {{
        const unsigned at = (first + bit) / 8u, mask = 1u << ((first + bit) % 8u);
        data[at] = (uint8_t)(((value >> bit) & 1u) ? (data[at] | mask) : (data[at] & ~mask));
    }}
}}
"""
_UNIONS = """
union {lower}_real32 {{ uint32_t bits; float value; }};
union {lower}_real64 {{ uint64_t bits; double value; }};
"""


@dataclass(frozen=True, slots=True)
class NodePdos:
    """The PDOs of a node (``layout.of_pdo``), its EDS, and in ``words`` its purpose; ``notes`` are for readers."""

    node_id: int
    words: str
    eds: Eds
    pdos: tuple[PdoLayout, ...]
    notes: tuple[str, ...] = ()


class _Names(NamedTuple):
    """The prefixes of names: of one device's PDOs, and of the functions of the whole header."""

    pdos: str
    helpers: str


def header(eds: Eds, node_id: int | None = None) -> str:
    """Return the text of the header; COB-IDs are those for ``node_id`` (1 to 127); without one they are macros of the node-ID."""
    name = _prefix(eds)
    found = [each for each in layouts(eds, node_id) if each.slots]
    title = f"The object dictionary of {_ascii(overview.overview(eds).title)}, from {_ascii(PurePath(eds.source).name)}."
    pdos = (line for each in found for line in _pdo(each, _Names(name, name.lower()), node_id))
    return _text(name, (title,), [*_dictionary(eds, name), *_helpers(name.lower()), *pdos])


def of_cell(file: str, nodes: Sequence[NodePdos]) -> str:
    """Return the header of a cell: the entries of each of its EDS files, and the PDOs of these nodes; ``file`` is its name."""
    name = naming.constant(PurePath(file).stem, "CELL")
    title = (
        f"The PDOs of {_ascii(PurePath(file).name)}, as boot-up configures them if each drive accepts the values of its EDS,",
        "and the object dictionaries of their nodes.",
    )
    body = [line for prefix, eds in _prefixes(nodes) for line in _dictionary(eds, prefix)]
    body += _helpers(name.lower())
    return _text(name, title, [*body, *(line for node in nodes for line in _node(node, name))])


def _text(name: str, title: Sequence[str], body: Sequence[str]) -> str:
    lines = [
        f"/* {title[0]}",
        *(f" * {line}" for line in title[1:]),
        " * Generated by axisbus eds code --c: generate it again instead of changing it. */",
        *_include_guard(f"{name}_H", name, ["", "#include <stdint.h>", "", *body, ""]),
        "",
    ]
    return "\n".join(lines)


def _include_guard(what: str, name: str, lines: Sequence[str]) -> list[str]:
    """Add an include guard; the compiler refuses different lines with the same guard."""
    guard, sign = f"AXISBUS_{what}", f"0x{zlib.crc32(chr(10).join(lines).encode()):08X}u"
    return [
        f"#ifndef {guard}",
        f"#define {guard} {sign}",
        *lines,
        f"#elif {guard} != {sign}",
        f'#error "two headers give the names that begin with {name}_ to different things; rename one file"',
        f"#endif /* {guard} */",
    ]


def _helpers(lower: str) -> list[str]:
    return [*_HELPERS.format(lower=lower).splitlines(), *_UNIONS.format(lower=lower).splitlines()]


def _prefix(eds: Eds) -> str:
    return naming.constant(PurePath(eds.source).stem, "DEVICE")


def _prefixes(nodes: Sequence[NodePdos]) -> list[tuple[str, Eds]]:
    """Return each EDS once, with a unique prefix: a name of one EDS can never be a name of another."""
    files = list({node.eds.source: node.eds for node in nodes}.values())
    names = [_prefix(eds) for eds in files]
    ambiguous = any(f"{one}_".startswith(f"{other}_") for one, other in itertools.permutations(names, 2))
    preferred = [f"FILE{number}_{name}" for number, name in enumerate(names, 1)] if ambiguous else names
    return list(zip(preferred, files, strict=True))


def _node(node: NodePdos, cell: str) -> Iterator[str]:
    name = f"{cell}_NODE{node.node_id}"
    yield from ("", f"/* Node {node.node_id}: {_ascii(node.words)} */")
    yield from (f"/* {_ascii(note)} */" for note in node.notes)
    yield f"#define {name}_ID {node.node_id}u"
    for pdo in node.pdos:
        yield from _pdo(pdo, _Names(name, cell.lower()), node.node_id)


def _ascii(text: str) -> str:
    """Return a text that is safe in a comment."""
    return _UNPRINTABLE.sub("?", text)


def _dictionary(eds: Eds, name: str) -> list[str]:
    """Return the addresses of the entries, which the headers of several cells may contain."""
    return _include_guard(f"{name}_DICTIONARY", name, list(_entries(eds, name)))


def _entries(eds: Eds, name: str) -> Iterator[str]:
    for (index, subindex), entry in codegen.entry_names(eds).items():
        sub = eds.objects[index].subs[subindex]
        yield f"/* {_ascii(sub.name)}: {sub.data_type.name}, {sub.access} */"
        yield f"#define {name}_{entry}_INDEX 0x{index:04X}u"
        yield f"#define {name}_{entry}_SUBINDEX 0x{subindex:02X}u"
        kind = _c_type(sub.data_type)
        if kind is not None:
            yield f"typedef {kind} {name.lower()}_{entry.lower()}_t;"


def _c_type(data_type: DataType) -> str | None:
    """Return the C type of a value; None if there is none of fixed size."""
    if data_type in _REALS:
        return _REALS[data_type][0]
    return _integer(data_type.bits or 0, signed=data_type.signed) if data_type.integer else None


def _integer(bits: int, *, signed: bool) -> str:
    return f"{'' if signed else 'u'}int{next(width for width in _WIDTHS if bits <= width)}_t"


# -- PDOs -------------------------------------------------------------------------------------------------------------------------


def _pdo(pdo: PdoLayout, names: _Names, node_id: int | None) -> Iterator[str]:
    macro, helpers = f"{names.pdos}_{pdo.name}", names.helpers
    lower = macro.lower()
    members = _members(pdo)
    yield ""
    off = "" if pdo.valid else "; switched off in the file"
    yield f"/* {pdo.name}: {'received' if pdo.receive else 'sent'} by the device{off} */"
    yield from _identifier(pdo, macro, node_id)
    yield f"#define {macro}_LENGTH {pdo.size}u"
    if pdo.transmission_type is not None and 0 <= pdo.transmission_type <= _MAX_TYPE:
        yield f"#define {macro}_TRANSMISSION_TYPE {pdo.transmission_type}u"
    if not members:
        return
    yield f"struct {lower} {{"
    for slot, member in members:
        yield f"    {_member_type(slot)} {member}; /* {slot.address}, {slot.where}: {_ascii(slot.name)} */"
    yield "};"
    yield f"static inline void {lower}_unpack(const uint8_t *data, struct {lower} *to)"
    yield from ("{", *(f"    {_unpacked(slot, member, helpers)}" for slot, member in members), "}")
    yield f"static inline void {lower}_pack(uint8_t *data, const struct {lower} *from)"
    yield from ("{", *(f"    {_packed(slot, member, helpers)}" for slot, member in members), "}")


def _identifier(pdo: PdoLayout, macro: str, node_id: int | None) -> Iterator[str]:
    if pdo.identifier is not None:
        yield f"#define {macro}_COB_ID 0x{pdo.identifier:X}u"
    elif pdo.formula is not None and node_id is None:
        yield f"#define {macro}_COB_ID(node_id) (0x{pdo.formula.value & (_NONE - 1) & ~(1 << 30):X}u + (node_id))"


def _members(pdo: PdoLayout) -> list[tuple[PdoSlot, str]]:
    """Return the members of a PDO's structure, with unique names; dummies are left out."""
    slots = [slot for slot in pdo.slots if not slot.mapped.is_dummy and slot.bits and slot.end <= 64]
    preferred = {slot.first_bit: _name(slot) for slot in slots}
    names = naming.unique(preferred, str, _KEYWORDS)
    return [(slot, names[slot.first_bit]) for slot in slots]


def _name(slot: PdoSlot) -> str:
    otherwise = f"object_{slot.mapped.index:04x}_{slot.mapped.subindex:02x}"
    return naming.constant(slot.name, otherwise.upper()).lower()


def _is_real(slot: PdoSlot) -> bool:
    return slot.data_type in _REALS and slot.bits == _REALS[slot.data_type][1]


def _member_type(slot: PdoSlot) -> str:
    if _is_real(slot):
        assert slot.data_type is not None
        return _REALS[slot.data_type][0]
    return _integer(slot.bits, signed=slot.signed)


def _unpacked(slot: PdoSlot, member: str, lower: str) -> str:
    where = f"data, {slot.first_bit}u, {slot.bits}u"
    if _is_real(slot):
        kind = f"{lower}_real{slot.bits}"
        return f"{{ union {kind} real; real.bits = (uint{slot.bits}_t){lower}_get({where}); to->{member} = real.value; }}"
    get = f"{lower}_get{'_signed' if slot.signed else ''}"
    return f"to->{member} = ({_member_type(slot)}){get}({where});"


def _packed(slot: PdoSlot, member: str, lower: str) -> str:
    where = f"data, {slot.first_bit}u, {slot.bits}u"
    if _is_real(slot):
        kind = f"{lower}_real{slot.bits}"
        return f"{{ union {kind} real; real.value = from->{member}; {lower}_put({where}, real.bits); }}"
    return f"{lower}_put({where}, (uint64_t)from->{member});"
