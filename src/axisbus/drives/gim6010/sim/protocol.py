"""CAN Simple server of a simulated module: executes commands, answers requests, and sends periodic messages.

Theory of operation
-------------------
A request is a remote frame or a data frame of 8 bytes; Get_Error needs its type byte in 8 bytes. A command that is shorter than its
fields, that arrives as a remote frame, or that is unknown is ignored: nothing raises. A period of 0 switches a message off.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from axisbus.drives.gim6010.sim.axis import ModuleAxis
from axisbus.drives.gim6010.sim.constants import (
    COMMANDS_PER_NODE,
    MIT_RANGES,
    MOST_NODE_ID,
    OLD_HEARTBEAT,
    SYSTEM_FLAG,
    AxisState,
    Command,
    ControlMode,
    ErrorType,
    Firmware,
    InputMode,
)
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.parameters import Endpoints, Parameters

Frame = tuple[int, bytes]
_READ, _WRITE = 0, 1
_PER_MILLE = 0.001  # unit of the two feed-forward values of Set_Input_Pos
_LARGEST = 3.4028234663852886e38  # of float32
_CAN = "axis0.config.can."
_CONTROLLER = "axis0.controller.config."
_TRAJECTORY = "axis0.traj_traj.config."
_RANGES = ("mit_max_pos", "mit_max_vel", "mit_max_kp", "mit_max_kd", "mit_max_torque")


# Commands that only set parameters: format, and the path of each field.
_SETTINGS: dict[Command, tuple[str, tuple[str, ...]]] = {
    Command.SET_LIMITS: ("<ff", (_CONTROLLER + "vel_limit", "axis0.motor.config.current_lim")),
    Command.SET_TRAJ_VEL_LIMIT: ("<f", (_TRAJECTORY + "vel_limit",)),
    Command.SET_TRAJ_ACCEL_LIMITS: ("<ff", (_TRAJECTORY + "accel_limit", _TRAJECTORY + "decel_limit")),
    Command.SET_TRAJ_INERTIA: ("<f", (_CONTROLLER + "inertia",)),
    Command.SET_POS_GAIN: ("<f", (_CONTROLLER + "pos_gain",)),
    Command.SET_VEL_GAINS: ("<ff", (_CONTROLLER + "vel_gain", _CONTROLLER + "vel_integrator_gain")),
}
# Periodic messages: the parameter of their period, the command, and the type of Get_Error.
_PERIODIC: tuple[tuple[str, Command, ErrorType | None], ...] = (
    ("heartbeat_rate_ms", Command.HEARTBEAT, None),
    ("encoder_rate_ms", Command.GET_ENCODER_ESTIMATES, None),
    ("motor_error_rate_ms", Command.GET_ERROR, ErrorType.MOTOR),
    ("encoder_error_rate_ms", Command.GET_ERROR, ErrorType.ENCODER),
    ("controller_error_rate_ms", Command.GET_ERROR, ErrorType.CONTROLLER),
    ("encoder_count_rate_ms", Command.GET_ENCODER_COUNT, None),
    ("iq_rate_ms", Command.GET_IQ, None),
    ("bus_vi_rate_ms", Command.GET_BUS_VOLTAGE_CURRENT, None),
)


class CanSimpleServer:
    """Frames to be sent, the life counter, and the due time of each periodic message."""

    def __init__(
        self,
        axis: ModuleAxis,
        parameters: Parameters,
        endpoints: Endpoints,
        dials: ModuleFaults,
        firmware: Firmware,
    ) -> None:
        self._axis = axis
        self._parameters = parameters
        self._endpoints = endpoints
        self._dials = dials
        self._firmware = firmware
        self._life = 0
        self._due: dict[str, float] = {}
        self.frames: list[Frame] = []
        self._requests: dict[int, Callable[[], bytes]] = {
            Command.GET_ENCODER_ESTIMATES: self._estimates,
            Command.GET_ENCODER_COUNT: self._count,
            Command.GET_IQ: lambda: _floats(axis.current_setpoint, axis.current),
            Command.GET_BUS_VOLTAGE_CURRENT: lambda: _floats(dials.bus_voltage, axis.bus_current),
            Command.GET_TORQUES: self._torques,
            Command.GET_POWERS: lambda: _floats(axis.electrical_power, axis.mechanical_power),
        }
        # With the number of bytes that a command needs.
        self._commands: dict[int, tuple[int, Callable[[bytes], None]]] = {
            Command.ESTOP: (0, lambda _: axis.estop()),
            Command.GET_ERROR: (8, self._get_error),
            Command.RX_SDO: (8, self._rx_sdo),
            Command.TX_SDO: (8, self._tx_sdo),
            Command.SET_AXIS_NODE_ID: (4, self._set_node_id),
            Command.SET_AXIS_STATE: (4, lambda data: axis.request(_u32(data))),
            Command.MIT_CONTROL: (8, self._mit),
            Command.SET_CONTROLLER_MODE: (8, lambda data: self._enter(*struct.unpack_from("<II", data))),
            Command.SET_INPUT_POS: (8, self._input_pos),
            Command.SET_INPUT_VEL: (8, self._input_vel),
            Command.SET_INPUT_TORQUE: (4, lambda data: self._take(torque=struct.unpack_from("<f", data)[0])),
            Command.REBOOT: (0, lambda _: endpoints.write("reboot")),
            Command.CLEAR_ERRORS: (0, lambda _: axis.clear()),
            Command.SET_LINEAR_COUNT: (
                4,
                lambda data: axis.shaft.set_linear_count(*struct.unpack_from("<i", data)),
            ),
            Command.DISABLE_CAN: (0, self._disable_can),
            Command.SAVE_CONFIGURATION: (0, lambda _: endpoints.write("save_configuration")),
        }
        for command, row in _SETTINGS.items():
            self._commands[command] = (struct.calcsize(row[0]), partial(self._set, *row))

    def restart(self) -> None:
        """Power up: no frame is pending, and all periods restart."""
        self.frames.clear()
        self._due.clear()
        self._life = 0

    def on_frame(self, can_id: int, data: bytes, *, remote: bool) -> None:
        """Take a frame with an 11-bit identifier; frames for other nodes and invalid frames are ignored."""
        node_id, command = divmod(can_id, COMMANDS_PER_NODE)
        if node_id != self._parameters.node_id:
            return
        answer = self._requests.get(command)
        if answer is not None:
            if remote or len(data) == 8:
                self._send(command, answer())
            return
        needed, act = self._commands.get(command, (0, None))
        if act is not None and not remote and len(data) >= needed:
            act(data)

    def step(self, now: float) -> None:
        for name, command, kind in _PERIODIC:
            period = self._parameters[_CAN + name] / 1000.0
            if period <= 0.0 or now < self._due.get(name, now) - 1e-9:
                continue
            due = self._due.get(name, now) + period
            self._due[name] = due if due > now else now + period
            self._beat(command, kind)

    def _beat(self, command: Command, kind: ErrorType | None) -> None:
        dials = self._dials
        if command is Command.HEARTBEAT:
            data = heartbeat(self._axis, self._firmware, dials, self._life)
            self._life = self._life + 1 & 0xFF
            if not dials.heartbeat_stops:
                self._send(command, data)
        elif kind is not None:
            self._send(command, self._errors(kind))
        elif command is not Command.GET_ENCODER_ESTIMATES or not dials.estimates_stop:
            self._send(command, self._requests[command]())

    def _send(self, command: int, data: bytes) -> None:
        self.frames.append((self._parameters.node_id * COMMANDS_PER_NODE + command, data))

    # Requests.

    def _estimates(self) -> bytes:
        axis = self._axis
        if self._dials.dead_in_idle and axis.state != AxisState.CLOSED_LOOP:
            return bytes(8)
        return _floats(axis.shaft.estimate, axis.shaft.velocity)

    def _count(self) -> bytes:
        shaft = self._axis.shaft
        return struct.pack("<ii", _wrapped(shaft.shadow_count), shaft.count_in_turn)

    def _torques(self) -> bytes:
        axis = self._axis
        on = axis.energised
        return _floats(axis.controller.torque_setpoint if on else 0.0, axis.shaft.torque if on else 0.0)

    def _get_error(self, data: bytes) -> None:
        if self._dials.get_error_answered and data[0] in list(ErrorType):
            self._send(Command.GET_ERROR, self._errors(ErrorType(data[0])))

    def _errors(self, kind: ErrorType) -> bytes:
        axis = self._axis
        word, size = {
            ErrorType.MOTOR: (axis.motor_error, 8),
            ErrorType.ENCODER: (axis.encoder_error, 4),
            ErrorType.CONTROLLER: (axis.controller_error, 4),
            ErrorType.SYSTEM: (axis.system_error, 4),
        }[kind]
        return int(word).to_bytes(size, "little")

    # Endpoints.

    def _rx_sdo(self, data: bytes) -> None:
        if not self._dials.endpoints:
            return
        operation, number = struct.unpack_from("<BH", data)
        if operation == _WRITE:
            self._write_endpoint(number, data[4:8])
        elif operation == _READ:
            value = self._endpoints.read_bytes(number)
            if value is not None:
                self._send(self._dials.endpoint_answer, struct.pack("<BHx", _READ, number) + value)

    def _tx_sdo(self, data: bytes) -> None:
        """Treat it as RxSdo with opcode 1, by the manual; other data under 0x05 are another module's answer."""
        if data[0] == _WRITE:
            self._rx_sdo(data)

    def _write_endpoint(self, number: int, value: bytes) -> None:
        protocol = self._endpoints.path_of(number) == "can.config.protocol"
        if not (protocol and self._dials.protocol_by_usb):
            self._endpoints.write_bytes(number, value)

    # Commands.

    def _set_node_id(self, data: bytes) -> None:
        node_id = _u32(data)
        if node_id <= MOST_NODE_ID:
            self._parameters[_CAN + "node_id"] = node_id

    def _disable_can(self, _: bytes) -> None:
        if not self._axis.energised:
            self._parameters["config.enable_can_a"] = 0
            self._endpoints.write("save_configuration")

    def _enter(self, control: int, inputs: int) -> None:
        self._parameters[_CONTROLLER + "control_mode"] = control
        self._parameters[_CONTROLLER + "input_mode"] = inputs
        if self._axis.state == AxisState.CLOSED_LOOP:
            self._axis.controller.mode_changed()

    def _set(self, form: str, paths: tuple[str, ...], data: bytes) -> None:
        for path, value in zip(paths, struct.unpack_from(form, data), strict=True):
            self._parameters[path] = value

    def _input_pos(self, data: bytes) -> None:
        position, velocity, torque = struct.unpack_from("<fhh", data)
        self._take(pos=position, vel=velocity * _PER_MILLE, torque=torque * _PER_MILLE)

    def _input_vel(self, data: bytes) -> None:
        velocity, torque = struct.unpack_from("<ff", data)
        self._take(vel=velocity, torque=torque)

    def _take(
        self, *, pos: float | None = None, vel: float | None = None, torque: float | None = None
    ) -> None:
        self._axis.feed()
        self._axis.controller.take(pos=pos, vel=vel, torque=torque)

    # MIT: its values are at the output shaft.

    def _mit(self, data: bytes) -> None:
        controller, ranges = self._axis.controller, self._ranges()
        order = unpack(data, ranges)
        get = self._parameters
        if (get[_CONTROLLER + "control_mode"], get[_CONTROLLER + "input_mode"]) != (
            ControlMode.POSITION,
            InputMode.MIT,
        ):
            self._enter(ControlMode.POSITION, InputMode.MIT)
        turns = controller.gear / (2.0 * math.pi)
        controller.kp, controller.kd = order.kp, order.kd
        self._take(
            pos=order.position * turns, vel=order.velocity * turns, torque=order.torque / controller.gear
        )
        self._send(Command.MIT_CONTROL, self._mit_answer(ranges))

    def _mit_answer(self, ranges: MitValues) -> bytes:
        axis = self._axis
        gear = axis.controller.gear
        radians = 2.0 * math.pi / gear
        shaft = axis.shaft
        torque = shaft.torque * gear if axis.energised else 0.0
        node_id = self._parameters.node_id
        return pack_answer(node_id, shaft.estimate * radians, shaft.velocity * radians, torque, ranges)

    def _ranges(self) -> MitValues:
        if self._firmware < MIT_RANGES:
            return MitValues()
        return MitValues(*(self._parameters[_CONTROLLER + name] for name in _RANGES))


