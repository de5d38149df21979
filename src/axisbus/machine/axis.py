"""The public axis: commands in engineering units, checked at the call, and values that are fresh or reported as unknown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from axisbus.cia402 import homing
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import ValueTransport
from axisbus.cia402.state import PowerState
from axisbus.errors import ArgumentError, AxisbusError, StaleError, StateError
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.coupling import Cam, Coupling
from axisbus.machine.handle import Handle
from axisbus.machine.probing import ProbeHandle, input_number, probe_command, require_objects
from axisbus.machine.request import AxisCall, buffering_of, flag_of, override_of, shown
from axisbus.machine.streaming.controller import Controller, ControllerRamps, Function, answering_of
from axisbus.motion import commands as c
from axisbus.motion.group.commands import Couple, ProbeMove
from axisbus.motion.moves.activity import age_text
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.numbers import short_repr
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import NOISE, AxisLimits, AxisParameters
from axisbus.motion.point_stream.curve_fit import StreamLimits, stream_limits_of
from axisbus.motion.position_limits import path_range
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.spline import Followed, trajectory_of
from axisbus.motion.states import AxisState
from axisbus.motion.stop.promises import Promise, promises
from axisbus.units import modulo_target

_HOMING_TIMEOUT = 60.0
_NO_DEMAND = "homing ended just now and the drive counts from the new home, its 6062h is not valid, or the last value is too old"
Measure = Callable[[str, str], float]


def no_measure(axis: str, what: str) -> float:
    """Raise StateError: the value ``what`` cannot be read, because the machine has no access to the drive's objects."""
    raise StateError(f"{axis}: its {what} is not known: the machine cannot read its objects")


