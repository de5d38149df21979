"""The motions of a module over Modbus: its own trapezoid to a position, a velocity or torque on a ramp, and monitoring."""

from __future__ import annotations

from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.motion.course import (
    ModbusCommand,
    ModbusControlMode,
    ModbusMotionStatus,
    MoveWatch,
    TurnWatch,
    require_finite,
    require_positive,
    require_torque,
    wrong,
)
from axisbus.drives.gim6010.modbus.motion.ladder import LONGEST_STEP, ramped, trapezoid_time
from axisbus.drives.gim6010.modbus.motion.power import PLACE, PoweredModule
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.errors import ArgumentError, LimitError

_SPARE = 2.0  # s that a move may take, in addition to
_TIMES = 1.5  # times the duration of its trapezoid


class ModbusAxis(PoweredModule):
    """Moves one module. If a motion deviates from its command, an error is raised, and the end of the block stops the module."""

    def move(
        self,
        target: float,
        *,
        velocity: float,
        acceleration: float,
        deceleration: float,
        relative: bool = False,
        window: float = 0.02,
    ) -> float:
        """Move by the module's trapezoid to ``target`` turns, or by ``target`` turns (``relative``); return the final position.

        ``velocity`` in turns/s, ramps in turns/s²; it has arrived when it is at standstill within ``window`` turns.

        Raises:
            ArgumentError, LimitError: an invalid value. StateError: not enabled for positions. NodeError: no answer.
            DriveFault, UncommandedMotion, MotionTimeout, StaleError: the motion deviates from its command.
        """
        course = self._enabled(ModbusControlMode.POSITION)
        require_positive(
            velocity=velocity, acceleration=acceleration, deceleration=deceleration, window=window
        )
        require_finite(target=target)
        self._require_slow(velocity)
        with self._signals.sheltered():
            start = self._place()
            target = start + target if relative else target
            request = requests.write(
                named("position_setpoint"), target
            )  # an invalid value raises before anything is sent
            self.module.write("trajectory_velocity", velocity)
            self.module.write("trajectory_acceleration", acceleration)
            self.module.write("trajectory_deceleration", deceleration)
            self._signals.check()
            course.ramp, course.fastest, course.target = deceleration, velocity, target
            self.module.put(request)
            longest = _SPARE + _TIMES * trapezoid_time(target - start, velocity, acceleration, deceleration)
            return self._follow(
                MoveWatch(start, target, velocity, window, self.module.wire.now() + longest), course
            )

    def turn(self, velocity: float, *, acceleration: float) -> None:
        """Ramp to ``velocity`` turns/s with at most ``acceleration`` turns/s²; return when that velocity is reached.

        The ramp is made here, in steps; the module's own ``vel_ramp_rate``, which no register holds, may make it slower.

        Raises:
            As ``move``; StateError: not enabled for velocities.
        """
        course = self._enabled(ModbusControlMode.VELOCITY)
        require_positive(acceleration=acceleration)
        require_finite(velocity=velocity)
        self._require_slow(velocity)
        with self._signals.sheltered():
            course.ramp = acceleration
            course.fastest = max(abs(velocity), abs(course.commanded))
            self._lead("velocity_setpoint", velocity, acceleration, course)
            self._follow(TurnWatch(velocity, course.fastest), course)
            course.fastest = abs(velocity)

    def push(self, torque: float, *, slope: float, most: float, max_velocity: float) -> None:
        """Ramp to ``torque`` N·m (rotor) with at most ``slope`` N·m/s; the highest allowed speed is ``max_velocity`` turns/s.

        ``most`` is the highest torque that the caller allows. The actual torque depends on the module's torque constant, and
        ``torque_ramp_rate``, which no register holds, may make it slower. Only this program monitors the velocity.

        Raises:
            As ``move``; LimitError: more than ``most``. StateError: not enabled for torques.
        """
        course = self._enabled(ModbusControlMode.TORQUE)
        require_positive(slope=slope, most=most, max_velocity=max_velocity)
        require_finite(torque=torque)
        require_torque(torque, most)
        with self._signals.sheltered():
            course.fastest = max_velocity
            self._lead("torque_setpoint", torque, slope, course)

    def watch(self, seconds: float) -> None:
        """Monitor the present motion for ``seconds``.

        Raises:
            As ``move``: the motion deviates from its command.
        """
        course = self._enabled()
        if not seconds > 0.0:
            raise ArgumentError(f"seconds = {seconds!r} is not above 0", remedy="give seconds above 0")
        with self._signals.sheltered():
            end = self.module.wire.now() + seconds
            while self.module.wire.now() < end:
                seen = self._round()
                if (
                    course.target is not None
                    and seen.position is not None
                    and abs(seen.position - course.target) > PLACE
                ):
                    raise wrong(self.module, ModbusMotionStatus.AWAY, seen, course)

    def _follow(self, watch: MoveWatch | TurnWatch, course: ModbusCommand) -> float:
        """Read the module until the motion has reached its command; return the position."""
        while True:
            seen = self._round()
            verdict = watch.judge(seen)
            if verdict is ModbusMotionStatus.DONE and seen.position is not None:
                return seen.position
            if verdict is not ModbusMotionStatus.UNDER_WAY:
                raise wrong(self.module, verdict, seen, course)

    def _lead(self, register: str, wanted: float, rate: float, course: ModbusCommand) -> None:
        """Write a ramp of set-points, step by step."""
        before = self.module.wire.now()
        while course.commanded != wanted:
            self._round()
            now = self.module.wire.now()
            course.commanded = ramped(course.commanded, wanted, rate, min(now - before, LONGEST_STEP))
            before = now
            self.module.put(requests.write(named(register), course.commanded))

    def _require_slow(self, velocity: float) -> None:
        if abs(velocity) > self._velocity_limit:
            raise LimitError(
                f"{velocity:g} turns/s is beyond the module's velocity_limit of {self._velocity_limit:g} turns/s",
                remedy="command less, or write another limit while it is in idle",
            )
