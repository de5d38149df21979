"""More kinds of planted defects: of numbers, names, keys, identifiers, modes, mappings and of the text itself.

Most are rows of a table: the location, the key, the written text, and the rules of which one has to report it.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from kit.eds.planted_defects import BITS, READ_ONLY, Plant, Text, put, unlisted, without_object

# Types and limits of CiA 402-2, typed from the standard's object descriptions.
TYPES_402 = {
    "605a": 3, "605b": 3, "605c": 3, "605d": 3, "605e": 3, "6065": 7, "6066": 6, "6067": 7, "6068": 6, "6072": 6, "6073": 6,
    "6075": 7, "6076": 7, "6078": 3, "607c": 4, "607e": 5, "607f": 7, "6080": 7, "6085": 7, "6087": 7, "6098": 2, "6099sub1": 7,
    "6099sub2": 7, "609a": 7, "60c5": 7, "60c6": 7, "60f4": 4, "60fd": 7, "607dsub1": 4, "607dsub2": 4,
}  # fmt: skip
NUMBERS = (2, 3, 4, 5, 6, 7)
TEXTS = (9, 11)
Names = Callable[[Text], Sequence[str]]


class Row(NamedTuple):
    """One kind: the possible sections, the key that gets one of the texts, and the rules that report it."""

    names: Names
    key: str
    texts: Sequence[str]
    rules: str


def of_types(*kinds: int, key: str = "defaultvalue", first: str = "2000") -> Names:
    """Objects of these data types that have a value for a key."""

    def names(text: Text) -> list[str]:
        there = [name for name in text.objects() if text.number(name, "datatype") in kinds]
        busy = text.mappings()
        return [
            name
            for name in there
            if text.value(name, key) and name >= first and name.partition("sub")[0] not in busy
        ]

    return names


def named(*names: str) -> Names:
    return lambda text: [name for name in names if name in text.heads]


def drive(*names: str) -> Names:
    """Objects of a file that describes a drive."""
    return lambda text: named(*names)(text) if {"6040", "6041", "6060"} <= text.heads.keys() else []


def matching(pattern: str) -> Names:
    return lambda text: [name for name in text.heads if re.fullmatch(pattern, name)]


def plain_numbers(text: Text) -> list[str]:
    return [name for name in of_types(*NUMBERS)(text) if not name.endswith("sub0")]


def subs(text: Text) -> list[str]:
    return [
        name
        for name in matching("[2-5][0-9a-f]{3}sub[1-9a-f][0-9a-f]?")(text)
        if text.value(name, "objecttype")
    ]


def records(text: Text) -> list[str]:
    return [name for name in text.objects() if text.value(name, "subnumber") and f"{name}sub1" in text.heads]


def variables(text: Text) -> list[str]:
    return [name for name in text.objects() if text.number(name, "objecttype") == 7 and "sub" not in name]


ROWS = {
    "text_in_a_number": Row(
        plain_numbers, "defaultvalue",
        ("10 rpm", "1,000,000", "ten", "12e3", "--5", "5-", "0b101", "1_000", "0x", "#5"), "V001 S011",
    ),
    "sign_inside": Row(of_types(2, 3, 4), "defaultvalue", ("0x-3", "0X-1"), "V021"),
    "octal": Row(plain_numbers, "defaultvalue", ("012", "0017", "08"), "V012"),
    "word": Row(plain_numbers, "defaultvalue", ("true", "False"), "V015"),
    "quoted": Row(of_types(*TEXTS, first="1000"), "defaultvalue", ('"name"', '"a b"'), "V013"),
    "comment_behind": Row(plain_numbers, "defaultvalue", ("1 ; one", "1 # one"), "S011"),
    "formula_in_a_limit": Row(
        of_types(*NUMBERS, key="highlimit"), "highlimit", ("$NODEID-5", "$NODE+5", "5*$NODEID", "NODEID+0x7000"), "V020"
    ),
    "turned_formula_in_a_limit": Row(
        of_types(4, 7, key="highlimit"), "highlimit", ("0x7F000000+$NODEID", "$NodeID+0x7F000000"), "V006"
    ),
    "text_in_a_limit": Row(of_types(*NUMBERS, key="lowlimit"), "lowlimit", ("none", "-", "n/a", "min"), "V001"),
    "huge_limit": Row(of_types(*NUMBERS, key="highlimit"), "highlimit", ("0x1FFFFFFFF", "99999999999"), "V005"),
    "wrong_type_402": Row(named(*TYPES_402), "datatype", ("0x0001", "0x0008", "0x000B"), "M002"),
    "sdo_type": Row(named("1200sub1", "1200sub2"), "datatype", ("0x0006", "0x0005"), "C003"),
    "sync_identifier": Row(named("1005"), "defaultvalue", ("0x605", "$NODEID+0x80", "0x40000000", "0x1080"), "C016"),
    "time_identifier": Row(named("1012"), "defaultvalue", ("0x701", "$NODEID+0x100", "0x80000000"), "C016"),
    "emergency_identifier": Row(named("1014"), "defaultvalue", ("0x300", "$NODEID+0x580", "$NODEID+0x1080"), "C016"),
    "homing_method": Row(named("6098"), "defaultvalue", ("15", "36", "99"), "M019"),
    "mode_of_operation": Row(named("6060"), "defaultvalue", ("5", "12", "100"), "M011"),
    "reserved_modes": Row(named("6502"), "defaultvalue", ("0x0000F3EF", "0x00000BEF"), "M010"),
    "undefined_reaction": Row(named("605a", "605b", "605c", "605d", "605e", "6007"), "defaultvalue", ("17", "9"), "M015"),
    "coasting": Row(named("605a", "605c", "605d", "605e"), "defaultvalue", ("0",), "M016"),
    "device_type": Row(drive("1000"), "defaultvalue", ("0x00020912", "0x00020191"), "M007"),
    "transmission_type": Row(matching("1[48]0[0-9]sub2"), "defaultvalue", ("241", "0xF5"), "P012"),
    "restricted_pdo": Row(named("1400sub1", "1800sub1"), "defaultvalue", ("$NODEID+0x600", "0x581", "$NODEID+0x1180"), "P013"),
    "pdo_count_no_number": Row(named("deviceinfo"), "nrofrxpdo", ("four", "-1", "4.5"), "D006"),
    "identity_no_number": Row(named("deviceinfo"), "productnumber", ("D-7", "n/a"), "D009"),
    "other_identity": Row(named("deviceinfo"), "vendornumber", ("0x7FFFFF",), "D004"),
    "boolean_of_the_device": Row(named("deviceinfo"), "simplebootupslave", ("yes", "2"), "D005"),
    "granularity": Row(named("deviceinfo"), "granularity", ("65", "bits"), "D014"),
    "date": Row(named("fileinfo"), "creationdate", ("2024-03-25", "25.03.2024", "03/25/2024"), "F004"),
    "time": Row(named("fileinfo"), "creationtime", ("14:30", "9h30", "25:00PM"), "F005"),
    "file_version": Row(named("fileinfo"), "fileversion", ("1.2", "v1", "256"), "F003"),
    "eds_version": Row(named("fileinfo"), "edsversion", ("402", "4", "2.1"), "F009"),
    "access_in_capitals": Row(variables, "accesstype", ("RW", "Ro"), "O019"),
    "empty_name": Row(variables, "parametername", ("",), "O021"),
    "long_name": Row(variables, "parametername", ("x" * 242,), "O015"),
    "sub_index_as_array": Row(subs, "objecttype", ("0x8", "9"), "O030"),
    "object_type_unknown": Row(variables, "objecttype", ("0x55", "VAR"), "O004"),
    "list_without_an_index": Row(named("optionalobjects"), "1", ("Device", "0x16041", "-1"), "L009"),
}  # fmt: skip


def row(rng: random.Random, text: Text, kind: Row) -> Plant | None:
    """Plant a kind of the table."""
    names = [name for name in kind.names(text) if kind.key in text.entries[name]]
    name = rng.choice(names)
    written = rng.choice(kind.texts)
    if written in ("RW", "Ro"):
        written = text.value(name, kind.key).upper()
    return put(text, name, kind.key, written, kind.rules)


def _inserted(text: Text, at: int, lines: list[str], rules: str, what: str, offset: int = 1) -> Plant:
    """Put lines behind line ``at``; a report is right on the one of them that ``offset`` counts from 1."""
    new, moved = text.changed({}, {at: lines})
    moved[-1] = moved[at] + offset
    return Plant(new, moved, {-1}, set(rules.split()), what)


def _changed(text: Text, number: int, line: str, rules: str, what: str) -> Plant:
    new, moved = text.changed({number: line})
    return Plant(new, moved, {number}, set(rules.split()), what)


def mapping_length(rng: random.Random, text: Text) -> Plant | None:
    """Map one value with the bits of another type."""
    used = [name for mapping in text.mappings() for name in text.used(mapping)]
    used = [name for name in used if (text.number(name, "defaultvalue") or 0) >> 16 >= 0x2000]
    name = rng.choice(used)
    value = text.number(name, "defaultvalue") or 0
    bits = rng.choice([bits for bits in (1, 8, 16) if bits != value & 0xFF])
    return put(text, name, "defaultvalue", f"0x{value & 0xFFFFFF00 | bits:08X}", "P003")


def section_in_other_letters(rng: random.Random, text: Text) -> Plant | None:
    """Describe an object again, its index in other letters."""
    names = [
        name for name in text.objects() if any(letter in "abcdef" for letter in name.partition("sub")[0])
    ]
    name = rng.choice(names)
    at = text.end(name) - 1
    header = text.lines[text.heads[name] - 1]
    turned = header.swapcase()
    body = text.lines[text.heads[name] : text.end(name) - 1]
    return _inserted(text, at, [turned, *[line for line in body if line.strip()]], "S003", f"{turned} again")


def beyond_the_count(rng: random.Random, text: Text) -> Plant | None:
    """Describe a sub-index behind the highest that sub-index 0 names."""
    names = [
        name
        for name in records(text)
        if "2000" <= name < "6000" and text.value(f"{name}sub0", "accesstype") in ("ro", "const")
    ]
    name = rng.choice([name for name in names if text.number(f"{name}sub0", "defaultvalue")])
    count = text.number(name, "subnumber") or 0
    last = max(int(each.partition("sub")[2], 16) for each in text.heads if each.startswith(f"{name}sub"))
    if last + 1 != count or text.number(f"{name}sub0", "defaultvalue") != last:
        return None
    old = f"{name}sub{last:x}"
    body = [line for line in text.lines[text.heads[old] : text.end(old) - 1] if line.strip()]
    body = [line + " more" if line.lower().startswith("parametername") else line for line in body]
    new, moved = text.changed(
        {text.entries[name]["subnumber"][0]: f"SubNumber={count + 1}"},
        {text.end(old) - 1: [f"[{name.upper()}sub{last + 1:X}]", *body]},
    )
    return Plant(new, moved, {text.entries[f"{name}sub0"]["defaultvalue"][0]}, {"O010"}, f"[{name}] one more")


def compact_names(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(records(text)).upper()
    return _inserted(
        text, len(text.lines), [f"[{name}Name]", "NrOfEntries=2", "1=First"], "B002", f"[{name}Name]", 2
    )


def compact_values(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(records(text)).upper()
    lines = [f"[{name}Value]", "NrOfEntries=1", "99=5"]
    return _inserted(
        text, len(text.lines), lines, "O013", f"[{name}Value] of a sub-index that is not there", 3
    )


def compact_beside(rng: random.Random, text: Text) -> Plant | None:
    """Count sub-indices in short, beside an object that describes them one by one."""
    name = rng.choice([name for name in records(text) if name >= "2000"])
    at = text.entries[name]["subnumber"][0]
    new, moved = text.changed({}, {at: [f"CompactSubObj={rng.choice(['255', '300', 'x'])}"]})
    moved[-1] = moved[at] + 1
    return Plant(new, moved, {-1, text.heads[name], at}, {"O013", "B001"}, f"[{name}] CompactSubObj")


def links_to_nothing(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(variables(text)).upper()
    lines = [f"[{name}ObjectLinks]", "ObjectLinks=1", "1=0x5FFE"]
    return _inserted(text, len(text.lines), lines, "B004", f"[{name}ObjectLinks]", 3)


def names_of_nothing(rng: random.Random, text: Text) -> Plant | None:
    del rng
    return _inserted(text, len(text.lines), ["[5FFEName]", "NrOfEntries=0"], "B005", "[5FFEName]")


def missing_device_key(rng: random.Random, text: Text) -> Plant | None:
    keys = ("vendorname", "productname", "ordercode", "simplebootupmaster", "granularity", "groupmessaging", "nrofrxpdo",
            "lss_supported", "dynamicchannelssupported", "baudrate_10", "baudrate_800")  # fmt: skip
    return _without(
        text, "deviceinfo", rng.choice([key for key in keys if key in text.entries["deviceinfo"]]), "D001"
    )


def missing_identity_key(rng: random.Random, text: Text) -> Plant | None:
    keys = ("vendornumber", "productnumber", "revisionnumber")
    return _without(
        text, "deviceinfo", rng.choice([key for key in keys if text.value("deviceinfo", key)]), "D002"
    )


def missing_file_key(rng: random.Random, text: Text) -> Plant | None:
    keys = ("filename", "fileversion", "filerevision", "edsversion", "description", "creationtime", "creationdate", "createdby",
            "modificationtime", "modifiedby")  # fmt: skip
    return _without(
        text, "fileinfo", rng.choice([key for key in keys if key in text.entries["fileinfo"]]), "F001 F011"
    )


def missing_list_count(rng: random.Random, text: Text) -> Plant | None:
    return _without(text, rng.choice(["mandatoryobjects", "optionalobjects"]), "supportedobjects", "L001")


def missing_dummy(rng: random.Random, text: Text) -> Plant | None:
    keys = [key for key in text.entries.get("dummyusage", {}) if re.fullmatch("dummy000[1-7]", key)]
    return _without(text, "dummyusage", rng.choice(keys), "D019")


def short_dummy(rng: random.Random, text: Text) -> Plant | None:
    number = rng.choice([line for line, _ in text.entries.get("dummyusage", {}).values()])
    return _changed(text, number, text.lines[number - 1].replace("000", "", 1), "D016", "a short dummy")


def _without(text: Text, name: str, key: str, rules: str) -> Plant:
    lines, moved = text.changed({text.entries[name][key][0]: None})
    return Plant(lines, moved, {text.heads[name]}, set(rules.split()), f"[{name}] without {key}")


def byte_order_mark(rng: random.Random, text: Text) -> Plant | None:
    del rng
    return _changed(text, 1, "\xef\xbb\xbf" + text.lines[0], "S002", "a byte order mark")


def letter_of_utf_8(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(variables(text))
    letter = rng.choice(["\u00b5", "\u00b0", "\u03a9", "\u901f"]).encode().decode("latin-1")
    return put(text, name, "parametername", text.value(name, "parametername") + letter, "S001")


def control_character(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(variables(text))
    return put(text, name, "parametername", text.value(name, "parametername") + "\x07x", "S018")


def write_only_in_a_tpdo(rng: random.Random, text: Text) -> Plant | None:
    """Make an object that a TPDO maps write-only, or one that an RPDO maps read-only."""
    transmit = rng.random() < 0.5
    used = [
        name for mapping in text.mappings() if (mapping[1] == "a") is transmit for name in text.used(mapping)
    ]
    used = [name for name in used if text.number(name, "defaultvalue")]
    name = rng.choice(used)
    value = text.number(name, "defaultvalue") or 0
    target = f"{value >> 16:04x}" if not value >> 8 & 0xFF else f"{value >> 16:04x}sub{value >> 8 & 0xFF:x}"
    number = text.entries[target]["accesstype"][0]
    lines, moved = text.changed({number: f"AccessType={'wo' if transmit else 'ro'}"})
    every = [
        each for mapping in text.mappings() for each in text.used(mapping)
        if (text.number(each, "defaultvalue") or 0) >> 8 == value >> 8
    ]  # fmt: skip
    where = {number, *(text.entries[each]["defaultvalue"][0] for each in every)}
    return Plant(lines, moved, where, {"P005", "M004", "C004"}, f"[{target}] in the wrong direction")


def empty_pdo(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(
        [name for name in text.mappings() if text.used(name) and text.number(f"{name}sub0", "defaultvalue")]
    )
    return put(text, f"{name}sub0", "defaultvalue", "0", "P016")


def inactive_entry(rng: random.Random, text: Text) -> Plant | None:
    """Fill an entry that sub-index 0 does not count with an object that is not there."""
    free = []
    for mapping in text.mappings():
        count = text.number(f"{mapping}sub0", "defaultvalue")
        names = [each for each in text.heads if re.fullmatch(f"{mapping}sub[1-9a-f][0-9a-f]?", each)]
        free += [each for each in names if count and int(each.partition("sub")[2], 16) > count]
    name = rng.choice([each for each in free if "defaultvalue" in text.entries[each]])
    return put(text, name, "defaultvalue", "0x5FFE0020", "P002")


def shared_identifier(rng: random.Random, text: Text) -> Plant | None:
    """Give the second of two PDOs that exist the identifier of the first."""
    names = [name for name in text.heads if re.fullmatch("1[48][0-9a-f]{2}sub1", name)]
    names = [
        name
        for name in names
        if re.fullmatch(r"\$NODEID\+0x[0-7][0-9A-F]{2}", text.value(name, "defaultvalue"))
    ]
    first, second = (
        sorted(rng.sample(names, 2), key=lambda name: int(name[:4], 16)) if len(names) > 1 else ("", "")
    )
    return put(text, second, "defaultvalue", text.value(first, "defaultvalue"), "P014") if first else None


def lone_communication(rng: random.Random, text: Text) -> Plant | None:
    """Take a mapping out, with its place in the list."""
    name = rng.choice([name for name in text.mappings() if f"{int(name, 16) - 0x200:04x}" in text.heads])
    lines, moved = text.changed({**without_object(text, name), **unlisted(text, name)})
    return Plant(lines, moved, {text.heads[f"{int(name, 16) - 0x200:04x}"]}, {"P001"}, f"no [{name}]")


def no_mode_display(rng: random.Random, text: Text) -> Plant | None:
    del rng
    if "6061" not in text.heads or "6061" in text.mapped() or not text.value("6502", "defaultvalue"):
        return None
    lines, moved = text.changed({**without_object(text, "6061"), **unlisted(text, "6061")})
    where = {text.entries["6502"]["defaultvalue"][0], text.heads["6060"]}
    return Plant(lines, moved, where, {"M001c", "M020"}, "no [6061]")


def fixed_object(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(
        [name for name in ("1005", "1006", "1017", "1400sub2") if text.value(name, "accesstype") == "rw"]
    )
    return put(text, name, "accesstype", "ro", "C021") if name[:2] == "10" else None


def shared_name(rng: random.Random, text: Text) -> Plant | None:
    first, second = sorted(
        rng.sample([name for name in variables(text) if name >= "2000"], 2), key=lambda name: int(name, 16)
    )
    return put(text, second, "parametername", text.value(first, "parametername").upper(), "O027")


def shared_sub_name(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in records(text) if f"{name}sub2" in text.heads])
    return put(text, f"{name}sub2", "parametername", text.value(f"{name}sub1", "parametername"), "O014")


def key_of_a_sub_index(rng: random.Random, text: Text) -> Plant | None:
    """Give a RECORD or ARRAY a key of its sub-indices."""
    name = rng.choice(records(text))
    line, rule = rng.choice(
        [
            ("DataType=0x0007", "O022"),
            ("AccessType=rw", "O022"),
            ("DefaultValue=1", "O023"),
            ("LowLimit=0", "O023"),
        ]
    )
    if line.partition("=")[0].lower() in text.entries[name]:
        return None
    return _inserted(text, text.entries[name]["subnumber"][0], [line], rule, f"[{name}] {line}")


def key_of_a_record(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(variables(text))
    return _inserted(
        text, text.entries[name]["objecttype"][0], ["SubNumber=2"], "O017", f"[{name}] SubNumber"
    )


def reserved_flags(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in variables(text) if "objflags" not in text.entries[name]])
    return _inserted(
        text, text.entries[name]["objecttype"][0], ["ObjFlags=0x4"], "O029", f"[{name}] ObjFlags"
    )


def leading_zero(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in subs(text) if len(name.partition("sub")[2]) == 1])
    number = text.heads[name]
    index, sub = name.split("sub")
    return _changed(text, number, f"[{index.upper()}sub0{sub.upper()}]", "O012", f"[{name}] with a zero")


def indented_section(rng: random.Random, text: Text) -> Plant | None:
    number = text.heads[rng.choice(text.objects())]
    return _changed(text, number, "  " + text.lines[number - 1], "S009", f"line {number} indented")


def spaced_key(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(variables(text))
    number = text.entries[name]["objecttype"][0]
    return _changed(text, number, text.lines[number - 1].replace("=", " =", 1), "S008", "a space before =")


def wrong_bit_rate(rng: random.Random, text: Text) -> Plant | None:
    at = text.entries["deviceinfo"]["baudrate_10"][0]
    return _inserted(text, at, [f"BaudRate_{rng.choice([25, 100, 300])}=1"], "D011", "a bit rate of nobody")


def bit_rate_in_other_letters(rng: random.Random, text: Text) -> Plant | None:
    rates = [number for key, (number, _) in text.entries["deviceinfo"].items() if key.startswith("baudrate_")]
    if not all(text.lines[number - 1].startswith("BaudRate_") for number in rates):
        return None  # the first is reported
    number = text.entries["deviceinfo"][f"baudrate_{rng.choice([10, 20, 50, 125, 250, 500])}"][0]
    return _changed(text, number, text.lines[number - 1].replace("BaudRate", "Baudrate"), "D012", "Baudrate_")


def other_element(rng: random.Random, text: Text) -> Plant | None:
    """Give one element of an ARRAY another type."""
    names = [
        name for name in records(text) if text.number(name, "objecttype") == 8 and "2000" <= name < "6000"
    ]
    name = rng.choice([name for name in names if f"{name}sub3" in text.heads]) + "sub3"
    if text.value(name, "defaultvalue") or text.value(name, "lowlimit") or name in text.mapped():
        return None
    kind = text.number(name, "datatype")
    return put(text, name, "datatype", "0x0004" if kind != 4 else "0x0007", "O026")


def cut_off(rng: random.Random, text: Text) -> Plant | None:
    """End the file behind one of its lines, or in one, in the part with most objects."""
    end = rng.randint(len(text.lines) * 2 // 3, len(text.lines) - 40)
    if min(text.heads[name] for name in text.objects()) > end or not text.lines[end - 1].strip():
        return None
    lists = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
    if any(text.heads.get(name, 0) >= end for name in lists):
        return None
    last = text.lines[end - 1]
    lines = [*text.lines[: end - 1], last[: rng.randint(3, len(last))] if len(last) > 3 else last]
    moved = {number: number for number in range(1, end + 1)}
    return Plant(lines, moved, {end}, {"S020"}, f"cut off in line {end}: {lines[-1]}")


def read_only_value(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in READ_ONLY if text.value(name, "accesstype") in ("ro", "const")])
    return put(text, name, "accesstype", "wo", "C004 M004 P005")


def crossed_in_signs(rng: random.Random, text: Text) -> Plant | None:
    """Give a signed value the limits of an unsigned one."""
    names = [
        name for name in of_types(2, 3, 4, key="highlimit")(text) if (text.number(name, "lowlimit") or 0) == 0
    ]
    name = rng.choice([name for name in names if text.value(name, "lowlimit")])
    bits = BITS[text.number(name, "datatype") or 4]
    return put(text, name, "highlimit", f"0x{(1 << bits) - 1:X}", "V002")


MORE = (
    *(
        mapping_length,
        section_in_other_letters,
        beyond_the_count,
        compact_names,
        compact_values,
        compact_beside,
    ),
    *(links_to_nothing, names_of_nothing, missing_device_key, missing_identity_key, missing_file_key),
    *(missing_list_count, missing_dummy, short_dummy, byte_order_mark, letter_of_utf_8, control_character),
    *(
        write_only_in_a_tpdo,
        empty_pdo,
        inactive_entry,
        shared_identifier,
        lone_communication,
        no_mode_display,
    ),
    *(fixed_object, shared_name, shared_sub_name, key_of_a_sub_index, key_of_a_record, reserved_flags),
    *(leading_zero, indented_section, spaced_key, wrong_bit_rate, bit_rate_in_other_letters, other_element),
    *(cut_off, read_only_value, crossed_in_signs),
)


def _of_the_table(kind: Row) -> Callable[[random.Random, Text], Plant | None]:
    return lambda rng, text: row(rng, text, kind)


EVERY = {
    **{kind.__name__: kind for kind in MORE},
    **{name: _of_the_table(kind) for name, kind in ROWS.items()},
}
