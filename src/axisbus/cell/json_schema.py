"""A JSON Schema of cell files, for completion in editors, made from the tables that ``reader`` uses.

It refuses no file that ``reader`` accepts. It cannot check everything (the order of two numbers, the bounds of a time, whether the
node of an axis exists); ``check`` does that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from axisbus.cell import key_descriptions, schema, virtual_keys
from axisbus.cell.group_kinematics import KINDS
from axisbus.cell.other_protocols import PACKAGE, CellPart
from axisbus.drives import registry
from axisbus.toml import value_readers
from axisbus.toml.tables import Keys
from axisbus.units import INCREMENTS

Json = dict[str, Any]

_DRAFT = "http://json-schema.org/draft-07/schema#"  # all editors support it
_NODE_ID = "^(?:[1-9]|[1-9][0-9]|1[01][0-9]|12[0-7])$"
_PDO = "^[rtRT][pP][dD][oO](?:[1-9]|[1-9][0-9]|[1-4][0-9][0-9]|50[0-9]|51[0-2])$"
# Letters of any language, digits, _ and -: everything but white space and the other characters of ASCII.
_NAME = r"^[^\s!-,./:-@\[-^`{-~]{1,64}$"


def schema_of_cells() -> Json:
    """Return the schema of a whole cell file, as plain values."""
    tables = {
        "bus": _bus(),
        "nodes": _many("nodes", _NODE_ID, _node()),
        "axes": _many("axes", _NAME, _axis()),
        "groups": _many(
            "groups", _NAME, _table(schema.GROUP, key_descriptions.GROUP, kinematics=_kinematics())
        ),
        "gantries": _many(
            "gantries", _NAME, _table(schema.GANTRY, key_descriptions.GANTRY, homing=_gantry_homing())
        ),
        "io": _many("io", _NAME, _table(schema.IO, key_descriptions.IO)),
    }
    return {
        "$schema": _DRAFT,
        "title": "axisbus cell file",
        "type": "object",
        "properties": {
            "drives": {**schema.DRIVES.read.json, "description": key_descriptions.DRIVES},
            **{name: tables[name] for name in schema.TOP},
        },
        "required": ["bus"],
        "anyOf": [{"required": ["nodes"]}, {"required": ["axes"]}],
        "additionalProperties": False,
    }


def _bus() -> Json:
    return _table(schema.BUS, key_descriptions.BUS, "bus", options=_open("bus.options"))


def _node() -> Json:
    program = _table(schema.PROGRAM, key_descriptions.PROGRAM, "nodes.program")
    program["anyOf"] = [{"required": ["date_time"]}, {"required": ["identification"]}]
    pdos = _many("nodes.pdo", _PDO, _table(schema.PDO, key_descriptions.PDO))
    objects = _objects("nodes.objects")
    parts: list[CellPart] = registry.parts(PACKAGE)
    others = {
        protocol: {**_table(part.keys, part.descriptions), "description": text}
        for part in parts
        for protocol, text in part.tables.items()
    }
    named = " or ".join(f'"{protocol}"' for protocol in others)
    about = {**key_descriptions.NODE, "protocol": key_descriptions.NODE["protocol"].format(named)}
    node = _table(schema.node_keys(), about, "", objects=objects, pdo=pdos, program=program, **others)
    node["oneOf"] = [{"required": [each]} for each in ("eds", "dcf", *others)]
    return node


def _axis() -> Json:
    axis = _table(
        schema.AXIS,
        key_descriptions.AXIS,
        defaults=_table(schema.DEFAULTS, key_descriptions.DEFAULTS, "axes.defaults"),
        homing=_table(schema.HOMING, key_descriptions.HOMING, "axes.homing"),
        stop=_table(schema.STOP, key_descriptions.STOP, "axes.stop"),
        feed_forward=_table(schema.FEED_FORWARD, key_descriptions.FEED_FORWARD, "axes.feed_forward"),
        objects=_objects("axes.objects"),
    )
    scaled: list[Json] = [{"properties": {"unit": {"const": INCREMENTS}}}, {"required": ["scale"]}]
    axis["required"].remove("node")
    alone: Json = {"properties": {virtual_keys.VIRTUAL: {"const": True}}, "required": [virtual_keys.VIRTUAL]}
    led = {"if": alone, "then": _virtual(), "else": {"required": ["node"], "anyOf": scaled}}
    return {**axis, "if": {"required": [virtual_keys.ENCODER]}, "then": _encoder(scaled), "else": led}


def _encoder(scaled: list[Json]) -> Json:
    """Return the keys that an axis with an encoder may have."""
    own: Json = dict.fromkeys(virtual_keys.KEYS_OF_ENCODER, True)
    return {"properties": own, "additionalProperties": False, "anyOf": scaled}


def _virtual() -> Json:
    """Return the keys that a virtual axis may have; any other key of it, or of its tables, is refused whatever its value."""
    own: Json = dict.fromkeys(virtual_keys.KEYS, True)
    for name, keys in virtual_keys.TABLES.items():
        own[name] = {"propertyNames": {"enum": sorted(keys)}}
    return {"properties": own, "additionalProperties": False}


def _gantry_homing() -> Json:
    return _table(schema.GANTRY_HOMING, key_descriptions.GANTRY_HOMING, "gantries.homing")


def _kinematics() -> Json:
    """Return the table of kinematics: each kind with its own keys, without those of other kinds."""
    table = _table(schema.KINEMATICS, key_descriptions.KINEMATICS, "groups.kinematics")
    each = [
        {
            "if": {"properties": {"kind": {"const": name}}, "required": ["kind"]},
            "then": {
                "required": list(kind.needs),
                "propertyNames": {"enum": ["kind", *kind.needs, *kind.may]},
            },
        }
        for name, kind in KINDS.items()
    ]
    return {**table, "allOf": each}


def _table(keys: Keys, about: Mapping[str, str], name: str = "", **tables: Json) -> Json:
    """Return a table with these keys and sub-tables, and no others."""
    found: Json = {
        "type": "object",
        "properties": {
            **{key: {**each.read.json, "description": about[key]} for key, each in keys.items()},
            **tables,
        },
        "additionalProperties": False,
    }
    required = [key for key, each in keys.items() if each.missing]
    return _described(name, {**found, "required": required} if required else found)


def _many(name: str, pattern: str, each: Json, **more: Any) -> Json:
    """Return a table of tables whose names match a pattern."""
    found = {"type": "object", "patternProperties": {pattern: each}, "additionalProperties": False, **more}
    return _described(name, found)


def _objects(name: str) -> Json:
    return _described(name, {"type": "object", "additionalProperties": dict(value_readers.setting.json)})


def _open(name: str) -> Json:
    return _described(name, {"type": "object"})


def _described(name: str, found: Json) -> Json:
    return {**found, "description": key_descriptions.TABLES[name]} if name else found