class Axis:
    """A named axis. Every command returns a ``Handle`` at once; ``handle.wait()`` blocks, ``await handle`` does not.

    Values are in the axis's unit (``unit``, unit/s, unit/s²), torques in N·m, times in seconds. Wrong arguments raise at the call.
    If the state of the axis forbids a command, or if an error occurs later, the handle ends with that error. A cycle accepts at
    most 32 commands; up to 1024 more are queued. Halt, stop, quick_stop and disable are never queued.
    """

    def __init__(
        self, parameters: AxisParameters, commanding: CommandDispatcher, measure: Measure = no_measure
    ) -> None:
        """``measure`` reads a value of the drive that is not sent cyclically, by its name (see ``temperature``)."""
        self.name = parameters.name
        self._parameters = parameters
        self._commanding = commanding
        self._session = commanding.session
        self._measure = measure

    def __repr__(self) -> str:
        if self._session.dead is not None:
            return f"<Axis {self.name}: unknown, its scan does not run>"
        try:
            where = f" at {self.position:g} {self.unit}"
        except StaleError:
            where = ", its position is unknown"
        return f"<Axis {self.name}: {self.snapshot.state.value}{where}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        from axisbus.machine.notebook_display import axis_html  # only a notebook needs it

        return axis_html(self)

    def _renew(self, parameters: AxisParameters) -> None:
        """Use the parameters of a node that was booted again."""
        self._parameters = parameters

    # -- identity and position ---------------------------------------------------------------------------------------

    @property
    def modulo(self) -> float | None:
        """Length of one turn of an endless axis, in its unit; None if the axis is not endless."""
        return self._parameters.units.modulo

    @property
    def unit(self) -> str:
        """The unit of the axis's positions."""
        return self._parameters.units.position.unit

    @property
    def state(self) -> AxisState:
        """The PLCopen state of the axis in the last cycle.

        Raises:
            StaleError: the state is unknown, because the scan has failed.
        """
        self._require_scan("state")
        return self.snapshot.state

    @property
    def error(self) -> AxisbusError | None:
        """Why the axis is in ErrorStop, is unknown (the scan has failed), or accepts no more commands; None if all is well.

        An axis accepts no more commands after Ctrl-C or SIGTERM: the machine can then only be closed.
        """
        dead, leaving = self._session.dead, self._session.leaving_because
        if dead is not None:
            return self._unknown("state", dead)
        if self.snapshot.error is None and leaving is not None and not self._session.ended:
            return _takes_nothing(self.name, leaving)
        return self.snapshot.error

    @property
    def homed(self) -> bool:
        """Whether the position is confirmed: homed, or set by ``set_position``, since the machine was opened.

        Raises:
            StaleError: it is unknown, because the scan has failed.
        """
        self._require_scan("position")
        return self.snapshot.homed

    @property
    def snapshot(self) -> Snapshot:
        """All values of the last cycle, in increments; consistent with each other."""
        return self._session.snapshots[self.name]

    @property
    def position(self) -> float:
        """Actual position in the axis's unit.

        Raises:
            StaleError: the position is unknown (never received, or older than its maximum age).
        """
        return self._parameters.units.turned(self.unwrapped_position)

    @property
    def unwrapped_position(self) -> float:
        """As ``position``, but not wrapped at the modulo: the total angle that an endless axis has turned; for groups."""
        snapshot = self.snapshot
        return self._parameters.units.position.to_units(
            self._known(snapshot.position, "position (6064h)") - snapshot.origin
        )

    @property
    def commanded_position(self) -> float:
        """The last demand position (6062h, if valid), else the actual position; unwrapped, in the axis's unit; for groups."""
        snapshot = self.snapshot
        increments = snapshot.demand if snapshot.demand_leads else None
        if increments is None:
            increments = self._known(snapshot.position, "position (6064h)")
        return self._parameters.units.position.to_units(increments - snapshot.origin)

    @property
    def scan_period(self) -> float:
        """The scan period of the axis in seconds; for groups."""
        return self._parameters.scan_period

    @property
    def increment(self) -> float:
        """The size of one position increment, in the axis's unit; for groups."""
        return abs(self._parameters.units.position.to_units(1))

    @property
    def start_tolerance(self) -> float:
        """The allowed distance between the axis and the start of a motion, in the axis's unit; for groups."""
        return self._parameters.position_tolerance * self.increment

    @property
    def velocity(self) -> float:
        """Actual velocity in unit/s; raises StaleError if it is unknown."""
        return self._parameters.units.velocity.to_units(
            self._known(self.snapshot.velocity, "velocity (606Ch)")
        )

    @property
    def torque(self) -> float:
        """Actual torque in N·m (without ``rated_torque``: in parts of the rated torque); raises StaleError if it is unknown."""
        return self._parameters.units.torque(self._known(self.snapshot.torque, "torque (6077h)"))

    @property
    def target(self) -> float | None:
        """Target of the last move to a position, in the axis's unit; None without one, or after another kind of motion."""
        snapshot = self.snapshot
        if snapshot.target is None:
            return None
        units = self._parameters.units
        return units.turned(units.position.to_units(snapshot.target - snapshot.origin))

    @property
    def distance_to_go(self) -> float | None:
        """Signed distance from the actual position to the target of the last move to a position, in the axis's unit.

        None without such a move, or while the position is unknown.
        """
        snapshot = self.snapshot
        if snapshot.target is None or snapshot.position is None or self._session.silent is not None:
            return None
        return self._parameters.units.position.to_units(snapshot.target - snapshot.position)

    @property
    def following_error(self) -> float:
        """Demand position minus actual position (6062h minus 6064h), in the axis's unit.

        Raises:
            StaleError: one of the two is unknown, for example because the drive's 6062h is not valid (see ``docs/stopping.md``).
        """
        snapshot = self.snapshot
        demand = self._known(snapshot.demand, "demand (6062h)")
        return self._parameters.units.position.to_units(
            demand - self._known(snapshot.position, "position (6064h)")
        )

    @property
    def enabled(self) -> bool:
        """Whether the drive was in *operation enabled* in the last cycle.

        Raises:
            StaleError: it is unknown: no fresh statusword, or the scan has failed.
        """
        self._require_scan("state")
        snapshot = self.snapshot
        self._known(snapshot.statusword, "statusword (6041h)")
        return snapshot.power_state is PowerState.OPERATION_ENABLED

    @property
    def limits(self) -> AxisLimits:
        """Limits that the master enforces (or None): ``position``, ``velocity``, ``acceleration`` in units, ``torque`` in N·m."""
        return self._parameters.limits

    def room_from(self, start: float) -> tuple[float, float] | None:
        """Return the range in which a path from ``start`` (unit) must lie, None if there are no position limits; for groups."""
        start = self._request(f"room_from({shown(start)})").finite("start", start)
        limits, units = self._parameters.limits.position, self._parameters.units.position
        if limits is None:
            return None
        noise = abs(units.to_units(NOISE))
        return path_range(limits, start, noise, abs(units.to_units(1)))

    @property
    def promises(self) -> tuple[Promise, ...]:
        """How the position and velocity limits are enforced in each mode, according to the drive's objects at boot.

        One entry for each limit and mode, with ``limit`` (its key in the cell file), ``mode`` (such as ``pv``), ``kept``, ``why``
        and ``remedy``.
        """
        return promises(self._parameters)

    @property
    def override(self) -> float:
        """The last factor of ``set_override`` from any program; 1 before that. The override of the cell multiplies it."""
        return self.snapshot.override

    @property
    def total_override(self) -> float:
        """The factor that multiplies the velocities of this axis: its own override times that of the cell, at most 1.5."""
        snapshot = self.snapshot
        return min(snapshot.override * snapshot.cell_override, MAX_OVERRIDE)

    @property
    def temperature(self) -> float:
        """Motor temperature in °C, if the drive plug-in names its object. Read by SDO: blocks until the drive has answered.

        Raises:
            StateError: the drive does not report it, or its object is unknown.
            SdoAbort, SdoTimeout: the drive refuses, or does not answer.
        """
        return self._measure(self.name, "temperature")

    @property
    def voltage(self) -> float:
        """DC link voltage in V (6079h); blocks and raises as ``temperature``."""
        return self._measure(self.name, "voltage")

    @property
    def current(self) -> float:
        """Actual current in A (6078h in parts of 6075h); blocks and raises as ``temperature``."""
        return self._measure(self.name, "current")

    def _known(self, value: int | None, what: str) -> int:
        silent = self._session.silent
        if silent is not None:
            raise self._unknown(what, silent)
        if value is None:
            observed, remedy = self._why_unknown(what)
            raise StaleError(
                f"{self.name}: its {what} is unknown", axis=self.name, observed=observed, remedy=remedy
            )
        return value

    def _require_scan(self, what: str) -> None:
        """Raise StaleError if the scan has failed. A scan that was ended in the normal manner is accepted."""
        dead = self._session.dead
        if dead is not None:
            raise self._unknown(what, dead)

    def _unknown(self, what: str, why: str) -> StaleError:
        remedy = "read it while the machine is open"
        if self._session.failed:
            remedy = "make sure that the axis is at standstill, then close the machine: its error says more"
        return StaleError(
            f"{self.name}: its {what} is unknown",
            axis=self.name,
            observed=why,
            remedy=f"{remedy}; axis.snapshot has the last known values, with their time",
        )

    def _why_unknown(self, what: str) -> tuple[str, str]:
        """Return the observation and the remedy for an unknown value."""
        name = what.partition(" ")[0]
        remedy = (
            "check that the node answers and sends it; it must be in a TPDO (axisbus boot shows the PDOs)"
        )
        if (
            self._session.axes[self.name].capabilities.inputs.get(name, ValueTransport.NONE)
            is ValueTransport.NONE
        ):
            return "it is not transmitted: no TPDO contains it, and it is not polled", remedy
        snapshot = self.snapshot
        if name == "position":
            return age_text(snapshot.now - snapshot.position_stamp), remedy
        if name == "demand" and snapshot.position is not None:
            return (
                _NO_DEMAND,
                "read it a cycle later; if it stays unknown, axisbus boot shows how 6062h is transmitted",
            )
        return "it was never received, or the last value is too old", remedy

    # -- power and stopping ------------------------------------------------------------------------------------------

    def enable(self, *, allow_moving: bool = False) -> Handle:
        """Switch the power stage on (MC_Power). This moves nothing: every target is preloaded.

        If the axis moves without power (coasts, sags, is turned by hand), the command waits until it is at standstill. If the axis
        does not come to rest, the command is refused. ``allow_moving`` enables the axis in motion. The handle is done when the axis
        is seen at standstill with its power on.

        If enable is called again while it is active, it continues, and both handles end with it. The same applies to ``reset`` and
        to all stop commands.
        """
        caught = flag_of(f"{self.name}.enable", "allow_moving", allow_moving)
        return self._submit("enable(allow_moving=True)" if caught else "enable()", c.EnableCommand(caught))

    def disable(self, *, coast: bool = False) -> Handle:
        """Halt, then switch the power stage off (transitions 5, 6, 7); ``coast`` cuts the power at once (transition 9)."""
        cut = flag_of(f"{self.name}.disable", "coast", coast)
        return self._submit("disable(coast=True)" if cut else "disable()", c.Disable(cut))

    def reset(self) -> Handle:
        """Reset a fault or ErrorStop (MC_Reset); never enables.

        Does not block. While the axis is being stopped, the reset waits; a new error, ``stop()`` or ``quick_stop()`` then ends it.
        """
        return self._submit("reset()", c.ResetCommand())

    def halt(self) -> Handle:
        """Brake to Standstill (MC_Halt); a new motion command may interrupt the braking."""
        return self._submit("halt()", c.Halt())

    def stop(self) -> Handle:
        """Brake to a stop and lock the axis in Stopping (MC_Stop) until ``release()``."""
        return self._submit("stop()", c.Stop())

    def release(self) -> Handle:
        """End the lock of ``stop()`` when the axis is at standstill."""
        return self._submit("release()", c.Release())

    @contextmanager
    def held_stopped(self, timeout: float | None = None) -> Iterator[None]:
        """Stop the axis for a ``with`` block: stop on entering (blocks until standstill), release on leaving.

        ``timeout``: seconds that stop and release may each take.
        """
        self.stop().wait(timeout)
        try:
            yield
        finally:
            self.release().wait(timeout)

    def quick_stop(self) -> Handle:
        """Make the drive perform its quick stop (605Ah). Afterwards the axis is Disabled, or held in Stopping, as configured."""
        return self._submit("quick_stop()", c.QuickStop())

    # -- motion ------------------------------------------------------------------------------------------------------

    def move_absolute(
        self,
        position: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        direction: int = 0,
        jerk: float | None = None,
        timeout: float | None = None,
        buffer: bool | str = False,
    ) -> Handle:
        """Move to ``position`` (MC_MoveAbsolute, profile position mode).

        ``jerk`` (unit/s³) limits the change of the acceleration per second; ``math.inf`` removes the limit, also that of the
        default. A drive with 60A4h and 6086h limits the jerk itself. For any other drive, and for a virtual axis, the master
        commands the move in csp. ``jerk`` does not change a halt or a stop. ``direction`` is for endless axes (``modulo``): 0 is
        the shortest path, 1 positive, -1 negative. ``timeout`` in seconds replaces the deadline that the master calculates.

        With ``buffer`` (True, or ``"buffered"``) the move begins when the axis's present command has ended successfully (100 may be
        queued); without it, the move replaces that command. With ``"blending_low"``, ``"blending_previous"``, ``"blending_next"``
        or ``"blending_high"`` (PLCopen's BufferMode) the axis passes the end of the previous move without a stop: at the lower
        velocity of the two, that of the previous move, that of this move, or the higher one. If the drive generates the previous
        move, the drive blends. If no command is active, the move begins at once, and the master commands it in csp (if the drive
        has csp), so that the next move can blend exactly. With ``jerk``, blending is possible only in csp. If blending is
        impossible, the handle's ``note`` gives the reason.

        Raises:
            LimitError: beyond ``position_limits``, ``max_velocity`` or ``max_acceleration``, or out of the range of the object.
            ArgumentError: not finite, not positive, or a default is missing.
        """
        name = f"move_absolute({shown(position)} {self.unit})"
        target = self._absolute_increments(name, position, direction)
        profile = self._request(name).profile(velocity, acceleration, deceleration, timeout, jerk)
        return self._submit_motion(
            name, c.Move(c.TargetReference.ABSOLUTE, target, profile), buffer, direction
        )

    def move_relative(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
        buffer: bool | str = False,
    ) -> Handle:
        """Move by ``distance`` from the actual position at the start (MC_MoveRelative); raises as ``move_absolute``.

        If the move blends, ``distance`` counts from the end of the previous move.
        """
        dynamics = velocity, acceleration, deceleration, timeout, jerk
        return self._move_by(c.TargetReference.RELATIVE, distance, dynamics, buffer=buffer)

    def move_additive(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
        buffer: bool | str = False,
    ) -> Handle:
        """Move by ``distance`` from the last commanded position (MC_MoveAdditive); raises as ``move_absolute``.

        If there is no last commanded position, the move starts from the actual position.
        """
        dynamics = velocity, acceleration, deceleration, timeout, jerk
        return self._move_by(c.TargetReference.ADDITIVE, distance, dynamics, buffer=buffer)

    def move_velocity(
        self,
        velocity: float,
        *,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
        buffer: bool | str = False,
    ) -> Handle:
        """Move at ``velocity`` (signed, unit/s) until another command ends the motion (MC_MoveVelocity, profile velocity mode).

        ``jerk`` (unit/s³) as in ``move_absolute``: a drive with 60A4h and 6086h limits it itself. For any other drive, and for a
        virtual axis, the master commands the motion in csp, from standstill or from a motion that the master already commands. In
        that case ``halt`` also keeps the jerk limit; every other stop does not. The handle is done when the velocity is reached.
        Raises as ``move_absolute``.
        """
        name = f"move_velocity({shown(velocity)} {self.unit}/s)"
        profile = self._request(name).turning(velocity, acceleration, deceleration, timeout, jerk)
        return self._submit_motion(name, c.MoveVelocity(profile), buffer)

    def jog(
        self, velocity: float, *, acceleration: float | None = None, continue_only: bool = False
    ) -> Handle:
        """Move at ``velocity`` for 200 ms; call it again with the same values to continue. Raises as ``move_absolute``.

        With ``continue_only`` the call continues the active jog and never starts one. If that jog has ended, for example by a halt
        from any program, the handle ends with ``Interrupted``. For a push button, use ``continue_only`` from the second call on.
        """
        name = f"jog({shown(velocity)} {self.unit}/s)"
        profile = self._request(name).turning(velocity, acceleration, jerk=math.inf)
        continues = flag_of(f"{self.name}.{name}", "continue_only", continue_only)
        return self._submit(name, c.MoveVelocity(profile, self._parameters.timing.jog, continues))

    def torque_control(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) in profile torque mode (MC_TorqueControl).

        Raises:
            ArgumentError: ``rated_torque`` is not in cell.toml, a value is not finite, or no slope is known: neither the call nor
                ``torque_slope`` of the defaults gives one, and the drive's own (6087h) is 0.
            LimitError: beyond ``max_torque``, or out of the range of 6071h.
        """
        name = f"torque_control({shown(torque)} N·m)"
        request = self._request(name)
        command = c.TorqueControl(
            request.torque(torque), request.torque_slope(slope), request.timeout(timeout)
        )
        return self._submit(name, command)

    def cyclic_velocity(
        self, velocity: float, *, acceleration: float | None = None, deceleration: float | None = None
    ) -> Handle:
        """Move at ``velocity`` (signed, unit/s) until another command ends the motion, in cyclic synchronous velocity mode (csv).

        The master generates the ramps: the drive gets one velocity per cycle. If the command is called again while the axis
        moves, it continues from the velocity of that cycle; it may be called in every cycle. It begins at standstill, or while
        another ``cyclic_velocity`` is active or is being halted. A halt brakes with ``deceleration``. The handle is done when
        the velocity is measured. Does not block.

        Raises:
            LimitError: beyond ``max_velocity`` or ``max_acceleration``, or out of the range of 60FFh.
            ArgumentError: not finite, not positive, a default is missing, or ``velocity_scale`` of an axis in increments is
                missing.
        """
        name = f"cyclic_velocity({shown(velocity)} {self.unit}/s)"
        command = self._request(name).cyclic_velocity(velocity, acceleration, deceleration)
        return self._submit(name, command)

    def cyclic_torque(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) in cyclic synchronous torque mode (cst).

        The master generates the slope, from the present torque of the axis: the drive gets one torque per cycle. The command
        begins at standstill, or while another ``cyclic_torque`` is active. The handle is done when the torque is measured. Does
        not block. ``timeout`` in seconds replaces the deadline that the master calculates.

        Raises:
            ArgumentError: ``rated_torque`` is not in cell.toml, a value is not finite, or no slope is known: neither the call nor
                ``torque_slope`` of the defaults gives one, and the drive's own (6087h) is missing or 0.
            LimitError: beyond ``max_torque``, out of the range of 6071h, or a slope below 0.1 % of rated torque per second.
        """
        name = f"cyclic_torque({shown(torque)} N·m)"
        request = self._request(name)
        raw, rise = request.torque(torque), request.cyclic_slope(slope)
        return self._submit(name, c.CyclicTorque(raw, rise, request.timeout(timeout)))

    def controller(
        self,
        function: Function,
        *,
        output: str = "velocity",
        acceleration: float | None = None,
        deceleration: float | None = None,
        slope: float | None = None,
        max_missed_cycles: int = 0,
    ) -> Controller:
        """Let ``function`` control the axis: each cycle it gets an ``AxisFeedback`` and returns the next set-point.

        ``output="velocity"``: the function returns a velocity (unit/s, csv), ``"torque"``: a torque (N·m, cst). The set-point
        is limited to ``max_velocity`` or ``max_torque``, and the ramps are the same as in ``cyclic_velocity`` and
        ``cyclic_torque``. The function runs in a thread of this program; the first call comes when the drive is in that mode.
        If the function raises an exception, or its answer is late for the next cycle, the axis is stopped (ErrorStop).
        ``max_missed_cycles`` is the number of further cycles for which the last answer stays valid. Does not block.

        Raises:
            ArgumentError, LimitError: as ``cyclic_velocity`` or ``cyclic_torque``.
        """
        if not callable(function):
            raise ArgumentError(
                f"{self.name}.controller: {short_repr(function)} is not a function",
                remedy="give a function that takes the measured values and returns a velocity or a torque",
            )
        answering = answering_of(
            self._parameters, output, ControllerRamps(acceleration, deceleration, slope), max_missed_cycles
        )
        units, period = self._parameters.units, self.scan_period
        return Controller(self.name, units, period, self._commanding, function, answering, self.halt)

    def home(self, method: int | None = None, *, timeout: float | None = None) -> Handle:
        """Home the axis (MC_Home) by ``method`` of 6098h, by default that of ``[axes.NAME.homing]``; ``timeout`` in seconds.

        If home is called again while the axis is Homing, the second call is refused and the first continues.

        Raises:
            ArgumentError: no method is known, or a method that moves has no speeds (a vendor's own, below 0, may have none).
        """
        given = self._parameters.homing
        request = self._request("home()" if method is None else f"home(method {shown(method)})")
        method = request.homing_method(method)
        name = f"home(method {method})"
        moves = homing.needs_speeds(method)
        job = HomingJob(
            method,
            request.homing_speed("speed_switch", given.speed_switch, moves),
            request.homing_speed("speed_zero", given.speed_zero, moves),
            request.homing_acceleration(given.acceleration),
            request.timeout(timeout) or given.timeout or _HOMING_TIMEOUT,
        )
        return self._submit(name, c.Home(job))

    def set_position(self, position: float) -> Handle:
        """Define the actual position as ``position`` from now on (MC_SetPosition).

        The master stores the difference; the drive's own position and limits do not change.

        Raises:
            LimitError: out of the range of a position object, so that no move from there could be commanded.
            ArgumentError: not finite.
        """
        name = f"set_position({shown(position)} {self.unit})"
        return self._submit(name, c.SetPosition(self._request(name).checked_position(position)))

    def follow(self, trajectory: Followed, *, duration: float | None = None) -> Handle:
        """Follow ``trajectory`` (position over time in the axis's unit) in cyclic synchronous position mode.

        ``trajectory`` is an object with ``duration`` and ``position(t)``; or rows of time (s, from 0 on) and position, also of
        numpy, through which the master lays a smooth curve (``SplineTrajectory``); or a function of time, with its ``duration`` in
        seconds.

        The trajectory must begin at the present position of the axis. ``TrapezoidalTrajectory``, ``SampledTrajectory`` and
        ``SplineTrajectory`` are checked against the limits as a whole, before the motion. Any other trajectory is checked in each
        cycle, as far ahead as braking takes with the default deceleration. If it would leave the position limits, the axis brakes
        along it and comes to standstill within them. The same happens if the next step would be faster than ``max_velocity`` or
        would need more than ``max_acceleration``; if neither limit is set, more than the default acceleration.

        Raises:
            LimitError: it goes beyond ``position_limits``, ``max_velocity`` or ``max_acceleration``.
            ArgumentError: the axis must be homed and is not; or no value is known to keep the limits with, or to detect a jump by.
        """
        followed = trajectory_of(trajectory, duration, f"{self.name}.follow")
        name = f"follow({type(followed).__name__}, {shown(followed.duration)} s)"
        self._require_homed(name)
        self._request(name).trajectory(followed)
        return self._submit(name, c.FollowTrajectory(followed))

    def gear_in(
        self,
        master: Axis,
        ratio: float,
        *,
        acceleration: float | None = None,
        sync_positions: Sequence[float] | None = None,
        master_start_distance: float | None = None,
        master_value_source: str = "command",
    ) -> Handle:
        """Follow ``master`` at ``ratio`` own units per master unit, negative in reverse (MC_GearIn, MC_GearInPos).

        The axis reaches its velocity with ``acceleration`` (unit/s², by default its own); from then on it keeps the relation to the
        master's position. With ``sync_positions`` = (master position, own position) the axis waits for the master. Within the last
        ``master_start_distance`` units of the master before its position the axis synchronises, so that both axes reach their
        positions at the same time.

        The handle is done when the axis is synchronised. The axis keeps following, one cycle behind, until another command,
        ``gear_out`` or a stop ends the coupling. ``master_value_source`` "command": the axis follows the master's commanded
        position; "actual": its filtered actual position. A master that is in ErrorStop, is being homed, or is unknown counts as
        lost: the axis brakes with its own deceleration and is in ErrorStop. The same happens if the master would move the axis
        beyond its own limits.

        Raises:
            LimitError: a value is beyond a limit.
            ArgumentError: a value is missing or no number, an axis must be homed and is not, or ``master`` is not another axis of
                this machine.
        """
        text = f"gear_in({getattr(master, 'name', shown(master))}, {shown(ratio)})"
        coupling = Coupling(self, master, text, self._request(text), master_value_source)
        return self._couple(coupling.gear(ratio, acceleration, sync_positions, master_start_distance), text)

    def cam_in(
        self,
        master: Axis,
        cam: Cam,
        *,
        master_start_distance: float = 0.0,
        relative: bool = False,
        master_offset: float = 0.0,
        master_scaling: float = 1.0,
        slave_scaling: float = 1.0,
        master_value_source: str = "command",
    ) -> Handle:
        """Follow ``master`` along a ``cam`` (MC_CamIn).

        At the call the axis must be at the position that the cam gives for the master's position, or it reaches the cam within
        the next ``master_start_distance`` units of the master. With ``relative`` the present position of the axis counts as
        that position. ``master_offset`` (units of the master): how far the master counts as further ahead. ``master_scaling``
        (above 0) and ``slave_scaling`` stretch the cam along the master's and the slave's positions. The handle,
        ``master_value_source`` and the end of the coupling are as in ``gear_in``.

        Raises:
            LimitError: the cam leaves ``position_limits``.
            ArgumentError: as ``gear_in``.
        """
        text = f"cam_in({getattr(master, 'name', shown(master))})"
        coupling = Coupling(self, master, text, self._request(text), master_value_source)
        command = coupling.cam(
            cam,
            master_start_distance,
            relative=relative,
            phase=master_offset,
            master_scale=master_scaling,
            scale=slave_scaling,
        )
        return self._couple(command, text)

    def gear_out(self) -> Handle:
        """End the coupling to a gear or a cam and keep the present velocity (MC_GearOut, MC_CamOut); ``halt()`` brakes the axis."""
        return self._submit("gear_out()", c.GearOut())

    def set_override(self, factor: float) -> Handle:
        """Multiply the velocity of the axis's commands by ``factor``: 0 (the axis holds) to 1.5 (MC_SetOverride). Does not block.

        It may be called at any time, also in motion. It applies to present and later commands, until it is set again. The overrides
        of the cell (``cell.set_override``) and of a group multiply it. At 0 the axis comes to rest, its handle stays busy, and the
        motion continues automatically when the factor rises. A line, path or stream of a group moves at the lowest factor of its
        axes.

        The override lifts no limit: 1.5 times a velocity is at most ``max_velocity``. A trajectory of the user's own becomes faster
        only if it is known in advance to stay within the limits. The override scales no ramp, torque, halt, stop or homing. A
        coupled axis follows its master.

        The handle ends with a StateError if it is unknown with which acceleration the axis may change its velocity.

        Raises:
            ArgumentError: not a number from 0 to 1.5.
        """
        found = override_of(f"{self.name}.set_override", factor)
        return self._submit(f"set_override({found:g})", c.SetOverride(found))

    def set_torque_offset(self, torque: float) -> Handle:
        """Add ``torque`` (N·m, signed) to the torque demand of the drive's controllers (60B2h), in csp and csv. Does not block.

        An example is the weight of a gripped part. The offset replaces ``torque_offset`` of ``[axes.NAME.feed_forward]`` until any
        program sets it again or the machine is reopened. It acts while the drive is seen enabled by this master, in csp or csv. It
        rises and falls within 0.2 s, and a stop removes it. The handle is done at once.

        Raises:
            LimitError: beyond ``max_torque``, else the drive's 6072h.
            ArgumentError: not a finite number; ``rated_torque`` is missing; the cell file does not configure 60B2h.
        """
        name = f"set_torque_offset({shown(torque)} N·m)"
        return self._submit(name, c.SetTorqueOffset(self._request(name).torque_offset(torque)))

    def phasing_relative(self, shift: float, *, velocity: float, acceleration: float) -> Handle:
        """Follow as if the master were ``shift`` units further ahead; both axes keep moving meanwhile (MC_PhasingRelative).

        Only for a synchronised axis. All values are in units of the master. The shift is signed, and changes with at most
        ``velocity`` (per s) and ``acceleration`` (per s²). The rest of an active shift is added to the new one. The handle is
        done when the whole shift is applied. Does not block.

        Raises:
            ArgumentError: a value is not finite, or velocity or acceleration are not above 0.
        """
        name = f"phasing_relative({shown(shift)})"
        request, of = self._request(name), "of its master"
        return self._submit(
            name,
            c.PhaseBy(
                request.finite("shift", shift, f"units {of}"),
                request.positive("velocity", velocity, f"units {of} per s"),
                request.positive("acceleration", acceleration, f"units {of} per s²"),
            ),
        )

    def move_superimposed(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
    ) -> Handle:
        """Add ``distance`` to a motion that the master commands, and that continues (MC_MoveSuperimposed). Does not block.

        The underlying motion may be a line, path or stream of a group, a trajectory, a gear or cam, a move with limited jerk
        that the master commands, or a motion that continues from one of these. It continues displaced: at its end ``position``
        is its own end plus ``distance``, and its handle waits for an active addition. A second addition replaces the first,
        from its present velocity.

        ``velocity`` (unit/s) and ramps (unit/s²) apply to the addition; the defaults are the axis's. The sum keeps
        ``max_velocity`` and ``max_acceleration``: if necessary, the addition is slower, or waits. ``position_limits`` apply to
        the sum: a LimitError ends the handle, and only the addition brakes. An override slows the addition, too. The addition
        has no jerk limit.

        The handle is done when the whole distance is added. It ends with a StateError if the master commands no motion of the
        axis (the axis is at standstill, or its drive generates the move). It ends with a LimitError if the underlying motion
        uses all of ``max_acceleration``. If a halt, a stop, a fault or another command ends the underlying motion, the handle
        ends with it.

        Raises:
            LimitError: beyond ``max_velocity`` or ``max_acceleration``.
            ArgumentError: not finite, not positive, or a default is missing.
        """
        name = f"move_superimposed({shown(distance)} {self.unit})"
        command = self._request(name).superimposed(distance, velocity, acceleration, deceleration)
        return self._submit(name, command)

    def halt_superimposed(self, *, deceleration: float | None = None) -> Handle:
        """Brake only the superimposed motion, with ``deceleration`` (unit/s²) or its own (MC_HaltSuperimposed). Does not block.

        The underlying motion continues, displaced by the distance that was added until then. Without a superimposed motion the
        call has no effect.

        Raises:
            LimitError: beyond ``max_acceleration``.
            ArgumentError: not finite or not above 0.
        """
        name = "halt_superimposed()"
        down = None if deceleration is None else self._request(name).acceleration(deceleration)
        return self._submit(name, c.HaltSuperimposed(down))

    # -- touch probe -------------------------------------------------------------------------------------------------

    def probe(
        self,
        input: int = 1,  # noqa: A002  # the standard's word
        edge: str = "rising",
        *,
        continuous: bool = False,
        window: tuple[float, float] | None = None,
        source: str = "input",
    ) -> ProbeHandle:
        """Arm a touch probe: the drive latches its position at the next ``edge`` (MC_TouchProbe; CiA 402-2, 60B8h to 60BDh).

        ``input``: 1 or 2. ``edge``: "rising", "falling", or "both", which is done when one of each is latched. ``source``: "input",
        or "zero pulse" of the encoder. ``continuous`` reports every edge until it is cancelled. ``window``: the range of positions
        (in the axis's unit) in which an edge counts; for an endless axis it may include the end of the turn.

        Does not block. The command energises and moves nothing, and works in every state in which the node is operational. The
        position is the drive's own latch. The master detects the latch by SDO, at most 10 ms and two answers later. An edge counts
        from the time at which the handle is ``active`` (see ``wait_armed``). Another request for the same input replaces this one;
        homing ends it.

        Raises:
            StateError: the EDS lacks an object that is needed.
            ArgumentError: a value is not one of those allowed; or with a window, the axis must be homed and is not.
        """
        name = f"probe(input {shown(input)}, {edge if isinstance(edge, str) else short_repr(edge)})"
        command = probe_command(
            self._request(name), self._parameters, input, edge, source, window, continuous=continuous
        )
        if window is not None:
            self._require_homed(name)
        abort = c.ProbeAbort(command.number, command.key)
        handle = ProbeHandle(
            f"{self.name}.{name}",
            self._session.waiter,
            self._parameters.units,
            lambda: self._submit(f"probe_abort(input {command.number})", abort),
        )
        self._commanding.give(handle, self.name, command)
        return handle

    def probe_move(
        self,
        position: float,
        *,
        input: int = 1,  # noqa: A002  # the standard's word
        edge: str = "rising",
        source: str = "input",
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
    ) -> ProbeHandle:
        """Move to ``position`` at most, and halt when a touch probe sees its next ``edge`` ("rising" or "falling").

        The command begins at standstill: the master arms the input, then moves the axis. The handle is done at rest, and its
        ``position`` is the position of the edge. The axis stops beyond the edge, by the distance that it moves until the edge
        is seen plus its braking distance. If it arrives without an edge, the handle ends with a ProbeError. A halt, or another
        motion, ends it as it ends a move; ``cancel()`` halts. The other arguments are as in ``move_absolute`` and ``probe``.
        Does not block.

        Raises:
            LimitError, ArgumentError: as ``move_absolute`` and ``probe``.
            StateError: the EDS lacks an object that is needed.
        """
        name = f"probe_move({shown(position)} {self.unit}, input {shown(input)})"
        target = self._absolute_increments(name, position)
        request = self._request(name)
        profile = request.profile(velocity, acceleration, deceleration, timeout)
        probe = probe_command(request, self._parameters, input, edge, source, None, continuous=False)
        if len(probe.edges) != 1:
            raise ArgumentError(
                f"{request.text}: it waits for one kind of edge", remedy='give edge="rising" or "falling"'
            )
        handle = ProbeHandle(f"{self.name}.{name}", self._session.waiter, self._parameters.units, self.halt)
        alone = (self.name,)
        self._session.add_group(alone, alone)
        self._commanding.give(
            handle, alone, ProbeMove(self.name, c.Move(c.TargetReference.ABSOLUTE, target, profile), probe)
        )
        return handle

    def probe_abort(self, input: int = 1) -> Handle:  # noqa: A002  # the standard's word
        """Switch off the touch probe of ``input`` (1 or 2), whichever program armed it (MC_AbortTrigger); its handle is aborted.

        Does not block; done when the drive has accepted it. Raises as ``probe``.
        """
        name = f"probe_abort(input {shown(input)})"
        request = self._request(name)
        number = input_number(request, input)
        require_objects(request, self._parameters, number, frozenset())
        return self._submit(name, c.ProbeAbort(number))

    # -- construction of commands -------------------------------------------------------------------------------------

    def _submit(self, name: str, command: c.Command) -> Handle:
        return self._commanding.submit(self.name, command, f"{self.name}.{name}")

    def _couple(self, command: Couple, text: str) -> Handle:
        both = (command.master, command.slave)
        self._session.add_group(both, both)
        return self._commanding.submit(both, command, f"{self.name}.{text}")

    def _require_master(self, master: object, text: str) -> Axis:
        """Return ``master``; raise ArgumentError unless it is another axis of this machine; for couplings."""
        if isinstance(master, Axis) and master is not self and master._session is self._session:
            return master
        raise ArgumentError(
            f"{self.name}.{text}: its master is another axis of this machine",
            observed=f"it is {'the axis itself' if master is self else short_repr(master)}",
            remedy='give an axis: cell["x"]',
        )

    def _submit_motion(
        self, name: str, command: c.Move | c.MoveVelocity, buffer: bool | str, direction: int = 0
    ) -> Handle:
        mode = buffering_of(f"{self.name}.{name}", buffer)
        if mode is None or not mode.blends:
            return self._submit(name, command if mode is None else c.Buffered(command))
        if isinstance(command, c.Move):
            return self._submit(name, c.BufferedMove(command, mode, direction))
        raise ArgumentError(
            f"{self.name}.{name}: only a move to a position can be blended with another one",
            observed=f'buffer is "{mode.value}"',
            remedy='let it begin at standstill: buffer="buffered"; or leave buffer out: then it replaces the present motion '
            "at once",
        )

    def _move_by(
        self,
        reference: c.TargetReference,
        distance: float,
        given: tuple[float | None, float | None, float | None, float | None, float | None],
        *,
        buffer: bool | str,
    ) -> Handle:
        """``given``: velocity, acceleration, deceleration, timeout and jerk."""
        name = f"move_{reference.value}({shown(distance)} {self.unit})"
        request = self._request(name)
        raw = request.distance(distance)
        return self._submit_motion(name, c.Move(reference, raw, request.profile(*given)), buffer)

    def _request(self, name: str) -> AxisCall:
        return AxisCall(self._parameters, name)

    def _absolute_command(self, name: str, position: float, velocity: float | None) -> c.Move:
        """Return the command of an absolute move, checked as ``move_absolute`` does; for groups."""
        target = self._absolute_increments(name, position)
        return c.Move(c.TargetReference.ABSOLUTE, target, self._request(name).profile(velocity))

    @property
    def default_acceleration(self) -> float | None:
        """Acceleration of ``[axes.NAME.defaults]`` in unit/s², None if it is missing."""
        return self._parameters.defaults.acceleration

    def _absolute_increments(self, name: str, position: float, direction: int = 0) -> int:
        """Return the target of an absolute move in user increments, checked as ``move_absolute`` does; for groups."""
        self._require_homed(name)
        request = self._request(name)
        position = request.finite("position", position)
        modulo, scale = self._parameters.units.modulo, self._parameters.units.position
        if modulo is None:
            return request.target(position)
        snapshot = self.snapshot
        here = scale.to_units(self._known(snapshot.position, "position (6064h)") - snapshot.origin)
        return scale.to_increments(modulo_target(here, position, modulo, direction))

    def _absolute_position(self, name: str, position: float) -> float:
        """Return the end position of an absolute move, in units, checked as ``move_absolute`` does; for groups."""
        target = self._absolute_increments(name, position)
        endless = self._parameters.units.modulo is not None
        return self._parameters.units.position.to_units(target) if endless else position

    def _require_stream_limits(self, text: str) -> None:
        """Raise ArgumentError if the deceleration or the maximum velocity of the axis is unknown; for streams."""
        self._request(text).streamed()

    def _stream_limits(self) -> StreamLimits:
        """Return the limits of the axis on a stream of points that begins at its commanded position; for streams."""
        return stream_limits_of(self._parameters, self.commanded_position)

    def _require_at_start(self, text: str, position: float) -> None:
        """Raise StateError if ``position`` is not the commanded position of the axis; for streams."""
        units = self._parameters.units.position
        off, allowed = abs(position - self.commanded_position), self.start_tolerance
        if off > allowed:
            raise StateError(
                f"{text}: {self.name} is not at the start of the stream",
                observed=f"{self.name} is at {self.commanded_position:.6g} {units.unit}, the point is at {position:.6g}; the "
                f"allowed distance is {allowed:.3g}",
                remedy="begin the stream at the present position of the axes, or first move to its first point",
            )

    def _require_homed(self, name: str) -> None:
        """Raise ArgumentError if the axis must be homed and is not; for couplings."""
        if self._parameters.homing.required and not self.snapshot.homed:
            raise ArgumentError(
                f"{self.name}.{name}: the axis is not homed",
                observed="its absolute position has not been confirmed since the machine was opened",
                remedy="home it (axis.home()) or confirm its position (axis.set_position(...)); with an absolute encoder set "
                "required = false in [axes." + self.name + ".homing]",
            )

    def _checked_position(self, name: str, position: float) -> float:
        """Return ``position``, checked as ``move_absolute`` does; for an endless axis the one within its turn; for couplings."""
        self._absolute_increments(name, position)
        return float(position)

    @property
    def modes(self) -> frozenset[ModeOfOperation]:
        """The modes of operation in use: those of the cell file, otherwise those in 6502h or those whose objects exist."""
        return self._parameters.modes


def _takes_nothing(name: str, reason: str) -> StateError:
    """Return the error of an axis that accepts no command, because the machine is being closed."""
    return StateError(
        f"{name}: command rejected: the machine is shutting down",
        observed=f"every axis is stopped: {reason}",
        remedy="close the machine, and open it again to continue",
    )
