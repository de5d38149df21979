"""A JSON Schema of drive files, for completion in editors, made from the tables that ``drive_file`` uses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from axisbus.drives import drive_file
from axisbus.toml.tables import Keys

Json = dict[str, Any]

_DRAFT = "http://json-schema.org/draft-07/schema#"  # all editors support it
ABOUT: Mapping[str, str] = {
    "name": "Name of the make, as reports show it.",
    "vendor_id": "1018h:01 of its drives.",
    "product_codes": "1018h:02 of its drives (default: any).",
    "revisions": "1018h:03 of its drives (default: any).",
    "eds_files": "EDS files of its drives for axisbus init; paths relative to this file.",
    "calibration_objects": "Objects with values of one drive alone, or that calibrate it: written only if the user names them.",
    "scale_proposal": "A text about the position scale, for a first cell file.",
    "unread_watchdog": "A sentence about a watchdog that no object reads, for the report of boot-up.",
    "notes": "Texts for a first cell file: what a user must know about these drives.",
    "sources": "The documents that the facts come from, with their sections.",
    "handshake": '"on-change" if bit 12 of the statusword is not reliable (default "acknowledge").',
    "homing_reached": "false if the drive does not set bit 10 at the end of homing (default true).",
    "demand": 'Whether 6062h is the demand of the axis: "use", "ignore", or "auto" (default): judged by its behaviour.',
    "modes": "Modes to use, if not all modes of the drive.",
    "ignored_objects": 'Objects that the drive has but does not act on, such as the option code "605Dh".',
    "transition_time": "How long one transition of the drive's state machine may take.",
    "mode_time": "How long a mode change may take.",
    "acknowledge_time": "How long the set-point acknowledge may take.",
    "lists_modes": "Whether 6502h lists the modes correctly (default true).",
    "store_restarts": "Whether storing the parameters (1010h) restarts the drive (default false).",
    "object": "Index and sub-index of the object.",
    "factor": "Value of one increment of the object, in °C, V or A.",
    "store": 'Object that stores the node-ID (default "1010h:01").',
    "relative_to": "Object of the reference value, if the object is a part of it.",
    "from_bit": "Lowest bit of the number in the object (default 0).",
    "width": "How many bits the number has (default: all from from_bit on).",
}
_TEXTS = {"type": "object", "additionalProperties": {"type": "string"}}


def schema_of_drive_files() -> Json:
    """Return the schema of a whole drive file, as plain values."""
    measured = {
        "type": "object",
        "properties": {name: _table(drive_file.MEASURED) for name in drive_file.MEASURED_NAMES},
        "additionalProperties": False,
        "description": "Objects of measured values, for axis.measure.",
    }
    fault_object = _table(
        drive_file.FAULT_OBJECT,
        bits={**_TEXTS, "description": "The meaning of each bit, by its number."},
        values={**_TEXTS, "description": "The meaning of each number."},
    )
    return {
        "$schema": _DRAFT,
        "title": "axisbus drive file",
        **_table(
            drive_file.TOP,
            behaviour={**_table(drive_file.BEHAVIOUR), "description": "Deviations from CiA 402."},
            errors={**_TEXTS, "description": "Texts of error codes (603Fh, EMCY): 8611h."},
            measured=measured,
            node_id={
                **_table(drive_file.NODE_ID),
                "description": "How an SDO sets the node-ID after the next restart.",
            },
            fault_objects={
                "type": "array",
                "items": fault_object,
                "description": "Objects that describe a fault, read when the drive is in fault.",
            },
        ),
    }


def _table(keys: Keys, **tables: Json) -> Json:
    """Return a table with these keys and sub-tables, and no others."""
    found: Json = {
        "type": "object",
        "properties": {
            **{key: {**each.read.json, "description": ABOUT[key]} for key, each in keys.items()},
            **tables,
        },
        "additionalProperties": False,
    }
    required = [key for key, each in keys.items() if each.missing]
    return {**found, "required": required} if required else found
