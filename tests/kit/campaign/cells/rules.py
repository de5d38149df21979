"""Rules of drawn cells: the motor keeps the promises for its axis, and legal commands on healthy axes end well."""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia402.modes import ModeOfOperation
from axisbus.eds.model import Number
from axisbus.errors import (
    AxisbusError,
    CommandError,
    DriveError,
    FollowingError,
    Interrupted,
    LimitError,
    ModeError,
    MotionTimeout,
    StaleError,
    StateError,
)
from axisbus.motion.states import AxisState
from kit.campaign.cells import promises
from kit.campaign.cells.cell_setup import DrawnCell, is_slow, velocity_unit
from kit.campaign.cells.files import BUILTIN, model_of
from kit.campaign.cells.recipe import NORM
from kit.campaign.commands import OVERRIDES
from kit.campaign.facts import MOVES, TORQUE_MODES, Facts, GivenCommand
from kit.campaign.motion_rules import TAKES_SET_POINT, Travel
from kit.plant_probe import ENABLED, OFF, QUICK_STOP, REACTION

_BEYOND = 0.5  # norm degrees beyond a limit: the sum of roundings and windows
_WINDOW = 25.0  # increments, the same
_NEAR = 0.02  # of the span: a limit has been approached
_BACK = 2.0  # norm degrees that a motor may move in the wrong direction at first
_STILL = 0.3  # s in which a refused command must have moved nothing
_SHARED = 1.0  # s, beside the braking time, after which all axes that share a fault are at standstill
_BLIND_FOR = 0.5  # s for which a torque that is gone may still be seen in the speed
_PP = 1
_CSP = 8
_BY_VELOCITY = (3, 9)  # pv, csv
_SHORT_LAG = 0.02  # s
_SAMPLES = 6  # of a value that are enough to judge it
_SELDOM = 1.0  # s between two samples of a value without a maximum age
_SLOPE = 1.01  # of max_acceleration
_ROUNDING = 3.0  # increments that the second difference of positions may be off
_COUNTED = 10.0  # s for which an axis may turn on before it comes to the end of its count
_ACTS = 6.0  # periods until a stop acts, from when the master has to think of it
_LAG_UNKNOWN = 0.02  # s, which the master reckons with where it does not know the lag
_END = 11  # increments from the end of a count, to which the master moves no axis
_BRAKED = 0.3  # of its speed, which a drive that is stopped must have lost by then
_CREEPS = 0.005  # of max_velocity: a motion that has just begun when another mode is taken
_SETTLED = 4  # cycles in csp before its targets are looked at
_TURNED = 0.5  # s from when a motor has turned round until a stop right after that has ended
_REFUSED = (CommandError, StateError)
_TOO_HIGH = "0x06090031"  # the abort code of a value that is too high
_BLOCKED = "was blocked during a move"
_HARDER = "stopped only by a harder stop"
# Errors that a healthy axis gets only by a mistake of the master.
_FALSE = (
    "FollowingError",
    "UncommandedMotion",
    "TransitionError",
    "SetPointError",
    "ModeError",
    "StaleError",
    "DriveFault",
    "DriveError",
    "SkewError",
)
# Rules that each have to be exercised in a campaign.
RULES = (
    "never beyond a limit",
    "never faster than max_velocity",
    "set-points keep max_acceleration",
    "no jolt",
    "never the wrong way",
    "done means there",
    "done means standing",
    "a healthy command ends well",
    "no false error",
    "nothing is energised after a stop",
    "a refused command moves nothing",
    "a time-out ends in a halt",
    "back from beyond a limit",
    "usable after a reset",
    "every boot-up ends",
    "who shares a fault stops",
    "a drive that hears is stopped",
    "a stop that is done stands",
    "what was stopped stays",
    "Standstill is standing",
    "nothing stale is shown",
    "an error has a cause",
    "every possible promise is made",
    "closed means standing",
    "closed means off",
    "closed stays so",
)


