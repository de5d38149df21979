"""Rules of motion: a move that is done is at its target, no command exceeds a limit, and nothing jolts."""

from __future__ import annotations

import math
from itertools import pairwise

from axisbus.errors import AxisbusError
from axisbus.motion.states import AxisState
from axisbus.sim.power import Effort
from kit.campaign.commands import OVERRIDES, PATHS
from kit.campaign.facts import TORQUE_MODES, Facts, GivenCommand, Trouble
from kit.plant_probe import ENABLED, OFF, PlantSample

_LATE = frozenset(
    {"frames_late", "late_feedback", "inputs_lost", "outputs_lost", "stutters", "demand_stuck"}
    | {"wire_loses", "wire_jitters", "wire_delays", "wire_slows"}
)
# Another master controls the axis: its motion continues for as long as that may take.
_FOREIGN = frozenset({"other_sets_point", "other_takes_velocity"})
# It stops the axis: the motor brakes as hard as it can, and swings.
STOPPED_BY_OTHERS = frozenset({"other_shuts_down", "other_quick_stops"})
# It changes the state of the drive, which forgets its set-point.
TAKES_SET_POINT = STOPPED_BY_OTHERS | {"other_enables", "other_program"}
_AT_REST = 4.0  # increments: the window of a measured position
_WINDOW = 20.0  # increments within which a place is reached
_OVERSPEED = 1.1  # the ratio that the master takes for noise
_CYCLES = 5.0  # scan periods in which a guard can do nothing: the feedback, its look, the SYNC after it, the drive's own step
_ON_SLOW_RAMP = (1, 5)  # 605Ah: a quick stop on the slow-down ramp
_ROUNDING = 0.5  # deg: windows, and the rounding of a drive's own profile
_CALM = 2.0  # s after a trouble for which nothing is judged by its smoothness, or by where it went
_SWINGS = 0.5  # s within which an axis that swings is fast again
_SEIZED = 0.1  # s for which the demand shows how a motor was pushed
_SPACING = 0.0039  # s between two positions for a speed
_QUANTUM = 2.0  # increments by which the difference of two positions may be off by rounding


