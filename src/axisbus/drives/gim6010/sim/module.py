"""A simulated module on the wire: it uses the stored protocol, restarts on command, and keeps its motor through all restarts.

Theory of operation
-------------------
As in every simulated node, ``on_frame`` takes a received frame, ``step`` advances the time, and ``take_frames`` returns the frames
to be sent. Depending on ``can.config.protocol`` it is a CAN Simple module, or the simulated CANopen node of its EDS on the same
motor, or it only sends heartbeats in the 29-bit protocol. A new protocol takes effect with the restart that follows saving.
``usb_read``, ``usb_write`` and ``usb_call`` are the USB port of the maker's tool, which works with every protocol. Node ID 0 is
invalid in CANopen: the module is then silent.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any

from axisbus.drives.gim6010.sim.axis import ModuleAxis
from axisbus.drives.gim6010.sim.constants import EXTENDED, FACTORY, AxisState, Firmware, Protocol
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.parameters import Endpoints, Parameters, Value, list_of, rows
from axisbus.drives.gim6010.sim.protocol import CanSimpleServer, Frame
from axisbus.drives.gim6010.sim.shaft import Shaft
from axisbus.eds.model import Eds
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.compliant import make_motor
from axisbus.sim.device import Device
from axisbus.sim.motor import MotorParams
from axisbus.sim.node.slave import Slave

_LONGEST = 0.02  # s of one step of the plant
_STANDARD = 0x7FF
_PROTOCOL = "can.config.protocol"


class Module:
    """One GIM6010-8; holds its motor, its parameters and its protocol servers."""

    def __init__(
        self,
        node_id: int = 0,
        *,
        firmware: Firmware = FACTORY,
        params: MotorParams | None = None,
        dials: ModuleFaults | None = None,
        eds: Eds | None = None,
        serial: int = 0x3936_3232_3334,
        **parameters: Value,
    ) -> None:
        """Make a running module; ``parameters`` by the last part of their path, for example ``break_timeout=500`` (saved).

        ``eds`` is for the simulated CANopen node; without it, the module is silent in CANopen. Firmware from 0.6.8 on starts in the
        29-bit protocol unless ``protocol`` is given.
        """
        if firmware >= EXTENDED:
            parameters.setdefault("protocol", Protocol.EXTENDED)
        self.dials = dials or ModuleFaults()
        self.firmware = firmware
        self.parameters = Parameters(node_id=node_id, serial_number=serial, **parameters)
        self.motor = make_motor(params or (MotorParams() if eds is None else motor_from_eds(eds)))
        self.shaft = Shaft(self.motor)
        self.axis = ModuleAxis(self.shaft, self.parameters, self.dials, firmware)
        live = {row.path: partial(attrgetter(row.live), self) for row in rows() if row.live}
        self.endpoints = Endpoints(self.parameters, list_of(firmware), live, self._acts())
        self._talk = CanSimpleServer(self.axis, self.parameters, self.endpoints, self.dials, firmware)
        self._beacon = Beacon()
        self._eds = eds
        self._params = params
        self.device: Device | None = None  # while it uses CANopen
        self._slave: Slave | None = None
        self.restarts = 0
        self._silent_for = 0.0
        self._now: float | None = None
        self._begin()

    # True state of the plant.

    @property
    def position(self) -> float:
        """True position of the motor, in rotor turns from its initial position."""
        return self.shaft.turns

    @property
    def energised(self) -> bool:
        """Whether there is really power on the motor."""
        if self.device is not None:
            return self.device.drive.power.effort.value != 0
        return self.axis.energised

    @property
    def is_awake(self) -> bool:
        """Whether it has supply voltage and is not restarting."""
        return self._silent_for <= 0.0 and not self.dials.dead

    @property
    def node_id(self) -> int:
        return self.parameters.node_id

    # The wire.

    def on_frame(self, can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
        """Take a frame received at ``now``; never raises."""
        if can_id > _STANDARD or not self._hears:
            return
        if self._slave is not None:
            self._slave.on_frame(can_id, data, now, remote=remote)
        elif self.protocol == Protocol.CAN_SIMPLE:
            self._talk.on_frame(can_id, data, remote=remote)

    def step(self, now: float) -> None:
        """Advance to ``now``, in s of any steady clock."""
        left = 0.0 if self._now is None else max(0.0, now - self._now)
        at = now - left
        while True:
            dt = min(left, _LONGEST)
            left, at = left - dt, at + dt
            self._step(dt, now if left <= 1e-12 else at)
            if left <= 1e-12:
                break
        self._now = now

    def serve(self, now: float) -> None:
        """Send the answers that are due, without advancing the time."""
        if self._slave is not None and self._hears:
            self._slave.serve(now)

    @property
    def next_answer(self) -> float | None:
        """Time at which the next pending answer is due; None if none is pending."""
        return self._slave.next_answer if self._slave is not None and self._hears else None

    def take_frames(self) -> list[Frame]:
        """Return the frames to be sent as (identifier, data) and clear them; identifiers above 7FFh have 29 bits."""
        sources: list[list[Frame]] = [self._talk.frames, self._beacon.frames]
        frames = [frame for source in sources for frame in source]
        for source in sources:
            source.clear()
        if self._slave is not None:
            frames += self._slave.take_frames()
        return frames if self._speaks else []

    # USB.

    def usb_read(self, path: str) -> Value:
        """Read a parameter by its path in the USB tree. Raises KeyError: no parameter has this path."""
        return self.endpoints.read(path)

    def usb_write(self, path: str, value: Value) -> None:
        """Write a parameter by its path in the USB tree; raises the same error as ``usb_read``."""
        self.endpoints.write(path, value)

    def usb_call(self, path: str, argument: Value = 0) -> None:
        """Call a function by its path in the USB tree (``save_configuration``, ``reboot``); raises as ``usb_read`` does."""
        self.endpoints.write(path, argument)

    def json(self) -> list[dict[str, Any]]:
        """Return the list of endpoints of this firmware, in a form that ``json.dumps`` accepts."""
        return self.endpoints.as_json()

    # Restarts.

    def restart(self) -> None:
        """Power up with the saved parameters; silent for ``restart_time``, then idle. The motor coasts."""
        self.restarts += 1
        self.parameters.load()
        self._silent_for = self.dials.restart_time
        self._begin()

    def _begin(self) -> None:
        get = self.parameters
        self._wired = bool(get["config.enable_can_a"]) and get["config.comm_intf_mux"] == 0
        self._bitrate = get["can.config.baud_rate"]
        self.shaft.restart(self._zero(), self.dials.shadow_offset)
        self.axis.restart()
        self._talk.restart()
        self._beacon.restart()
        self._speak(int(self.parameters[_PROTOCOL]))

    def _zero(self) -> float:
        """Return the user's zero within a turn, including the deviation after restarts that owners saw."""
        branch = self.dials.branch if self.restarts % 2 else 0.0
        offset = self.parameters["axis0.encoder.config.index_offset"]
        used = self.parameters["axis0.encoder.config.use_index_offset"]
        return (offset if used and abs(offset) < 1e9 else 0.0) - branch

    def _speak(self, protocol: int) -> None:
        self.protocol = protocol
        self.device = self._slave = None
        if protocol == Protocol.CANOPEN and self._eds is not None and self.node_id > 0:
            self.device = self._as_canopen(self._eds)
            self._slave = Slave(self.device)

    def _as_canopen(self, eds: Eds) -> Device:
        device = device_from_eds(eds, self.node_id, self._params)
        axis = device.drive.axis
        axis.motor, axis.position = self.motor, self.motor.position
        self.motor.brake_closed = False
        return device

    # Time.

    def _step(self, dt: float, now: float) -> None:
        if self.dials.protocol_at_once and self.protocol != self.parameters[_PROTOCOL]:
            self.axis.restart()
            self._speak(int(self.parameters[_PROTOCOL]))
        if self._silent_for > 0.0:
            self._silent_for = max(0.0, self._silent_for - dt)
            self.motor.blocked = self.dials.blocked
            self.shaft.push(0.0, dt)  # it coasts
            return
        if self._slave is not None and self.device is not None:
            self.device.drive.dials.blocked = self.dials.blocked
            self.device.dials.dead = self.dials.dead
            self._slave.step(now)
            return
        self.axis.step(dt)
        if self.protocol == Protocol.CAN_SIMPLE:
            self._talk.step(now)
        elif self.protocol == Protocol.EXTENDED:
            self._beacon.step(now, self.node_id)

    @property
    def _speaks(self) -> bool:
        """Whether it is connected to the bus at all."""
        line = self.dials.line_bitrate
        return self._wired and line in (None, self._bitrate) and not self.dials.dead

    @property
    def _hears(self) -> bool:
        return self._speaks and self._silent_for <= 0.0

    # Actions of commands and endpoints.

    def _save(self) -> None:
        """Save and restart (manual 3.1.6); a module with power on its motor does not save."""
        if not self.energised:
            self.parameters.save()
            self.restart()

    def _erase(self) -> None:
        self.parameters.erase()
        self.restart()

    def _request(self, state: Value) -> None:
        if self.device is None:  # in CANopen the controlword switches the power
            self.axis.request(int(state))

    def _mode_written(self) -> None:
        if self.axis.state == AxisState.CLOSED_LOOP:
            self.axis.controller.mode_changed()

    def _acts(self) -> dict[str, Callable[[Value], None]]:
        axis = self.axis
        controller = "axis0.controller."

        def gain(name: str) -> Callable[[Value], None]:
            return lambda value: setattr(self.axis.controller, name, float(value))

        return {
            "axis0.requested_state": self._request,
            controller + "input_pos": lambda value: axis.controller.take(pos=float(value)),
            controller + "input_vel": lambda value: axis.controller.take(vel=float(value)),
            controller + "input_torque": lambda value: axis.controller.take(torque=float(value)),
            controller + "input_mit_kp": gain("kp"),
            controller + "input_mit_kd": gain("kd"),
            controller + "config.control_mode": lambda _: self._mode_written(),
            controller + "config.input_mode": lambda _: self._mode_written(),
            "axis0.encoder.set_linear_count": lambda value: self.shaft.set_linear_count(int(value)),
            "save_configuration": lambda _: self._save(),
            "erase_configuration": lambda _: self._erase(),
            "reboot": lambda _: self.restart(),
            "clear_errors": lambda _: axis.clear(),
        }


# ----------------------------------------------------------------------------------------------------------------------
# The 29-bit protocol of firmware 0.6.8 as seen by a listener: a heartbeat, by which it is recognised. It receives nothing.
#
# Only the identifier of node 1 is known, 0x19200404: 0x48 in bits 25 to 18, the node in bits 17 to 10 (node 0: off). The meaning of
# its bytes is not published; here they are a counter and zeros.


_BEAT = 0x1920_0004
_NODE_SHIFT = 10
_PERIOD = 0.1  # s


class Beacon:
    """The heartbeats to be sent, and the time of the next."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes]] = []
        self._due: float | None = None
        self._life = 0

    def restart(self) -> None:
        self.frames.clear()
        self._due, self._life = None, 0

    def step(self, now: float, node_id: int) -> None:
        if node_id == 0 or (self._due is not None and now < self._due - 1e-9):
            return
        self._due = max(now, (now if self._due is None else self._due) + _PERIOD)
        self.frames.append((_BEAT | node_id << _NODE_SHIFT, bytes([self._life, *bytes(7)])))
        self._life = self._life + 1 & 0xFF
