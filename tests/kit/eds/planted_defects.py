"""Defects planted into the text of an EDS, each with the line on which a checker must report it.

The text is taken apart here by a few lines of its own, so that the reader under test is not its own judge. Numbers of types and
objects are typed from CiA 301 and CiA 402.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

TYPES = {  # CiA 301 table 44, of the objects that every drive has
    "1000": 7, "1001": 5, "1017": 6, "1018sub1": 7, "1018sub2": 7, "6040": 6, "6041": 6, "6060": 2, "6061": 2, "6064": 4,
    "606c": 4, "6071": 3, "6077": 3, "607a": 4, "60ff": 4, "6081": 7, "6083": 7, "6084": 7, "607dsub1": 4, "6502": 7,
}  # fmt: skip
READ_ONLY = ("1000", "1001", "1018sub1", "1018sub2", "6041", "6061", "6064", "606c", "6077", "6502")
# CiA 402-2: mandatory objects of the modes, by the bit of 6502h, without those that nearly every mode shares.
MODE_OBJECTS = {
    0: ("6081", "6083"),
    2: ("60ff",),
    3: ("6071", "6087"),
    5: ("6098", "6099"),
    7: ("607a",),
    8: ("60ff",),
    9: ("6071",),
}
BITS = {1: 1, 2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}


@dataclass
class Plant:
    """A changed text: its lines, the new number of each old line, the lines on which a report is right, and the rules."""

    lines: list[str]
    moved: dict[int, int]
    where: set[int]
    rules: set[str]
    what: str = ""


@dataclass
class Text:
    """A file as lines, and its sections by lower-case name: header line (from 1) and entries (lower-case key: line, value)."""

    lines: list[str]
    heads: dict[str, int] = field(default_factory=dict)
    entries: dict[str, dict[str, tuple[int, str]]] = field(default_factory=dict)

    @classmethod
    def of(cls, text: str) -> Text:
        found = cls(text.replace("\r\n", "\n").split("\n"))
        name = ""
        for number, line in enumerate(found.lines, 1):
            if line.startswith("["):
                name = line[1 : line.index("]")].lower()
                found.heads[name], found.entries[name] = number, {}
            elif "=" in line and not line.startswith(";") and name:
                key, _, value = line.partition("=")
                found.entries[name].setdefault(key.strip().lower(), (number, value.strip()))
        return found

    def value(self, name: str, key: str) -> str:
        return self.entries.get(name, {}).get(key, (0, ""))[1]

    def number(self, name: str, key: str) -> int | None:
        try:
            return int(self.value(name, key), 0)
        except ValueError:
            return None

    def objects(self) -> list[str]:
        return [name for name in self.heads if re.fullmatch("[1-9a-f][0-9a-f]{3}(sub[0-9a-f]+)?", name)]

    def end(self, name: str) -> int:
        """Return the line behind a section."""
        after = [line for line in self.heads.values() if line > self.heads[name]]
        return min(after, default=len(self.lines) + 1)

    def used(self, mapping: str) -> list[str]:
        """Return the sections of a mapping that its sub-index 0 puts in use."""
        count = self.number(f"{mapping}sub0", "defaultvalue")
        count = 64 if count is None else count
        return [name for sub in range(1, count + 1) if (name := f"{mapping}sub{sub:x}") in self.heads]

    def mappings(self) -> list[str]:
        return [name for name in self.heads if re.fullmatch("1[6a][0-9a-f]{2}", name)]

    def mapped(self) -> set[str]:
        """Return the objects that are mapped anywhere, as index or index and sub-index."""
        found = set()
        for mapping in self.mappings():
            for name in self.used(mapping):
                value = self.number(name, "defaultvalue") or 0
                index, sub = f"{value >> 16:04x}", value >> 8 & 0xFF
                found |= {index, f"{index}sub{sub:x}"}
        return found

    def changed(
        self, changes: dict[int, str | None], inserted: dict[int, list[str]] | None = None
    ) -> tuple[list[str], dict[int, int]]:
        """Return the lines with some replaced (None: removed) and others inserted behind a line, and where the old ones are."""
        lines: list[str] = []
        moved = {}
        for number, line in enumerate(self.lines, 1):
            new = changes.get(number, line)
            if new is not None:
                lines.append(new)
                moved[number] = len(lines)
            lines += (inserted or {}).get(number, [])
        return lines, moved


def put(text: Text, name: str, key: str, value: str, rules: str, what: str = "") -> Plant:
    """Give one key another value; a report is right on its line."""
    number = text.entries[name][key][0]
    written = text.lines[number - 1].partition("=")[0]
    lines, moved = text.changed({number: f"{written}={value}"})
    return Plant(lines, moved, {number}, set(rules.split()), what or f"[{name}] {key}={value}")


def wrong_type(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in TYPES if name in text.heads and text.number(name, "datatype") == TYPES[name]]
    name = rng.choice(names)
    kind = rng.choice([kind for kind in (1, 2, 3, 4, 5, 6, 7) if kind != TYPES[name]])
    return put(text, name, "datatype", f"0x{kind:04X}", "C003 M002")


def unknown_type(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in text.objects() if text.value(name, "datatype")])
    return put(text, name, "datatype", rng.choice(["0x003F", "UNSIGNED32", ""]), "O002")


def wrong_object_type(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if "sub" not in name and text.value(name, "objecttype")]
    name = rng.choice([name for name in names if "compactsubobj" not in text.entries[name]])
    record = (text.number(name, "objecttype") or 7) in (8, 9)
    return put(text, name, "objecttype", "0x7" if record else "0x9", "O011 O008 C002 M003")


def missing_mode_object(rng: random.Random, text: Text) -> Plant | None:
    claimed = text.number("6502", "defaultvalue")
    if claimed is None:
        return None
    needed = sorted({name for bit, names in MODE_OBJECTS.items() if claimed >> bit & 1 for name in names})
    free = [name for name in needed if name in text.heads and name not in text.mapped()]
    if not free:
        return None
    name = rng.choice(free)
    changes = without_object(text, name)
    lines, moved = text.changed({**changes, **unlisted(text, name)})
    return Plant(lines, moved, {text.entries["6502"]["defaultvalue"][0]}, {"M001c", "M008"}, f"no [{name}]")


def missing_section(rng: random.Random, text: Text) -> Plant | None:
    busy = text.mapped() | {name for names in MODE_OBJECTS.values() for name in names} | set(TYPES)
    names = [name for name in text.objects() if name >= "2000" and "sub" not in name and name not in busy]
    name = rng.choice(names)
    listed = _listing(text, name)
    if listed is None:
        return None
    lines, moved = text.changed(without_object(text, name))
    return Plant(lines, moved, {listed[1]}, {"L005"}, f"no [{name}], still listed")


def without_object(text: Text, name: str) -> dict[int, str | None]:
    whole = [each for each in text.heads if each == name or each.startswith(name + "sub")]
    return {number: None for each in whole for number in range(text.heads[each], text.end(each))}


def _listing(text: Text, name: str) -> tuple[str, int] | None:
    for section in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        for key, (number, value) in text.entries.get(section, {}).items():
            if key.isdigit() and int(value, 0) == int(name, 16):
                return section, number
    return None


def unlisted(text: Text, name: str) -> dict[int, str | None]:
    """Take an object out of its list, and number and count the others again."""
    listed = _listing(text, name)
    assert listed is not None
    rows = sorted(
        number
        for key, (number, _) in text.entries[listed[0]].items()
        if key.isdigit() and number != listed[1]
    )
    changes: dict[int, str | None] = {listed[1]: None}
    for count, number in enumerate(rows, 1):
        changes[number] = f"{count}={text.lines[number - 1].partition('=')[2]}"
    changes[text.entries[listed[0]]["supportedobjects"][0]] = f"SupportedObjects={len(rows)}"
    return changes


def long_pdo(rng: random.Random, text: Text) -> Plant | None:
    """Map three values of 32 bits, one more than fits."""
    fitting = [name for name in text.mappings() if name[1] == "a" and f"{name}sub3" in text.heads]
    if not fitting or text.value("6064", "pdomapping") != "1":
        return None
    name = rng.choice(fitting)
    changes: dict[int, str | None] = {}
    for sub, value in (("0", "3"), ("1", "0x60640020"), ("2", "0x60640020"), ("3", "0x60640020")):
        place = text.entries[f"{name}sub{sub}"].get("defaultvalue")
        if place is None:
            return None
        changes[place[0]] = f"DefaultValue={value}"
    lines, moved = text.changed(changes)
    where = {text.entries[f"{name}sub{sub}"]["defaultvalue"][0] for sub in (2, 3)}  # P017 speaks of both
    return Plant(lines, moved, where, {"P006"}, f"[{name}] of 96 bits")


def bad_sub_number(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in text.objects() if text.number(name, "subnumber")])
    number = text.number(name, "subnumber") or 0
    return put(text, name, "subnumber", f"{number + rng.choice([-1, 1, 2])}", "O007")


def bad_highest(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if name.endswith("sub0") and text.value(name, "defaultvalue")]
    name = rng.choice([name for name in names if not name.startswith("1003")])
    number = text.number(name, "defaultvalue")
    subs = [each for each in text.heads if each.startswith(name[:-1]) and each != name]
    if number is None or number != max((int(each.partition("sub")[2], 16) for each in subs), default=0):
        return None
    return put(text, name, "defaultvalue", f"{number + 1}", "O010 P008")


def bad_list_count(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(["mandatoryobjects", "optionalobjects", "manufacturerobjects"])
    number = text.number(name, "supportedobjects")
    if number is None:
        return None
    return put(text, name, "supportedobjects", f"{number + rng.choice([1, 3])}", "L003")


def bad_list_entry(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(["optionalobjects", "manufacturerobjects"])
    keys = [key for key in text.entries.get(name, {}) if key.isdigit()]
    if not keys:
        return None
    wrong = "0x5FFE" if name == "manufacturerobjects" else "0x67FD"
    return put(text, name, rng.choice(keys), wrong, "L005")


def bad_pdo_count(rng: random.Random, text: Text) -> Plant | None:
    key = rng.choice(["nrofrxpdo", "nroftxpdo"])
    number = text.number("deviceinfo", key)
    return None if number is None else put(text, "deviceinfo", key, str(number + 1), "D006")


def duplicate_key(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    key = rng.choice(list(text.entries[name]))
    number = text.entries[name][key][0]
    last = max(line for line, _ in text.entries[name].values())
    copy = text.lines[number - 1].partition("=")[0] + "=" + rng.choice(["1", text.value(name, key)])
    lines, moved = text.changed({}, {last: [copy]})
    moved[-1] = moved[last] + 1
    return Plant(lines, moved, {-1}, {"S004"}, f"[{name}] {key} twice")


def duplicate_section(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    copy = [line for line in text.lines[text.heads[name] - 1 : text.end(name) - 1] if line.strip()]
    at = text.end(name) - 1
    lines, moved = text.changed({}, {at: copy})
    moved[-1] = moved[at] + 1
    return Plant(lines, moved, {-1}, {"S003"}, f"[{name}] twice")


def _limited(text: Text) -> Iterator[tuple[str, int, int]]:
    for name in text.objects():
        low, high = text.number(name, "lowlimit"), text.number(name, "highlimit")
        kind = text.number(name, "datatype")
        if low is not None and high is not None and kind in BITS and low < high < 1 << BITS[kind] - 1:
            yield name, low, high


def value_beyond_limit(rng: random.Random, text: Text) -> Plant | None:
    found = [(name, high) for name, _, high in _limited(text) if text.value(name, "defaultvalue")]
    tops = {name: (1 << BITS[text.number(name, "datatype") or 7] - 1) - 1 for name, _ in found}
    found = [(name, high) for name, high in found if high < tops[name] and not name.startswith("1")]
    if not found:
        return None
    name, high = rng.choice(found)
    return put(text, name, "defaultvalue", str(high + 1), "V003")


def crossed_limits(rng: random.Random, text: Text) -> Plant | None:
    found = [each for each in _limited(text) if each[1] >= 0]
    if not found:
        return None
    name, low, high = rng.choice(found)
    default = text.number(name, "defaultvalue")
    if rng.random() < 0.5 and default is not None and low > 0:
        return put(text, name, "highlimit", str(low - 1), "V004")
    return put(text, name, "lowlimit", str(high + 1), "V004 V002 V005")


def missing_key(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    keys = {"parametername": "O001", "datatype": "O002", "accesstype": "O003", "subnumber": "O024"}
    there = [key for key in keys if text.value(name, key)]
    if not there or text.number(name, "objecttype") == 2:
        return None
    key = rng.choice(there)
    lines, moved = text.changed({text.entries[name][key][0]: None})
    return Plant(lines, moved, {text.heads[name]}, {keys[key]}, f"[{name}] without {key}")


def wrong_access(rng: random.Random, text: Text) -> Plant | None:
    if rng.random() < 0.3:
        names = [name for name in text.objects() if text.value(name, "accesstype")]
        return put(text, rng.choice(names), "accesstype", rng.choice(["rx", "r", "readonly"]), "O003")
    name = rng.choice([name for name in READ_ONLY if text.value(name, "accesstype") in ("ro", "const")])
    return put(text, name, "accesstype", rng.choice(["rw", "wo"]), "C004 M004")


def bad_mapping(rng: random.Random, text: Text) -> Plant | None:
    """Make an invalid mapping: a missing object, one that is not mappable, or with the wrong number of bits."""
    used = [name for mapping in text.mappings() for name in text.used(mapping)]
    used = [name for name in used if text.number(name, "defaultvalue")]
    if not used:
        return None
    name = rng.choice(used)
    value = text.number(name, "defaultvalue") or 0
    bits, kind = value & 0xFF, rng.choice(["target", "flag", "bits"])
    if kind == "target":
        return put(text, name, "defaultvalue", f"0x5FFE00{bits:02X}", "P002")
    if kind == "bits" and value >> 16 >= 0x2000:
        return put(
            text, name, "defaultvalue", f"0x{value & 0xFFFFFF00 | (8 if bits != 8 else 4):08X}", "P003"
        )
    closed = [each for each in text.objects() if text.value(each, "pdomapping") == "0" and each >= "2000"]
    closed = [each for each in closed if text.value(each, "accesstype") == "rw" and each.count("sub0") == 0]
    closed = [each for each in closed if BITS.get(text.number(each, "datatype") or 0) == bits]
    if not closed:
        return None
    index, _, sub = rng.choice(closed).partition("sub")
    return put(text, name, "defaultvalue", f"0x{index}{int(sub or '0', 16):02x}{bits:02X}", "P004")


def bad_node_id(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if "$NODEID" in text.value(name, "defaultvalue")]
    if not names:
        return None
    name = rng.choice(names)
    given = text.value(name, "defaultvalue")
    base = given.replace("$NODEID", "").strip("+ ")
    if not base:
        return None
    spelled = [f"{base}+$NODEID", f"$NodeID+{base}", f"$NODE+{base}", f"$NODEID-{base}", f"$NODEID{base}"]
    return put(text, name, "defaultvalue", rng.choice(spelled), "V006 V020")


def no_number(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if text.number(name, "datatype") in (3, 4, 6, 7)]
    names = [name for name in names if text.value(name, "defaultvalue")]
    name = rng.choice(names)
    return put(text, name, "defaultvalue", rng.choice(["0xZZ", "4x0", "abc", "1 2"]), "V001")


def too_large(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if text.number(name, "datatype") in (3, 4, 6, 7)]
    names = [name for name in names if text.value(name, "defaultvalue")]
    return put(text, rng.choice(names), "defaultvalue", "0x123456789", "V005")


def broken_header(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    number = text.heads[name]
    broken = text.lines[number - 1].replace("]", "").rstrip()
    lines, moved = text.changed({number: broken})
    return Plant(lines, moved, {number}, {"S010"}, f"{broken} without bracket")


def stray_text(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    at = max(line for line, _ in text.entries[name].values())
    lines, moved = text.changed({}, {at: ["this belongs to nothing"]})
    moved[-1] = moved[at] + 1
    return Plant(lines, moved, {-1}, {"S006"}, f"text in [{name}]")


def unknown_section(rng: random.Random, text: Text) -> Plant | None:
    at = text.end(rng.choice(text.objects())) - 1
    lines, moved = text.changed({}, {at: ["[ToolNotes]", "Author=me"]})
    moved[-1] = moved[at] + 1
    return Plant(lines, moved, {-1}, {"S012"}, "[ToolNotes]")


def bad_flag(rng: random.Random, text: Text) -> Plant | None:
    if rng.random() < 0.5:
        names = [name for name in text.objects() if text.value(name, "pdomapping") == "0"]
        return put(text, rng.choice(names), "pdomapping", "2", "O016")
    return (
        put(text, "deviceinfo", "baudrate_1000", "2", "D010")
        if text.value("deviceinfo", "baudrate_1000")
        else None
    )


def misspelt_key(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(text.objects())
    key = rng.choice(list(text.entries[name]))
    at = rng.randrange(1, len(key))
    number = text.entries[name][key][0]
    written = text.lines[number - 1]
    lines, moved = text.changed({number: written[:at] + written[at + 1 :]})
    return Plant(lines, moved, {number}, {"S017", "S016"}, f"[{name}] {key} without a letter")


def missing_sub_index(rng: random.Random, text: Text) -> Plant | None:
    busy = text.mapped() | set(TYPES)
    names = [name for name in text.objects() if re.fullmatch("[2-5][0-9a-f]{3}sub[0-9a-f]+", name)]
    names = [name for name in names if name not in busy and text.value(name.partition("sub")[0], "subnumber")]
    if not names:
        return None
    name = rng.choice(names)
    parent = name.partition("sub")[0]
    lines, moved = text.changed(
        without_object(text, name) if not name.endswith("sub0") else _section(text, name)
    )
    where = {text.heads[parent], text.entries[parent]["subnumber"][0]}
    return Plant(lines, moved, where, {"O007", "O008"}, f"no [{name}]")


def _section(text: Text, name: str) -> dict[int, str | None]:
    return dict.fromkeys(range(text.heads[name], text.end(name)))


def lost_node_id(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in ("1400sub1", "1401sub1", "1800sub1", "1801sub1", "1014") if name in text.heads]
    names = [name for name in names if text.value(name, "defaultvalue").startswith("$NODEID+0x")]
    if not names:
        return None
    name = rng.choice(names)
    base = int(text.value(name, "defaultvalue").partition("+")[2], 0)
    if base >= 0x800:
        return None
    return put(text, name, "defaultvalue", f"0x{base + rng.choice([0, 5]):X}", "V019 V007")


def negative(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if text.number(name, "datatype") in (5, 6, 7)]
    names = [name for name in names if text.value(name, "defaultvalue")]
    return put(text, rng.choice(names), "defaultvalue", "-1", "V009")


def fraction(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if text.number(name, "datatype") in (3, 4, 6, 7)]
    names = [name for name in names if text.value(name, "defaultvalue")]
    return put(text, rng.choice(names), "defaultvalue", "1.5", "V011")


def wrong_list(rng: random.Random, text: Text) -> Plant | None:
    """Move the last optional object to the end of the manufacturer's."""
    old, new = "optionalobjects", "manufacturerobjects"
    counts = {name: text.number(name, "supportedobjects") for name in (old, new)}
    if not counts[old] or not counts[new] or str(counts[old]) not in text.entries[old]:
        return None
    last, value = text.entries[old][str(counts[old])]
    end = max(number for number, _ in text.entries[new].values())
    lines, moved = text.changed(
        {
            last: None,
            text.entries[old]["supportedobjects"][0]: f"SupportedObjects={counts[old] - 1}",
            text.entries[new]["supportedobjects"][0]: f"SupportedObjects={counts[new] + 1}",
        },
        {end: [f"{counts[new] + 1}={value}"]},
    )
    moved[-1] = moved[end] + 1
    return Plant(lines, moved, {-1}, {"L008"}, f"{value} in the wrong list")


