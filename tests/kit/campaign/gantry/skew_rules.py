"""The promises of a pair: neither side moves alone, and a beam that is bent, or loses a side, is stopped.

Theory of operation
-------------------

The oracle is the motors. The bend of the beam is the deviation of their difference from ``square``. ``square`` is that
difference when the cell was opened, when the switches were found, or when the user defined it. If a drive restarts its count
and the position has not been confirmed since, the bend is unknown and is not judged. Wrong feedback, missing frames and drives
that receive nothing excuse the rules that need them. The effect of a fault of one side on the other side is no excuse.
"""

from __future__ import annotations

from axisbus.errors import SkewError
from axisbus.motion.states import MOVING, AxisState
from kit.campaign.commands import OVERRIDES, STOPS
from kit.campaign.facts import Facts, GivenCommand
from kit.campaign.gantry.scene import AXES, SQUARE_AT_SWITCHES, PairCell
from kit.gantry.pair import MAX_SKEW
from kit.plant_probe import ENABLED, OFF

_ALLOWED_ALONE = STOPS | OVERRIDES | {"coast", "release", "reset", "probe", "axis_override"}  # of one side
# Faults that hide a side from the master, or show it elsewhere.
_UNSEEN = frozenset(
    {
        "encoder_frozen",
        "encoder_jumps",
        "late_feedback",
        "frames_late",
        "inputs_lost",
        "sync_lost",
        "dead",
        "stalls",
    }
    | {"pre_operational", "other_stops_node", "reboots", "loses_supply", "stutters", "demand_stuck"}
    | {
        "wire_loses",
        "wire_jitters",
        "wire_delays",
        "wire_slows",
        "wire_cut",
        "bus_off",
        "queue_full",
        "second_device",
    }
)
# By these the place of a side is unknown for a while, or another one.
_FORGETS = frozenset(
    {"dead", "pre_operational", "other_stops_node", "reboots", "sync_lost", "encoder_jumps", "stalls"}
    | {"wire_loses", "wire_slows", "wire_cut", "bus_off", "second_device", "loses_supply"}
)
_RESTARTS = frozenset({"reboots", "loses_supply"})
_ELSEWHERE = frozenset(
    {"encoder_jumps", "encoder_frozen"}
)  # with these a drive reports a position other than its motor's
# With these a side moves without our command, or does not move.
_STRAYS = frozenset({"slips_to_pp", "slips_to_pv", "slips_to_csp", "resumes", "creeps", "ignores_halt"})
_SEEN_LATE = 6  # cycles from a bend to the stop commands to both
_BRAKES_LATE = 6  # cycles from a bend, or a failure, to the first deceleration of the plant
_BRAKED = 950.0  # deg/s²: max_acceleration and each drive's own ramp are 1000
_STOPPED_STATES = (AxisState.ERRORSTOP, AxisState.DISABLED)
_AT_REST = (AxisState.DISABLED, AxisState.STANDSTILL)
_TOGETHER = 0.03  # s within which both are energised
_ROUNDING = 0.3  # deg
_CALM = 2.0  # s after a fault
_STOPPED = 1.5  # s in which one side stops when the other has failed


