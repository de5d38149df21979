"""What each table of a cell file may hold: each key with its reader, and what to write where a required one is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.cell import value_readers as v
from axisbus.cell.can_simple.module import CAN_SIMPLE, CANOPEN, MODBUS, READERS
from axisbus.cia301.cob import ID_MASK_11
from axisbus.cia402 import options
from axisbus.cia402.modes import FACTS


@dataclass(frozen=True, slots=True)
class Key:
    """One key; ``missing`` is the remedy where a required one is left out (empty: it is not required)."""

    read: v.Reader
    missing: str = ""


Keys = Mapping[str, Key]

_positive = Key(v.positive)
_number = Key(v.finite)
_text = Key(v.text)
_flag = Key(v.boolean)
_unsigned32 = Key(v.integer(0, 0xFFFF_FFFF))
_step_time = Key(v.duration("1ms", "600s"))
_scale = Key(v.scale)

BUS: Keys = {
    "interface": Key(v.text, 'interface = "socketcan" (channel = "can0"), or "sim" to run without hardware'),
    "channel": Key(v.text_or_number),
    "bitrate": Key(v.integer(10_000, 1_000_000)),
    "master_id": Key(v.integer(1, 127)),
    "scan_period": Key(v.duration("100us", "1s"), 'scan_period = "4ms"; the scan always has a period'),
    "sync": _flag,
    "sync_producer": Key(v.words("master", "external")),
    "sync_cob_id": Key(v.integer(1, ID_MASK_11)),
    "sync_counter": Key(v.or_word("off", 0, v.integer(2, 240))),  # 1019h (CiA 301 7.5.2.20)
    "sync_timeout": Key(v.duration("1ms", "10s")),
    "time": Key(v.or_word("off", None, v.duration("10ms", "60min"))),
    "time_cob_id": Key(v.integer(1, ID_MASK_11)),
    # A drive waits for three heartbeats, and 1016h counts 65535 ms at most.
    "heartbeat": Key(v.or_word("off", None, v.duration("1ms", "20s"))),
    "on_lost_node": Key(v.words("group", "cell", "report")),
    "process": Key(v.words("thread", "own")),
    "beside": _flag,
}

NODE: Keys = {
    "eds": _text,
    "dcf": _text,
    "remap": Key(v.words("auto", "never")),
    "optional": _flag,
    "on_lost": Key(v.words("stop", "tell")),
    "serial": _unsigned32,
    "revision": _unsigned32,
    "configuration_date": Key(v.days),
    "configuration_time": Key(v.time_of_day),
    "restore_defaults": _flag,
    "protocol": Key(v.words(CANOPEN, CAN_SIMPLE, MODBUS)),
    "firmware": _text,
}

MODULE: Keys = {key: Key(*each) for key, each in READERS.items()}

PROGRAM: Keys = {
    "date_time": Key(v.date_time),
    "identification": _unsigned32,
    "file": _text,
    "download": _flag,
    "deadline": Key(v.duration("1s", "60min")),
}

PDO: Keys = {
    "map": Key(v.list_of(v.text, "objects, each a text such as \"6040\" or \"607A:00\"", empty=True)),
    "transmission": Key(v.integer(0, 255)),
    "event_timer": Key(v.or_word("off", 0.0, v.duration("1ms", "65.535s"))),
    "inhibit_time": Key(v.or_word("off", 0.0, v.duration("100us", "6.5535s"))),
    "cob_id": Key(v.integer(1, ID_MASK_11)),
    "sync_start": Key(v.integer(0, 240)),
    "rtr": Key(v.duration("1ms", "600s")),
}  # fmt: skip

AXIS: Keys = {
    "node": Key(v.integer(1, 127), "node = 1, the number of its [nodes.N]"),
    "drive_axis": Key(v.integer(1, 8)),
    "virtual": _flag,
    "encoder": Key(v.text),
    "unit": Key(v.unit, 'unit = "deg", "mm" or the like; unit = "increments" to do without'),
    "scale": _scale,
    "velocity_scale": _scale,
    "acceleration_scale": _scale,
    "invert": Key(v.words("master", "drive")),
    "rated_torque": _positive,
    "position_limits": Key(v.interval),
    "max_velocity": _positive,
    "max_acceleration": _positive,
    "max_torque": _positive,
    "limits_in_drive": _flag,
    "modulo": _positive,
    "position_window": _positive,
    "standstill_velocity": _positive,
    "standstill_window": _positive,
    "following_error": Key(v.or_word("off", math.inf, v.positive)),
    "demand": Key(v.words("use", "ignore")),
    "modes": Key(v.names([facts.short for facts in FACTS.values()], "modes")),
    "holds_load": Key(v.never_true(None, v.words("brake", "torque"))),
    "transition_time": _step_time,
    "mode_time": _step_time,
    "acknowledge_time": _step_time,
    "handshake": Key(v.words("acknowledge", "on-change")),
}

DEFAULTS: Keys = {
    "velocity": _positive,
    "acceleration": _positive,
    "deceleration": _positive,
    "torque_slope": _positive,
    "jerk": _positive,
}

HOMING: Keys = {
    "method": Key(v.integer(-128, 127)),
    "speed_switch": _positive,
    "speed_zero": _positive,
    "acceleration": _positive,
    "timeout": Key(v.duration("100ms", "60min")),
    "required": _flag,
    "offset": _number,
}

STOP: Keys = {
    **{option.key: Key(v.words(*option.words)) for option in options.ALL},
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
    "axes": Key(v.list_of(v.text, "axes' names"), 'axes = ["x", "y"]'),
    "on_fault": Key(v.words("path", "each", "quick")),
}

KINEMATICS: Keys = {
    "kind": Key(v.words("corexy", "scara", "delta"), 'kind = "corexy", "scara" or "delta"'),
    "upper": _positive,
    "fore": _positive,
    "base": _number,
    "plate": _number,
    "left": _flag,
    "middle": _number,
}

GANTRY: Keys = {
    "axes": Key(v.list_of(v.text, "axes' names"), 'axes = ["y1", "y2"], the two that carry the beam'),
    "max_skew": Key(
        v.positive, "max_skew = how far out of square the beam may be, in the axes' unit; it is never guessed"
    ),
    "offset": _number,
}

GANTRY_HOMING: Keys = {
    "switches": Key(v.words("each", "first")),
    "input": Key(v.integer(1, 2), "input = 1 or 2, the touch probe that the switch is wired to"),
    "edge": Key(
        v.words("rising", "falling"),
        'edge = "rising" or "falling", that of the switch where both come upon it',
    ),
    "velocity": Key(v.positive, "velocity = unit/s of the search; it is never guessed"),
    "distance": Key(v.finite, "distance = how far to search at most, below 0 towards smaller positions"),
    "positions": Key(
        v.list_of(v.finite, "numbers"),
        "positions = [0.0, 0.0], what the place of each axis is called at its own switch",
    ),
    "skew": _positive,
}

IO: Keys = {
    "node": Key(v.integer(1, 127), "node = 5, the number of its [nodes.N]"),
    "object": Key(v.text, 'object = "6200h:01", the input or output object; [nodes.N] has its EDS'),
    "bit": Key(v.integer(0, 31)),
    "safe": Key(v.safe),
    "scale": _scale,
    "offset": _number,
    "unit": _text,
}

TOP = ("bus", "nodes", "axes", "groups", "gantries", "io")
# Tables inside a table; ``None``: any key may stand in it.
BUS_TABLES: Mapping[str, Keys | None] = {"options": None}
NODE_TABLES: Mapping[str, Keys | None] = {
    "objects": None,
    "pdo": None,
    "program": PROGRAM,
    CAN_SIMPLE: MODULE,
    MODBUS: MODULE,
}
AXIS_TABLES: Mapping[str, Keys | None] = {
    "defaults": DEFAULTS,
    "homing": HOMING,
    "stop": STOP,
    "feed_forward": FEED_FORWARD,
    "objects": None,
}
GROUP_TABLES: Mapping[str, Keys | None] = {"kinematics": KINEMATICS}
GANTRY_TABLES: Mapping[str, Keys | None] = {"homing": GANTRY_HOMING}
