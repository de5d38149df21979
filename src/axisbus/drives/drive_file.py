"""Read a drive file: the facts about a make of drives as TOML, without code; every error with its line and its remedy."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from axisbus.cia402.axes import FIRST_AXIS
from axisbus.cia402.modes import FACTS
from axisbus.drives.plugin import (
    STORE_ALL,
    Behaviour,
    DrivePlugin,
    FaultObject,
    FaultTexts,
    MeasuredObject,
    NodeIdObject,
)
from axisbus.errors import ConfigError
from axisbus.toml import document as toml
from axisbus.toml import value_readers as v
from axisbus.toml.document import KeyPath, TomlDocument
from axisbus.toml.problem import CellProblem, as_exception, as_problem, errors
from axisbus.toml.tables import NO_NAME, CellKey, Fields, Keys, Tables

KIND = "drive file"

_OBJECT = re.compile(r"([0-9A-Fa-f]{4})h?(?::([0-9A-Fa-f]{2}))?", re.ASCII)
_CODE = re.compile(r"(?:0x)?([0-9A-Fa-f]{4})h?", re.ASCII)
_OBJECT_JSON = {"type": "string", "pattern": f"^(?:{_OBJECT.pattern})$"}


def _object(value: Any) -> tuple[int, int | None]:
    found = _OBJECT.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        raise v.InvalidValue(
            'an object such as "2320h" or "3201h:01"', "write its index in four hexadecimal digits, in quotes"
        )
    return int(found[1], 16), None if found[2] is None else int(found[2], 16)


def _address(value: Any) -> tuple[int, int]:
    index, subindex = _object(value)
    return index, subindex or 0


def _profile_index(value: Any) -> int:
    index, subindex = _object(value)
    if subindex is not None or index not in FIRST_AXIS:
        raise v.InvalidValue(
            'an object of the drive profile without a sub-index, such as "605Dh"',
            "write 6000h to 67FFh, as for a first axis",
        )
    return index


address = v.ValueReader(_address, _OBJECT_JSON)
_any_object = v.ValueReader(_object, _OBJECT_JSON)
_profile_object = v.ValueReader(_profile_index, {"type": "string", "pattern": "^6[0-7][0-9A-Fa-f]{2}h?$"})
_unsigned32 = v.integer(0, 0xFFFF_FFFF)
_step_time = CellKey(v.duration("1ms", "600s"))
_texts = CellKey(v.list_of(v.text, "texts"))
_flag = CellKey(v.boolean)

# What a make and an axis of a cell file may both set: the axis overrides the make.
OF_AXIS: Keys = {
    "handshake": CellKey(v.words("acknowledge", "on-change")),
    "homing_reached": CellKey(v.boolean),
    "demand": CellKey(v.words("auto", "use", "ignore")),
    "modes": CellKey(v.names([facts.short for facts in FACTS.values()], "modes")),
    "ignored_objects": CellKey(v.list_of(_profile_object, "objects", empty=True)),
    "transition_time": _step_time,
    "mode_time": _step_time,
    "acknowledge_time": _step_time,
}
BEHAVIOUR: Keys = {**OF_AXIS, "lists_modes": _flag, "store_restarts": _flag}
TOP: Keys = {
    "name": CellKey(v.text, 'name = "ACME servo", as it is shown'),
    "vendor_id": CellKey(_unsigned32, "vendor_id = 0x123, the value of 1018h:01 (axisbus scan shows it)"),
    "product_codes": CellKey(v.list_of(_unsigned32, "product codes")),
    "revisions": CellKey(v.list_of(_unsigned32, "revisions")),
    "eds_files": _texts,
    "calibration_objects": CellKey(v.list_of(_any_object, "objects")),
    "scale_proposal": CellKey(v.text),
    "unread_watchdog": CellKey(v.text),
    "notes": _texts,
    "sources": _texts,
}
MEASURED: Keys = {
    "object": CellKey(address, 'object = "3201h:01"'),
    "factor": CellKey(v.positive, "factor = the value of one increment of the object, in °C, V or A"),
    "relative_to": CellKey(address),
}
FAULT_OBJECT: Keys = {
    "object": CellKey(address, 'object = "2320h"'),
    "from_bit": CellKey(v.integer(0, 31)),
    "width": CellKey(v.integer(1, 32)),
}
NODE_ID: Keys = {
    "object": CellKey(address, 'object = "2009h"'),
    "store": CellKey(address),
}
MEASURED_NAMES = ("temperature", "voltage", "current")
TABLES: Mapping[str, Keys | None] = {
    "behaviour": BEHAVIOUR,
    "errors": None,
    "measured": None,
    "fault_objects": None,
    "node_id": NODE_ID,
}
_OF_FAULT: Mapping[str, Keys | None] = {"bits": None, "values": None}


def load(path: str | Path) -> DrivePlugin:
    """Read a drive file; blocks while the file is read.

    Raises:
        ConfigError: the file cannot be read, is not TOML, or contains an error; the first error, with the others listed.
    """
    return _valid(*read(path))


def of_resource(file: Traversable) -> DrivePlugin:
    """Read a drive file of an installed package; blocks, and raises as ``load``."""
    return _valid(*_interpreted(lambda: toml.loads(file.read_text("utf-8"), str(file), KIND)))


def read(path: str | Path) -> tuple[DrivePlugin | None, list[CellProblem]]:
    """Read a drive file and return it with all errors in it, in the order of the lines; the plug-in is None if there are any.

    Blocks while the file is read; raises nothing.
    """
    return _interpreted(lambda: toml.load(path, KIND))


def _interpreted(document: Callable[[], TomlDocument]) -> tuple[DrivePlugin | None, list[CellProblem]]:
    try:
        reading = _Reading(document())
    except ConfigError as error:
        return None, [as_problem(error)]
    plugin = reading.plugin()
    return plugin, sorted(reading.problems, key=lambda problem: problem.rank)


def _valid(plugin: DrivePlugin | None, problems: list[CellProblem]) -> DrivePlugin:
    if plugin is None:
        raise as_exception(errors(problems))
    return plugin


class _Reading(Tables):
    """One walk through the tables of a drive file."""

    def plugin(self) -> DrivePlugin | None:
        """Return the plug-in, None if the file has an error."""
        top = self._document.data
        fields = self._fields((), top, TOP, TABLES)
        behaviour = self._sub((), top, "behaviour", BEHAVIOUR)
        codes = self._numbered(("errors",), top.get("errors", {}), _code)
        objects = self._fault_objects(top.get("fault_objects", []))
        measured = self._measured(self._table(("measured",), top.get("measured", {})))
        node_id = self._node_id(top)
        if self.problems:
            return None
        del fields["at"], behaviour["at"]
        for key in ("product_codes", "revisions"):
            if key in fields:
                fields[key] = frozenset(fields[key])
        folder = Path(self._document.file).parent
        fields["eds_files"] = tuple(str(folder / file) for file in fields.get("eds_files", ()))
        return DrivePlugin(
            **fields,
            behaviour=Behaviour(**behaviour),
            fault_objects=tuple(each.address for each in objects),
            explain=FaultTexts(codes, objects),
            measured=measured,
            node_id=node_id,
        )

    def _node_id(self, top: Fields) -> NodeIdObject | None:
        if "node_id" not in top:
            return None
        fields = self._sub((), top, "node_id", NODE_ID)
        if not fields["at"].sound(*NODE_ID):
            return None
        return NodeIdObject(fields["object"], fields.get("store", STORE_ALL))

    def _numbered(self, path: KeyPath, raw: Any, number: Callable[[str], int]) -> dict[int, str]:
        """Read a table whose keys are numbers and whose values are texts."""
        found: dict[int, str] = {}
        for key, value in self._table(path, raw).items():
            try:
                found[number(key)] = v.text(value)
            except v.InvalidValue as unfit:
                if isinstance(value, str) and value.strip():
                    self._error(
                        (*path, key), f"{key!r} is not {unfit.expected}", remedy=unfit.remedy, rule=NO_NAME
                    )
                else:
                    self._unfit((*path, key), value, unfit)
        return found

    def _measured(self, table: Fields) -> dict[str, MeasuredObject]:
        self._unknown(("measured",), table, MEASURED_NAMES, "value")
        found = {}
        for name in MEASURED_NAMES:
            if name not in table:
                continue
            fields = self._sub(("measured",), table, name, MEASURED)
            if fields["at"].sound(*MEASURED):
                (index, subindex), reference = fields["object"], fields.get("relative_to")
                of = None if reference is None else reference[0]
                found[name] = MeasuredObject(index, subindex, fields["factor"], of)
        return found

    def _fault_objects(self, raw: Any) -> tuple[FaultObject, ...]:
        path: KeyPath = ("fault_objects",)
        if not isinstance(raw, list) or not all(isinstance(each, dict) for each in raw):
            self._error(
                path,
                "fault_objects must be a list of tables",
                remedy="write [[fault_objects]] in double brackets",
            )
            return ()
        return tuple(
            each for number, table in enumerate(raw) if (each := self._fault_object((*path, number), table))
        )

    def _fault_object(self, path: KeyPath, table: Fields) -> FaultObject | None:
        fields = self._fields(path, table, FAULT_OBJECT, _OF_FAULT)
        bits = self._numbered((*path, "bits"), table.get("bits", {}), _bit)
        values = self._numbered((*path, "values"), table.get("values", {}), _value)
        if not fields["at"].sound(*FAULT_OBJECT):
            return None
        from_bit = fields.get("from_bit", 0)
        width = fields.get("width", 32 - from_bit)
        if from_bit + width > 32:
            message = f"from_bit = {from_bit} and width = {width} exceed 32 bits"
            self._error((*path, "width"), message, remedy=f"write width = {32 - from_bit} or less")
        index, subindex = fields["object"]
        return FaultObject(index, subindex, bits, values, from_bit, width)


def _code(key: str) -> int:
    found = _CODE.fullmatch(key)
    if found is None:
        raise v.InvalidValue("an error code", "write it in four hexadecimal digits, such as 8611h or 0x8611")
    return int(found[1], 16)


def _bit(key: str) -> int:
    if not key.isascii() or not key.isdigit() or int(key) > 31:
        raise v.InvalidValue("the number of a bit", "write 0 to 31")
    return int(key)


def _value(key: str) -> int:
    try:
        return int(key, 0)
    except ValueError:
        raise v.InvalidValue("a whole number", "write it in decimal, or as 0x1F") from None