class Beam:
    """Holds the square difference, the begin of a bend, and the allowed difference of both set-points."""

    def __init__(self, facts: Facts) -> None:
        cell = facts.cell
        assert isinstance(cell, PairCell)
        self._facts, self._cell = facts, cell
        config = cell.machine.cell.gantries[cell.gantry.name]
        self._offset = config.offset
        self._absolute = not cell.core("x").parameters.homing.required
        self.square: float | None = config.offset if self._absolute else self._apart
        self._bent_since: float | None = None
        # deg/s: how fast the beam was when it was bent, and deg: beyond which it counted as bent
        self._fastest = 0.0
        self._bound, self._inside_at = MAX_SKEW, 0.0
        self._off: list[GivenCommand] = []  # one side was disabled
        self._alone_since: dict[str, float] = {}
        self._failed_since: dict[str, float] = {}
        self._stage = {name: facts.stage(name) for name in AXES}
        self._may_differ = MAX_SKEW
        self._homed = self._squares = False

    @property
    def _apart(self) -> float:
        """How much farther the motor of y is than that of x."""
        return self._facts.where("y") - self._facts.where("x")

    @property
    def skew(self) -> float | None:
        """How far the beam is out of square, by the motors."""
        return None if self.square is None else self._apart - self.square

    def ended(self, asked: GivenCommand) -> None:
        """A command has ended."""
        self._refused_alone(asked)
        if asked.what == "disable" and asked.names in tuple(AXES) and asked.error is None:
            self._off.append(asked)
        if asked.error is not None or not set(AXES) <= set(asked.names):
            return
        if asked.what == "home":
            self._is_homed(asked)
        elif asked.what == "set_square":
            # While a drive reports a position other than its motor's, the square difference is unknown when it ends.
            self.square = None if self._troubled_by(_ELSEWHERE, 0.5) else self._apart
        elif asked.what.startswith("move_") and asked.what != "move_velocity" and not self._troubled(_CALM):
            self._is_square(asked)

    def look(self) -> None:
        """Look at this cycle."""
        forgets = _RESTARTS if self._confirmed() else _FORGETS
        if self._troubled_by(forgets, 0.5):
            self.square = None
        self._look_for_switches()
        self._bent_is_stopped()
        self._is_not_bent_more()
        self._one_fails_both_stop()
        self._energised_together()
        self._disabled_together()
        self._commanded_as_one()

    def _look_for_switches(self) -> None:
        """A homing has counted from both switches, whatever becomes of it afterwards."""
        homes = any(asked.what == "home" and asked.ended is None for asked in self._facts.asked)
        before, self._homed = self._homed, all(self._facts.core[name].homed for name in AXES)
        if homes and self._homed and not before:
            self.square = self._offset + SQUARE_AT_SWITCHES

    # -- neither alone ---------------------------------------------------------------------------------------------------

    def _refused_alone(self, asked: GivenCommand) -> None:
        """A command that would move, or energise, one side is refused."""
        if asked.names not in tuple(AXES) or asked.what in _ALLOWED_ALONE:
            return
        told = f"{asked.handle.name} ended well"
        self._facts.must(asked.error is not None, "one side is not moved alone", told)

    def _energised_together(self) -> None:
        """One that gets power gets it with the other, unless something is the matter with it."""
        facts = self._facts
        for name, other in (AXES, AXES[::-1]):
            before, self._stage[name] = self._stage[name], facts.stage(name)
            if before in OFF and self._stage[name] == ENABLED and facts.stage(other) != ENABLED:
                self._alone_since[name] = facts.now
            if self._stage[name] != ENABLED or facts.stage(other) == ENABLED:
                self._alone_since.pop(name, None)
            alone = facts.now - self._alone_since.get(name, facts.now)
            if alone > _TOGETHER and not self._troubled(_CALM):
                facts.must(
                    False, "both get power together", f"{name} has had it for {alone:.2f} s, {other} not"
                )

    def _disabled_together(self) -> None:
        """A command that disables one side disables the other."""
        facts = self._facts
        for asked in [each for each in self._off if facts.now - (each.ended or 0.0) > _STOPPED]:
            self._off.remove(asked)
            later = facts.asked[facts.asked.index(asked) + 1 :]
            if not self._troubled(_CALM + _STOPPED) and not any(each.what == "enable" for each in later):
                on = [name for name in AXES if facts.stage(name) not in OFF]
                facts.must(
                    not on, "what disables one disables both", f"{asked.handle.name} was done: {on} has power"
                )

    def _commanded_as_one(self) -> None:
        """The set-points of both differ by no more than they did at standstill, unless the beam is being made square."""
        cell = self._cell
        samples = [cell.record(name).sample for name in AXES]
        led = all(sample.stage == ENABLED for sample in samples) and all(
            cell.drive(name).mode_display == 8 for name in AXES
        )
        rests = all(cell.core(name).state in _AT_REST and not self._facts.moves(name) for name in AXES)
        squares = any(asked.what in ("square", "home") and asked.ended is None for asked in self._facts.asked)
        self._squares = squares or (self._squares and not rests)  # also while it brakes
        if self.square is None or not led or self._squares or rests or self._troubled(_CALM):
            self._may_differ = max(MAX_SKEW, abs(self.skew or 0.0)) if not led else self._differ(samples)
            return
        differ = self._differ(samples)
        told = f"{differ:g} deg, {self._may_differ:g} before it moved: {cell.told('x')}; {cell.told('y')}"
        self._facts.must(differ <= self._may_differ + _ROUNDING, "both are led as one", told)

    def _differ(self, samples: list) -> float:
        return abs(samples[1].demand - samples[0].demand - (self.square or 0.0))

    # -- bent ------------------------------------------------------------------------------------------------------------

    def _bent_is_stopped(self) -> None:
        """A beam that is driven and bent beyond its bound is found out, and both go to ErrorStop."""
        skew, cell, facts = self.skew, self._cell, self._facts
        bound = cell.machine._core.scan.groups[cell.gantry.name].monitor.bound + _ROUNDING
        driven = any(facts.stage(name) not in OFF and cell.core(name).touched for name in AXES)
        excused = self._troubled_by(_UNSEEN, _CALM)
        cores = [cell.core(name) for name in AXES]
        # One that is being stopped because the other has failed is left to that.
        stopped = all(core.state in _STOPPED_STATES or core.stop_sequence is not None for core in cores)
        if skew is None or abs(skew) <= bound or not driven or excused or stopped:
            self._bent_since = None
            return
        self._bent_since = facts.now if self._bent_since is None else self._bent_since
        late = facts.now - self._bent_since > _SEEN_LATE * facts.scene.period
        states = [core.state for core in cores]
        told = f"{skew:g} deg where {bound:g} are allowed, {states}: {cell.told('x')}; {cell.told('y')}"
        facts.must(not late, "a bent beam is stopped", told)

    def _is_not_bent_more(self) -> None:
        """It is bent no farther than the bound, the distance until it is seen, and the braking distance."""
        facts, skew = self._facts, self.skew
        hindered = self._troubled_by(_UNSEEN | _STRAYS | {"pushed", "sticks"}, _CALM) or self._deaf()
        powered = all(facts.stage(name) == ENABLED for name in AXES)
        if skew is None or hindered or not powered:
            self._fastest = 0.0
            return
        bound = self._cell.machine._core.scan.groups[self._cell.gantry.name].monitor.bound
        speed = max(abs(self._cell.record(name).sample.velocity) for name in AXES)
        if abs(skew) <= bound:
            self._fastest, self._bound, self._inside_at = speed, bound, facts.now
            return
        if self._fastest and facts.now - self._inside_at <= _BRAKES_LATE * facts.scene.period:
            self._fastest = max(self._fastest, speed)  # until it is braked it may get faster
        if not self._fastest:
            return  # it was so when this began to count
        allowed = self._bound + _ROUNDING + self._stopping_distance(self._fastest)
        told = f"{skew:g} deg where {allowed:g} are allowed after {self._fastest:g} deg/s"
        facts.must(abs(skew) <= allowed, "bent no farther than stopping takes", told)

    def _stopping_distance(self, speed: float) -> float:
        return speed * (_BRAKES_LATE * self._facts.scene.period + self._lag()) + speed * speed / (2 * _BRAKED)

    def _lag(self) -> float:
        return self._cell.drive("x").params.lag

    # -- when one fails --------------------------------------------------------------------------------------------------

    def _one_fails_both_stop(self) -> None:
        facts = self._facts
        for name, other in (AXES, AXES[::-1]):
            if facts.core[name].state is not AxisState.ERRORSTOP:
                self._failed_since.pop(name, None)
                continue
            since = self._failed_since.setdefault(name, facts.now)
            if facts.now - since <= _STOPPED or self._strays(other):
                continue
            told = f"{name} has been in ErrorStop for {facts.now - since:.2f} s: {facts.cell.told(other)}"
            still = facts.stage(other) in OFF or not facts.moves(other)
            facts.must(still, "one that fails stops the other", told)
            rests = facts.core[other].state not in MOVING
            facts.must(rests, "one that fails stops the other", f"{told}, {facts.core[other].state}")

    def _strays(self, name: str) -> bool:
        """Whether the axis cannot be stopped in time, or moves without a command: that is judged by its own rules."""
        troubles = self._facts.troubled(name, _CALM + _STOPPED)
        own = [trouble for trouble in troubles if trouble.kind.shared or trouble.axis == name]
        return any(t.kind.deaf or t.kind.moves or t.what in _UNSEEN | {"outputs_lost"} for t in own)

    # -- reports ---------------------------------------------------------------------------------------------------------

    def _is_homed(self, asked: GivenCommand) -> None:
        """Each place is that which its switch has; nothing else may have moved the count."""
        if self._troubled(_CALM):
            return
        for name, of_switch, place in (("x", -40.0, 5.0), ("y", -37.0, 7.0)):
            core = self._facts.core[name]
            units = core.parameters.units.position
            shown = units.to_units(self._facts.place(name) - self._facts.origin(name))
            true = self._facts.where(name) - of_switch + place
            told = f"{asked.handle.name}: {name} is at {true:g}, and counts {shown:g}"
            self._facts.must(abs(shown - true) <= _ROUNDING, "homed counts from the switch", told)
        self._is_square(asked)

    def _is_square(self, asked: GivenCommand) -> None:
        if self._facts.later(asked, "x") or self.skew is None:
            return
        told = f"{asked.handle.name} is done, and the beam is {self.skew:g} deg out of square"
        self._facts.must(abs(self.skew) <= 1.0, "done means square", told)

    # -- causes ----------------------------------------------------------------------------------------------------------

    def _confirmed(self) -> bool:
        return self._absolute or all(self._facts.core[name].homed for name in AXES)

    def _troubled(self, within: float) -> bool:
        return any(True for name in AXES for _ in self._facts.troubled(name, within))

    def _troubled_by(self, kinds: frozenset[str], within: float) -> bool:
        return any(t.what in kinds for name in AXES for t in self._facts.troubled(name, within))

    def _deaf(self) -> bool:
        return any(t.kind.deaf for name in AXES for t in self._facts.troubled(name, _CALM))


def has_bent(facts: Facts, error: Exception, names: str) -> bool:
    """Whether one of the pair's sides has had something by which a beam may be bent, or seem so."""
    if not isinstance(error, SkewError):
        return False
    recent = [trouble for name in names for trouble in facts.troubled(name, 10.0)]
    return any(t.kind.moves or t.kind.deaf or t.what in _UNSEEN for t in recent)
