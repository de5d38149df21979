"""Rules of standstill: a reported standstill is true, a stopped axis stays, and a drive is energised only by a command."""

from __future__ import annotations

from axisbus.cia402.state import PowerState
from axisbus.errors import Interrupted
from axisbus.motion.states import AxisState
from kit.campaign.commands import QUIET, STOPS
from kit.campaign.facts import Facts, GivenCommand
from kit.plant_probe import ENABLED, OFF, STAGE_NAMES

WAY = 1.0  # deg that an axis may be off its reported position; a pull within ``standstill_window`` is no pull
SLOW = 0.5  # deg/s: a motor without power that is slower has all but run down
BLIND = 0.8  # s for which a state may say Standstill while the plant moves
UNCONFIRMED = 6.5  # s for which ErrorStop may leave an axis moving: all steps of its stop sequence, by their usual times
ENABLE_LATE = 1.0  # s: a transition that was running when its enable ended
_STANDS = "is at standstill"  # the text of an error about a stop by a later step
_BY_OTHERS = (
    "other_enables",
    "other_shuts_down",
    "other_sets_point",
    "other_program",
)  # its word is that of an enabled drive
_TAKES_POWER = frozenset(
    {"fault", "drops_power", "other_shuts_down", "other_quick_stops", "heartbeat_lost", "stalls", "reboots"}
    | {"loses_supply"}
    | {"wire_cut", "bus_off", "queue_full"}
)
_AT_REST = ("jam", "resumes")  # these move no axis that was at standstill with nothing to pull it
_JUST = 0.5  # s within which the master may not have reported yet that an axis moves without a command
RESTS = 1.0  # s after which a reported standstill must be true


