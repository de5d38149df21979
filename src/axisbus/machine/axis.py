"""One axis as its user sees it: commands in engineering units, checked at the call; values that are never passed off as fresh."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from axisbus.cia402 import homing
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import ValueTransport
from axisbus.cia402.state import PowerState
from axisbus.errors import ArgumentError, AxisbusError, StaleError, StateError
from axisbus.machine.cam import Cam
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.coupling import Coupling
from axisbus.machine.handle import Handle
from axisbus.machine.probing import ProbeHandle, input_number, probe_command, require_objects
from axisbus.machine.request import AxisCall, buffering_of, flag_of, override_of, shown
from axisbus.machine.streaming.controller import Controller, Function
from axisbus.machine.streaming.controller_options import ControllerRamps, answering_of
from axisbus.motion import commands as c
from axisbus.motion.group.commands import Couple, ProbeMove
from axisbus.motion.moves.activity import age_text
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.numbers import told
from axisbus.motion.override.factor import FASTER
from axisbus.motion.parameters import AxisLimits, AxisParameters
from axisbus.motion.point_stream.curve_fit import Allowed, allowed_of
from axisbus.motion.position_limits import NOISE, room_of_way
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.spline import Followed, trajectory_of
from axisbus.motion.states import AxisState
from axisbus.motion.stop.promises import Promise, promises
from axisbus.units import modulo_target

_HOMING_TIMEOUT = 60.0
_NO_DEMAND = (
    "the drive counts anew since homing ended just now, its 6062h says nothing, or the last one is too old"
)
Measure = Callable[[str, str], float]


def tells_nothing(axis: str, what: str) -> float:
    """Refuse to read ``what``: there is no way to the drive's objects."""
    raise StateError(f"{axis}: its {what} is not known: the machine has no way to its objects")


