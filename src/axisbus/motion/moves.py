"""Moves in the profile modes: to a position (pp), at a velocity (pv), with a torque (tq)."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import MotionTimeout
from axisbus.motion.activity import Activity, ModeSwitch, Transfers, require_position
from axisbus.motion.gate import Gate
from axisbus.motion.image import Image
from axisbus.motion.order import Order
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.profile import Profile, braking_distance, duration
from axisbus.motion.setpoint import Phase, SetPoint

_WINDOW_FLOOR = 20  # increments
_WINDOW_SHARE = 0.02  # of the move's distance
_VELOCITY_FLOOR = 2  # velocity increments
_VELOCITY_SHARE = 0.05  # of the velocity asked for


class Prepare:
    """What comes before a profile move: the mode, the profile objects, and (in a group) waiting for the others."""

    __slots__ = ("_gate", "_mode", "_prepared", "_transfers")

    def __init__(self, mode: ModeSwitch, transfers: Transfers, gate: Gate) -> None:
        self._mode = mode
        self._transfers = transfers
        self._gate = gate
        self._prepared = False

    def step(self, image: Image, order: Order) -> bool:
        """Return True from the cycle on in which the move may begin."""
        if not self._prepared:
            written = self._transfers.step(image, order)
            self._prepared = self._mode.step(image, order) and written
        return self._prepared and self._gate.pass_through(self)

    def cancel(self, order: Order) -> None:
        """Take back queued transfers."""
        self._transfers.cancel(order)


class PositionMove(Activity):
    """A move in profile position mode: prepare, set-point handshake, arrival; holds its deadline and its progress."""

    mode = ModeOfOperation.PROFILE_POSITION

    def __init__(
        self,
        target: int,
        profile: Profile,
        parameters: AxisParameters,
        prepare: Prepare,
        before: SetPoint | None,
    ) -> None:
        """``target`` in unwrapped increments; ``before`` is a handshake that another move has begun."""
        self.set_point = SetPoint(target, parameters.name, parameters.timing.acknowledge)
        self._profile = profile
        self._parameters = parameters
        self._prepare = prepare
        self._before = before
        self._start: int | None = None
        self._window = parameters.position_window
        self._watch = _ArrivalWatch(target, profile, parameters)

    def step(self, image: Image, order: Order) -> bool:
        """Return True when the drive has arrived."""
        if self._before is not None and self._before.begun:
            self._before.step(image, order)
            return False
        if not self._prepare.step(image, order):
            return False
        if self._start is None:
            self._begin(image)
        taken = self.set_point.step(image, order)
        order.halt = order.halt and self._stays_halted(image)
        if not taken:
            return False
        if self._arrived(image):
            return True
        self._watch.check(image)
        return False

    def _stays_halted(self, image: Image) -> bool:
        """A halted axis stays so until its drive has the new target: without the halt it would go on to the old one.

        A drive that takes no set-point under halt is given half of the time without.
        """
        phase = self.set_point.phase
        patience = 0.5 * self._parameters.timing.acknowledge
        return phase is Phase.CLEAR or (phase is Phase.OFFER and image.now < self.set_point.since + patience)

    @property
    def in_flight(self) -> SetPoint | None:
        """The handshake that is under way, for the move that replaces this one."""
        if self._before is not None and self._before.begun:
            return self._before
        return self.set_point if self.set_point.begun else None

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._prepare.cancel(order)

    def _begin(self, image: Image) -> None:
        if self._profile.timeout is None:
            require_position(image, self._parameters.name, "the time that a move may take")
        self._start = image.position if image.position is not None else self.set_point.target
        distance = abs(self.set_point.target - self._start)
        if self._window is None:
            self._window = max(_WINDOW_FLOOR, int(distance * _WINDOW_SHARE))
        self._watch.begin(image, distance)

    def _arrived(self, image: Image) -> bool:
        """Bit 10, and (where 6064h is fresh) within the window: bit 10 may still stand from the move before."""
        if image.statusword is None or not image.statusword & sw.TARGET_REACHED:
            return False
        if image.position is None:
            return True
        assert self._window is not None
        return abs(image.position - self.set_point.target) <= self._window


class _ArrivalWatch:
    """The deadline of a move: from its distance and limits, else from progress, else the caller's."""

    __slots__ = ("_deadline", "_parameters", "_profile", "_progress_at", "_progress_position", "_target")

    def __init__(self, target: int, profile: Profile, parameters: AxisParameters) -> None:
        self._target = target
        self._profile = profile
        self._parameters = parameters
        self._deadline: float | None = None
        self._progress_at = 0.0
        self._progress_position: int | None = None

    def begin(self, image: Image, distance: float) -> None:
        """Start the watch for a move of ``distance`` increments."""
        allowed = self._allowed(distance, self._speed(image))
        self._deadline = None if allowed is None else image.now + allowed
        self._progress_at = image.now

    def _allowed(self, distance: float, speed: float) -> float | None:
        """Twice the time to brake from ``speed`` (perhaps away from the target) and to go all the way, and a margin."""
        profile = self._profile
        if profile.timeout is not None:
            return profile.timeout
        if not profile.speed or not profile.ramp:
            return None
        way = distance + braking_distance(speed, profile.ramp)
        return 2.0 * (speed / profile.ramp + duration(way, profile.speed, profile.ramp)) + 2.0

    def _speed(self, image: Image) -> float:
        """The present speed in position increments per second; 0 where it is not known."""
        units = self._parameters.units
        if image.velocity is None or not units.ratio_known:
            return 0.0
        return abs(units.velocity.to_units(image.velocity) * units.position.factor)

    def check(self, image: Image) -> None:
        """Raise MotionTimeout when the deadline has passed, or (without one) when 6064h no longer changes."""
        if self._deadline is not None:
            if image.now > self._deadline:
                raise self._late(
                    image, "the time that its distance, velocity and acceleration need, doubled, has passed"
                )
            return
        if image.position != self._progress_position:
            self._progress_position = image.position
            self._progress_at = image.now
        elif image.now - self._progress_at > self._parameters.timing.progress:
            raise self._late(image, f"6064h has not changed for {self._parameters.timing.progress:g} s")

    def _late(self, image: Image, why: str) -> MotionTimeout:
        name, position = self._parameters.name, self._parameters.units.position
        shown = None if image.position is None else position.to_units(image.position - image.origin)
        where = "unknown" if shown is None else f"{shown:g} {position.unit}"
        word = 0 if image.statusword is None else image.statusword
        return MotionTimeout(
            f"{name}: has not arrived at {position.to_units(self._target - image.origin):g} {position.unit}",
            axis=name,
            observed=f"position {where}; {why}; target reached (bit 10) is {int(bool(word & sw.TARGET_REACHED))}, "
            f"statusword 0x{word:04X}" + "".join(f"; {hint}" for hint in sw.hints(word)),
            remedy="look whether the axis is blocked, whether the drive limits torque or velocity, and whether its position window "
            "(6067h) can be met; if it only stops a little short, set position_window in [axes." + name + "]",
        )