class Rest:
    """Holds the reported standstills, and since when a state and its plant differ."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._stood: dict[
            str, tuple[float, str]
        ] = {}  # axis: position of the reported standstill, and report
        self._stage = {name: facts.cell.stage(name) for name in facts.names}
        self._differs: dict[tuple[str, str], float] = {}  # (axis, rule): since when
        self._resting: dict[str, float] = {}

    def asked(self, asked: GivenCommand) -> None:
        """A command was given: by some of them nothing moves."""
        for name in asked.names:
            drive = self._facts.drive[name]
            if (
                asked.what not in QUIET
                or (asked.what == "enable" and drive.dials.resumes_on_enable)
                or (asked.what == "coast" and drive.params.load)  # it sinks until its brake has closed
                or self._facts.is_dropped(name)
            ):
                self._forget(name)

    def befell(self, what: str, names: list[str], moves: bool) -> None:
        """Something happens to axes; by some of it a plant moves, and that is no broken promise."""
        for name in names:
            if moves and what not in _AT_REST:
                self._forget(name)

    def ended(self, asked: GivenCommand) -> None:
        """A command has ended; a stop that is done, or says why it was none, has promised something."""
        error = asked.error
        if asked.what == "enable" and error is None:
            for name in asked.names:
                self._is_energised(name, asked)
        if asked.what not in STOPS or isinstance(error, Interrupted):
            return
        self._facts.worst = max(self._facts.worst, self._facts.now - asked.since)
        for name in asked.names:
            if error is None or (_STANDS in error.message and name in error.message):
                self._promised(name, asked)

    def _is_energised(self, name: str, enable: GivenCommand) -> None:
        """An enable that is done has a drive that is energised, unless something has just happened to it.

        The master itself may take an axis to ErrorStop in the cycle in which it finds nothing left to enable.
        """
        facts = self._facts
        if any(True for _ in facts.troubled(name, 1.0)) or facts.power_removed_after(enable, name):
            return
        if facts.core[name].state is AxisState.ERRORSTOP:
            return
        told = f"{enable.handle.name} was done at {facts.now:.2f} s: {facts.cell.told(name)}"
        facts.must(facts.cell.stage(name) == ENABLED, "an enable that is done has power", told)

    def look(self, name: str) -> None:
        self._energised_only_by_command(name)
        self._stays_where_it_was_stopped(name)
        self._states_are_true(name)
        self._reported_standstill_holds(name)

    def _forget(self, name: str) -> None:
        self._stood.pop(name, None)
        self._resting.pop(name, None)

    def _promised(self, name: str, stop: GivenCommand) -> None:
        facts = self._facts
        recent = facts.troubled(name, _JUST)
        moved = any(trouble.kind.moves and trouble.what not in _AT_REST for trouble in recent)
        restless = moved or facts.has_a_will(name) or facts.may_fall(name) or facts.turns_unseen(name)
        restless = restless or facts.is_caught_unseen(name, stop)
        if facts.later(stop, name) or restless:
            return
        said = "done" if stop.error is None else f"ended by {stop.error}"
        told = f"{stop.handle.name} was {said} at {facts.now:.2f} s"
        # A released one moves by the pull, which is judged by its distance.
        stands = self._was_released(name) or not facts.moves(name)
        facts.must(stands, "a stop that is done stands", f"{told}: {facts.cell.told(name)}")
        self._stood.setdefault(name, (facts.cell.where(name), told))

    def _was_released(self, name: str) -> bool:
        """Whether the axis is blocked, or was a moment ago."""
        return any(trouble.what == "jam" for trouble in self._facts.troubled(name, _JUST))

    def _stays_where_it_was_stopped(self, name: str) -> None:
        if name not in self._stood:
            return
        facts = self._facts
        if facts.may_fall(name) and (
            facts.is_pulled(name)
            or any(trouble.what in _TAKES_POWER for trouble in facts.troubled(name, BLIND))
        ):
            self._forget(name)
            return
        if self._was_released(name):  # it jumps by the lag that its drive kept while it was blocked
            self._stood[name] = (facts.where(name), self._stood[name][1])
        place, told = self._stood[name]
        came = abs(facts.where(name) - place)
        facts.must(
            came <= max(WAY, facts.core[name].parameters.pull_window / abs(facts.scale[name])),
            "what was stopped stays",
            lambda: f"{told}; now {facts.cell.told(name)}, {came:g} deg on",
        )

    def _energised_only_by_command(self, name: str) -> None:
        facts = self._facts
        before, self._stage[name] = self._stage[name], facts.stage(name)
        if before not in OFF or self._stage[name] != ENABLED:
            return
        recent = facts.now - ENABLE_LATE
        enables = [asked for asked in facts.asked if asked.what == "enable" and name in asked.names]
        asked_for = any(asked.ended is None or asked.ended > recent for asked in enables)
        # A controlword of ours in transit when another master shut the drive down is no new command.
        by_other = any(trouble.what in _BY_OTHERS for trouble in facts.troubled(name, ENABLE_LATE))
        text = f"{facts.cell.told(name)}, was {STAGE_NAMES[before]}"
        facts.must(asked_for or by_other, "energised only when asked", text)

    def _states_are_true(self, name: str) -> None:
        facts, core = self._facts, self._facts.core[name]
        state, moves = core.state, facts.moves(name)
        energised = facts.stage(name) not in OFF
        seen = not facts.drive[name].dials.encoder_frozen
        facts.tally["rule: Standstill is standing"] += state is AxisState.STANDSTILL
        stands = state is AxisState.STANDSTILL and moves and seen
        speed = abs(facts.drive[name].axis.motor.velocity)
        within = core.parameters.pull_window / speed if speed else 0.0  # the cell file sets this window
        self._not_long("Standstill is standing", name, BLIND + within, stands)
        held = state is AxisState.STOPPING and self._rests(name) and seen
        self._not_long("what is held in Stopping stands", name, BLIND, held and moves)
        known = core.image.state is not PowerState.UNKNOWN
        off = state is AxisState.DISABLED and energised and core.touched and known
        self._not_long("Disabled is off", name, BLIND, off and self._rests(name))
        untold = state is AxisState.ERRORSTOP and moves and energised and seen
        untold = untold and not facts.cell.device(name).dials.dead and not facts.is_reported_as_moving(name)
        self._not_long(
            "ErrorStop stops or says that it moves", name, max(UNCONFIRMED, facts.stops_in(name)), untold
        )

    def _reported_standstill_holds(self, name: str) -> None:
        """An axis in Standstill or ErrorStop that is not reported as moving is reported as at standstill."""
        facts = self._facts
        state = facts.core[name].state
        rests = state in (AxisState.STANDSTILL, AxisState.ERRORSTOP) and self._rests(name)
        restless = facts.has_a_will(name) or facts.may_fall(name) or facts.is_held_unseen(name)
        if not rests or facts.is_reported_as_moving(name) or restless:
            self._resting.pop(name, None)
            return
        since = self._resting.setdefault(name, facts.now)
        slow = abs(facts.drive[name].axis.motor.velocity / facts.scale[name]) < SLOW
        if name not in self._stood and facts.now - since > RESTS and slow:
            self._stood[name] = facts.where(name), f"it rested in {state.value} at {facts.now:.2f} s"

    def _rests(self, name: str) -> bool:
        core = self._facts.core[name]
        return core.stop_sequence is None and core.activity is None

    def _not_long(self, rule: str, name: str, limit: float, wrong: bool) -> None:
        facts, core = self._facts, self._facts.core[name]
        if not wrong:
            self._differs.pop((name, rule), None)
            return
        long = facts.now - self._differs.setdefault((name, rule), facts.now)
        facts.must(
            long <= limit,
            rule,
            lambda: (
                f"{long:.2f} s: {facts.cell.told(name)}, the master says {core.state.value}, error {core.error}"
            ),
        )
