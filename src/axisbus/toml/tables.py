"""Read the tables of a TOML file by their keys: convert the values, and collect all errors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from axisbus.eds.model import Severity
from axisbus.toml import value_readers
from axisbus.toml.document import KeyPath, TomlDocument
from axisbus.toml.problem import UNREADABLE as UNREADABLE
from axisbus.toml.problem import CellProblem

Fields = dict[str, Any]

# The ids of the reader's findings; ``axisbus.check`` has the table of all ids.
UNKNOWN, MISSING, UNFIT, NO_TABLE = "C002", "C003", "C004", "C005"
NO_NAME, TWO_OF_A_NAME, TOGETHER, NO_AXIS = "C006", "C007", "C008", "C009"

_NAME = re.compile(r"[\w-]{1,64}")


@dataclass(frozen=True, slots=True)
class CellKey:
    """One key; ``missing`` is the remedy if a required key is left out (empty: the key is not required)."""

    read: value_readers.ValueReader
    missing: str = ""


Keys = Mapping[str, CellKey]


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """The location of a table: its ``line`` (from 1), the line of each of its keys, and the keys that are missing or wrong.

    A key in ``faulty`` has already been reported; its value is a placeholder.
    """

    name: str = ""
    line: int = 0
    keys: Mapping[str, int] = field(default_factory=dict)
    faulty: frozenset[str] = frozenset()

    def of(self, key: str) -> int:
        """Return the line of ``key``, or of the table if the key is left out."""
        return self.keys.get(key, self.line)

    def gives(self, key: str) -> bool:
        """Whether the file has ``key``."""
        return key in self.keys

    def sound(self, *keys: str) -> bool:
        """Whether all ``keys`` are present and valid."""
        return self.faulty.isdisjoint(keys)


class Tables:
    """A walk through a document; holds the problems found so far. It never stops at a problem."""

    def __init__(self, document: TomlDocument) -> None:
        self._document = document
        self.problems: list[CellProblem] = []

    def _sub(self, path: KeyPath, table: Mapping[str, Any], key: str, keys: Keys) -> Fields:
        path = (*path, key)
        return self._fields(path, self._table(path, table.get(key, {})), keys)

    def _fields(
        self, path: KeyPath, table: Fields, keys: Keys, tables: Mapping[str, Keys | None] | None = None
    ) -> Fields:
        """Read the keys of one table; a missing or wrong key is reported and left out, so that its default applies."""
        tables = tables or {}
        self._unknown(path, table, (*keys, *tables), "key", tables)
        fields: Fields = {}
        faulty = set()
        for name, key in keys.items():
            if name in table:
                try:
                    fields[name] = key.read(table[name])
                except value_readers.InvalidValue as unfit:
                    self._unfit((*path, name), table[name], unfit)
                    faulty.add(name)
            elif key.missing:
                self._error(
                    path,
                    f"{name} is missing in {self._where(path)}",
                    remedy=f"add {key.missing}",
                    rule=MISSING,
                )
                faulty.add(name)
        lines = {name: self._document.line((*path, name)) for name in table}
        fields["at"] = SourceLocation(name_of(path), self._document.line(path), lines, frozenset(faulty))
        return fields

    def _table(self, path: KeyPath, raw: Any) -> Fields:
        if isinstance(raw, dict):
            return raw
        double = isinstance(raw, list) and raw and isinstance(raw[0], dict)
        remedy = (
            f"write [{name_of(path)}] in single brackets"
            if double
            else f"write [{name_of(path)}] on a line of its own"
        )
        self._error(
            path, f"{name_of(path)} must be a table", f"it is {value_readers.told(raw)}", remedy, NO_TABLE
        )
        return {}

    def _named(self, path: KeyPath, name: str) -> bool:
        if _NAME.fullmatch(name):
            return True
        self._error(
            path,
            f"{name[:80]!r} is not a name",
            remedy="a name may contain letters, digits, _ and -",
            rule=NO_NAME,
        )
        return False

    def _unknown(
        self,
        path: KeyPath,
        table: Fields,
        known: tuple[str, ...],
        what: str,
        tables: Mapping[str, Keys | None] | None = None,
    ) -> None:
        for key in table:
            if key in known:
                continue
            remedy = self._advice(key, path, known, tables or {})
            message = f"unknown {what} {key[:80]!r} in {self._where(path)}"
            self._error((*path, key), message, remedy=remedy, rule=UNKNOWN)

    def _where(self, path: KeyPath) -> str:
        """Return the name of a table in brackets; the kind of file, if ``path`` is empty."""
        return f"[{name_of(path)}]" if path else f"a {self._document.kind}"

    def _advice(
        self, key: str, path: KeyPath, known: tuple[str, ...], tables: Mapping[str, Keys | None]
    ) -> str:
        """Return the right table of an unknown key, or a similar known key, or all known keys."""
        for name, keys in tables.items():
            if keys and key in keys:
                return f"it belongs in [{name_of((*path, name))}]"
        near = get_close_matches(key.lower(), known, n=1, cutoff=0.6)
        meant = near[0] if near else _ELSEWHERE.get(key.lower(), "")
        if meant in known:
            return f"did you mean {meant}?"
        return f"the known names are {', '.join(known)}"

    def _unfit(self, path: KeyPath, raw: Any, unfit: value_readers.InvalidValue) -> None:
        key = path[-1]
        message = f"{key} in {self._where(path[:-1])} cannot be used"
        observed = f"it is {value_readers.told(raw)}; expected {unfit.expected}"
        self._error(path, message, observed, unfit.remedy or f"correct {key}", UNFIT)

    def _error(
        self, path: KeyPath, message: str, observed: str = "", remedy: str = "", rule: str = TOGETHER
    ) -> None:
        line, file = self._document.line(path), self._document.file
        self.problems.append(CellProblem(Severity.ERROR, file, line, message, observed, remedy, rule=rule))

    def _warning(self, path: KeyPath, message: str, remedy: str, rule: str) -> None:
        line, file = self._document.line(path), self._document.file
        self.problems.append(CellProblem(Severity.WARNING, file, line, message, "", remedy, rule=rule))


def name_of(path: KeyPath) -> str:
    """Return the key of a table or value as it is written in the file."""
    return ".".join(str(part) for part in path)


# Keys of other files and other programs -> the keys of a cell file.
_ELSEWHERE = {
    "period": "scan_period",
    "cycle_time": "scan_period",
    "baudrate": "bitrate",
    "node_id": "node",
    "max_speed": "max_velocity",
    "speed": "velocity",
    "limits": "position_limits",
    "inverted": "invert",
    "direction": "invert",
}
