"""The meaning of each key of a cell file in one line, for display in editors."""

from __future__ import annotations

from collections.abc import Mapping

TABLES: Mapping[str, str] = {
    "bus": "The CAN bus: adapter, scan, SYNC, heartbeat.",
    "bus.options": "Further options for the adapter, with python-can's names.",
    "nodes": "One table for each device: [nodes.1] to [nodes.127].",
    "nodes.objects": 'Objects to write at boot: "6065" = 4000, "6099:01" = 100, or by name.',
    "nodes.pdo": "PDOs to configure: rpdo1 to rpdo512, tpdo1 to tpdo512.",
    "nodes.program": "The program (firmware) that the node must have (1F52h, 1F56h).",
    "axes": "One table for each axis: [axes.x].",
    "groups.kinematics": "How the axes form a pose in a workspace; lines, paths and circles of the group are then in this "
    "workspace.",
    "axes.defaults": "Used by commands that leave them out.",
    "axes.homing": "How the axis finds its zero (CiA 402-2, hm).",
    "axes.stop": "Reactions to halt, quick stop, disable, fault and a lost link; written to the drive and read back.",
    "axes.feed_forward": "Feed-forward values sent to the drive, in csp and csv (60B1h, 60B2h).",
    "axes.objects": "Objects of the axis to write at boot, by the numbers of its first axis.",
    "io": "One table for each named input or output: [io.lamp].",
    "gantries": "Two axes that carry one beam and move as one: [gantries.y].",
    "gantries.homing": "How the pair is homed: both axes move together until their touch probes have detected their switches.",
    "groups": "Axes that move together and are stopped together by a fault: [groups.xy].",
}

DRIVES = "Drive files, and folders of drive files: the facts about makes that axisbus does not know."

BUS: Mapping[str, str] = {
    "interface": 'python-can\'s interface: "socketcan", "pcan", "kvaser", "slcan" ...; "sim" runs without hardware.',
    "channel": 'Which adapter: "can0", "PCAN_USBBUS1", 0 ...',
    "bitrate": "bit/s; with SocketCAN it is compared with the link's.",
    "master_id": "Node ID of the master (default 127).",
    "scan_period": 'Commands, SYNC and feedback are transmitted once in this time: "4ms".',
    "sync": "Whether SYNC is sent or received (default true).",
    "sync_producer": 'Who sends SYNC: "master" (default), or "external" for another device.',
    "sync_cob_id": "COB-ID of SYNC (1005h; default 0x80).",
    "sync_counter": 'Last value of SYNC\'s counter (1019h), or "off".',
    "sync_timeout": "After which time an external SYNC is missing (default 1.5 scan periods).",
    "time": 'Period of TIME, or "off".',
    "time_cob_id": "COB-ID of TIME (1012h; default 0x100).",
    "heartbeat": 'Heartbeat of the master and of the nodes (1017h, 1016h; default "100ms"), or "off".',
    "on_lost_node": 'Which axes stop if a node is lost: its "group" (default), the "cell", or no others ("report").',
    "process": 'Where the core runs: in its "own" process (default, if possible), or in a "thread" of the program.',
    "beside": "Open the bus even if another master is detected.",
}

NODE: Mapping[str, str] = {
    "eds": 'EDS: a path relative to this file, or "builtin:gim6010-8".',
    "dcf": "DCF instead of an EDS: its values are written at boot.",
    "remap": 'Whether boot may change PDO mappings: "auto" (default) or "never".',
    "optional": "The cell also opens without this node; the node is booted when it appears.",
    "on_lost": 'Whether the loss of a node without axes stops the cell ("stop", default) or is only reported ("report").',
    "rejoin": 'Whether a node that has returned is booted by a command ("manual", default) or "automatic"; nothing is enabled.',
    "serial": "Required serial number (1018h:04).",
    "revision": "Required revision (1018h:03).",
    "configuration_date": "Date of its configuration (1020h:01): the node is configured only if it has another date.",
    "configuration_time": "Time of its configuration (1020h:02).",
    "restore_defaults": "Restore its defaults (1011h) before it is configured.",
    "protocol": 'Its protocol: "canopen" (default), or {}, which need a table of that name and no EDS.',
    "firmware": "Firmware version of a module with CAN Simple.",
}

