"""Endpoints: parameters and functions by number, as accessed by RxSdo, and the list of their names."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

from axisbus.sim.can_simple.parameters import FORMATS, Parameters, Row, Value, fitted, number_in, rows


class Endpoints:
    """Reads, writes and calls by path or number; stores the arguments of functions until they are called.

    The number of a function's argument follows that of the function. The argument is written first, then the function is called.
    """

    def __init__(
        self,
        parameters: Parameters,
        name: str,
        live: Mapping[str, Callable[[], Value]],
        acts: Mapping[str, Callable[[Value], None]],
    ) -> None:
        """``name``: the list whose numbers are used. ``live``: measured values. ``acts``: actions of a write or call."""
        self.name = name
        self._parameters = parameters
        self._live = live
        self._acts = acts
        self._by_number = {number_in(name, row.number): row for row in rows()}
        self._by_path = {row.path: row for row in rows()}
        self._argument_of = {
            number + 1: row for number, row in self._by_number.items() if row.is_function and row.kind
        }
        self._given: dict[str, Value] = {}

    def number(self, path: str) -> int:
        """Return the number of a path in this list."""
        return number_in(self.name, self._by_path[path].number)

    def read(self, path: str) -> Value:
        """Return a value by its path."""
        live = self._live.get(path)
        row = self._by_path[path]
        if live is None:
            return self._parameters[path]
        value = fitted(row.kind, live())
        return 0 if value is None else value

    def write(self, path: str, value: Value = 0) -> None:
        """Write a value, or call a function, by its path; a value that does not fit its type is ignored."""
        row = self._by_path[path]
        held = value if not row.kind else fitted(row.kind, value)
        if row.access == "r" or held is None:
            return
        if not row.is_function:
            self._parameters[path] = held
        act = self._acts.get(path)
        if act is not None:
            act(held)

    def read_bytes(self, number: int) -> bytes | None:
        """Return the four bytes of the answer to RxSdo; None if the endpoint cannot be read."""
        row = self._by_number.get(number)
        if row is None or row.is_function:
            return None
        return struct.pack(FORMATS[row.kind], self.read(row.path)).ljust(4, b"\0")[:4]

    def path_of(self, number: int) -> str | None:
        """Return the path of the parameter or function with this number, if it can be written or called."""
        row = self._by_number.get(number)
        return None if row is None or row.access == "r" else row.path

    def write_bytes(self, number: int, data: bytes) -> None:
        """Write the four bytes of RxSdo, or call; a missing or read-only endpoint is ignored."""
        argument = self._argument_of.get(number)
        if argument is not None:
            self._given[argument.path] = _unpacked(argument.kind, data)
            return
        path = self.path_of(number)
        if path is None:
            return
        row = self._by_path[path]
        self.write(path, self._given.get(path, 0) if row.is_function else _unpacked(row.kind, data))

    def as_json(self) -> list[dict[str, Any]]:
        """Return the list in the format of the firmware's file: nested, functions with their arguments and without access."""
        top: list[dict[str, Any]] = [{"name": "", "id": 0, "type": "json", "access": "r"}]
        for row in rows():
            *folders, name = row.path.split(".")
            _folder(top, folders).append(self._leaf(row, name))
        return top

    def _leaf(self, row: Row, name: str) -> dict[str, Any]:
        number = number_in(self.name, row.number)
        if not row.is_function:
            kind = "uint16" if row.path == "can.config.protocol" and self.name == "v8" else row.kind
            return {"name": name, "id": number, "type": kind, "access": row.access}
        inputs = []
        if row.kind:
            inputs = [{"name": "value", "id": number + 1, "type": row.kind, "access": "rw"}]
        return {"name": name, "id": number, "type": "function", "inputs": inputs, "outputs": []}


def _unpacked(kind: str, data: bytes) -> Value:
    size = struct.calcsize(FORMATS[kind])
    value: Value = struct.unpack(FORMATS[kind], data.ljust(size, b"\0")[:size])[0]
    return value


def _folder(members: list[dict[str, Any]], folders: list[str]) -> list[dict[str, Any]]:
    for name in folders:
        found = next((one for one in members if one["name"] == name and "members" in one), None)
        if found is None:
            found = {"name": name, "type": "object", "members": []}
            members.append(found)
        members = found["members"]
    return members
