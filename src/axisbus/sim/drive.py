"""One axis of a simulated drive: power stage, modes, supervision and motor, advanced by dt.

Theory of operation
-------------------
``step(dt)`` does everything: it evaluates the controlword, advances the power stage, follows the mode of operation, moves the
motor, supervises, and publishes. Nothing else advances time. A port or the object dictionary writes ``controlword``, ``mode`` and
the targets between steps. A controlword that arrives through the dictionary is evaluated at once (``evaluate_controlword``), so
that an edge shorter than a step is not lost.

The power stage decides on an *effort* (run the mode, brake on a ramp, off). Only a change of the effort switches the motor on or
off, makes modes begin or end, and moves the brake.
"""

from __future__ import annotations

from axisbus.eds.model import Eds
from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CW_HALT, as_int8, as_int16, as_int32
from axisbus.sim.dictionary import INVALID_VALUE, Dictionary, Refused
from axisbus.sim.fault_injection import DriveFaults
from axisbus.sim.feedback import Feedback
from axisbus.sim.modes.base import Mode
from axisbus.sim.modes.catalogue import IMPLEMENTED, make_modes
from axisbus.sim.motor import MotorParams
from axisbus.sim.node.history import ErrorHistory
from axisbus.sim.objects import connect
from axisbus.sim.power import Effort, PowerStage, Stage
from axisbus.sim.settings import AXIS_SPAN, Settings, object_key
from axisbus.sim.statusword import compose
from axisbus.sim.touch_probe import TouchProbe

FOLLOWING_ERROR = 0x8611
# Members that every step tests are module constants: a look-up in an Enum costs more than a call.
_OFF, _RUN, _ENABLED = Effort.OFF, Effort.RUN, Stage.ENABLED
_HALT_EFFORT = (Effort.OFF, Effort.SLOW, Effort.QUICK, Effort.LIMIT, Effort.LIMIT)