class Physics(Travel):
    """Holds, per axis, its promises, how far it was beyond a limit, and its last set-points."""

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        cell = facts.cell
        assert isinstance(cell, DrawnCell)
        self._cell = cell
        self._period = cell.recipe.period / 1000.0
        self._spacing = max(0.0039, 0.99 * self._period)
        self._promised = {name: promises.promise_of(cell, name) for name in facts.names}
        self._allowed_beyond: dict[str, float | None] = dict.fromkeys(facts.names)
        self._origins: dict[str, float] = {}
        self._turned_to: dict[str, tuple[int, bool]] = {}  # the drive's mode, and whether it came in motion
        self._enabled_speed: dict[str, float] = {}  # in csp, in norm degrees per s, when it was last enabled
        self._rolled: dict[str, float] = {}  # when the motor moved last, by the time of the cycle
        self._led: dict[tuple[str, int], float] = {}  # seconds of a valid demand of the axis, by its mode
        self._targets: dict[str, deque[tuple[float, int]]] = {
            name: deque(maxlen=_SETTLED) for name in facts.names
        }
        self._off: dict[
            str, tuple[float, GivenCommand]
        ] = {}  # since when (by the plant's clock) a stop has kept it without power
        self._refusals: list[tuple[float, str, float, str]] = []
        self._failed: dict[
            str, tuple[float, float]
        ] = {}  # since when it has been in ErrorStop, and how fast it was
        self._faults: list[tuple[float, str, str]] = []  # time, failed axis, axis of the same group
        self._errors: dict[str, int] = {}
        self._blind: dict[str, tuple[float, float]] = {}  # the speed that a torque adds, and since when
        self._was_reset: dict[str, float] = {}
        self._watched: list[GivenCommand] = []
        for name in facts.names:
            facts.tally["axes"] += 1
            for text in self._promised[name].printed:
                facts.tally[f"promise: {text}"] += 1
            lacks = promises.missing(cell, name, cell.recipe.axis(name))
            facts.must(not lacks, "every possible promise is made", f"{name}: {'; '.join(lacks)}")

    # -- events ----------------------------------------------------------------------------------------------------------

    def asked(self, asked: GivenCommand) -> None:
        """A command was given."""
        if asked.what == "enable":
            for name in asked.names:
                self._off.pop(name, None)
        if asked.direction and asked.legal:
            self._watched.append(asked)
        for name in asked.names:
            if asked.what == "reset":
                self._was_reset[name] = self._facts.now

    def refused(self, asked: GivenCommand, error: AxisbusError) -> None:
        """Note that a command was rejected at the call."""
        if not asked.legal or asked.kind == "extreme":
            return
        facts = self._facts
        text = f"{asked.what}: {error.message}"
        self._refusals += [(facts.now, name, facts.where(name), text) for name in asked.names]
        facts.tally[f"legal, refused: {asked.what}: {type(error).__name__}"] += 1

    def _others_must_stop(self, name: str) -> None:
        """An axis has failed."""
        recipe = self._cell.recipe
        group = recipe.names[: recipe.group]
        self._faults.append((self._facts.now, name, group if name in group else recipe.names))

    def ended(self, asked: GivenCommand) -> None:
        """A command has ended."""
        super().ended(asked)
        error, facts = asked.error, self._facts
        if isinstance(error, _REFUSED):
            facts.tally["commands refused later"] += asked.kind != "extreme"
        if error is None or isinstance(error, Interrupted):
            facts.tally[f"{'done' if error is None else 'interrupted'}: {asked.kind}"] += 1
        if error is None and asked.kind == "move":
            facts.tally[f"done: move, mode {self._mode_of(asked)}"] += 1
        if error is None and asked.what in ("quick_stop", "disable", "coast"):
            for name in asked.names:
                if facts.stage(name) in OFF and not self._enabled_since(asked, name):
                    self._off[name] = facts.cell.moment(name), asked
        self._ends_well(asked, error)
        self._time_out_halts(asked, error)

    def _mode_of(self, asked: GivenCommand) -> str:
        mode = self._facts.drive[asked.names[0]].mode_display
        return ModeOfOperation(mode).name.lower() if mode in ModeOfOperation._value2member_map_ else str(mode)

    def _enabled_since(self, asked: GivenCommand, name: str) -> bool:
        later = self._facts.asked[self._facts.asked.index(asked) + 1 :]
        return any(other.what == "enable" and name in other.names for other in later)

    # -- ends ------------------------------------------------------------------------------------------------------------

    def _ends_well(self, asked: GivenCommand, error: AxisbusError | None) -> None:
        """Check that a legal command ends without an error on healthy axes that got no other command."""
        facts = self._facts
        if not asked.legal or asked.kind in (
            "torque",
            "couple",
            "timed",
            "extreme",
            "set",
            "override",
            "probe",
        ):
            return
        if asked.kind == "turn" and any(self._cell.recipe.axis(name).limits for name in asked.names):
            self._turns_back(asked, error)
            return  # it goes to the limit, and that is an error
        if isinstance(error, (*_REFUSED, Interrupted)) or self._disturbed(asked):
            if isinstance(error, _REFUSED) and not self._disturbed(asked):
                facts.tally[f"legal, refused: {asked.what}: {type(error).__name__}"] += 1
            return
        if isinstance(error, LimitError) and any(self._leaves_count(asked, name) for name in asked.names):
            return
        if isinstance(error, DriveError) and any(self._is_too_much(name, error) for name in asked.names):
            return
        if isinstance(error, DriveError) and any(self._brakes_for_long(name, error) for name in asked.names):
            facts.tally["halts for which a read-only 6084h is too small"] += 1
            return
        if isinstance(error, DriveError) and any(self._has_crept(name) for name in asked.names):
            return
        if isinstance(error, DriveError) and any(self._crawls(name, error) for name in asked.names):
            facts.tally["halts of moves too slow to be told from a blocked axis"] += 1
            return
        if isinstance(error, DriveError) and any(
            self._has_lost_move(name, asked, error) for name in asked.names
        ):
            facts.tally["halts of moves that another master had ended, which looks like a blocked axis"] += 1
            return
        if isinstance(error, MotionTimeout) and any(map(self._is_limited_by_drive, asked.names)):
            facts.tally["velocities without a known unit that the drive does not reach"] += 1
            return
        if isinstance(error, FollowingError) and not all(
            is_slow(self._cell.recipe.axis(name)) for name in asked.names
        ):
            return
        text = f"{asked.handle.name} ended by {type(error).__name__}: {error}"
        if isinstance(error, ModeError) and not all(map(self._has_all_modes, asked.names)):
            facts.tally["modes of a maker's file that its simulated drive has not"] += 1
            return
        facts.must(error is None, "a healthy command ends well", text, error)
        for name in asked.names if asked.kind == "move" else "":
            if self._was_beyond(asked, name):
                facts.must(error is None, "back from beyond a limit", text, error)
            if name in self._was_reset and asked.since - self._was_reset[name] < 5.0:
                facts.must(error is None, "usable after a reset", text, error)

    def _turns_back(self, asked: GivenCommand, error: AxisbusError | None) -> None:
        """Check that a velocity command from beyond a limit, or from near it, back into the limits is not ended by that limit."""
        name, facts = asked.names[0], self._facts
        axis = self._cell.recipe.axis(name)
        if axis.edges is None or not asked.direction or len(asked.names) > 1 or self._disturbed(asked):
            return
        if axis.file not in BUILTIN:  # its ramps may be the maker's, and too weak for these limits
            return
        low, high = (asked.direction * edge for edge in axis.edges[:: 1 if asked.direction > 0.0 else -1])
        place = asked.direction * self._units(name)
        start = place - asked.direction * (facts.where(name) - asked.starts[name]) * self._unit(name)
        near = _WINDOW / axis.scale
        ramp, acts = axis.acceleration / axis.scale, _ACTS * self._period + axis.lag + _LAG_UNKNOWN
        speed = min(axis.velocity, math.sqrt(2.0 * ramp * max(0.0, place - start)) + ramp * acts)
        weakest = min(0.2, axis.ease[1]) * ramp / _slowness(axis.fixed)
        brakes = speed * acts + 0.5 * speed * speed / weakest
        if low - near <= start <= low + near and place < high - brakes:
            stopped = isinstance(error, LimitError)
            text = f"{asked.handle.name} ended by {error}"
            facts.must(not stopped, "back from beyond a limit", text, error if stopped else None)

    def _leaves_count(self, asked: GivenCommand, name: str) -> bool:
        """Whether the goal is beyond the range of 607Ah, of an axis without a modulo; or it turns on near that end of its count.

        An axis that has turned on past the end of its count has another one, in which its earlier positions do not exist.
        """
        goal, axis = asked.goals.get(name), self._cell.recipe.axis(name)
        if axis.endless:
            return False
        if goal is None:
            room = 2**31 - abs(self._facts.place(name))
            return asked.kind == "turn" and room < _COUNTED * axis.speed
        if 2**31 - abs((goal + 2**31) % 2**32 - 2**31) <= _END:
            return True
        place = self._facts.place(name)  # the encoder may be noisy at the end of its count
        return any((goal + 2**31) // 2**32 != (place + off + 2**31) // 2**32 for off in (-_WINDOW, _WINDOW))

    def _is_too_much(self, name: str, error: DriveError) -> bool:
        """Whether the drive refuses a velocity or ramp beyond the limits of a maker's file for its object."""
        axis = self._cell.recipe.axis(name)
        if axis.file in BUILTIN or _TOO_HIGH not in str(error):
            return False
        model = model_of(axis.file)
        for index, most in ((0x6081, axis.speed), (0x6083, axis.acceleration), (0x6084, axis.acceleration)):
            entry = model.get(index, 0)
            if entry is not None and isinstance(entry.high, Number) and entry.high.value < most:
                return True
        return False

    def _brakes_for_long(self, name: str, error: DriveError) -> bool:
        """Whether the drive has read-only decelerations, with which a halt takes longer than the time it has."""
        axis = self._cell.recipe.axis(name)
        if _HARDER not in error.message:
            return False
        if axis.file in BUILTIN:
            return any(index in (0x6084, 0x6085) and share > 1 for index, share in axis.fixed)
        own = model_of(axis.file).get(0x6084, 0)
        if own is None or own.writable or not isinstance(own.default, Number):
            return False
        needs = axis.speed * velocity_unit(axis) / max(own.default.value, 1)
        return needs > self._facts.core[name].parameters.stop_times.halt

    def _crawls(self, name: str, error: DriveError) -> bool:
        """Whether a move was so slow that the master cannot know that nothing holds it: by an extreme override, or where it turned.

        Without a demand that was seen to be valid, it then removes the power as a precaution.
        """
        drive, image = self._facts.drive[name], self._facts.core[name].image
        if _BLOCKED not in error.message or image.demand is not None or drive.mode_display != _PP:
            return False
        cell = self._facts.cell
        velocities = [sample.velocity for sample in cell.record(name).since(cell.moment(name) - _TURNED)]
        turned = min(velocities) < 0.0 < max(velocities)
        return turned or drive.axis.speed(drive.settings.profile_velocity) < self._facts.unseen_speed(name)

    def _has_lost_move(self, name: str, halt: GivenCommand, error: DriveError) -> bool:
        """Whether another master shut the drive down during the move that ``halt`` ended, and the next word enabled it at once.

        A drive forgets its set-point by this. If no statusword shows it, the axis stands in the middle of a move as if blocked.
        """
        if _BLOCKED not in error.message or self._facts.core[name].image.demand is not None:
            return False
        begun = [
            other.since
            for other in self._facts.asked
            if name in other.names and other.kind == "move" and other.ended and other.ended >= halt.since
        ]
        span = self._facts.now - min(begun, default=halt.since)
        return any(trouble.what in TAKES_SET_POINT for trouble in self._facts.troubled(name, span))

    def _is_limited_by_drive(self, name: str) -> bool:
        """Whether the drive limits the axis by 6080h to less than max_velocity, which is unknown to the master.

        Without a scale max_velocity is a number in the drive's own unit, here revolutions per minute: it may be more than the
        drive has. The master then reports that the velocity was not reached. With a scale the recipe's max_velocity is below 6080h.
        """
        axis = self._cell.recipe.axis(name)
        if axis.counted:
            return False
        return self._facts.drive[name].axis.speed_limit < axis.speed / velocity_unit(axis)

    def _has_crept(self, name: str) -> bool:
        """Whether the motor has left the demand (6062h) that its drive continues in csv: the distance of creeping stays."""
        return any(trouble.what == "creeps" for trouble in self._facts.troubled(name, math.inf))

    def _has_all_modes(self, name: str) -> bool:
        """Whether the drive of an axis has each mode whose objects it has, so that no command is to end for want of one."""
        axis = self._cell.recipe.axis(name)
        return axis.file in BUILTIN and not axis.modes and not axis.written

    def _disturbed(self, asked: GivenCommand) -> bool:
        """Whether something went wrong meanwhile, or another command was given to one of its axes."""
        facts = self._facts
        later = facts.asked[facts.asked.index(asked) + 1 :]
        if any(set(other.names) & set(asked.names) and other.what not in ("probe",) for other in later):
            return True
        before = any(
            other.ended is None or other.ended > asked.since
            for other in facts.asked[: facts.asked.index(asked)]
            if set(other.names) & set(asked.names)
            and other.kind not in ("override", "probe")
            and asked.kind != "stop"
        )
        span = facts.now - asked.since + 0.1
        return before or any(True for name in facts.names for _ in facts.troubled(name, span))

    def _was_beyond(self, asked: GivenCommand, name: str) -> bool:
        axis = self._cell.recipe.axis(name)
        if axis.edges is None or name not in asked.goals:
            return False
        start = asked.starts[name] - self._facts.where(name)
        units = self._units(name) + start * self._unit(name)
        return not axis.edges[0] <= units <= axis.edges[1]

    def _units(self, name: str) -> float:
        """Where the motor is, in units of the axis."""
        return (self._facts.place(name) - self._facts.origin(name)) / self._cell.factor(name)

    def _unit(self, name: str) -> float:
        """Units per norm degree of the motor, with the sign of its direction."""
        axis = self._cell.recipe.axis(name)
        turned = -1.0 if self._facts.drive[name].settings.polarity & 0x80 else 1.0
        return turned * axis.increments / self._cell.factor(name)

    def _time_out_halts(self, asked: GivenCommand, error: AxisbusError | None) -> None:
        if not isinstance(error, MotionTimeout) or self._disturbed(asked):
            return
        facts = self._facts
        for name in asked.names:
            stages = {
                sample.stage
                for sample in facts.cell.record(name).samples[-round((facts.now - asked.since) / 0.01) - 2 :]
            }
            text = f"{asked.handle.name} ended by {type(error).__name__}: stages {sorted(stages)}, {facts.cell.told(name)}"
            facts.must(stages == {ENABLED}, "a time-out ends in a halt", text)

    # -- each cycle ------------------------------------------------------------------------------------------------------

    def look(self, name: str) -> None:
        self._see_motion(name)
        super().look(name)
        self._keeps_acceleration(name)
        self._stays_off(name)
        self._no_false_error(name)
        self._is_stopped(name)
        if self._watched:
            self._right_direction(name)
        if self._refusals:
            self._moved_nothing()
        if self._faults:
            self._others_stop()

    def _inside_limits(self, name: str) -> None:
        """By a command alone no motor gets farther beyond a limit than it was when the limit began to hold."""
        facts, core = self._facts, self._facts.core[name]
        edges = self._cell.recipe.axis(name).edges
        origin = facts.origin(name)
        free = edges is None or not core.bounded or core.state is AxisState.HOMING or facts.stage(name) in OFF
        free = free or self._by_its_own_ramp(name)
        promised = facts.drive[name].mode_display in self._promised[name].limits
        if free or not promised or self._origins.get(name, origin) != origin:
            self._allowed_beyond[name] = None
            self._origins[name] = origin
            return
        assert edges is not None
        self._origins[name] = origin
        place = (facts.place(name) - origin) / self._cell.factor(name)
        unseen = self._unseen_lag(name)
        beyond = max(edges[0] - place, place - edges[1]) / abs(self._unit(name))  # norm degrees
        allowed = self._allowed_beyond[name]
        if allowed is None:
            if facts.moves(name):
                return  # an axis in motion when the limit begins to hold may stop anywhere
            allowed = max(0.0, beyond)
        self._allowed_beyond[name] = min(allowed, max(0.0, beyond))
        span = (edges[1] - edges[0]) / abs(self._unit(name))
        if beyond < -_NEAR * span or not facts.moves(name):
            return
        tolerance = (
            max(_BEYOND, _WINDOW / self._cell.recipe.axis(name).increments)
            + self.reaction(name)
            - 0.5
            + unseen
            + self._step_of_set_points(name)
            + (self.farther_by_torque(name) if allowed > 0.0 else 0.0)
        )
        text = f"{facts.cell.told(name)}, {beyond:g} norm deg beyond {edges}, {allowed:g} before"
        facts.must(beyond <= allowed + tolerance, "never beyond a limit", text)
        if unseen:  # from a position reached like this, it may return
            self._allowed_beyond[name] = max(allowed, beyond)

    def _by_its_own_ramp(self, name: str) -> bool:
        """Whether a quick stop that a command or ``on_fault`` requests, or a fault reaction, brakes less than the axis may.

        No limit is promised for that.
        """
        facts, drive = self._facts, self._facts.drive[name]
        asked = any(
            one.what.endswith("quick_stop")
            and name in one.names
            and facts.now - one.since < facts.stops_in(name)
            for one in facts.asked
        )
        # A drive whose node counts as lost cannot be braked in another manner.
        lost = any(t.what == "second_device" for t in facts.troubled(name, facts.stops_in(name)))
        weak = drive.axis.braking(drive.power.effort) < self._cell.recipe.axis(name).acceleration
        reacts = facts.stage(name) == REACTION and drive.mode_display != _CSP
        return weak and (
            reacts
            or (facts.stage(name) == QUICK_STOP and (asked or lost or self._stops_with_its_group(name)))
        )

    def _stops_with_its_group(self, name: str) -> bool:
        """Whether an axis is quick-stopped by ``on_fault`` because another axis of its group has failed."""
        recipe, core = self._cell.recipe, self._facts.core
        group = recipe.names[: recipe.group] if recipe.on_fault == "quick" else ()
        return name in group and any(
            core[mate].state is AxisState.ERRORSTOP for mate in group if mate != name
        )

    def _step_of_set_points(self, name: str) -> float:
        """Return by how many norm degrees a fault reaction may go beyond the end of a path that brakes as hard as it does.

        Derivation. Between two set-points the drive moves at a constant velocity, which falls in steps. A path that brakes evenly
        with ``d`` has ``v²/2d`` left at a set-point, where ``v`` is its own velocity. The drive has the mean velocity of the period
        ``T`` before that, which is ``v + dT/2``. The drive's own reaction begins with it, and needs ``vT/2 + dT²/8`` more: less
        than half of that velocity times ``T``. No command of the master can change this.
        """
        reacts = self._facts.stage(name) == REACTION
        return 0.5 * self._enabled_speed.get(name, 0.0) * self._period if reacts else 0.0

    def _unseen_lag(self, name: str) -> float:
        """Return by how many norm degrees an invisible demand may be ahead: the lag of the motor at max_velocity.

        Derivation. Without a 6062h that shows the demand, the lag is known by a ramp from standstill. In a velocity mode that
        begins in motion the demand's velocity at that moment is unknown, so that a lag and an earlier beginning look alike. A 6062h
        that was only seen at standstill proves nothing either. Under torque nothing shows a lag; a short one is
        assumed.
        """
        axis, mode = self._cell.recipe.axis(name), int(self._facts.drive[name].mode_display)
        if self._turned_to.get(name, (None, False))[0] != mode:
            creeps = abs(self._facts.drive[name].axis.motor.velocity) > _CREEPS * axis.speed
            self._turned_to[name] = mode, creeps or not self._has_been_at_standstill(name)
        if mode in TORQUE_MODES:
            return NORM * max(0.0, axis.lag - _SHORT_LAG)
        in_motion = mode in _BY_VELOCITY and self._turned_to[name][1]
        return NORM * axis.lag if in_motion and not self._is_led(name, mode) else 0.0

    def _see_motion(self, name: str) -> None:
        """Note how fast it was while it was enabled, when the motor moved, and for how long a valid demand has controlled it."""
        facts, drive = self._facts, self._facts.drive[name]
        if facts.stage(name) == ENABLED:
            speed = abs(drive.axis.motor.velocity / facts.scale[name])
            self._enabled_speed[name] = speed if drive.mode_display == _CSP else 0.0
        if not facts.moves(name):
            return
        self._rolled[name] = facts.now
        follows = facts.stage(name) == ENABLED and drive.mode == drive.mode_display
        has_demand = facts.core[name].parameters.has(0x6062)
        shows = has_demand and self._cell.recipe.axis(name).demand == "real" and not drive.dials.demand_frozen
        if follows and shows:
            key = name, int(drive.mode_display)
            self._led[key] = self._led.get(key, 0.0) + self._period

    def _has_been_at_standstill(self, name: str) -> bool:
        """Whether the motor was at standstill for so long that received positions can have shown it."""
        core = self._facts.core[name]
        shows = core.parameters.timing.standstill_time + core.capabilities.max_age.get("position", 0.1)
        return self._facts.now - self._rolled.get(name, -math.inf) > shows + _SAMPLES * self._period

    def _is_led(self, name: str, mode: int) -> bool:
        """Whether its demand has controlled it for so long, in pp or in this mode, that some samples of it must have shown that."""
        apart = min(_SELDOM, self._facts.core[name].capabilities.max_age.get("demand", 0.1))
        longest = max(self._led.get((name, each), 0.0) for each in (_PP, mode))
        return longest > _SAMPLES * (apart + self._period)

    def _lost_sight(self, name: str) -> None:
        self._allowed_beyond[name] = None

    def _blind_speed(self, name: str) -> float:
        """As in ``PathSpeed``; the speed added by a torque counts until the motor has braked, even without the torque."""
        speed, since = self._blind.get(name, (0.0, 0.0))
        found = super()._blind_speed(name)
        if found >= speed or self._facts.now - since > _BLIND_FOR:
            self._blind[name] = found, self._facts.now
            return found
        return speed

    def _top_speed(self, name: str) -> float | None:
        promised = self._facts.drive[name].mode_display in self._promised[name].velocity
        return NORM if promised else None

    def _allowed(self, name: str) -> float:
        axis, drive = self._cell.recipe.axis(name), self._facts.drive[name]
        if not axis.counted:
            return math.inf  # the numbers of its ramps may be anything
        quick = drive.settings.quick_stop_deceleration / drive.params.acceleration_unit
        return max(axis.acceleration, quick) / axis.increments

    def _keeps_acceleration(self, name: str) -> None:
        """Set-points of the master change their velocity by no more than max_acceleration from cycle to cycle."""
        facts, drive = self._facts, self._facts.drive[name]
        targets = self._targets[name]
        coupled = facts.core[name].state is AxisState.SYNCHRONIZED_MOTION
        if drive.mode_display != _CSP or drive.mode != _CSP or facts.stage(name) != ENABLED or coupled:
            targets.clear()
            return
        if not facts.moves(name) or any(True for _ in facts.troubled(name, 2.0)):
            targets.clear()
            return
        targets.append((facts.now, drive.target_position))
        if len(targets) < _SETTLED or targets[-1][0] - targets[0][0] > (_SETTLED - 0.5) * self._period:
            return
        (_, before), (_, here), (_, after) = list(targets)[-3:]
        change = abs(after - 2 * here + before)
        axis = self._cell.recipe.axis(name)
        allowed = _SLOPE * axis.acceleration * self._period**2 + _ROUNDING
        if change > 2**31:
            return
        per = axis.acceleration * self._period**2
        share = (change - _ROUNDING) / per
        text = f"{change} increments where {allowed:.1f} are allowed, {share:.3f} of max_acceleration: {facts.cell.told(name)}"
        facts.must(change <= allowed, "set-points keep max_acceleration", text)

    def _stays_off(self, name: str) -> None:
        """After a stop that takes the power is done, no step of the plant has any, until that is asked for again."""
        if name not in self._off:
            return
        facts = self._facts
        since, asked = self._off[name]
        if any(t.what.startswith("other_") for t in facts.troubled(name, 1.0)):
            del self._off[name]
            return
        samples = facts.cell.record(name).since(since)
        if samples:
            self._off[name] = samples[-1].time, asked
        on = [sample for sample in samples if sample.stage == ENABLED]
        facts.must(
            not on,
            "nothing is energised after a stop",
            f"{asked.handle.name} was done at {asked.ended:.3f} s: {len(on)} steps with power",
        )

    def _no_false_error(self, name: str) -> None:
        """Check that a healthy axis gets no error without a cause."""
        facts = self._facts
        error = facts.core[name].error
        if error is None:
            self._errors.pop(name, None)
            return
        if self._errors.get(name) == id(error):
            return
        if (
            name not in self._errors
        ):  # another error of an axis in ErrorStop is no new failure: a refused boot-up of its node
            self._others_must_stop(name)
        self._errors[name] = id(error)
        caused = any(
            True for other in facts.names for _ in facts.troubled(other, facts.remembers(name))
        ) or self._pushed_of_late(name)
        facts.tally[f"cause: {type(error).__name__}"] += 1
        facts.tally["rule: an error has a cause"] += 1
        if not caused:
            false = type(error).__name__ in _FALSE and not self._may_be_so(name, error)
            false = false and not (isinstance(error, DriveError) and self._brakes_for_long(name, error))
            facts.must(not false, "no false error", f"{type(error).__name__}: {error}", error)

    def _is_stopped(self, name: str) -> None:
        """Check that an axis in ErrorStop stops if its drive receives frames, whatever the master knows about its node."""
        facts = self._facts
        if facts.core[name].state is not AxisState.ERRORSTOP or not facts.moves(name):
            stopped = self._failed.pop(name, None) is not None
            facts.tally["rule: a drive that hears is stopped"] += stopped
            return
        speed = abs(facts.drive[name].axis.motor.velocity)
        since, first = self._failed.setdefault(name, (facts.now, speed))
        for_long = facts.now - since
        hindered = any(t.kind.deaf or t.kind.moves for t in facts.troubled(name, for_long + _SHARED))
        if hindered or facts.is_pulled(name):
            return
        # Half of what its weakest ramp brakes meanwhile: this shows long before the times of its stop have passed.
        axis = self._cell.recipe.axis(name)
        braked = 0.5 * self._weakest_braking(name) / _slowness(axis.fixed) * (for_long - _SHARED)
        brakes = braked < _BRAKED * first or speed < first - min(braked, 0.5 * first)
        if (brakes or axis.file not in BUILTIN) and for_long < facts.stops_in(name) + _SHARED:
            return
        powered = facts.stage(name) == ENABLED
        text = f"in ErrorStop for {for_long:.1f} s, and {facts.cell.told(name)}"
        facts.must(not powered, "a drive that hears is stopped", text, facts.core[name].error)

    def _may_be_so(self, name: str, error: AxisbusError) -> bool:
        """Whether an error of a healthy axis is justified by missing information of its drive, or its cell file."""
        if isinstance(error, ModeError):
            return not self._has_all_modes(name)
        if isinstance(error, StaleError):
            return "never received" in str(error)  # a maker's file whose 6064h cannot be mapped
        # The acceleration exceeds the limit in the maker's file, and the drive has reported it; or it may be blocked.
        if isinstance(error, DriveError) and (self._is_too_much(name, error) or self._crawls(name, error)):
            return True
        # How it brakes is not known, so that a quick stop past its last target may be a pull.
        if isinstance(error, DriveError) and not self._cell.recipe.axis(name).counted:
            return True
        return "passed: halt_time" in str(error) and self._brakes_slowly(name)

    def _brakes_slowly(self, name: str) -> bool:
        """Whether the drive has a deceleration of its own by which a halt from max_velocity takes longer than halt_time."""
        drive, axis = self._facts.drive[name], self._cell.recipe.axis(name)
        return drive.axis.deceleration * self._facts.core[name].parameters.stop_times.halt < axis.speed

    def _pushed_of_late(self, name: str) -> bool:
        """Whether a torque command or a torque mode may move it."""
        drive = self._facts.drive[name]
        own = [asked for asked in self._facts.asked if name in asked.names and asked.kind == "torque"]
        return drive.mode_display in TORQUE_MODES or any(
            asked.ended is None or asked.ended > self._facts.now - 2.0 for asked in own
        )

    def _right_direction(self, name: str) -> None:
        """Check that a motor starts from standstill in the direction of its command."""
        for asked in list(self._watched):
            if (
                asked.ended is not None
                or self._facts.later(asked, name)
                or any(True for _ in self._facts.troubled(name, 2.0))
            ):
                self._watched.remove(asked)
                continue
            if name not in asked.names:
                continue
            came = (self._facts.where(name) - asked.starts[name]) * asked.direction * self._sense(name)
            lag = _BACK + _WINDOW / self._cell.recipe.axis(name).increments
            text = f"{asked.handle.name}: {-came:g} norm deg in the wrong direction, {self._facts.cell.told(name)}"
            self._facts.must(came >= -lag, "never the wrong way", text)

    def _sense(self, name: str) -> float:
        return 1.0 if self._unit(name) > 0.0 else -1.0

    def _moved_nothing(self) -> None:
        """A command that was refused at the call, on an axis at standstill, moves nothing."""
        facts = self._facts
        for refusal in list(self._refusals):
            at, name, place, text = refusal
            other = any(
                asked.since >= at and name in asked.names and asked.what not in OVERRIDES
                for asked in facts.asked
            )
            if other or any(True for _ in facts.troubled(name, facts.now - at + 0.1)):
                self._refusals.remove(refusal)
            elif facts.now - at > _STILL:
                self._refusals.remove(refusal)
                came = abs(facts.where(name) - place)
                facts.must(came <= _BACK, "a refused command moves nothing", f"{text}: {came:g} norm deg")

    def _has_moved(self, name: str, since: float) -> bool:
        """Whether there was something to stop when another axis failed."""
        cell = self._cell
        moment = cell.moment(name) - (self._facts.now - since)
        return max(cell.speeds(name, moment)[:25], default=0.0) > MOVES

    def _weakest_braking(self, name: str) -> float:
        """Return the lowest deceleration of a halt (increments per s²): default, quick stop, or that of the last command."""
        axis = self._cell.recipe.axis(name)
        last = self._facts.drive[name].axis.deceleration or math.inf
        return min(min(axis.ease[1], axis.stop) * axis.acceleration, last)

    def _others_stop(self) -> None:
        """Axes of the same group (or, without one, cell) as a drive in fault stop."""
        facts = self._facts
        for fault in list(self._faults):
            at, failed, mates = fault
            slowest = max(
                axis.speed / min(self._weakest_braking(name), axis.acceleration) * _slowness(axis.fixed)
                for name, axis in zip(facts.names, self._cell.recipe.axes, strict=True)
            )
            if facts.now - at < _SHARED + 1.2 * slowest:
                continue
            self._faults.remove(fault)
            if any(trouble.what != "fault" for name in facts.names for trouble in facts.troubled(name, 8.0)):
                continue
            for name in mates:
                asked = any(other.since >= at - self._period and name in other.names for other in facts.asked)
                if name != failed and not asked and self._has_moved(name, at):
                    text = f"{failed} failed {facts.now - at:.1f} s ago, and {facts.cell.told(name)}"
                    facts.must(not facts.moves(name), "who shares a fault stops", text)


def _slowness(fixed: tuple[tuple[int, int], ...]) -> float:
    """Return the factor by which read-only ramps are slower."""
    return float(max((share for _, share in fixed), default=1))