PROGRAM: Mapping[str, str] = {
    "date_time": "Date and time in 1F52h: 2026-03-31T14:30:00.",
    "identification": "Value of 1F56h:01.",
    "file": "The program, a path relative to this file.",
    "download": "Replace another program at boot (1F50h, 1F51h); by default never.",
    "deadline": "For each part of that.",
}

PDO: Mapping[str, str] = {
    "map": 'Objects in their order: ["6041", "6064:00"].',
    "transmission": "Transmission type (sub-index 2): 0 to 240 synchronous, 254 and 255 event-driven.",
    "event_timer": 'Longest time between two transmissions (sub-index 5), or "off".',
    "inhibit_time": 'Shortest time between two transmissions (sub-index 3), or "off".',
    "cob_id": "COB-ID (sub-index 1).",
    "sync_start": "SYNC start value (sub-index 6).",
    "rtr": "Request a TPDO by remote frames with this period.",
}

AXIS: Mapping[str, str] = {
    "node": "The number of its [nodes.N].",
    "drive_axis": "Which axis of a device with several (default 1).",
    "virtual": "An axis without node and drive, which only the core moves.",
    "encoder": "The [io.NAME] with the position of an axis without a drive: an encoder, which other axes can follow.",
    "unit": 'Unit of positions: "deg", "mm" ...; "increments" needs no scale.',
    "scale": 'Position increments per unit: 1000, or a ratio such as "131072/360".',
    "velocity_scale": "Velocity increments per unit/s, if they are not position increments per second.",
    "acceleration_scale": "Acceleration increments per unit/s², if they are not those of the position.",
    "invert": 'Invert the direction: "master" (the master inverts the sign) or "drive" (607Eh).',
    "rated_torque": "Rated torque in N·m (the value of 6076h); torques are sent as parts of it.",
    "position_limits": "[lowest, highest] in units.",
    "max_velocity": "unit/s.",
    "max_acceleration": "unit/s².",
    "max_torque": "N·m.",
    "limits_in_drive": "Write the limits into the drive too (607Dh, 607Fh, 6080h, 6072h).",
    "modulo": "Units per turn of an endless axis.",
    "position_window": "Target window (6067h) in units.",
    "standstill_velocity": "Velocity in unit/s below which the axis is at standstill.",
    "standstill_window": "Allowed distance between an axis at standstill and its demand, in units.",
    "following_error": 'Additional allowed distance in motion, in units; "off": 6062h is not compared in motion.',
    "demand": 'Whether 6062h is the demand of the axis: "use", "ignore", or "auto" (default): axisbus decides by its '
    "behaviour.",
    "modes": "Modes to use, if not all modes of the drive.",
    "ignored_objects": 'Objects that the drive has but does not act on, such as an option code: "605Dh".',
    "holds_load": 'What holds the load of a vertical axis: "brake" or "torque"; false if no load must be held.',
    "transition_time": "How long one transition of the drive's state machine may take.",
    "mode_time": "How long a mode change may take.",
    "acknowledge_time": "How long the set-point acknowledge may take.",
    "handshake": '"on-change" if bit 12 of the statusword is not reliable (default "acknowledge").',
    "homing_reached": "false if the drive does not set bit 10 at the end of homing (default true).",
}

DEFAULTS: Mapping[str, str] = {
    "velocity": "unit/s.",
    "acceleration": "unit/s².",
    "deceleration": "unit/s².",
    "torque_slope": "N·m/s (6087h).",
    "jerk": "unit/s³, of moves to a position and of move_velocity (60A4h, or streamed by the master).",
}