class Axis:
    """A named axis. Every command returns a ``Handle`` at once; ``handle.wait()`` blocks, ``await handle`` does not.

    Values are in the axis's unit (``unit``, unit/s, unit/s²), torques in N·m, times in seconds. Argument errors raise at the call;
    what the state forbids, and all that happens later, ends the handle. Commands that come faster than the scan takes them wait, up
    to a number (see ``inbox``); halt, stop, quick_stop and disable never do.
    """

    def __init__(
        self, parameters: AxisParameters, commanding: CommandDispatcher, measure: Measure = tells_nothing
    ) -> None:
        """``measure`` reads what the drive tells beside the cyclic values, by name (see ``temperature``)."""
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
        """Let a notebook show it."""
        from axisbus.machine.display.notebook import axis_html  # only a notebook needs it

        return axis_html(self)

    # -- what it is and where it is ----------------------------------------------------------------------------------

    @property
    def modulo(self) -> float | None:
        """How far an endless axis turns until it counts anew, in its unit; None where it is not endless."""
        return self._parameters.units.modulo

    @property
    def unit(self) -> str:
        """The unit of its positions."""
        return self._parameters.units.position.unit

    @property
    def state(self) -> AxisState:
        """PLCopen's state, as of the last cycle.

        Raises:
            StaleError: it is unknown: the scan has failed.
        """
        self._require_scan("state")
        return self.snapshot.state

    @property
    def error(self) -> AxisbusError | None:
        """Why the axis is in ErrorStop, or nothing is known of it (the scan has failed), or it takes no command any more.

        The last comes of Ctrl-C or SIGTERM, after which there is only the way out. None when all is well.
        """
        dead, leaving = self._session.dead, self._session.leaving_because
        if dead is not None:
            return self._unknown("state", dead)
        if self.snapshot.error is None and leaving is not None and not self._session.ended:
            return _takes_nothing(self.name, leaving)
        return self.snapshot.error

    @property
    def homed(self) -> bool:
        """Whether its position is a confirmed one: homed, or set by ``set_position``, since the machine was opened.

        Raises:
            StaleError: it is unknown: the scan has failed.
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
            StaleError: it is unknown (never received, or older than its maximum age).
        """
        return self._parameters.units.turned(self.unwrapped_position)

    @property
    def unwrapped_position(self) -> float:
        """As ``position``, but of an endless axis not within its modulo: how far it has turned in all; for groups."""
        snapshot = self.snapshot
        return self._parameters.units.position.to_units(
            self._known(snapshot.position, "position (6064h)") - snapshot.origin
        )

    @property
    def commanded_position(self) -> float:
        """Where its drive was led to last (6062h, where it is believed), else where it is; unwrapped, in its unit; for groups."""
        snapshot = self.snapshot
        place = snapshot.demand if snapshot.demand_leads else None
        if place is None:
            place = self._known(snapshot.position, "position (6064h)")
        return self._parameters.units.position.to_units(place - snapshot.origin)

    @property
    def scan_period(self) -> float:
        """Seconds between two of its cycles; for groups."""
        return self._parameters.scan_period

    @property
    def increment(self) -> float:
        """What one increment of its position comes to, in its unit; for groups."""
        return abs(self._parameters.units.position.to_units(1))

    @property
    def start_tolerance(self) -> float:
        """How far it may be from a place that counts as where it stands, in its unit; for groups."""
        return self._parameters.place_window * self.increment

    @property
    def velocity(self) -> float:
        """Actual velocity in unit/s; raises StaleError when it is unknown."""
        return self._parameters.units.velocity.to_units(
            self._known(self.snapshot.velocity, "velocity (606Ch)")
        )

    @property
    def torque(self) -> float:
        """Actual torque in N·m (in parts of rated torque without ``rated_torque``); raises StaleError when it is unknown."""
        return self._parameters.units.torque(self._known(self.snapshot.torque, "torque (6077h)"))

    @property
    def target(self) -> float | None:
        """Where the last move to a position leads, in the axis's unit; None without one, or after another kind of motion."""
        snapshot = self.snapshot
        if snapshot.target is None:
            return None
        units = self._parameters.units
        return units.turned(units.position.to_units(snapshot.target - snapshot.origin))

    @property
    def distance_to_go(self) -> float | None:
        """How far the target of the last move to a position is from where the axis is, signed, in the axis's unit.

        None without such a move, or while the position is unknown.
        """
        snapshot = self.snapshot
        if snapshot.target is None or snapshot.position is None or self._session.silent is not None:
            return None
        return self._parameters.units.position.to_units(snapshot.target - snapshot.position)

    @property
    def following_error(self) -> float:
        """How far the actual position is behind the demand (6062h minus 6064h), in the axis's unit.

        Raises:
            StaleError: one of both is unknown; so it is on a drive whose 6062h says nothing (see ``docs/stopping.md``).
        """
        snapshot = self.snapshot
        demand = self._known(snapshot.demand, "demand (6062h)")
        return self._parameters.units.position.to_units(
            demand - self._known(snapshot.position, "position (6064h)")
        )

    @property
    def enabled(self) -> bool:
        """Whether the drive is in *operation enabled*, as of the last cycle.

        Raises:
            StaleError: it is unknown: no fresh statusword, or the scan has failed.
        """
        self._require_scan("state")
        snapshot = self.snapshot
        self._known(snapshot.statusword, "statusword (6041h)")
        return snapshot.power_state is PowerState.OPERATION_ENABLED

    @property
    def limits(self) -> AxisLimits:
        """What the master keeps: ``position``, ``velocity``, ``acceleration`` in units, ``torque`` in N·m (None: none)."""
        return self._parameters.limits

    def room_from(self, start: float) -> tuple[float, float] | None:
        """Return within what a way from ``start`` (unit) must lie, None: anything; for groups."""
        start = self._request(f"room_from({shown(start)})").finite("start", start)
        limits, units = self._parameters.limits.position, self._parameters.units.position
        if limits is None:
            return None
        noise = abs(units.to_units(NOISE))
        return room_of_way(limits, start, noise, abs(units.to_units(1)))

    @property
    def promises(self) -> tuple[Promise, ...]:
        """In which mode each limit is kept and how, by what the drive has shown when it was booted; one entry for each mode.

        An entry has ``limit`` (its key in the cell file), ``mode`` (such as ``pv``), ``kept``, ``why`` and ``remedy``.
        """
        return promises(self._parameters)

    @property
    def override(self) -> float:
        """The factor of ``set_override``, whichever program has set it; 1 before that. That of the cell multiplies it."""
        return self.snapshot.override

    @property
    def total_override(self) -> float:
        """By what the velocities of its commands are multiplied: its own override times that of the cell, at most 1.5."""
        snapshot = self.snapshot
        return min(snapshot.override * snapshot.cell_override, FASTER)

    @property
    def temperature(self) -> float:
        """Motor temperature in °C, where the make's table names its object; read by SDO: it blocks until the drive has answered.

        Raises:
            StateError: the drive does not tell it, or nobody knows by which object.
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
        """Check that the scan lives, or was ended well; raises StaleError."""
        dead = self._session.dead
        if dead is not None:
            raise self._unknown(what, dead)

    def _unknown(self, what: str, why: str) -> StaleError:
        remedy = "read it while the machine is open"
        if self._session.failed:
            remedy = "make sure that the axis stands, then close the machine, which tells more"
        return StaleError(
            f"{self.name}: its {what} is unknown",
            axis=self.name,
            observed=why,
            remedy=f"{remedy}; axis.snapshot keeps what was seen last, with its time",
        )

    def _why_unknown(self, what: str) -> tuple[str, str]:
        """Return what is seen of a value that is not known, and what to do."""
        name = what.partition(" ")[0]
        remedy = "check that the node is there and sends it; it must be in a TPDO (axisbus boot shows what travels how)"
        if (
            self._session.axes[self.name].capabilities.inputs.get(name, ValueTransport.NONE)
            is ValueTransport.NONE
        ):
            return "it does not travel: no TPDO holds it, and it is not polled", remedy
        snapshot = self.snapshot
        if name == "position":
            return age_text(snapshot.now - snapshot.position_stamp), remedy
        if name == "demand" and snapshot.position is not None:
            return (
                _NO_DEMAND,
                "read it a cycle later; where it stays unknown, axisbus boot shows how 6062h travels",
            )
        return "it was never received, or the last one is too old", remedy

    # -- power and stopping ------------------------------------------------------------------------------------------

    def enable(self, *, allow_moving: bool = False) -> Handle:
        """Switch the power stage on (MC_Power). Nothing moves by it: every target is preloaded.

        An axis that moves without power (coasts, sags, is turned by hand) is awaited, and refused where it does not come to rest;
        ``allow_moving`` catches it in motion. It is done when the axis is seen to stand with its power on.

        Asked for again while it is under way, it goes on, and both handles end as it does; so do ``reset`` and all that stops.
        """
        caught = flag_of(f"{self.name}.enable", "moving", allow_moving)
        return self._submit("enable(allow_moving=True)" if caught else "enable()", c.EnableCommand(caught))

    def disable(self, *, coast: bool = False) -> Handle:
        """Halt, then switch the power stage off (transitions 5, 6, 7); ``coast`` cuts the power at once (transition 9)."""
        cut = flag_of(f"{self.name}.disable", "coast", coast)
        return self._submit("disable(coast=True)" if cut else "disable()", c.Disable(cut))

    def reset(self) -> Handle:
        """Reset a fault or ErrorStop (MC_Reset); never enables.

        Does not block. The reset waits while the axis is being stopped; a new error, ``stop()`` or ``quick_stop()`` ends it then.
        """
        return self._submit("reset()", c.ResetCommand())

    def halt(self) -> Handle:
        """Brake to Standstill (MC_Halt); a new motion command may interrupt it."""
        return self._submit("halt()", c.Halt())

    def stop(self) -> Handle:
        """Brake to a stop and lock the axis in Stopping (MC_Stop) until ``release()``."""
        return self._submit("stop()", c.Stop())

    def release(self) -> Handle:
        """End the lock of ``stop()``, once the axis stands."""
        return self._submit("release()", c.Release())

    @contextmanager
    def held_stopped(self, timeout: float | None = None) -> Iterator[None]:
        """Stop on entering (blocks until it stands), release on leaving."""
        self.stop().wait(timeout)
        try:
            yield
        finally:
            self.release().wait(timeout)

    def quick_stop(self) -> Handle:
        """Let the drive do its quick stop (605Ah); afterwards it is Disabled, or held in Stopping, as configured."""
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

        ``jerk`` (unit/s³): the acceleration changes by no more in a second; ``math.inf``: at once, whatever the default is. A drive
        with 60A4h and 6086h limits it; any other, and a virtual axis, is led by the master in csp. A halt and a stop are
        as without.
        ``direction`` is for endless axes (``modulo``): 0 shortest way, 1 positive, -1 negative. ``timeout`` in seconds replaces the
        deadline that the master works out.

        With ``buffer`` (True, or ``"buffered"``) it begins when what the axis does has ended well (100 may wait), else it replaces
        that. With ``"blending_low"``, ``"blending_previous"``, ``"blending_next"`` or ``"blending_high"`` (PLCopen's BufferMode) it
        passes the end of the move before at the lower velocity of both, that of the one before, its own, or the higher. Behind a
        move of the drive, the drive does that; with nothing under way it begins at once, led by the master in csp (where the drive
        has it), so that the next passes exactly; with ``jerk`` only so. Where it cannot be so, the handle's ``note`` says why.

        Raises:
            LimitError: beyond ``position_limits``, ``max_velocity`` or ``max_acceleration``, or beyond what the object holds.
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

        Where it blends, it counts from the end of the move before.
        """
        ways = velocity, acceleration, deceleration, timeout, jerk
        return self._move_by(c.TargetReference.RELATIVE, distance, ways, buffer=buffer)

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
        """Move by ``distance`` from the last commanded position (MC_MoveAdditive); raises as ``move_absolute``."""
        ways = velocity, acceleration, deceleration, timeout, jerk
        return self._move_by(c.TargetReference.ADDITIVE, distance, ways, buffer=buffer)

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
        """Move at ``velocity`` (signed, unit/s) until something else is wanted (MC_MoveVelocity, profile velocity mode).

        ``jerk`` (unit/s³) as in ``move_absolute``: a drive with 60A4h and 6086h limits it, any other, and a virtual axis, is led by
        the master in csp, from standstill or from where that leads it already; ``halt`` is then as soft, every other stop is not.
        The handle is done when the velocity is reached. Raises as ``move_absolute``.
        """
        name = f"move_velocity({shown(velocity)} {self.unit}/s)"
        profile = self._request(name).turning(velocity, acceleration, deceleration, timeout, jerk)
        return self._submit_motion(name, c.MoveVelocity(profile), buffer)

    def jog(
        self, velocity: float, *, acceleration: float | None = None, continue_only: bool = False
    ) -> Handle:
        """Move at ``velocity`` for 200 ms; call it again with the same values to go on. Raises as ``move_absolute``.

        With ``continue_only`` it goes on with the jog that runs, and begins none: where that has ended, by a halt of anybody's say,
        the handle ends with ``Interrupted``. Whoever holds a button calls so from the second time on.
        """
        name = f"jog({shown(velocity)} {self.unit}/s)"
        profile = self._request(name).turning(velocity, acceleration, jerk=math.inf)
        goes_on = flag_of(f"{self.name}.{name}", "continue_only", continue_only)
        return self._submit(name, c.MoveVelocity(profile, self._parameters.timing.jog, goes_on))

    def torque_control(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) in profile torque mode (MC_TorqueControl).

        Raises:
            ArgumentError: ``rated_torque`` is not in cell.toml, a value is not finite, or no slope is known: the call gives
                none, nor does ``torque_slope`` of the defaults, and the drive's own (6087h) is 0.
            LimitError: beyond ``max_torque``, or beyond what 6071h holds.
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
        """Turn at ``velocity`` (signed, unit/s) until something else is wanted, in cyclic synchronous velocity mode (csv).

        The ramps are made here: the drive gets one velocity per cycle. Called again while the axis turns, it goes on from the
        velocity of that cycle; it may be called in every one. It begins at standstill, or where a ``cyclic_velocity`` runs or is
        being halted. A halt brakes with ``deceleration``. The handle is done when the velocity is measured; it does not block.

        Raises:
            LimitError: beyond ``max_velocity`` or ``max_acceleration``, or beyond what 60FFh holds.
            ArgumentError: not finite, not positive, a default is missing, or ``velocity_scale`` of an axis in increments.
        """
        name = f"cyclic_velocity({shown(velocity)} {self.unit}/s)"
        command = self._request(name).cyclic_velocity(velocity, acceleration, deceleration)
        return self._submit(name, command)

    def cyclic_torque(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) in cyclic synchronous torque mode (cst).

        The slope is made here, from the torque that the axis has when it begins: the drive gets one torque per cycle. It begins
        at standstill, or where a ``cyclic_torque`` acts. The handle is done when the torque is measured; it does not block.
        ``timeout`` in seconds replaces the deadline that the master works out.

        Raises:
            ArgumentError: ``rated_torque`` is not in cell.toml, a value is not finite, or no slope is known: the call gives
                none, nor does ``torque_slope`` of the defaults, and the drive's own (6087h) is missing or 0.
            LimitError: beyond ``max_torque``, beyond what 6071h holds, or a slope below 0.1 % of rated torque per second.
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
        """Let ``function`` lead the axis: it is given what was ``Measured`` in each cycle, and returns what is led to in the next.

        ``output="velocity"``: it returns a velocity (unit/s, csv), ``"torque"``: a torque (N·m, cst); it is held to
        ``max_velocity`` or ``max_torque``, and the ramps are those of ``cyclic_velocity`` and ``cyclic_torque``. It runs in a
        thread of this program, and is called once the drive is in that mode. An exception, or no answer in time for the next
        cycle, stops the axis (ErrorStop); ``max_missed_cycles``: for how many cycles more the last answer holds. Does not block.

        Raises:
            ArgumentError, LimitError: as ``cyclic_velocity`` or ``cyclic_torque``.
        """
        if not callable(function):
            raise ArgumentError(
                f"{self.name}.controller: {told(function)} is no function",
                remedy="give one that takes what was measured, and returns a velocity or a torque",
            )
        answering = answering_of(
            self._parameters, output, ControllerRamps(acceleration, deceleration, slope), max_missed_cycles
        )
        units, period = self._parameters.units, self.scan_period
        return Controller(self.name, units, period, self._commanding, function, answering, self.halt)

    def home(self, method: int | None = None, *, timeout: float | None = None) -> Handle:
        """Home the axis (MC_Home) by ``method`` of 6098h, by default that of ``[axes.NAME.homing]``; ``timeout`` in seconds.

        Asked for again while the axis is Homing, the second is refused and the first goes on.

        Raises:
            ArgumentError: no method is known, or one that moves has no speeds (a maker's own, below 0, may do without).
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
        """Call the actual position ``position`` from now on (MC_SetPosition).

        The master keeps the difference; the drive's own position and limits do not change.

        Raises:
            LimitError: beyond what a position object holds, so that no move could ever be told from there.
            ArgumentError: not finite.
        """
        name = f"set_position({shown(position)} {self.unit})"
        return self._submit(name, c.SetPosition(self._request(name).place(position)))

    def follow(self, trajectory: Followed, *, duration: float | None = None) -> Handle:
        """Follow ``trajectory`` (position over time in the axis's unit) in cyclic synchronous position mode.

        It is an object with ``duration`` and ``position(t)``; rows of time (s, from 0 on) and position, also of numpy,
        through which a smooth curve is laid (``SplineTrajectory``); or a function of time, with its ``duration`` in seconds.

        It must begin where the axis stands. What is known in advance (``TrapezoidalTrajectory``, ``SampledTrajectory``,
        ``SplineTrajectory``) is held against the limits as a whole. Any other is looked at in each cycle, as far ahead as braking
        takes with the default deceleration: where it would leave the position limits, the axis is braked along it and stands within
        them. So it is where the next step would be faster than ``max_velocity`` or harder than ``max_acceleration``; without both,
        harder than the default acceleration.

        Raises:
            LimitError: it goes beyond ``position_limits``, ``max_velocity`` or ``max_acceleration``.
            ArgumentError: the axis is not homed where it must be, or nothing is known to keep the limits with or to tell a jump by.
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
        """Be led by ``master``: ``ratio`` units for each of its units, below 0 the other way (MC_GearIn, MC_GearInPos).

        The axis takes up its speed with ``acceleration`` (unit/s², by default its own); from where it has it, it keeps to the
        master's place. With ``sync_positions`` = (master's place, own place) it waits until the master comes by, and within
        ``master_start_distance`` units of the master before its place comes into step such that both are there at a time.

        The handle ends when they are in step; the axis is led on, one cycle behind, until another command, ``gear_out`` or a stop
        takes it away. ``master_value_source`` "command": it goes by where the master is led to; "actual": by where it is, filtered.
        A master in ErrorStop, being homed or unknown is lost: the axis is braked by its own deceleration, in ErrorStop. So it is
        where the master would take it beyond its own limits.

        Raises:
            LimitError: a value is beyond a limit.
            ArgumentError: a value is missing or no number, an axis is not homed where it must be, or ``master`` is no other axis
                of this machine.
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
        """Be led by ``master`` along a ``cam`` (MC_CamIn).

        It must stand where it is due for the master's place, or comes there within the next ``master_start_distance`` units of the
        master; with ``relative`` where it is counts as where it is due. ``master_offset``: by how many units of the master it is
        ahead; ``master_scaling`` (above 0) and ``slave_scaling`` stretch the cam for the master's and the slave's places. The
        handle, ``master_value_source``, and the ends are as of ``gear_in``.

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
        """Be led no more, by a gear or a cam, and go on with the present speed (MC_GearOut, MC_CamOut); ``halt()`` brakes it."""
        return self._submit("gear_out()", c.GearOut())

    def set_override(self, factor: float) -> Handle:
        """Let the axis go at ``factor`` times the velocity of its commands: 0 (it holds) to 1.5 (MC_SetOverride). Does not block.

        At any time, also in motion, and for what follows, until it is set again; ``cell.set_override`` multiplies it, and so does
        that of a group. At 0 the axis comes to rest, its handle stays busy, and it goes on by itself when the factor rises. A line,
        path or stream of a group goes as slowly as its slowest axis. It lifts no limit: 1.5 times a velocity is at most
        ``max_velocity``; a trajectory of your own is only made faster where it tells in advance that it stays within the limits.
        It scales no ramp, torque, halt, stop or homing; an axis that another one leads follows that.

        The handle ends with a StateError where nothing says with which acceleration the axis may change its speed.

        Raises:
            ArgumentError: it is no number from 0 to 1.5.
        """
        found = override_of(f"{self.name}.set_override", factor)
        return self._submit(f"set_override({found:g})", c.SetOverride(found))

    def set_torque_offset(self, torque: float) -> Handle:
        """Let ``torque`` (N·m, signed) be added to what the drive's controllers ask for (60B2h), in csp and csv. Does not block.

        Such as a weight that has been gripped. It takes the place of ``torque_offset`` in ``[axes.NAME.feed_forward]``, whichever
        program sets it, until it is set again or the machine is opened anew. It acts while the drive is seen enabled by us, in csp
        or csv; it comes and goes within 0.2 s, and a stop takes it away. The handle is
        done at once.

        Raises:
            LimitError: beyond ``max_torque``, else the drive's 6072h.
            ArgumentError: no finite number; ``rated_torque`` is missing; the cell file does not ask for 60B2h.
        """
        name = f"set_torque_offset({shown(torque)} N·m)"
        return self._submit(name, c.SetTorqueOffset(self._request(name).torque_offset(torque)))

    def phasing_relative(self, shift: float, *, velocity: float, acceleration: float) -> Handle:
        """See its master ``shift`` units farther on than that is, while both go on (MC_PhasingRelative).

        For an axis in step. All in units of the master: the shift is signed, and changes with at most ``velocity`` (per s) and
        ``acceleration`` (per s²). What is still to come of a shift under way is added to it. The handle is done when all has been
        shifted; does not block.

        Raises:
            ArgumentError: a value is not finite, or velocity or acceleration are not above 0.
        """
        name = f"phase_by({shown(shift)})"
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
        """Lay ``distance`` over what leads the axis along a path, which goes on meanwhile (MC_MoveSuperimposed). Does not block.

        For an axis that the master leads: on a line, path or stream of a group, a trajectory, a gear or cam, a soft move of the
        master's, what goes on from these. The motion below goes on displaced: at its end ``position`` is its own end and
        ``distance``, and its handle waits for an addition under way. Another one supersedes this one, from its present speed.

        ``velocity`` (unit/s) and ramps (unit/s²) are those of the addition, by default the axis's. The sum keeps ``max_velocity``
        and ``max_acceleration``: the addition is slower, or waits. ``position_limits`` hold for the sum: a LimitError ends the
        handle, and brakes the addition alone. An override slows it, too. There is no limit of jerk.

        The handle is done when all is laid over. It ends with a StateError where nothing leads the axis (at standstill, or where
        its drive plans the move), with a LimitError where what leads it takes all of ``max_acceleration``, or with what ends the
        motion below: a halt, a stop, a fault, another command.

        Raises:
            LimitError: beyond ``max_velocity`` or ``max_acceleration``.
            ArgumentError: not finite, not positive, or a default is missing.
        """
        name = f"move_superimposed({shown(distance)} {self.unit})"
        command = self._request(name).superimposed(distance, velocity, acceleration, deceleration)
        return self._submit(name, command)

    def halt_superimposed(self, *, deceleration: float | None = None) -> Handle:
        """Brake what is laid over the motion, by ``deceleration`` (unit/s²) or its own (MC_HaltSuperimposed). Does not block.

        The motion below goes on, displaced by what has been laid over it until then. Harmless where nothing is.

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
        """Arm a touch probe: the drive latches where it is at the next ``edge`` (MC_TouchProbe; CiA 402-2, 60B8h to 60BDh).

        ``input``: 1 or 2. ``edge``: "rising", "falling", or "both", which is done when one of each was latched. ``source``:
        "input", or "zero pulse" of the encoder. ``continuous`` tells every edge until it is cancelled. ``window``: from where to
        where (in the axis's unit) an edge counts; of an endless axis it may go over the end of the turn.

        It does not block, energises and moves nothing, and works in every state in which the node is operational. The position is
        the drive's own latch; that it was latched is seen by SDO, 10 ms and two answers later at most. An edge counts from when the
        handle is ``active`` (see ``wait_armed``). Another request for the same input replaces this one; homing ends it.

        Raises:
            StateError: the EDS lacks an object for it.
            ArgumentError: a value is none that there is; or with a window, the axis is not homed where it must be.
        """
        name = f"probe(input {shown(input)}, {edge if isinstance(edge, str) else told(edge)})"
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
        """Move to ``position`` at most, and halt where a touch probe sees its next ``edge`` ("rising" or "falling").

        It begins at standstill: the input is armed, then the axis goes. The handle is done at rest, and its ``position`` is that
        of the edge; the axis stands beyond it, by its way until the edge was seen and by its braking. Where it arrives without
        an edge, the handle ends with a ProbeError. A halt, or another motion, ends it as it ends a move; ``cancel()`` halts.
        Values are as of ``move_absolute`` and ``probe``; it does not block.

        Raises:
            LimitError, ArgumentError: as ``move_absolute`` and ``probe``.
            StateError: the EDS lacks an object for it.
        """
        name = f"probe_move({shown(position)} {self.unit}, input {shown(input)})"
        target = self._absolute_increments(name, position)
        request = self._request(name)
        profile = request.profile(velocity, acceleration, deceleration, timeout)
        probe = probe_command(request, self._parameters, input, edge, source, None, continuous=False)
        if len(probe.edges) != 1:
            raise ArgumentError(
                f"{request.text}: it goes until one edge", remedy='give edge="rising" or "falling"'
            )
        handle = ProbeHandle(f"{self.name}.{name}", self._session.waiter, self._parameters.units, self.halt)
        alone = (self.name,)
        self._session.add_group(alone, alone)
        self._commanding.give(
            handle, alone, ProbeMove(self.name, c.Move(c.TargetReference.ABSOLUTE, target, profile), probe)
        )
        return handle

    def probe_abort(self, input: int = 1) -> Handle:  # noqa: A002  # the standard's word
        """Switch the touch probe of ``input`` (1 or 2) off, whoever has armed it (MC_AbortTrigger); its handle ends as aborted.

        It does not block; done when the drive has taken it. Raises as ``probe``.
        """
        name = f"probe_abort(input {shown(input)})"
        request = self._request(name)
        number = input_number(request, input)
        require_objects(request, self._parameters, number, frozenset())
        return self._submit(name, c.ProbeAbort(number))

    # -- how a command is made ----------------------------------------------------------------------------------------

    def _submit(self, name: str, command: c.Command) -> Handle:
        return self._commanding.submit(self.name, command, f"{self.name}.{name}")

    def _couple(self, command: Couple, text: str) -> Handle:
        both = (command.master, command.slave)
        self._session.add_group(both, both)
        return self._commanding.submit(both, command, f"{self.name}.{text}")

    def _require_master(self, master: object, text: str) -> Axis:
        """Return ``master``, which must be another axis of this machine (ArgumentError); for couplings."""
        if isinstance(master, Axis) and master is not self and master._session is self._session:
            return master
        raise ArgumentError(
            f"{self.name}.{text}: its master is another axis of this machine",
            observed=f"it is {'the axis itself' if master is self else told(master)}",
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
            f"{self.name}.{name}: only a move to a position passes into another one",
            observed=f'buffer is "{mode.value}"',
            remedy='let it begin from rest: buffer="buffered"; or leave buffer out, and it takes over at once',
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
        """Acceleration of ``[axes.NAME.defaults]`` in unit/s², None where it is missing."""
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
        """Return where an absolute move would end, in units, checked as ``move_absolute`` does; for groups."""
        target = self._absolute_increments(name, position)
        endless = self._parameters.units.modulo is not None
        return self._parameters.units.position.to_units(target) if endless else position

    def _require_stream_limits(self, text: str) -> None:
        """Raise ArgumentError where nothing says how it is braked, or how fast it may be; for streams."""
        self._request(text).streamed()

    def _stream_limits(self) -> Allowed:
        """Return what it may do on a stream of points that begins where it is led to; for streams."""
        return allowed_of(self._parameters, self.commanded_position)

    def _require_at_start(self, text: str, position: float) -> None:
        """Raise StateError where ``position`` is not where it is led to; for streams."""
        units = self._parameters.units.position
        off, allowed = abs(position - self.commanded_position), self.start_tolerance
        if off > allowed:
            raise StateError(
                f"{text}: {self.name} does not stand where the stream begins",
                observed=f"{self.name} is at {self.commanded_position:.6g} {units.unit}, the point at {position:.6g}; allowed are "
                f"{allowed:.3g} between them",
                remedy="begin the stream with where the axes stand, or go to its first point before",
            )

    def _require_homed(self, name: str) -> None:
        """Raise ArgumentError where it is not homed and must be; for couplings."""
        if self._parameters.homing.required and not self.snapshot.homed:
            raise ArgumentError(
                f"{self.name}.{name}: the axis is not homed",
                observed="its absolute position is not confirmed since the machine was opened",
                remedy="home it (axis.home()) or confirm its position (axis.set_position(...)); with an absolute encoder set "
                "required = false in [axes." + self.name + ".homing]",
            )

    def _checked_position(self, name: str, position: float) -> float:
        """Return a place, checked as ``move_absolute`` does; of an endless axis the one within its turn; for couplings."""
        self._absolute_increments(name, position)
        return float(position)

    @property
    def modes(self) -> frozenset[ModeOfOperation]:
        """The modes of operation that the drive claims (6502h)."""
        return self._parameters.modes


def _takes_nothing(name: str, reason: str) -> StateError:
    """The axis ``name`` is at rest, or is being stopped, and takes no command: the machine is on its way out."""
    return StateError(
        f"{name}: takes no command any more, the machine is on its way out",
        observed=f"every axis is stopped: {reason}",
        remedy="close the machine, and open it again to go on",
    )