class VelocityMove(Activity):
    """A move at constant velocity in profile velocity mode; ends well when the velocity is reached, and goes on moving."""

    mode = ModeOfOperation.PROFILE_VELOCITY
    goes_on = True

    def __init__(self, profile: Profile, parameters: AxisParameters, prepare: Prepare) -> None:
        """``profile.velocity`` is signed here: the direction."""
        self.ramp = profile.ramp
        self._profile = profile
        self._parameters = parameters
        self._prepare = prepare
        self._deadline: float | None = None
        self._commanded_at: float | None = None
        self.reached = False

    def step(self, image: Image, order: Order) -> bool:
        """Return True once the velocity is reached; to be stepped on afterwards, to keep it."""
        if not self._prepare.step(image, order):
            return False
        order.target_velocity = self._profile.velocity
        order.halt = False
        if self._commanded_at is None:
            self._commanded_at = image.now
            self._deadline = image.now + self._allowed()
        if not self.reached:
            self.reached = self._in_velocity(image)
            self._watch(image)
        return self.reached

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._prepare.cancel(order)

    def _in_velocity(self, image: Image) -> bool:
        """The measured velocity itself; where it is noisy, or does not travel, the drive's word for it.

        More than half of the velocity must be there in any case: in coarse units (rpm) a standing axis may be two increments off,
        and a drive with a wide window (606Dh) says *reached* of a blocked one.
        """
        target, velocity = self._profile.velocity, image.velocity
        if velocity is None:
            return self._says_reached(image)
        off = abs(velocity - target)
        if not target:
            return off <= _VELOCITY_FLOOR or image.standstill
        close = max(_VELOCITY_FLOOR, abs(target) * _VELOCITY_SHARE)
        return off < abs(target) / 2 and (off <= close or self._says_reached(image))

    def _says_reached(self, image: Image) -> bool:
        """Bit 10, in a word received well after the new target went out."""
        assert self._commanded_at is not None
        if (
            image.statusword is None
            or image.statusword_stamp < self._commanded_at + self._parameters.timing.settle
        ):
            return False
        return bool(image.statusword & sw.TARGET_REACHED)

    def _allowed(self) -> float:
        profile = self._profile
        if profile.timeout is not None:
            return profile.timeout
        if profile.speed and profile.ramp:
            return 4.0 * profile.speed / profile.ramp + 2.0
        return 10.0

    def _watch(self, image: Image) -> None:
        assert self._deadline is not None
        if self.reached or image.now <= self._deadline:
            return
        name, velocity = self._parameters.name, self._parameters.units.velocity
        shown = (
            "unknown" if image.velocity is None else f"{velocity.to_units(image.velocity):g} {velocity.unit}"
        )
        raise MotionTimeout(
            f"{name}: has not reached {velocity.to_units(self._profile.velocity):g} {velocity.unit}",
            axis=name,
            observed=f"velocity {shown}, statusword 0x{image.statusword or 0:04X}",
            remedy="look whether the axis is blocked and whether the drive limits velocity or torque (607Fh, 6080h, 6072h)",
        )