class Drive:
    """A CiA 402 drive with its motor; holds all of its state.

    To be written: ``controlword``, ``mode`` (6060h), ``target_position``, ``target_velocity``, ``target_torque``,
    ``velocity_offset``, ``torque_offset``, ``warning`` and the fault settings ``dials``; the signals of ``touch_probe``. To be
    read: ``statusword``, ``mode_display``, ``position``, ``position_demand`` (increments), ``velocity`` (velocity increments),
    ``torque`` (‰ of rated), ``error_code``. All have the format of their objects.
    """

    axis: Axis
    touch_probe: TouchProbe
    controlword: int
    mode: int
    mode_display: int
    statusword: int
    position: int
    position_demand: int
    velocity: int
    torque: int
    error_code: int
    maker_bits: int

    def __init__(
        self,
        eds: Eds,
        node_id: int = 1,
        axis: int = 0,
        params: MotorParams | None = None,
        *,
        dials: DriveFaults | None = None,
        dictionary: Dictionary | None = None,
        errors: ErrorHistory | None = None,
        modes: frozenset[int] = IMPLEMENTED,
        seed: int = 0,
    ) -> None:
        """Make the drive of ``axis`` (from 0) of a node; further axes use dictionary and error history of the first one.

        ``modes`` are the modes that it really has, regardless of 6502h; ``seed`` is for the noise of the encoder.
        """
        self.axis_number = axis
        self.params = params or MotorParams()
        self.dials = dials or DriveFaults()
        self.dictionary = dictionary or Dictionary(eds, node_id)
        self.errors = errors or ErrorHistory()
        self.modes = modes & IMPLEMENTED
        self.settings = Settings(self.dictionary, axis)
        self.axis = Axis(self.settings, self.params, self.dials)
        self._feedback = Feedback(self.axis, self.dials, seed)
        self.touch_probe = TouchProbe(self.axis, self.dials)
        self.warning = False
        self.maker_bits = 0
        self.error_code = 0
        self.time = 0.0
        self._sync_time: float | None = None
        self._sync_period = 0.0
        self._has_switches = self.params.limit_switches != (None, None)
        self._has_period = self.dictionary.has(0x60C2 + axis * AXIS_SPAN, 1)
        self._reset_state()
        connect(self)
        self.mode = self.mode_display = self._first_mode()
        self._mode = self._all_modes[self.mode]
        self._publish()

    def _reset_state(self) -> None:
        """Set the state after power-up."""
        brake = (self.params.brake_opens, self.params.brake_closes) if self.params.brake else (0.0, 0.0)
        self.power = PowerStage(self.settings, self.dials, brake=brake)
        self._all_modes = make_modes()
        self.controlword = 0
        self.mode = self.mode_display = 0
        self._mode = self._all_modes[0]
        self._word = 0
        self._effort = Effort.OFF
        self._halted = False
        self._mode_timer = 0.0
        self._is_mode_ignored = False  # 6060h was last written during halt
        self._brake_timer = 0.0
        self.statusword = 0
        self.position = self.position_demand = self.velocity = self.torque = 0

    def restart(self) -> None:
        """Power up again: all state is lost except the motor's position and the dictionary's stored values."""
        self._reset_state()
        self.touch_probe.restart()
        self.axis.offset = 0.0
        self.axis.clamped = self.axis.speed_limited = False
        self.axis.motor.brake_closed = self.params.brake
        self.error_code = self.maker_bits = 0
        self._sync_time = None
        self.mode = self.mode_display = self._first_mode()
        self._mode = self._all_modes[self.mode]
        self._publish()

    def start_enabled(self, mode: int = 0) -> None:
        """Start in operation enabled in ``mode``, as another master left it."""
        self.controlword = self._word = 0x000F
        self.power.start_enabled(self.controlword)
        self.mode = self.mode_display = mode
        self._mode = self._all_modes.get(mode, self._all_modes[0])
        self._apply_effort()
        self._publish()

    # The targets are stored in the motion part.

    @property
    def target_position(self) -> int:
        """607Ah in increments."""
        return self.axis.target_position

    @target_position.setter
    def target_position(self, value: int) -> None:
        self.axis.target_position = value

    @property
    def target_velocity(self) -> int:
        """60FFh in velocity increments."""
        return self.axis.target_velocity

    @target_velocity.setter
    def target_velocity(self, value: int) -> None:
        self.axis.target_velocity = value

    @property
    def target_torque(self) -> int:
        """6071h in ‰ of the rated torque."""
        return self.axis.target_torque

    @target_torque.setter
    def target_torque(self, value: int) -> None:
        self.axis.target_torque = value

    @property
    def velocity_offset(self) -> int:
        """60B1h in velocity increments."""
        return self.settings.velocity_offset

    @velocity_offset.setter
    def velocity_offset(self, value: int) -> None:
        self._set_object(0x60B1, as_int32(value))

    @property
    def torque_offset(self) -> int:
        """60B2h in ‰ of the rated torque."""
        return self.settings.torque_offset

    @torque_offset.setter
    def torque_offset(self, value: int) -> None:
        self._set_object(0x60B2, as_int16(value))

    @property
    def interpolation_target(self) -> int:
        """60C1h:01 in increments."""
        return self.settings.interpolation_target

    @interpolation_target.setter
    def interpolation_target(self, value: int) -> None:
        self.dictionary.set(0x60C1 + self.axis_number * AXIS_SPAN << 8 | 1, as_int32(value))

    def _set_object(self, index: int, value: int) -> None:
        self.dictionary.set(object_key(self.dictionary, index + self.axis_number * AXIS_SPAN), value)

    # Time.

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds (0.1 ms to 20 ms)."""
        self.time += dt
        axis, power, dials = self.axis, self.power, self.dials
        axis.refresh()
        axis.since_mode_write += dt
        axis.motor.blocked = dials.blocked
        axis.motor.sticks = dials.sticks
        if dials.drift_velocity and self._effort is not _OFF:
            axis.drift += dials.drift_velocity * dt
        if dials.encoder_jump:
            self._jump_encoder()
        word = self.controlword
        if word != self._word or word & 0x8F != 0x0F or power.stage is not _ENABLED:
            self._evaluate_controlword(word)
        if power.pending is not None:
            power.step(dt, axis.at_standstill)
            self._apply_effort()
        if dials.spontaneous_mode is not None:
            self._take_mode(dials.spontaneous_mode)
        elif self.mode != self.mode_display:
            self._follow_mode(dt)
        if self._has_switches:
            axis.watch_switches()
        before = axis.motor.position
        self._move(dt)
        if self.touch_probe.function:
            self.touch_probe.pass_over(before, axis.motor.position)
        self._publish()

    def evaluate_controlword(self) -> None:
        """Evaluate the controlword now, as a receive interrupt does; no time passes."""
        self._evaluate_controlword(self.controlword)
        self.power.step(0.0, self.axis.at_standstill)
        self._apply_effort()
        self._publish()

    def sync(self) -> None:
        """Process a SYNC: latch the targets of the cyclic modes."""
        if self._sync_time is not None:
            self._sync_period = self.time - self._sync_time
        self._sync_time = self.time
        if self._effort is _RUN and not self._halted:
            self._mode.sync(self.axis, self._interpolation_time())

    def _interpolation_time(self) -> float:
        settings = self.settings
        if self._has_period and settings.interpolation_value > 0:
            return float(settings.interpolation_value * 10.0**settings.interpolation_index)
        return self._sync_period

    def _evaluate_controlword(self, word: int) -> None:
        old = self._word
        if self.dials.local_control:
            self._word = word
            return
        self.power.command(word)
        self._word = word
        if word != old and self._effort is Effort.RUN:
            self._mode.command(self.axis, old, word)

    # Power.

    def _apply_effort(self) -> None:
        """Apply the power stage's effort to the motor, if it has changed."""
        if self.error_code and self.power.last_transition == 15:
            self._settle_fault()
        old, new = self._effort, self.power.effort
        if old is new:
            return
        self._effort = new
        axis = self.axis
        if new is Effort.OFF:
            self._mode.abandon(axis)
            self._release()
        elif old is Effort.OFF:
            axis.restart_tracking()
            axis.motor.brake_closed = False
            self._brake_timer = 0.0
            self._enabled()
            if self.dials.fault_on_enable:
                self.fault(self.dials.fault_on_enable)
        elif new is Effort.RUN:
            self._enabled()
        else:
            self._restart_demand()
            self._mode.abandon(axis)

    def _restart_demand(self) -> None:
        """Restart the position demand at the motor's position, after torque, feed-forward, a coasting halt or drift."""
        coasted = self._halted and self.settings.halt_option == 0
        if self._mode.by_torque or coasted or self.axis.drift or self.axis.motor.feed_forward:
            self.axis.restart_tracking()

    def _enabled(self) -> None:
        self._enter_mode()
        if self.dials.resumes_on_enable:
            self._mode.resume_last_motion(self.axis)

    def _enter_mode(self) -> None:
        self._halted = False
        self.axis.clamped = self.axis.speed_limited = False
        if self._effort is Effort.RUN:
            self._mode.enter(self.axis)

    def _release(self) -> None:
        """Switch the motor off. A brake is closed already, or closes only now (if the power was removed without a ramp)."""
        self._halted = False
        if not self.params.brake:
            return
        if self.power.brake_in_time:
            self.axis.motor.brake_closed = True
        else:
            self._brake_timer = max(self.params.brake_closes, 1e-9)

    # Motion.

    def _move(self, dt: float) -> None:
        effort, axis = self._effort, self.axis
        if effort is _RUN:
            self._run(dt)
            if self._mode.supervised and axis.following_fault(dt):
                self.fault(FOLLOWING_ERROR)
        elif effort is _OFF:
            self._coast(dt)
        else:
            axis.brake(effort, dt)

    def _run(self, dt: float) -> None:
        mode = self._mode
        if self._word & CW_HALT and self._obeys_halt(mode):
            self._halted = True
            option = self.settings.halt_option
            effort = _HALT_EFFORT[option] if 0 <= option < len(_HALT_EFFORT) else Effort.SLOW
            mode.halt(self.axis, effort, dt)
            return
        if self._halted:
            self._restart_demand()
            self._halted = False
            mode.resume(self.axis)
        mode.step(self.axis, dt)

    def _obeys_halt(self, mode: Mode) -> bool:
        dials = self.dials
        return not dials.ignore_halt and (dials.halt_in_cyclic_modes or not mode.cyclic)

    def _coast(self, dt: float) -> None:
        if self._brake_timer > 0.0:
            self._brake_timer -= dt
            if self._brake_timer <= 0.0:
                self.axis.motor.brake_closed = True
        self.axis.push(0.0, dt)

    def _jump_encoder(self) -> None:
        self.axis.motor.position += self.dials.encoder_jump
        self.dials.encoder_jump = 0

    # Modes of operation.

    def write_mode(self, mode: int) -> None:
        """Process a write to 6060h."""
        self.mode = mode
        self.axis.since_mode_write = 0.0
        self._is_mode_ignored = self.dials.ignore_mode_during_halt and bool(self.controlword & CW_HALT)

    def check_mode(self, value: int) -> None:
        """Reject a mode that the drive does not have, as for an SDO write."""
        if value and value not in self.modes:
            raise Refused(INVALID_VALUE)

    def _first_mode(self) -> int:
        """Return the mode after power-up: the default of 6060h; a drive without that object always has the same mode."""
        stored = self.dictionary.values.get(
            object_key(self.dictionary, 0x6060 + self.axis_number * AXIS_SPAN)
        )
        if stored is None:
            return min(self.modes, default=0)
        mode = as_int8(stored) if isinstance(stored, int) else 0
        return mode if mode in self.modes else 0

    def _follow_mode(self, dt: float) -> None:
        wanted = self.mode
        if self._is_mode_ignored:
            return
        if (wanted and wanted not in self.modes) or wanted in self.dials.modes_refused:
            return
        self._mode_timer += dt
        if self._mode_timer <= self.dials.mode_delay:
            return
        self._mode_timer = 0.0
        self._take_mode(wanted)

    def _take_mode(self, mode: int) -> None:
        if mode == self.mode_display:
            return
        self._restart_demand()
        self._mode.abandon(self.axis)
        self.mode_display = mode
        self._mode = self._all_modes[mode]
        self._enter_mode()

    # Faults.

    def fault(
        self, code: int, maker_bits: int = 0, register: int | None = None, *, announce: bool = True
    ) -> None:
        """Go into fault with error code ``code`` (603Fh) and the manufacturer's bits (203Fh, 203Eh; five bytes of the EMCY).

        ``register`` replaces the bits of 1001h that belong to the code's class; if ``announce`` is False, no entry is made and no
        EMCY sent.
        """
        self.error_code = code
        self.maker_bits = maker_bits
        if announce:
            self.errors.report(self.axis_number, code, maker_bits, register)
        self.power.fault()
        self._apply_effort()
        self._publish()

    def connection_lost(self, code: int) -> None:
        """Execute 6007h: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop."""
        option = self.settings.abort_connection_option
        if option == 1:
            self.fault(code, announce=False)
        elif option == 2:
            self.power.force(9)
        elif option == 3:
            self.power.force(11)

    def _settle_fault(self) -> None:
        self.error_code = self.maker_bits = 0
        self.errors.settle(self.axis_number)

    # Published values.

    def _publish(self) -> None:
        axis, energised = self.axis, self._effort is not _OFF
        position, velocity, torque = self._feedback.measured(self.time)
        self.position = as_int32(round(axis.to_user(position)))
        if energised:
            self.position_demand = self._feedback.demand(self.position, self.position_demand)
        elif not self.dials.demand_frozen:
            self.position_demand = self.position
        self.velocity = axis.user_velocity(velocity) if velocity else 0
        self.torque = round(torque) if energised else 0
        if not self.dials.statusword_frozen:
            self.statusword = compose(
                self.power, self.dials, self._mode, axis, halted=self._halted, warning=self.warning
            )