def _u32(data: bytes) -> int:
    return int.from_bytes(data[:4], "little")


def _floats(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}f", *(max(-_LARGEST, min(_LARGEST, value)) for value in values))


def _wrapped(value: int) -> int:
    return (value + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000


# -- The heartbeat in its three layouts (manual 4.1.2) -----------------------------------------------------------------


def heartbeat(axis: ModuleAxis, firmware: Firmware, dials: ModuleFaults, life: int) -> bytes:
    """Return the 8 bytes of a heartbeat; ``life`` is the life counter."""
    head = int(axis.error).to_bytes(4, "little") + bytes([axis.state & 0xFF])
    faults = [bool(axis.motor_error), bool(axis.encoder_error), bool(axis.controller_error)]
    if firmware >= SYSTEM_FLAG:
        faults.append(bool(axis.system_error))
    bits = [fault != dials.flags_inverted for fault in faults]
    done = axis.controller.trajectory_done
    if firmware <= OLD_HEARTBEAT:
        motor, encoder, controller = bits
        return head + bytes([motor, encoder, controller | done << dials.done_bit])
    flags = sum(bit << place for place, bit in enumerate(bits)) | done << 7
    return head + bytes([flags, 0, life & 0xFF])


# ----------------------------------------------------------------------------------------------------------------------
# MIT control on the wire (manual 4.1.2): fields of 16 and 12 bits, most significant bits first, at the output shaft.
#
# Like the firmware, the packing truncates and does not limit: a value beyond its range wraps to the other end.


class MitValues(NamedTuple):
    """The values of a command, or the ends of their ranges: rad, rad/s, N·m/turn, N·m·s/turn, N·m at the output shaft."""

    position: float = 12.5
    velocity: float = 65.0
    kp: float = 500.0
    kd: float = 5.0
    torque: float = 50.0


def unpack(data: bytes, ranges: MitValues) -> MitValues:
    """Return the command in 8 bytes."""
    bits = int.from_bytes(data[:8], "big")
    return MitValues(
        _signed(bits >> 48, 16, ranges.position),
        _signed(bits >> 36 & 0xFFF, 12, ranges.velocity),
        (bits >> 24 & 0xFFF) * ranges.kp / 4095,
        (bits >> 12 & 0xFFF) * ranges.kd / 4095,
        _signed(bits & 0xFFF, 12, ranges.torque),
    )


def pack_answer(node_id: int, position: float, velocity: float, torque: float, ranges: MitValues) -> bytes:
    """Return the answer in 8 bytes, the last two of which are 0; rad, rad/s and N·m at the output shaft."""
    bits = _field(position, 16, ranges.position) << 24
    bits |= _field(velocity, 12, ranges.velocity) << 12 | _field(torque, 12, ranges.torque)
    return bytes([node_id]) + bits.to_bytes(5, "big") + bytes(2)


def _signed(raw: int, width: int, end: float) -> float:
    return raw * 2 * end / ((1 << width) - 1) - end


def _field(value: float, width: int, end: float) -> int:
    if not math.isfinite(value) or end <= 0.0:
        return 0
    most = (1 << width) - 1
    return math.floor((value + end) * most / (2 * end)) & most