class Travel:
    """Holds the last speeds of each demand."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._spacing = _SPACING
        self._seen = {name: facts.cell.moment(name) for name in facts.names}
        self._outside: dict[str, bool] = {}
        self._origin: dict[str, float] = {}
        self._astray: dict[
            str, float
        ] = {}  # the allowed speed of a drive that moved without our command, or swings; and when it was last too fast
        self._foreign: set[str] = set()  # on the way to where another master has sent it
        # When the motor was last not at the demand: in a torque mode, or moved away by a drive that creeps.
        self._pushed = dict.fromkeys(facts.names, facts.now)
        self._crept = dict.fromkeys(
            facts.names, -math.inf
        )  # when a drive last held its motor beside its demand
        self._mode: dict[str, tuple[int, float]] = {}  # the displayed mode of the drive, and since when
        # When the master last did not know yet that the drive is enabled: its target is the read position, with its noise.
        self._unseen = dict.fromkeys(facts.names, -math.inf)

    def ended(self, asked: GivenCommand) -> None:
        """A move that is done is at its target, and at standstill."""
        if asked.error is not None:
            return
        facts = self._facts
        for name, goal in asked.goals.items():
            if facts.later(asked, name) or any(t.kind.moves for t in facts.troubled(name, _CALM)):
                continue
            scale = facts.cell.scale_of(name)
            off = abs(facts.place(name) - goal) / scale
            there = max(facts.scene.there, facts.drive[name].settings.position_window / scale)  # 6067h
            told = f"{asked.handle.name}: {facts.cell.told(name)}, {off:g} deg off"
            facts.must(off <= there, "done means there", told)
            settles = off * abs(scale) <= _WINDOW  # a move as small may be over before it is seen
            facts.must(settles or not facts.moves(name), "done means standing", told)

    def look(self, name: str) -> None:
        drive = self._facts.drive[name]
        if drive.axis.drift or drive.mode_display in TORQUE_MODES or drive.mode in TORQUE_MODES:
            self._pushed[name] = self._facts.now
        if drive.axis.drift:
            self._crept[name] = self._facts.now
        if self._facts.core[name].state is AxisState.DISABLED:
            self._unseen[name] = self._facts.now
        if self._mode.get(name, (None,))[0] != drive.mode_display:
            self._mode[name] = drive.mode_display, self._facts.now
        samples = self._facts.cell.record(name).since(self._seen[name])
        exact = self._facts.scene.exact
        calm = exact and not any(True for _ in self._facts.troubled(name, _CALM))
        if exact and not self._is_moved_by_others(name):
            self._inside_limits(name)
            self._not_too_fast(name)
        else:
            self._lost_sight(name)
            self._astray[name] = self._facts.now
        if len(samples) < 4:
            return
        self._seen[name] = samples[-3].time
        if calm:
            self._smooth(name, samples)

    def _lost_sight(self, name: str) -> None:
        """Note that no promise holds for the position of the axis now."""
        self._outside.pop(name, None)

    def asked(self, asked: GivenCommand) -> None:
        """A command was given."""

    def refused(self, asked: GivenCommand, error: AxisbusError) -> None:
        """A command was refused at the call."""

    def _is_moved_by_others(self, name: str) -> bool:
        troubles = list(self._facts.troubled(name, _CALM))
        if any(trouble.what in _FOREIGN for trouble in troubles):
            self._foreign.add(name)
        elif not self._facts.moves(name):
            self._foreign.discard(name)
        return name in self._foreign or any(map(self._may_move_it, troubles))

    def _may_move_it(self, trouble: Trouble) -> bool:
        return trouble.kind.moves or trouble.kind.deaf or trouble.what in _LATE | STOPPED_BY_OTHERS

    # -- limits ----------------------------------------------------------------------------------------------------------

    def _inside_limits(self, name: str) -> None:
        """A command alone takes no axis farther beyond a limit than it moves before a stop can act (``reaction``)."""
        facts = self._facts
        core = facts.core[name]
        limits = core.parameters.limits.position
        homes = core.state is AxisState.HOMING  # the drive restarts its count before its master knows
        if limits is None or not core.bounded or homes or facts.stage(name) in OFF:
            self._outside.pop(name, None)
            return
        if self._origin.get(name) != facts.origin(name):  # a new origin is no motion
            self._origin[name] = facts.origin(name)
            self._outside.pop(name, None)
        units = core.parameters.units.position
        place = units.to_units(facts.place(name) - facts.origin(name))
        beyond = max(limits[0] - place, place - limits[1])
        if self._outside.setdefault(
            name, beyond > 0.0
        ):  # it was there when it was enabled, or got there by a trouble
            self._outside[name] = beyond > 0.0
            return
        if beyond > 0.0:
            text = f"{facts.cell.told(name)}, {beyond:g} deg beyond {limits}"
            facts.must(beyond <= self.reaction(name), "never beyond a limit", text)

    def _not_too_fast(self, name: str) -> None:
        """Nor is it faster than max_velocity by more than the addition of a torque before it is seen (see ``reaction``).

        A drive that has crept away from its demand takes that back as fast as it can.
        """
        facts = self._facts
        limit = self._top_speed(name)
        if limit is None or facts.stage(name) in OFF:
            return
        speed = abs(facts.drive[name].axis.motor.velocity / facts.scale[name])
        allowed = _OVERSPEED * limit + self._blind_speed(name)
        if facts.now - self._crept[name] < _SEIZED:
            self._astray[name] = facts.now
        if name in self._astray:
            if speed > limit:
                self._astray[name] = facts.now
            elif facts.now - self._astray[name] > _SWINGS:
                del self._astray[name]
            return
        text = f"{speed:g} deg/s where {limit:g} is max_velocity"
        facts.must(speed <= allowed, "never faster than max_velocity", text)

    def _top_speed(self, name: str) -> float | None:
        return self._facts.core[name].parameters.limits.velocity

    def _blind_speed(self, name: str) -> float:
        """The addition of an unknown torque to the speed, in deg/s, before a stop acts; a drive may change its torque gradually."""
        drive, facts = self._facts.drive[name], self._facts
        if drive.mode_display not in TORQUE_MODES and drive.mode not in TORQUE_MODES:
            return 0.0
        torque = max(0.0, max(abs(drive.target_torque), abs(drive.axis.motor.torque)) - drive.params.friction)
        per_second = torque / 1000.0 * drive.params.rated_acceleration / abs(facts.scale[name])
        return per_second * _CYCLES * facts.scene.period

    def reaction(self, name: str) -> float:
        """Degrees that an axis may be beyond a limit by a command.

        Derivation. In each cycle the guard stops an axis that would not stop before the limit with the deceleration of its
        stop. It cannot know the motion during the ``T`` = 5 scan periods between the sampling of a position and the reaction of
        the drive. The speed and acceleration of a motion streamed by the master are known in advance: only rounding remains,
        and the lag of the motor behind a demand that stops before the limit. Under torque the acceleration is unknown until it
        is measured: from standstill, ``a T²/2`` until the stop acts, at the speed ``a T``, which takes ``(a T)² / 2 d`` to
        brake with the deceleration ``d`` of the quick stop. ``a`` is the commanded torque, less friction, times the
        acceleration per torque. A quick stop on the slow-down ramp (605Ah) has the deceleration 6084h, any other 6085h.
        """
        speed, time = self._blind_speed(name), _CYCLES * self._facts.scene.period
        return _ROUNDING + speed * time / 2 + speed * speed / (2 * self._braking(name))

    def farther_by_torque(self, name: str) -> float:
        """Degrees, besides ``reaction``, that a torque takes an axis which stood beyond a limit farther out.

        Derivation. An axis counts as at rest within the window ``w`` of a measured position (docs/stopping.md), so the guard sees
        it only at the speed ``sqrt(2 a w)``, which adds to that of ``reaction`` and is braked like it.
        """
        speed, time = self._blind_speed(name), _CYCLES * self._facts.scene.period
        more = math.sqrt(2 * speed / time * _AT_REST / abs(self._facts.scale[name]))
        return more * time + ((speed + more) ** 2 - speed * speed) / (2 * self._braking(name))

    def _braking(self, name: str) -> float:
        """The deceleration of its quick stop, in deg/s²."""
        drive, scale = self._facts.drive[name], abs(self._facts.scale[name])
        if drive.settings.quick_stop_option in _ON_SLOW_RAMP:
            return max(drive.axis.braking(Effort.SLOW) / scale, 1.0)
        return max(drive.settings.quick_stop_deceleration / (drive.params.acceleration_unit * scale), 1.0)

    # -- jolts -----------------------------------------------------------------------------------------------------------

    def _smooth(self, name: str, samples: list[PlantSample]) -> None:
        """The demand of an enabled drive changes its speed by no more than the hardest commanded ramp.

        In another mode the drive sets its demand to the motor, which may have differed: then the motor is judged. A drive
        that moved its motor away without a command, and was seen at standstill, takes that back as hard as it can.
        """
        drive = self._facts.cell.drive(name)
        if self._facts.now - self._pushed[name] < _SEIZED:
            return
        if any(sample.stage != ENABLED for sample in samples) or self._by_path(name):
            return
        self._facts.tally["rule: no jolt"] += 1
        allowed = self._allowed(name)
        kept = _spaced(samples, self._spacing)
        jolts = self._jolts(name, kept, "demand", allowed)
        if jolts and self._facts.now - self._mode[name][1] < _SEIZED:
            jolts = self._jolts(name, kept, "position", allowed)
        if jolts:
            text = f"{jolts[0]:g} deg/s² where {allowed:g} are allowed: {self._facts.cell.told(name)}, mode {drive.mode_display}"
            self._facts.must(False, "no jolt", text)

    def _jolts(self, name: str, samples: list[PlantSample], of: str, allowed: float) -> list[float]:
        """The accelerations beyond the allowed ones, in deg/s²."""
        found, grain = [], _QUANTUM
        if self._facts.now - self._unseen[name] < _SEIZED:
            grain += 2.0 * self._facts.drive[name].params.noise
        for before, after in pairwise(_speeds(samples, of)):
            change = abs(after[0] - before[0]) / min(before[1], after[1])
            noise = grain / abs(self._facts.cell.scale_of(name)) / min(before[1], after[1]) ** 2
            if change > 1.1 * allowed + 2.0 * noise:
                found.append(change)
        return found

    def _by_path(self, name: str) -> bool:
        """Whether the path of the motion is the caller's."""
        moving = (
            asked
            for asked in reversed(self._facts.asked)
            if name in asked.names and asked.what not in OVERRIDES
        )
        last = next(moving, None)
        return last is not None and last.what in PATHS and last.ended is None

    def _allowed(self, name: str) -> float:
        facts, drive = self._facts, self._facts.cell.drive(name)
        scale = abs(facts.cell.scale_of(name)) * drive.params.acceleration_unit
        limit = facts.cell.core(name).parameters.limits.acceleration or 0.0
        return max(limit, drive.settings.quick_stop_deceleration / scale)


def _spaced(samples: list[PlantSample], spacing: float) -> list[PlantSample]:
    kept = samples[:1]
    for sample in samples[1:]:
        if sample.time - kept[-1].time > spacing:
            kept.append(sample)
    return kept


def _speeds(samples: list[PlantSample], of: str) -> list[tuple[float, float]]:
    """Speeds between samples, of their demand or position, with the time that each is of."""
    return [
        ((getattr(after, of) - getattr(before, of)) / (after.time - before.time), after.time - before.time)
        for before, after in pairwise(samples)
    ]