HOMING: Mapping[str, str] = {
    "absolute": "The drive keeps its position without power: a homed axis is still homed after its node was booted again.",
    "method": "Homing method (6098h); 35 and 37: the present position is zero.",
    "speed_switch": "unit/s of the search for the switch (6099h:01).",
    "speed_zero": "unit/s of the search for zero (6099h:02).",
    "acceleration": "unit/s² (609Ah).",
    "timeout": "After which time homing has failed.",
    "required": "Whether absolute moves wait for it (default: if position_limits are set).",
    "offset": "Home offset (607Ch) in units.",
}

STOP: Mapping[str, str] = {
    "quick_stop": "Quick stop option code (605Ah).",
    "shutdown": "Shutdown option code (605Bh).",
    "disable": "Disable operation option code (605Ch).",
    "halt": "Halt option code (605Dh).",
    "fault": "Fault reaction option code (605Eh).",
    "connection_loss": "Abort connection option code (6007h).",
    "communication_error": "Error behaviour (1029h:01).",
    "deceleration": "unit/s² of the quick stop (6085h).",
    "halt_time": "How long the halt may take before the next step of the stop sequence.",
    "quick_stop_time": "How long the quick stop may take.",
    "disable_time": "How long the disabling may take.",
}

FEED_FORWARD: Mapping[str, str] = {
    "velocity": "Send the velocity of each set-point (60B1h), in csp.",
    "inertia": "N·m per unit/s²: send the torque for the acceleration of the set-points (60B2h), in csp and csv.",
    "torque_offset": "Constant N·m, for example for a weight (60B2h), in csp and csv; 0.0 if a program will set it.",
}

GROUP: Mapping[str, str] = {
    "axes": "The order of the positions in move_linear.",
    "on_fault": 'How a fault of one stops the others: on their "path" (default), "each" by its own ramp, or by "quick" stop.',
}

KINEMATICS: Mapping[str, str] = {
    "kind": 'Kinematics of the axes: "corexy", "scara" or "delta".',
    "upper": "Length of the upper arm, or of each of them.",
    "fore": "Length of the forearm, or of each of them, in the same unit.",
    "base": "For a delta robot: distance of the upper joints from the middle.",
    "plate": "For a delta robot: distance of the lower joints from the middle of the plate.",
    "left": "For a SCARA robot: whether the elbow is bent to positive angles (default true).",
    "middle": "For a SCARA robot: the shoulder stays within half a turn of this angle (default 0 degrees).",
}

GANTRY: Mapping[str, str] = {
    "axes": "The two axes that carry the beam; the position of the first is that of the beam.",
    "max_skew": "Allowed skew of the beam in units; beyond it both axes are stopped.",
    "offset": "Position of the second axis minus position of the first when the beam is square, in units (default 0).",
}

GANTRY_HOMING: Mapping[str, str] = {
    "switches": 'Whether "each" axis has a switch (default), or only the "first".',
    "input": "Touch probe (1 or 2) that the switch is wired to.",
    "edge": 'Edge of the switch: "rising" or "falling".',
    "velocity": "unit/s of the search, and of squaring.",
    "distance": "Units to search at most, below 0 towards smaller positions.",
    "positions": "Position of each axis at its own switch.",
    "skew": "Allowed skew found by homing, in units (default: max_skew).",
}

IO: Mapping[str, str] = {
    "node": "The number of its [nodes.N].",
    "object": 'Its object, which also decides between input and output: "6000h:01", "6200h:01", "60FEh:01" ...',
    "bit": "Which bit of the object, from 0; without it the object is a number.",
    "safe": "State of an output when its node, the program or the master is lost, and when the machine is closed.",
    "scale": "Digits per unit of a number: 3276.7, or a ratio; without it the number is in digits.",
    "offset": "Value of a number at 0 digits, in its unit (default 0).",
    "unit": "Unit of a number, for display.",
}
