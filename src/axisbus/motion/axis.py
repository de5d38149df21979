"""One axis as its user sees it: commands in engineering units, checked at the call; values that are never passed off as fresh."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from axisbus.cia301.datatypes import DataType, check_range
from axisbus.cia402 import homing
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Waiter
from axisbus.errors import ArgumentError, AxisbusError, LimitError, StaleError
from axisbus.motion import commands as c
from axisbus.motion.handle import Handle
from axisbus.motion.homing import HomingJob
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.profile import Profile
from axisbus.motion.scan import Scan
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import Trajectory
from axisbus.units import Scale, modulo_target

_HOMING_TIMEOUT = 60.0


class Axis:
    """A named axis. Every command returns a ``Handle`` at once; ``handle.wait()`` blocks, ``await handle`` does not.

    Values are in the axis's unit (``unit``, unit/s, unit/s²), torques in N·m, times in seconds. Argument errors raise at the call;
    what the state forbids, and all that happens later, ends the handle.
    """

    def __init__(self, parameters: AxisParameters, scan: Scan, waiter: Waiter) -> None:
        self.name = parameters.name
        self._parameters = parameters
        self._scan = scan
        self._waiter = waiter

    def __repr__(self) -> str:
        return f"<Axis {self.name}: {self.state.value}>"

    # -- what it is and where it is ----------------------------------------------------------------------------------

    @property
    def unit(self) -> str:
        """The unit of its positions."""
        return self._parameters.units.position.unit

    @property
    def state(self) -> AxisState:
        """PLCopen's state, as of the last cycle."""
        return self.snapshot.state

    @property
    def error(self) -> AxisbusError | None:
        """Why the axis is in ErrorStop; None when it is not."""
        return self.snapshot.error

    @property
    def homed(self) -> bool:
        """Whether its position is a confirmed one: homed, or set by ``set_position``, since the machine was opened."""
        return self.snapshot.homed

    @property
    def snapshot(self) -> Snapshot:
        """All values of the last cycle, in increments; consistent with each other."""
        return self._scan.snapshots[self.name]

    @property
    def position(self) -> float:
        """Actual position in the axis's unit.

        Raises:
            StaleError: it is unknown (never received, or older than its maximum age).
        """
        snapshot = self.snapshot
        raw = self._known(snapshot.position, "position (6064h)")
        value = self._parameters.units.position.to_units(raw - snapshot.origin)
        modulo = self._parameters.units.modulo
        return value if modulo is None else value % modulo

    @property
    def velocity(self) -> float:
        """Actual velocity in unit/s; raises StaleError when it is unknown."""
        return self._parameters.units.velocity.to_units(
            self._known(self.snapshot.velocity, "velocity (606Ch)")
        )

    @property
    def torque(self) -> float:
        """Actual torque in N·m (in parts of rated torque without ``rated_torque``); raises StaleError when it is unknown."""
        return (
            self._known(self.snapshot.torque, "torque (6077h)")
            / 1000.0
            * (self._parameters.units.rated_torque or 1.0)
        )

    def _known(self, value: int | None, what: str) -> int:
        if value is None:
            raise StaleError(
                f"{self.name}: its {what} is unknown",
                axis=self.name,
                observed="it does not travel, was never received, or the last one is too old",
                remedy="map it into a TPDO (axisbus boot shows what travels how), and check that the node is there",
            )
        return value

    # -- power and stopping ------------------------------------------------------------------------------------------

    def enable(self) -> Handle:
        """Switch the power stage on (MC_Power). Nothing moves by it: every target is preloaded."""
        return self._submit("enable()", c.Enable())

    def disable(self, *, coast: bool = False) -> Handle:
        """Halt, then switch the power stage off (transitions 5, 6, 7); ``coast`` cuts the power at once (transition 9)."""
        return self._submit("disable(coast=True)" if coast else "disable()", c.Disable(coast))

    def reset(self) -> Handle:
        """Reset a fault or ErrorStop (MC_Reset); never enables."""
        return self._submit("reset()", c.Reset())

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
    def stopped(self, timeout: float | None = None) -> Iterator[None]:
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
        timeout: float | None = None,
    ) -> Handle:
        """Move to ``position`` (MC_MoveAbsolute, profile position mode).

        ``direction`` is for endless axes (``modulo``): 0 shortest way, 1 positive, -1 negative. ``timeout`` in seconds replaces the
        deadline that the master works out.

        Raises:
            LimitError: beyond ``position_limits``, ``max_velocity`` or ``max_acceleration``, or beyond what the object holds.
            ArgumentError: not finite, not positive, or a default is missing.
        """
        name = f"move_absolute({position:g} {self.unit})"
        target = self.absolute_increments(name, position, direction)
        profile = self._profile(name, velocity, acceleration, deceleration, timeout)
        return self._submit(name, c.Move(c.Reference.ABSOLUTE, target, profile))

    def move_relative(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move by ``distance`` from the actual position at the start (MC_MoveRelative); raises as ``move_absolute``."""
        return self._move_by(c.Reference.RELATIVE, distance, velocity, acceleration, deceleration, timeout)

    def move_additive(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move by ``distance`` from the last commanded position (MC_MoveAdditive); raises as ``move_absolute``."""
        return self._move_by(c.Reference.ADDITIVE, distance, velocity, acceleration, deceleration, timeout)

    def move_velocity(
        self,
        velocity: float,
        *,
        acceleration: float | None = None,
        deceleration: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move at ``velocity`` (signed, unit/s) until something else is wanted (MC_MoveVelocity, profile velocity mode).

        The handle is done when the velocity is reached. Raises as ``move_absolute``.
        """
        name = f"move_velocity({velocity:g} {self.unit}/s)"
        return self._submit(
            name, c.MoveVelocity(self._turning(name, velocity, acceleration, deceleration, timeout))
        )

    def jog(self, velocity: float, *, acceleration: float | None = None) -> Handle:
        """Move at ``velocity`` for 200 ms; call it again with the same values to go on. Raises as ``move_absolute``."""
        name = f"jog({velocity:g} {self.unit}/s)"
        profile = self._turning(name, velocity, acceleration, None, None)
        return self._submit(name, c.MoveVelocity(profile, life=self._parameters.timing.jog))

    def torque_control(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) in profile torque mode (MC_TorqueControl).

        Raises:
            ArgumentError: ``rated_torque`` is not in cell.toml, or a value is not finite.
            LimitError: beyond ``max_torque``, or beyond what 6071h holds.
        """
        name = f"torque_control({torque:g} N·m)"
        rated = self._parameters.units.rated_torque
        if rated is None:
            raise self._missing(name, "rated_torque", "the axis's rated torque in N·m")
        slope = slope if slope is not None else self._parameters.defaults.torque_slope
        self._finite(name, "torque", torque)
        limit = self._parameters.limits.torque
        if limit is not None and abs(torque) > limit:
            raise self._beyond(name, "torque", torque, "N·m", "max_torque", limit)
        raw = check_range(round(torque / rated * 1000), DataType.INTEGER16, f"{self.name}.{name}: 6071h")
        raw_slope = None if slope is None else self._positive(name, "slope", slope) / abs(rated) * 1000
        rounded = (
            None
            if raw_slope is None
            else check_range(round(raw_slope), DataType.UNSIGNED32, f"{self.name}: 6087h")
        )
        return self._submit(name, c.TorqueControl(raw, rounded, timeout))

    def home(self, method: int | None = None, *, timeout: float | None = None) -> Handle:
        """Home the axis (MC_Home) by ``method`` of 6098h, by default that of ``[axes.NAME.homing]``; ``timeout`` in seconds.

        Raises:
            ArgumentError: no method is known, or one that moves has no speeds.
        """
        homing_parameters = self._parameters.homing
        method = homing_parameters.method if method is None else method
        if method is None:
            raise self._missing("home()", "method", "a homing method of 6098h", "homing")
        name = f"home(method {method})"
        check_range(method, DataType.INTEGER8, f"{self.name}.{name}: 6098h")
        moves = method not in homing.IN_PLACE
        job = HomingJob(
            method,
            self._homing_speed(name, "speed_switch", homing_parameters.speed_switch, moves),
            self._homing_speed(name, "speed_zero", homing_parameters.speed_zero, moves),
            self._homing_acceleration(homing_parameters.acceleration),
            timeout or homing_parameters.timeout or _HOMING_TIMEOUT,
        )
        return self._submit(name, c.Home(job))

    def set_position(self, position: float) -> Handle:
        """Call the actual position ``position`` from now on (MC_SetPosition).

        The master keeps the difference; the drive's own position and limits do not change.
        """
        name = f"set_position({position:g} {self.unit})"
        self._finite(name, "position", position)
        return self._submit(name, c.SetPosition(self._parameters.units.position.to_increments(position)))

    def follow(self, trajectory: Trajectory) -> Handle:
        """Follow ``trajectory`` (position over time in the axis's unit) in cyclic synchronous position mode.

        It must begin where the axis stands. Limits are checked in each cycle.
        """
        name = f"follow({type(trajectory).__name__}, {trajectory.duration:g} s)"
        self._require_homed(name)
        return self._submit(name, c.FollowTrajectory(trajectory))

    # -- from units to increments ------------------------------------------------------------------------------------

    def _submit(self, name: str, command: c.Command) -> Handle:
        handle = Handle(f"{self.name}.{name}", self._waiter)
        self._scan.submit(self.name, command, handle)
        return handle

    def _move_by(
        self,
        reference: c.Reference,
        distance: float,
        velocity: float | None,
        acceleration: float | None,
        deceleration: float | None,
        timeout: float | None,
    ) -> Handle:
        name = f"move_{reference.value}({distance:g} {self.unit})"
        self._finite(name, "distance", distance)
        raw = self._parameters.units.position.to_increments(distance)
        check_range(raw, DataType.INTEGER32, f"{self.name}.{name}: 607Ah")
        profile = self._profile(name, velocity, acceleration, deceleration, timeout)
        return self._submit(name, c.Move(reference, raw, profile))

    def absolute_command(self, name: str, position: float, velocity: float | None) -> c.Move:
        """Return the command of an absolute move, checked as ``move_absolute`` does; for groups."""
        target = self.absolute_increments(name, position)
        return c.Move(c.Reference.ABSOLUTE, target, self._profile(name, velocity, None, None, None))

    @property
    def default_acceleration(self) -> float | None:
        """Acceleration of ``[axes.NAME.defaults]`` in unit/s², None where it is missing."""
        return self._parameters.defaults.acceleration

    def absolute_increments(self, name: str, position: float, direction: int = 0) -> int:
        """Return the target of an absolute move in user increments, checked as ``move_absolute`` does; for groups."""
        self._require_homed(name)
        self._finite(name, "position", position)
        scale, limits = self._parameters.units.position, self._parameters.limits.position
        modulo = self._parameters.units.modulo
        if modulo is not None:
            snapshot = self.snapshot
            here = scale.to_units(self._known(snapshot.position, "position (6064h)") - snapshot.origin)
            return scale.to_increments(modulo_target(here, position, modulo, direction))
        if limits is not None and not limits[0] <= position <= limits[1]:
            raise LimitError(
                f"{self.name}.{name}: beyond the position limits",
                observed=f"allowed are {limits[0]:g} to {limits[1]:g} {self.unit}",
                remedy="give a position within them, or change position_limits in [axes."
                + self.name
                + "] of cell.toml",
            )
        return check_range(scale.to_increments(position), DataType.INTEGER32, f"{self.name}.{name}: 607Ah")

    def _require_homed(self, name: str) -> None:
        if self._parameters.homing.required and not self.homed:
            raise ArgumentError(
                f"{self.name}.{name}: the axis is not homed",
                observed="its absolute position is not confirmed since the machine was opened",
                remedy="home it (axis.home()) or confirm its position (axis.set_position(...)); with an absolute encoder set "
                "required = false in [axes." + self.name + ".homing]",
            )

    def _profile(
        self,
        name: str,
        velocity: float | None,
        acceleration: float | None,
        deceleration: float | None,
        timeout: float | None,
    ) -> Profile:
        speed = self._positive(name, "velocity", self._or_default(name, "velocity", velocity))
        limit = self._parameters.limits.velocity
        if limit is not None and speed > limit:
            raise self._beyond(name, "velocity", speed, self.unit + "/s", "max_velocity", limit)
        units = self._parameters.units
        raw = _raw(units.velocity, speed, f"{self.name}.{name}: 6081h")
        raw_up, raw_down, ramp = self._ramps(name, acceleration, deceleration)
        inc = abs(units.position.factor)
        known = units.ratio_known
        return Profile(
            raw, raw_up, raw_down, speed * inc if known else None, ramp * inc if known else None, timeout
        )

    def _turning(
        self,
        name: str,
        velocity: float,
        acceleration: float | None,
        deceleration: float | None,
        timeout: float | None,
    ) -> Profile:
        """Return the profile of a signed velocity."""
        self._finite(name, "velocity", velocity)
        limit, units = self._parameters.limits.velocity, self._parameters.units
        if limit is not None and abs(velocity) > limit:
            raise self._beyond(name, "velocity", velocity, self.unit + "/s", "max_velocity", limit)
        raw = check_range(
            units.velocity.to_increments(velocity), DataType.INTEGER32, f"{self.name}.{name}: 60FFh"
        )
        raw_up, raw_down, ramp = self._ramps(name, acceleration, deceleration)
        inc = abs(units.position.factor)
        known = units.ratio_known
        speed = abs(velocity) * inc if known else None
        return Profile(raw, raw_up, raw_down, speed, ramp * inc if known else None, timeout)

    def _ramps(
        self, name: str, acceleration: float | None, deceleration: float | None
    ) -> tuple[int, int, float]:
        """Return acceleration and deceleration in the drive's increments, and the weaker one in units."""
        defaults, limit = self._parameters.defaults, self._parameters.limits.acceleration
        up = self._positive(name, "acceleration", self._or_default(name, "acceleration", acceleration))
        down = deceleration if deceleration is not None else defaults.deceleration
        down = up if down is None else self._positive(name, "deceleration", down)
        if limit is not None and max(up, down) > limit:
            raise self._beyond(
                name, "acceleration", max(up, down), self.unit + "/s²", "max_acceleration", limit
            )
        scale = self._parameters.units.acceleration
        what = f"{self.name}.{name}"
        return _raw(scale, up, what + ": 6083h"), _raw(scale, down, what + ": 6084h"), min(up, down)

    def _or_default(self, name: str, what: str, value: float | None) -> float:
        if value is not None:
            return value
        default: float | None = getattr(self._parameters.defaults, what)
        if default is None:
            raise self._missing(name, what, f"the default {what}", "defaults")
        return default

    def _homing_speed(self, name: str, key: str, value: float | None, moves: bool) -> int | None:
        if value is None:
            if moves:
                raise self._missing(name, key, "the homing speed in " + self.unit + "/s", "homing")
            return None
        return _raw(self._parameters.units.velocity, value, f"{self.name}.{name}: 6099h")

    def _homing_acceleration(self, value: float | None) -> int | None:
        return (
            None if value is None else _raw(self._parameters.units.acceleration, value, f"{self.name}: 609Ah")
        )

    def _finite(self, name: str, what: str, value: float) -> float:
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ArgumentError(f"{self.name}.{name}: {what} {value!r} is no finite number")
        return value

    def _positive(self, name: str, what: str, value: float) -> float:
        if self._finite(name, what, value) <= 0:
            raise ArgumentError(f"{self.name}.{name}: {what} {value:g} must be above 0")
        return value

    def _missing(self, name: str, key: str, what: str, table: str = "") -> ArgumentError:
        where = f"[axes.{self.name}.{table}]" if table else f"[axes.{self.name}]"
        return ArgumentError(
            f"{self.name}.{name}: {key} is missing",
            observed=f"the call does not give it, and {where} in cell.toml does not either",
            remedy=f"give {key} = ... in the call, or {what} in {where}; it is never guessed",
        )

    def _beyond(self, name: str, what: str, value: float, unit: str, key: str, limit: float) -> LimitError:
        return LimitError(
            f"{self.name}.{name}: {what} {value:g} {unit} is beyond the limit",
            observed=f"{key} is {limit:g} {unit}",
            remedy=f"ask for less, or raise {key} in [axes.{self.name}] of cell.toml",
        )

    @property
    def modes(self) -> frozenset[ModeOfOperation]:
        """The modes of operation that the drive claims (6502h)."""
        return self._parameters.modes


def _raw(scale: Scale, value: float, what: str) -> int:
    """Return a magnitude in increments, at least 1, that fits UNSIGNED32."""
    return check_range(max(1, abs(scale.to_increments(value))), DataType.UNSIGNED32, what)
