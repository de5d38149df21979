"""The tables of a cell file: each key with its reader, and the remedy if a required key is missing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from axisbus.cell.model import CANOPEN
from axisbus.cell.other_protocols import keys_of
from axisbus.cia301.cob import ID_MASK_11
from axisbus.cia402 import options
from axisbus.drives import registry
from axisbus.drives.drive_file import OF_AXIS
from axisbus.toml import value_readers as v
from axisbus.toml.tables import CellKey, Keys

_positive = CellKey(v.positive)
_number = CellKey(v.finite)
_text = CellKey(v.text)
_flag = CellKey(v.boolean)
_unsigned32 = CellKey(v.integer(0, 0xFFFF_FFFF))
_step_time = CellKey(v.duration("1ms", "600s"))
_scale = CellKey(v.scale)

BUS: Keys = {
    "interface": CellKey(
        v.text, 'interface = "socketcan" (channel = "can0"), or "sim" to run without hardware'
    ),
    "channel": CellKey(v.text_or_number),
    "bitrate": CellKey(v.integer(10_000, 1_000_000)),
    "master_id": CellKey(v.integer(1, 127)),
    "scan_period": CellKey(v.duration("100us", "1s"), 'scan_period = "4ms"; the scan always has a period'),
    "sync": _flag,
    "sync_producer": CellKey(v.words("master", "external")),
    "sync_cob_id": CellKey(v.integer(1, ID_MASK_11)),
    "sync_counter": CellKey(v.or_word("off", 0, v.integer(2, 240))),  # 1019h (CiA 301 7.5.2.22)
    "sync_timeout": CellKey(v.duration("1ms", "10s")),
    "time": CellKey(v.or_word("off", None, v.duration("10ms", "60min"))),
    "time_cob_id": CellKey(v.integer(1, ID_MASK_11)),
    # A drive waits for three heartbeats, and 1016h holds at most 65535 ms.
    "heartbeat": CellKey(v.or_word("off", None, v.duration("1ms", "20s"))),
    "on_lost_node": CellKey(v.words("group", "cell", "report")),
    "process": CellKey(v.words("thread", "own")),
    "beside": _flag,
}

_NODE: Keys = {
    "eds": _text,
    "dcf": _text,
    "remap": CellKey(v.words("auto", "never")),
    "optional": _flag,
    "on_lost": CellKey(v.words("stop", "report")),
    "rejoin": CellKey(v.words("manual", "automatic")),
    "serial": _unsigned32,
    "revision": _unsigned32,
    "configuration_date": CellKey(v.days),
    "configuration_time": CellKey(v.time_of_day),
    "restore_defaults": _flag,
}


def node_keys() -> Keys:
    """Return the keys of ``[nodes.N]``; the drive plug-ins have the words of its protocol."""
    return {
        **_NODE,
        "protocol": CellKey(v.words(CANOPEN, *registry.protocols())),
        "firmware": _text,
    }


PROGRAM: Keys = {
    "date_time": CellKey(v.date_time),
    "identification": _unsigned32,
    "file": _text,
    "download": _flag,
    "deadline": CellKey(v.duration("1s", "60min")),
}

PDO: Keys = {
    "map": CellKey(v.list_of(v.text, "objects, each a text such as \"6040\" or \"607A:00\"", empty=True)),
    "transmission": CellKey(v.integer(0, 255)),
    "event_timer": CellKey(v.or_word("off", 0.0, v.duration("1ms", "65.535s"))),
    "inhibit_time": CellKey(v.or_word("off", 0.0, v.duration("100us", "6.5535s"))),
    "cob_id": CellKey(v.integer(1, ID_MASK_11)),
    "sync_start": CellKey(v.integer(0, 240)),
    "rtr": CellKey(v.duration("1ms", "600s")),
}  # fmt: skip

AXIS: Keys = {
    "node": CellKey(v.integer(1, 127), "node = 1, the number of its [nodes.N]"),
    "drive_axis": CellKey(v.integer(1, 8)),
    "virtual": _flag,
    "encoder": CellKey(v.text),
    "unit": CellKey(v.unit, 'unit = "deg", "mm" or the like; unit = "increments" needs no scale'),
    "scale": _scale,
    "velocity_scale": _scale,
    "acceleration_scale": _scale,
    "invert": CellKey(v.words("master", "drive")),
    "rated_torque": _positive,
    "position_limits": CellKey(v.interval),
    "max_velocity": _positive,
    "max_acceleration": _positive,
    "max_torque": _positive,
    "limits_in_drive": _flag,
    "modulo": _positive,
    "position_window": _positive,
    "standstill_velocity": _positive,
    "standstill_window": _positive,
    "following_error": CellKey(v.or_word("off", math.inf, v.positive)),
    "demand": OF_AXIS["demand"],
    "modes": OF_AXIS["modes"],
    "ignored_objects": OF_AXIS["ignored_objects"],
    "holds_load": CellKey(v.never_true(None, v.words("brake", "torque"))),
    "transition_time": OF_AXIS["transition_time"],
    "mode_time": OF_AXIS["mode_time"],
    "acknowledge_time": OF_AXIS["acknowledge_time"],
    "handshake": OF_AXIS["handshake"],
    "homing_reached": OF_AXIS["homing_reached"],
}

DEFAULTS: Keys = {
    "velocity": _positive,
    "acceleration": _positive,
    "deceleration": _positive,
    "torque_slope": _positive,
    "jerk": _positive,
}

HOMING: Keys = {
    "absolute": _flag,
    "method": CellKey(v.integer(-128, 127)),
    "speed_switch": _positive,
    "speed_zero": _positive,
    "acceleration": _positive,
    "timeout": CellKey(v.duration("100ms", "60min")),
    "required": _flag,
    "offset": _number,
}

STOP: Keys = {
    **{option.key: CellKey(v.words(*option.words)) for option in options.ALL},
    "deceleration": _positive,
    "halt_time": _step_time,
    "quick_stop_time": _step_time,
    "disable_time": _step_time,
}

FEED_FORWARD: Keys = {
    "velocity": _flag,
    "inertia": _positive,
    "torque_offset": _number,
}

GROUP: Keys = {
    "axes": CellKey(v.list_of(v.text, "axes' names"), 'axes = ["x", "y"]'),
    "on_fault": CellKey(v.words("path", "each", "quick")),
}

KINEMATICS: Keys = {
    "kind": CellKey(v.words("corexy", "scara", "delta"), 'kind = "corexy", "scara" or "delta"'),
    "upper": _positive,
    "fore": _positive,
    "base": _number,
    "plate": _number,
    "left": _flag,
    "middle": _number,
}

GANTRY: Keys = {
    "axes": CellKey(v.list_of(v.text, "axes' names"), 'axes = ["y1", "y2"], the two that carry the beam'),
    "max_skew": CellKey(
        v.positive, "max_skew = the allowed skew of the beam, in the axes' unit; it is never guessed"
    ),
    "offset": _number,
}

GANTRY_HOMING: Keys = {
    "switches": CellKey(v.words("each", "first")),
    "input": CellKey(v.integer(1, 2), "input = 1 or 2, the touch probe that the switch is wired to"),
    "edge": CellKey(
        v.words("rising", "falling"),
        'edge = "rising" or "falling", the edge of the switch when both axes reach it',
    ),
    "velocity": CellKey(v.positive, "velocity = unit/s of the search; it is never guessed"),
    "distance": CellKey(
        v.finite, "distance = the longest search distance, below 0 towards smaller positions"
    ),
    "positions": CellKey(
        v.list_of(v.finite, "numbers"),
        "positions = [0.0, 0.0], the position of each axis at its own switch",
    ),
    "skew": _positive,
}

IO: Keys = {
    "node": CellKey(v.integer(1, 127), "node = 5, the number of its [nodes.N]"),
    "object": CellKey(v.text, 'object = "6200h:01", the input or output object; [nodes.N] has its EDS'),
    "bit": CellKey(v.integer(0, 31)),
    "safe": CellKey(v.safe),
    "scale": _scale,
    "offset": _number,
    "unit": _text,
}

DRIVES = CellKey(v.list_of(v.text, "drive files and folders of drive files"))
TOP = ("bus", "nodes", "axes", "groups", "gantries", "io")
# Tables inside a table; ``None``: the table may have any key.
BUS_TABLES: Mapping[str, Keys | None] = {"options": None}
_NODE_TABLES: Mapping[str, Keys | None] = {"objects": None, "pdo": None, "program": PROGRAM}


class NodeTables(Mapping[str, Keys | None]):
    """The tables inside ``[nodes.N]``; a plug-in is imported when the keys of its protocol's table are read."""

    def __getitem__(self, name: str) -> Keys | None:
        if name in _NODE_TABLES:
            return _NODE_TABLES[name]
        if name not in registry.protocols():
            raise KeyError(name)
        return keys_of(name)

    def __iter__(self) -> Iterator[str]:
        return iter((*_NODE_TABLES, *registry.protocols()))

    def __len__(self) -> int:
        return len(_NODE_TABLES) + len(registry.protocols())


AXIS_TABLES: Mapping[str, Keys | None] = {
    "defaults": DEFAULTS,
    "homing": HOMING,
    "stop": STOP,
    "feed_forward": FEED_FORWARD,
    "objects": None,
}
GROUP_TABLES: Mapping[str, Keys | None] = {"kinematics": KINEMATICS}
GANTRY_TABLES: Mapping[str, Keys | None] = {"homing": GANTRY_HOMING}