class TorqueMove(Activity):
    """A torque in profile torque mode; ends well when the drive reports it as reached, and keeps it."""

    mode = ModeOfOperation.PROFILE_TORQUE
    goes_on = True

    def __init__(
        self, torque: int, timeout: float | None, parameters: AxisParameters, prepare: Prepare
    ) -> None:
        """``torque`` in 0.1 % of rated torque."""
        self._torque = torque
        self._timeout = timeout
        self._parameters = parameters
        self._prepare = prepare
        self._commanded_at: float | None = None
        self.reached = False

    def step(self, image: Image, order: Order) -> bool:
        """Return True once the torque is reached; to be stepped on afterwards, to keep it."""
        if not self._prepare.step(image, order):
            return False
        order.target_torque = self._torque
        order.halt = False
        if self._commanded_at is None:
            self._commanded_at = image.now
        if not self.reached:
            self.reached = self._in_torque(image)
            self._watch(image)
        return self.reached

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._prepare.cancel(order)

    def _in_torque(self, image: Image) -> bool:
        assert self._commanded_at is not None
        if (
            image.statusword is None
            or image.statusword_stamp < self._commanded_at + self._parameters.timing.settle
        ):
            return False
        if image.torque is not None:
            return abs(image.torque - self._torque) <= max(10, abs(self._torque) * 0.05)
        return bool(image.statusword & sw.TARGET_REACHED)

    def _watch(self, image: Image) -> None:
        assert self._commanded_at is not None
        if self.reached or self._timeout is None or image.now <= self._commanded_at + self._timeout:
            return
        shown = "unknown" if image.torque is None else f"{image.torque / 10:g} % of rated torque"
        raise MotionTimeout(
            f"{self._parameters.name}: has not reached {self._torque / 10:g} % of rated torque",
            axis=self._parameters.name,
            observed=f"torque {shown}, statusword 0x{image.statusword or 0:04X}",
            remedy="look at max torque (6072h) and torque slope (6087h) of the drive",
        )


# A drive without these brakes as it accelerates, and ends every move at rest.
OPTIONAL_PROFILE = frozenset({objects.PROFILE_DECELERATION, objects.END_VELOCITY})


def profile_writes(
    profile: Profile, parameters: AxisParameters, mode: ModeOfOperation
) -> list[tuple[int, int, int | None]]:
    """Return the SDO writes that a profile needs.

    They are made for every move: what another tool may have written meanwhile is not trusted.
    """
    wanted = [
        (objects.PROFILE_ACCELERATION, profile.acceleration),
        (objects.PROFILE_DECELERATION, profile.deceleration),
    ]
    if mode is ModeOfOperation.PROFILE_POSITION:
        wanted.insert(0, (objects.PROFILE_VELOCITY, profile.velocity))
        wanted.append((objects.END_VELOCITY, 0))  # anything else would run past the target
    return [(index, 0, value) for index, value in wanted if parameters.has(index)]
