"""Read a cell file: convert TOML to frozen values, and collect all errors in its text.

Theory of operation. ``schema`` defines the keys of each table; ``_Reading`` walks the file by it and never stops at a problem. It
reports an unusable value, adds its key to the ``faulty`` keys of its table, and replaces the value by a placeholder, so that the
rest can still be checked. ``check`` finds out whether the parts fit each other and the drives.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from axisbus.cell import group_kinematics, schema, virtual_keys
from axisbus.cell.gantry_validation import wrong
from axisbus.cell.model import (
    INCREMENTS,
    AxisConfig,
    BusConfig,
    CellConfig,
    DefaultsConfig,
    FeedForwardConfig,
    GantryConfig,
    GantryHomingConfig,
    GroupConfig,
    HomingConfig,
    IoConfig,
    KinematicsConfig,
    NodeConfig,
    ObjectSetting,
    PdoConfig,
    ProgramConfig,
    SourceLocation,
    StopConfig,
)
from axisbus.cell.other_protocols import part_for
from axisbus.cell.virtual_keys import quick_deceleration
from axisbus.drives import drive_file, registry
from axisbus.drives.plugin import DrivePlugin
from axisbus.errors import ConfigError
from axisbus.toml import document as toml
from axisbus.toml import value_readers
from axisbus.toml.document import KeyPath, TomlDocument
from axisbus.toml.problem import CellProblem, as_exception, as_problem, errors
from axisbus.toml.tables import (
    MISSING,
    NO_AXIS,
    NO_NAME,
    TWO_OF_A_NAME,
    CellKey,
    Fields,
    Keys,
    Tables,
    name_of,
)

__all__ = [
    "AxisConfig",
    "BusConfig",
    "CellConfig",
    "DefaultsConfig",
    "FeedForwardConfig",
    "GroupConfig",
    "HomingConfig",
    "IoConfig",
    "NodeConfig",
    "ObjectSetting",
    "PdoConfig",
    "ProgramConfig",
    "SourceLocation",
    "StopConfig",
    "load",
    "loads",
    "read",
]

_ALONE = "only the core moves it: it has no node and no drive"


def load(path: str | Path) -> CellConfig:
    """Read a cell file; blocks while the file is read.

    Raises:
        ConfigError: the file cannot be read, is not TOML, or contains an error; the first error, with the others listed.
    """
    cell, problems = read(path)
    wrong = errors(problems)
    if cell is None or wrong:
        raise as_exception(wrong)
    return cell


def read(path: str | Path) -> tuple[CellConfig | None, list[CellProblem]]:
    """Read a cell file and return it with all errors in its text, in the order of the lines.

    The cell is None if the file cannot be read or is not TOML. A cell with errors contains placeholders and is only useful for
    further checks. Raises nothing.
    """
    try:
        return interpret(toml.load(path))
    except ConfigError as error:
        return None, [as_problem(error)]


def loads(text: str, file: str = "cell.toml") -> tuple[CellConfig | None, list[CellProblem]]:
    """Do the same as ``read`` with a text; ``file`` is the name in messages, and its folder is the base of relative paths."""
    try:
        return interpret(toml.loads(text, file))
    except ConfigError as error:
        return None, [as_problem(error)]


def interpret(document: TomlDocument) -> tuple[CellConfig, list[CellProblem]]:
    """Convert a TOML document to a cell, and return it with all errors in it."""
    reading = _Reading(document)
    cell = reading.cell()
    return cell, sorted(reading.problems, key=lambda problem: problem.rank)


_PDO_NAME = re.compile(r"([rt])pdo([1-9]\d{0,2})")


class _Reading(Tables):
    """One walk through the tables of a cell file."""

    def cell(self) -> CellConfig:
        top = self._document.data
        makes = self._drive_files(top.get("drives"))
        self._makes = tuple(makes.values())
        self._unknown((), top, ("drives", *schema.TOP), "table")
        return CellConfig(
            self._document.file,
            self._bus(top.get("bus")),
            {node.node_id: node for node in self._nodes(top.get("nodes"))},
            {axis.name: axis for axis in self._axes(self._table(("axes",), top.get("axes", {})))},
            {group.name: group for group in self._groups(self._table(("groups",), top.get("groups", {})))},
            self._document.text,
            {each.name: each for each in self._io(self._table(("io",), top.get("io", {})))},
            {each.name: each for each in self._gantries(self._table(("gantries",), top.get("gantries", {})))},
            tuple(makes),
        )

    def _advice(
        self, key: str, path: KeyPath, known: tuple[str, ...], tables: Mapping[str, Keys | None]
    ) -> str:
        if path[:1] == ("axes",) and len(path) == 3 and key in schema.AXIS:
            return f"it belongs in [{name_of(path[:2])}], before its sub-tables"
        if path[:1] in (("bus",), ("nodes",), ("axes",)) and len(path) <= 2:
            for table, keys in (
                ("bus", schema.BUS),
                ("nodes.N", schema.node_keys()),
                ("axes.NAME", schema.AXIS),
            ):
                if key in keys:
                    return f"it belongs in [{table}]"
        return super()._advice(key, path, known, tables)

    def _drive_files(self, raw: Any) -> dict[Path, DrivePlugin]:
        """Read the drive files that ``drives`` names, and those in the folders that it names; return the plug-ins by path."""
        found: dict[Path, DrivePlugin] = {}
        if raw is None:
            return found
        try:
            names = schema.DRIVES.read(raw)
        except value_readers.InvalidValue as unfit:
            self._unfit(("drives",), raw, unfit)
            return found
        for number, name in enumerate(names):
            path: KeyPath = ("drives", number)
            named = Path(self._document.file).parent / name
            files = sorted(named.glob("*.toml")) if named.is_dir() else [named]
            if not files:
                self._error(
                    path, f"the folder {name!r} has no drive file", remedy="name a folder with .toml files"
                )
            for file in files:
                plugin, problems = drive_file.read(file)
                here = f"named in {self._document.file}:{self._document.line(path)}"
                self.problems += [
                    each if each.line else replace(each, observed=each.observed or here) for each in problems
                ]
                if plugin is None:
                    continue
                same = next((other for other, each in found.items() if each.same_drives(plugin)), None)
                if same is not None:
                    self._error(
                        path,
                        f"{file} and {same} describe the same drives",
                        remedy="name one of them, or give their product_codes or revisions",
                    )
                found[file] = plugin
        return found

    # -- the tables --------------------------------------------------------------------------------------------------

    def _bus(self, raw: Any) -> BusConfig:
        if raw is None:
            self._error(
                (),
                "[bus] is missing",
                remedy='add [bus] with interface = "sim" (or "socketcan") and scan_period = "4ms"',
                rule=MISSING,
            )
            return BusConfig(at=SourceLocation("bus", 1, {}, frozenset(schema.BUS)))
        table = self._table(("bus",), raw)
        fields = self._fields(("bus",), table, schema.BUS, schema.BUS_TABLES)
        options = self._table(("bus", "options"), table.get("options", {}))
        return BusConfig(**fields, options=options)

    def _nodes(self, raw: Any) -> list[NodeConfig]:
        table = self._table(("nodes",), {} if raw is None else raw)
        if not table and not self._any_virtual():
            self._error(
                ("nodes",), "the cell has no node", remedy='add [nodes.1] with eds = "..."', rule=MISSING
            )
        return [node for key, value in table.items() if (node := self._node(key, value)) is not None]

    def _node(self, key: str, raw: Any) -> NodeConfig | None:
        path: KeyPath = ("nodes", key)
        node_id = _node_id(key)
        if node_id is None:
            remedy = "write [nodes.N] with N from 1 to 127, in decimal without leading zeros"
            self._error(path, f"{key!r} is not a node ID", remedy=remedy, rule=NO_NAME)
            return None
        table = self._table(path, raw)
        fields = self._fields(path, table, schema.node_keys(), schema.NodeTables())
        for spoken, words in registry.protocols().items():
            if fields.get("protocol") == spoken or spoken in table:
                return self._module(node_id, path, table, fields, spoken, words)
        if "firmware" in table:
            self._error(
                (*path, "firmware"),
                f"[nodes.{key}] speaks CANopen, and firmware has no effect",
                remedy="leave firmware out; [nodes.N.program] requires a program of a CANopen node",
            )
        if isinstance(raw, dict) and ("eds" in table) == ("dcf" in table):
            both = "eds" in table
            self._error(
                (*path, "dcf") if both else path,
                f"[nodes.{key}] gives {'both eds and dcf' if both else 'neither eds nor dcf'}",
                remedy="leave one of them out"
                if both
                else 'write eds = "drive.eds", a path relative to this file, or eds = "builtin:..."',
            )
        pdos = self._pdos((*path, "pdo"), table.get("pdo", {}))
        program = self._program(path, table)
        return NodeConfig(
            node_id,
            **fields,
            program=program,
            objects=self._objects(path, table),
            pdos=pdos,
            makes=self._makes,
        )

    def _module(
        self, node_id: int, path: KeyPath, table: Fields, fields: Fields, spoken: str, words: str
    ) -> NodeConfig:
        """Read a node that does not speak CANopen; all keys of CANopen nodes are refused, whatever their values."""
        name = name_of(path)
        for key in table:
            if key not in ("protocol", "firmware", spoken):
                remedy = f"leave {key} out; [{name}.{spoken}] has the settings that it needs"
                self._error((*path, key), f"[{name}] uses {words}, and has no {key}", remedy=remedy)
        if fields.get("protocol") != spoken:
            self._error(
                (*path, spoken), f"[{name}] does not use {words}", remedy=f'add protocol = "{spoken}"'
            )
        part = part_for(spoken)
        module = part.settings(spoken, self._sub(path, table, spoken, part.keys))
        return NodeConfig(node_id, **fields, module=module)

    def _any_virtual(self) -> bool:
        """Whether there is an axis that needs no node."""
        axes = self._document.data.get("axes")
        tables = axes.values() if isinstance(axes, dict) else ()
        return any(isinstance(table, dict) and virtual_keys.is_virtual(table) for table in tables)

    def _program(self, path: KeyPath, table: Fields) -> ProgramConfig | None:
        if "program" not in table:
            return None
        program = ProgramConfig(**self._sub(path, table, "program", schema.PROGRAM))
        if not any(program.at.gives(key) for key in ("date_time", "identification")):
            self._error(
                (*path, "program"),
                f"[{program.at.name}] has no identification of the program",
                remedy="add date_time = 2026-03-31T14:30:00 (the value of 1F52h), or identification = 0x1234 (1F56h:01)",
            )
        return program

    def _pdos(self, path: KeyPath, raw: Any) -> tuple[PdoConfig, ...]:
        found = []
        for key, value in self._table(path, raw).items():
            name = _PDO_NAME.fullmatch(key.lower())
            if name is None or int(name[2]) > 512:
                self._error(
                    (*path, key),
                    f"{key!r} is not a PDO",
                    remedy="write rpdo1 to rpdo512, or tpdo1 to tpdo512",
                    rule=NO_NAME,
                )
                continue
            fields = self._fields((*path, key), self._table((*path, key), value), schema.PDO)
            found.append(PdoConfig(name[1] == "r", int(name[2]), **fields))
        return tuple(found)

    def _objects(self, path: KeyPath, table: Mapping[str, Any]) -> tuple[ObjectSetting, ...]:
        path = (*path, "objects")
        found = []
        for key, raw in self._table(path, table.get("objects", {})).items():
            try:
                value = value_readers.setting(raw)
            except value_readers.InvalidValue as unfit:
                self._unfit((*path, key), raw, unfit)
                continue
            found.append(ObjectSetting(key, value, self._document.line((*path, key)), name_of(path)))
        return tuple(found)

    def _axes(self, table: Fields) -> list[AxisConfig]:
        if not table and "io" not in self._document.data:
            self._warning(
                ("axes",), "the cell has no axis", "add [axes.x] with node, unit and scale", NO_AXIS
            )
        return [self._axis(name, raw) for name, raw in table.items() if self._named(("axes", name), name)]

    def _axis(self, name: str, raw: Any) -> AxisConfig:
        path: KeyPath = ("axes", name)
        table = self._table(path, raw)
        if virtual_keys.is_virtual(table):
            return self._virtual_axis(name, path, table)
        keys = schema.AXIS
        if table.get("unit") != INCREMENTS:
            remedy = f"scale = position increments per {table.get('unit', 'unit')}; it is never guessed"
            keys = {**keys, "scale": CellKey(value_readers.scale, remedy)}
        fields = self._fields(path, table, keys, schema.AXIS_TABLES)
        return AxisConfig(
            name,
            **fields,
            defaults=DefaultsConfig(**self._sub(path, table, "defaults", schema.DEFAULTS)),
            homing=HomingConfig(**self._sub(path, table, "homing", schema.HOMING)),
            stop=StopConfig(**self._sub(path, table, "stop", schema.STOP)),
            feed_forward=FeedForwardConfig(**self._sub(path, table, "feed_forward", schema.FEED_FORWARD)),
            objects=self._objects(path, table),
        )

    def _virtual_axis(self, name: str, path: KeyPath, table: Fields) -> AxisConfig:
        """Read an axis without a drive; all keys that need a drive are refused, whatever their values."""
        found = list(virtual_keys.foreign(table))
        for below, remedy in found:
            what, of = name_of(below), name_of(path)
            kind = "an encoder" if virtual_keys.ENCODER in table else "a virtual axis"
            self._error((*path, *below), f"{what} cannot be in [{of}], {kind}", _ALONE, remedy)
        table = virtual_keys.without(table, found)
        own, _ = virtual_keys.keys_of(table)
        keys = {key: each for key, each in schema.AXIS.items() if key in own}
        if virtual_keys.ENCODER in table:
            return self._encoder(name, path, table, keys)
        fields = {
            "scale": virtual_keys.resolution(table.get("unit")),
            **self._fields(path, table, keys, schema.AXIS_TABLES),
        }
        axis = AxisConfig(
            name,
            **fields,
            defaults=DefaultsConfig(**self._sub(path, table, "defaults", schema.DEFAULTS)),
            stop=StopConfig(**self._sub(path, table, "stop", schema.STOP)),
        )
        if quick_deceleration(axis) is None and axis.stop.at.sound("deceleration"):
            self._error(
                path,
                f"no deceleration is given for [{name_of(path)}]",
                "a virtual axis has no drive with a ramp, and must not stop from one cycle to the next",
                f"add acceleration = ... to [{name_of(path)}.defaults], or deceleration = ... to [{name_of(path)}.stop]",
            )
        return axis

    def _encoder(self, name: str, path: KeyPath, table: Fields, keys: Keys) -> AxisConfig:
        """Read an axis whose position comes from an input; the number of counts per unit is never guessed."""
        if table.get("unit") != INCREMENTS:
            remedy = f"scale = counts per {table.get('unit', 'unit')}; it is never guessed"
            keys = {**keys, "scale": CellKey(value_readers.scale, remedy)}
        fields = self._fields(path, table, keys, schema.AXIS_TABLES)
        return AxisConfig(name, **{**fields, virtual_keys.VIRTUAL: True})

    def _io(self, table: Fields) -> list[IoConfig]:
        named = [(name, raw) for name, raw in table.items() if self._named(("io", name), name)]
        return [
            IoConfig(name, **self._fields(("io", name), self._table(("io", name), raw), schema.IO))
            for name, raw in named
        ]

    def _groups(self, table: Fields) -> list[GroupConfig]:
        axes = self._document.data.get("axes")
        found = []
        for name, raw in table.items():
            path: KeyPath = ("groups", name)
            if not self._named(path, name):
                continue
            if isinstance(axes, dict) and name in axes:
                where = f"[axes.{name}] is at line {self._document.line(('axes', name))}"
                remedy = "axes and groups share one name space: rename one of them"
                self._error(path, f"{name!r} names both an axis and a group", where, remedy, TWO_OF_A_NAME)
            table = self._table(path, raw)
            fields = self._fields(path, table, schema.GROUP, schema.GROUP_TABLES)
            made = self._kinematics(path, table, len(fields.get("axes", ())))
            found.append(GroupConfig(name, **fields, kinematics=made))
        return found

    def _gantries(self, table: Fields) -> list[GantryConfig]:
        found = []
        for name, raw in table.items():
            path: KeyPath = ("gantries", name)
            if not self._named(path, name):
                continue
            self._own_name(path, name)
            table = self._table(path, raw)
            fields = self._fields(path, table, schema.GANTRY, schema.GANTRY_TABLES)
            homing = None
            if "homing" in table:
                homing = GantryHomingConfig(**self._sub(path, table, "homing", schema.GANTRY_HOMING))
            config = GantryConfig(name, **fields, homing=homing)
            for key, message, remedy in wrong(config):
                self._error((*path, *key), message, remedy=remedy)
            found.append(config)
        return found

    def _own_name(self, path: KeyPath, name: str) -> None:
        """Report a gantry with the name of an axis or a group, because commands use the names of all three."""
        for kind in ("axes", "groups"):
            others = self._document.data.get(kind)
            if isinstance(others, dict) and name in others:
                where = f"[{kind}.{name}] is at line {self._document.line((kind, name))}"
                remedy = "axes, groups and gantries share one name space: rename one of them"
                self._error(path, f"{name!r} names two things", where, remedy, TWO_OF_A_NAME)

    def _kinematics(self, path: KeyPath, table: Fields, axes: int) -> KinematicsConfig | None:
        if "kinematics" not in table:
            return None
        config = KinematicsConfig(**self._sub(path, table, "kinematics", schema.KINEMATICS))
        if not config.kind:
            return None
        for key, message, remedy in group_kinematics.wrong(config, axes):
            at = (*path, "kinematics", key) if key else (*path, "kinematics")
            self._error(at, message, remedy=remedy)
        return config


def _node_id(key: str) -> int | None:
    if not re.fullmatch(r"[1-9]\d{0,2}", key, re.ASCII) or int(key) > 127:
        return None
    return int(key)