def renumbered(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(["optionalobjects", "manufacturerobjects"])
    count = text.number(name, "supportedobjects") or 0
    if count < 2:
        return None
    number, value = text.entries[name][str(count)]
    lines, moved = text.changed({number: f"{count + 5}={value}"})
    return Plant(lines, moved, {number}, {"L004"}, f"[{name}] {count} called {count + 5}")


def listed_twice(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice(["optionalobjects", "manufacturerobjects"])
    count = text.number(name, "supportedobjects") or 0
    if not count:
        return None
    end = max(number for number, _ in text.entries[name].values())
    again = text.value(name, str(rng.randint(1, count)))
    changes: dict[int, str | None] = {
        text.entries[name]["supportedobjects"][0]: f"SupportedObjects={count + 1}"
    }
    lines, moved = text.changed(changes, {end: [f"{count + 1}={again}"]})
    moved[-1] = moved[end] + 1
    return Plant(lines, moved, {-1}, {"L007"}, f"{again} twice in [{name}]")


def foreign_letter(rng: random.Random, text: Text) -> Plant | None:
    name = rng.choice([name for name in text.objects() if text.value(name, "parametername")])
    return put(text, name, "parametername", text.value(name, "parametername") + " \xb5", "S001")


def no_default(rng: random.Random, text: Text) -> Plant | None:
    names = {"1000": "C005", "6502": "M006"}
    name = rng.choice([name for name in names if text.value(name, "defaultvalue")])
    lines, moved = text.changed({text.entries[name]["defaultvalue"][0]: None})
    return Plant(lines, moved, {text.heads[name]}, {names[name]}, f"[{name}] without default")


def mapped_flag(rng: random.Random, text: Text) -> Plant | None:
    """Forbid the mapping of a core object that is mapped, or take its flag away."""
    names = [name for name in ("6040", "6041", "6064", "607a", "60ff") if name in text.mapped()]
    name = rng.choice([name for name in names if text.value(name, "pdomapping") == "1"])
    if rng.random() < 0.5:
        return put(text, name, "pdomapping", "0", "M005 P004")
    lines, moved = text.changed({text.entries[name]["pdomapping"][0]: None})
    return Plant(lines, moved, {text.heads[name]}, {"O020", "P004", "M005"}, f"[{name}] without PDOMapping")


def bad_parameter_type(rng: random.Random, text: Text) -> Plant | None:
    names = [name for name in text.objects() if re.fullmatch("1[468a]0[0-9]sub[0-5]", name)]
    name = rng.choice([name for name in names if text.value(name, "datatype")])
    kind = text.number(name, "datatype")
    return put(text, name, "datatype", "0x0006" if kind != 6 else "0x0007", "P009 O009")


KINDS: tuple[Callable[[random.Random, Text], Plant | None], ...] = (
    *(
        wrong_type,
        unknown_type,
        wrong_object_type,
        missing_mode_object,
        missing_section,
        long_pdo,
        bad_sub_number,
    ),
    *(bad_highest, bad_list_count, bad_list_entry, bad_pdo_count, duplicate_key, duplicate_section),
    *(
        value_beyond_limit,
        crossed_limits,
        missing_key,
        wrong_access,
        bad_mapping,
        bad_node_id,
        no_number,
        too_large,
    ),
    *(
        misspelt_key,
        missing_sub_index,
        lost_node_id,
        negative,
        fraction,
        wrong_list,
        renumbered,
        listed_twice,
    ),
    *(foreign_letter, no_default, mapped_flag, bad_parameter_type),
    *(broken_header, stray_text, unknown_section, bad_flag),
)


def plant(
    rng: random.Random, text: Text, kind: Callable[[random.Random, Text], Plant | None]
) -> Plant | None:
    """Plant one defect of a kind; None where the file has no place for it."""
    try:
        return kind(rng, text)
    except (IndexError, ValueError):  # nothing, or not enough, to choose from
        return None
