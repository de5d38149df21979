"""What must hold of the plants in a random campaign, whatever is asked and whatever goes wrong; looked at in every cycle."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.errors import AxisbusError
from axisbus.motion.handle import Handle
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.probe import ENABLED, OFF, STAGE_NAMES

STEP = 0.01  # s: one cycle
STANDS = 5.0  # deg/s: faster is moving (an axis that rings, or the last of a lag, is slower)
WAY = 1.0  # deg that an axis may come from where it was said to stand
BLIND = 0.8  # s for which a state may say Standstill while the plant moves
UNCONFIRMED = 4.0  # s for which ErrorStop may leave an axis moving: all rungs of its ladder
ENABLE_LATE = 1.0  # s: a transition that was under way when its enable ended
RESTS = 1.0  # s after which an axis at rest is taken at its word
CLOSED = 2.0  # s for which what was closed must stand
HONEST = ("MOVING", "could not be confirmed", "NOT CONFIRMED", "ENERGISED", "is lost", "still energised")
STOPS = frozenset({"halt", "stop", "quick_stop", "disable"})
QUIET = STOPS | {"enable", "release", "reset", "set_position"}  # nothing moves by these
BY_ITSELF = frozenset(
    {
        "creeps",
        "creeps_no_more",
        "encoder_jumps",
        "slips_to_pp",
        "slips_to_pv",
        "slips_to_csp",
        "slips_no_more",
        "resumes",
    }
)


class Violation(Exception):
    """A rule that did not hold; ``rule`` is its name."""

    def __init__(self, rule: str, text: str) -> None:
        super().__init__(text)
        self.rule = rule


@dataclass
class Asked:
    """A command that was given."""

    what: str
    names: str
    handle: Handle
    since: float
    ended: float | None = None


class Rules:
    """Holds the cell against the rules; remembers what was asked and what was said to stand."""

    def __init__(self, cell: Cell, names: str) -> None:
        self._cell = cell
        self._names = names
        self._asked: list[Asked] = []
        self._stood: dict[str, tuple[float, str]] = {}  # axis: where it was said to stand, and by what
        self._stage = {name: cell.stage(name) for name in names}
        self._moving: dict[tuple[str, str], float] = {}  # (axis, rule): since when
        self._resting: dict[str, float] = {}
        self._at = ""

    # -- what the campaign tells ---------------------------------------------------------------------------------------

    def now_at(self, number: int, event: str) -> None:
        """The event that comes next, for messages."""
        self._at = f"[{number}] {event}"

    def asked(self, what: str, names: str, handle: Handle) -> None:
        """A command was given."""
        self._asked.append(Asked(what, names, handle, self._cell.now))
        for name in names:
            if what not in QUIET or (what == "enable" and self._cell.drive(name).dials.resumes_on_enable):
                self._stood.pop(name, None)
                self._resting.pop(name, None)

    def mishap(self, what: str, name: str) -> None:
        """Something happens to an axis; by some of it a plant moves, and that is no broken promise."""
        if what in BY_ITSELF:
            self._stood.pop(name, None)
            self._resting.pop(name, None)

    def forget(self) -> None:
        """Nobody asks for what became of the handles."""
        for asked in self._asked:
            if not asked.handle.busy:
                asked.handle.exception()

    # -- time ----------------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Let time pass, and look after each cycle."""
        end = self._cell.now + seconds
        while self._cell.now < end - 1e-9:
            self._cell.run(STEP)
            self._look()

    def leave(self) -> None:
        """Close the machine: what is not told as moving stands, is off, and stays so when nothing holds it any more."""
        cell, text = self._cell, ""
        try:
            cell.machine.close()
        except (AxisbusError, ExceptionGroup) as error:
            text = _all_text(error)
        for asked in self._asked:
            self._must(not asked.handle.busy, "every handle ends", f"{asked.handle!r} is busy after close()")
        honest = [name for name in self._names if self._is_told(name, text)]
        places = {name: cell.where(name) for name in self._names}
        for name in self._names:
            if name not in honest:
                self._must(
                    cell.speed(name) <= STANDS,
                    "closed means standing",
                    f"{cell.told(name)}; close() said {text!r}",
                )
                off = cell.stage(name) in OFF or not cell.core(name).touched
                self._must(off, "closed means off", f"{cell.told(name)}; close() said {text!r}")
        for _ in range(2):
            cell.run(CLOSED)
            for name in self._names:
                came = abs(cell.where(name) - places[name])
                self._must(
                    name in honest or came <= WAY,
                    "closed stays so",
                    f"{cell.told(name)}, {came:g} deg on; {text!r}",
                )
                cell.free(name)

    # -- the rules -----------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        scan = self._cell.machine.scan
        self._must(not scan.ended and scan.failure is None, "the scan lives", f"{scan.failure!r}")
        self._note_ends()
        for name in self._names:
            self._energised_only_when_asked(name)
            self._stays_where_it_was_stopped(name)
            self._states_are_true(name)
            self._rest_is_a_promise(name)

    def _note_ends(self) -> None:
        """See which commands have ended; a stop that is done has promised something."""
        for asked in self._asked:
            if asked.ended is not None or asked.handle.busy:
                continue
            asked.ended = self._cell.now
            if asked.what in STOPS and asked.handle.exception() is None:
                for name in asked.names:
                    self._promised(name, asked)

    def _promised(self, name: str, stop: Asked) -> None:
        later = self._asked[self._asked.index(stop) + 1 :]
        if any(other.what not in QUIET and name in other.names for other in later):
            return
        if self._has_a_will(name):
            return
        told = f"{stop.handle.name} was done at {self._cell.now:.2f} s"
        self._must(
            self._cell.speed(name) <= STANDS, "a stop that is done stands", f"{told}: {self._cell.told(name)}"
        )
        self._stood.setdefault(name, (self._cell.where(name), told))

    def _stays_where_it_was_stopped(self, name: str) -> None:
        if name not in self._stood:
            return
        place, told = self._stood[name]
        came = abs(self._cell.where(name) - place)
        self._must(
            came <= WAY, "what was stopped stays", f"{told}; now {self._cell.told(name)}, {came:g} deg on"
        )

    def _energised_only_when_asked(self, name: str) -> None:
        before, self._stage[name] = self._stage[name], self._cell.stage(name)
        if before not in OFF or self._stage[name] != ENABLED:
            return
        recent = self._cell.now - ENABLE_LATE
        enables = [asked for asked in self._asked if asked.what == "enable" and name in asked.names]
        asked_for = any(asked.ended is None or asked.ended > recent for asked in enables)
        self._must(
            asked_for, "energised only when asked", f"{self._cell.told(name)}, was {STAGE_NAMES[before]}"
        )

    def _states_are_true(self, name: str) -> None:
        cell = self._cell
        state, moves = cell.core(name).state, cell.speed(name) > STANDS
        energised = cell.stage(name) not in OFF
        alive = not cell.device(name).dials.dead
        said = f"{state.value}, error {cell.core(name).error}"
        self._not_long("Standstill is standing", name, BLIND, state is AxisState.STANDSTILL and moves, said)
        held = state is AxisState.STOPPING and self._rests(name)
        self._not_long("what is held in Stopping stands", name, BLIND, held and moves, said)
        off = state is AxisState.DISABLED and energised and cell.core(name).touched
        self._not_long("Disabled is off", name, BLIND, off and self._rests(name), said)
        untold = state is AxisState.ERRORSTOP and moves and alive and not self._is_told(name, "")
        self._not_long("ErrorStop stops or says that it moves", name, UNCONFIRMED, untold and energised, said)

    def _rest_is_a_promise(self, name: str) -> None:
        """An axis that rests in Standstill or ErrorStop, and is not told as moving, is said to stand."""
        cell = self._cell
        state = cell.core(name).state
        rests = state in (AxisState.STANDSTILL, AxisState.ERRORSTOP) and self._rests(name)
        if not rests or self._is_told(name, "") or self._has_a_will(name):
            self._resting.pop(name, None)
            return
        since = self._resting.setdefault(name, cell.now)
        if cell.now - since > RESTS and cell.speed(name) <= STANDS:
            self._stood.setdefault(
                name, (cell.where(name), f"it rested in {state.value} at {cell.now:.2f} s")
            )

    def _has_a_will(self, name: str) -> bool:
        """Whether the drive moves by itself: then a moment's rest is nobody's promise."""
        dials = self._cell.drive(name).dials
        return bool(dials.creep) or dials.mode_slips_to is not None

    def _rests(self, name: str) -> bool:
        core = self._cell.core(name)
        return core.ladder is None and core.activity is None

    def _not_long(self, rule: str, name: str, limit: float, wrong: bool, said: str) -> None:
        if not wrong:
            self._moving.pop((name, rule), None)
            return
        since = self._moving.setdefault((name, rule), self._cell.now)
        long = self._cell.now - since
        self._must(long <= limit, rule, f"{long:.2f} s: {self._cell.told(name)}, the master says {said}")

    def _is_told(self, name: str, text: str) -> bool:
        """Whether the master says of an axis that it may move, or is energised still."""
        error = self._cell.core(name).error
        lines = [str(error)] if error is not None else []
        lines += [part for part in text.split("\0") if part.startswith(f"{name}:") or f"[{name}]" in part]
        return any(word in line for line in lines for word in HONEST)

    def _must(self, holds: bool, rule: str, text: str) -> None:
        if not holds:
            raise Violation(rule, f"at {self._cell.now:.2f} s, before {self._at}: {text}")


def _all_text(error: BaseException) -> str:
    """The texts of all errors, apart from each other."""
    if isinstance(error, BaseExceptionGroup):
        return "\0".join(_all_text(one) for one in error.exceptions)
    return str(error)
