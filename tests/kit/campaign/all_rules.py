"""All rules of the campaign together, checked in every cycle, and the conditions when the machine is left."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from axisbus.motion.parameters import HoldsLoad
from kit.campaign import can_simple_rules, output_rules
from kit.campaign.can_simple_rules import Beside
from kit.campaign.facts import Facts, GivenCommand
from kit.campaign.faults import ENDS, MISHAPS
from kit.campaign.feed_forward_rules import Offsets
from kit.campaign.gantry.scene import NAME
from kit.campaign.gantry.skew_rules import Beam
from kit.campaign.motion_rules import Travel
from kit.campaign.output_rules import Outputs
from kit.campaign.report_rules import Truth
from kit.campaign.standstill_rules import WAY, Rest
from kit.plant_probe import OFF

CLOSED = 2.0  # s for which the standstill after closing must last
_LONGEST = 20.0  # s for each axis that closing may take


# Faults that neither hide frames from a drive, nor its state from the master.
_HARMLESS = frozenset(
    {"jam", "sticks", "fault", "drops_power", "creeps", "encoder_jumps", "late_feedback", "slow_to_enable"}
)


def _offsets_of(facts: Facts) -> Offsets | None:
    given = {core.parameters.feed_forward for core in facts.core.values()}
    return None if None in given else Offsets(facts.cell, facts.names, facts.scene.period)


class Judge:
    """Lets time pass, reports events to the rules, and checks."""

    def __init__(self, facts: Facts) -> None:
        self.facts = facts
        self._rest, self._truth = Rest(facts), Truth(facts)
        self._travel = facts.scene.travel(facts) if facts.scene.travel else Travel(facts)
        self._outputs = Outputs(facts.cell) if output_rules.LAMP in facts.cell.machine.cell.io else None
        self._offsets = _offsets_of(facts)
        self._beam = Beam(facts) if facts.scene.pair else None
        self._beside = Beside(facts.cell) if can_simple_rules.NAME in facts.cell.machine.cell.axes else None
        self._switched: list[Handle] = []

    def asked(self, asked: GivenCommand) -> None:
        """A command was given."""
        self.facts.asked.append(asked)
        if self._beside is not None and asked.what == "enable" and len(asked.names) > 1:
            self._beside.enabled_by(asked.handle)  # the group is that of all axes
        self._rest.asked(asked)
        self._travel.asked(asked)

    def refused(self, asked: GivenCommand, error: AxisbusError) -> None:
        """A command was refused at the call."""
        self._travel.refused(asked, error)

    def pushed(self, name: str, increments: int) -> None:
        """Move a motor without power by hand."""
        self._rest.befell("encoder_jumps", [name], True)
        self.facts.drive[name].dials.encoder_jump = increments

    def switch(self, value: float) -> None:
        """Set the outputs of a cell that has some, and let something happen to its module, by a number from -1 to 1."""
        if self._beside is not None:
            self._beside.happen(value)
        if self._outputs is not None:
            asked = {"lamp": value > 0.0, "clamp": abs(value) > 0.5}
            self._switched += [self._outputs.ask(name, int(on)) for name, on in asked.items()]

    def happen(self, what: str, axis: str, value: float) -> None:
        """A fault begins or ends."""
        if what in ENDS:
            self.facts.end(what, axis)
            ENDS[what](self.facts.site, axis, value)
            if what in {kind.ends for kind in MISHAPS.values() if kind.moves}:
                self._rest.befell(what, [axis], what != "free")
            return
        befallen = self.facts.begin(what, axis)
        self._rest.befell(what, befallen, MISHAPS[what].moves)
        MISHAPS[what].do(self.facts.site, axis, value)

    def run(self, seconds: float) -> None:
        """Let time pass, and look after each cycle.

        Raises:
            Violation: a rule did not hold.
        """
        end = self.facts.now + seconds
        while self.facts.now < end - 1e-9:
            self.facts.cell.machine.sleep(0.5 * self.facts.scene.period)  # one cycle
            self._look()

    def settle(self) -> None:
        """Let time pass until no command is running, or one is late."""
        while any(asked.ended is None and not self._truth.takes_hours(asked) for asked in self.facts.asked):
            self.run(0.1)
            self._truth.late()

    def _look(self) -> None:
        facts = self.facts
        scan = facts.cell.machine._core.scan
        facts.must(not scan.ended and scan.failure is None, "the scan lives", f"{scan.failure!r}")
        for name in facts.names:
            facts.look(name)
        self._note_ends()
        if self._outputs is not None:
            self._outputs_hold(self._outputs)
        if self._beside is not None:
            self._module_holds(self._beside)
        if self._offsets is not None:
            self._offsets_hold(self._offsets)
        for name in facts.names:
            self._rest.look(name)
            self._travel.look(name)
            self._truth.look(name)
        if self._beam is not None:
            self._beam.look()

    def _note_ends(self) -> None:
        for asked in self.facts.asked:
            if asked.ended is not None or asked.handle.busy:
                continue
            asked.ended = self.facts.now
            self._rest.ended(asked)
            self._travel.ended(asked)
            self._truth.ended(asked)
            if self._beam is not None:
                self._beam.ended(asked)

    # -- closing ---------------------------------------------------------------------------------------------------------

    def leave(self, ending: str) -> None:
        """Leave the machine: an axis not reported as moving is at standstill, is off, and stays so when nothing holds it any more.

        Raises:
            Violation: a rule did not hold.
        """
        facts, began = self.facts, self.facts.now
        text = _error_of(lambda: ENDINGS[ending](facts))
        took = facts.now - began
        facts.worst = max(facts.worst, took)
        stops = (
            2 if ending == "ctrl-c" else 1
        )  # Ctrl-C stops the axes, and closing tries again to confirm the unconfirmed stops
        facts.must(took <= stops * _longest(facts), "the way out ends", f"it took {took:.1f} s")
        for asked in facts.asked:
            busy = f"{asked.handle!r} is busy after the machine was left ({ending})"
            facts.must(not asked.handle.busy, "every handle ends", busy)
        honest = [
            name
            for name in facts.names
            if facts.is_reported_as_moving(name, text) or facts.turns_unseen(name)
        ]
        for name in facts.names:
            if name not in honest:
                self._is_left(name, text)
        self._stays_left(honest, text)
        if self._beside is not None:
            self._module_holds(self._beside)
            for handle in self._beside.given:
                facts.must(not handle.busy, "every handle ends", f"{handle!r} is busy")
            wrong = self._beside.unsafe(text)
            facts.must(not wrong, "closed means a module at rest and off", wrong)
        if self._offsets is not None:
            for name in facts.names:
                left = name in honest or self._offsets.left(name) or self._disturbed(name)
                facts.must(left, "closed means no offset", f"{facts.cell.told(name)}; it was said {text!r}")
        if self._outputs is not None:
            self._outputs_are_left(self._outputs, honest, text)

    def _offsets_hold(self, offsets: Offsets) -> None:
        for name in self.facts.names:
            for wrong in offsets.look(name, clean=not self._disturbed(name)):
                self.facts.must(False, "an offset belongs to a set-point", f"{name}: {wrong}")

    def _disturbed(self, name: str) -> bool:
        """Whether something keeps, or has just kept, the master from knowing the drive, or the drive from hearing it."""
        return any(trouble.what not in _HARMLESS for trouble in self.facts.troubled(name, 1.0))

    def _module_holds(self, module: Beside) -> None:
        self.facts.must(
            not module.wrong, "a module has power only when that was asked", "; ".join(module.wrong)
        )

    def _outputs_hold(self, outputs: Outputs) -> None:
        self.facts.must(not outputs.wrong, "an output has what was asked for", "; ".join(outputs.wrong))

    def _outputs_are_left(self, outputs: Outputs, honest: list[str], text: str) -> None:
        self._outputs_hold(outputs)
        for handle in self._switched:
            self.facts.must(not handle.busy, "every handle ends", f"{handle!r} is busy")
        for name in outputs.unsafe():
            told = f"{name} could not be confirmed as safe" in text
            self.facts.must(
                told, "closed means safe", f"{name} is {outputs.shown(name)}; it was said {text!r}"
            )
        early = outputs.early.difference(honest)
        early = {name for name in early if self.facts.core[name].touched}
        self.facts.must(not early, "outputs become safe last", f"{early} had power; it was said {text!r}")

    def _is_left(self, name: str, text: str) -> None:
        facts = self.facts
        told = f"{facts.cell.told(name)}; it was said {text!r}"
        stands = not facts.moves(name) or facts.is_dropped(name) or facts.turns_unseen(name)
        stands = stands or facts.is_pulled(name)
        facts.must(stands, "closed means standing", told)
        core = facts.cell.core(name)
        off = facts.cell.stage(name) in OFF or not core.touched
        held = core.parameters.holds_load is HoldsLoad.TORQUE
        facts.must(off or held, "closed means off", told)

    def _stays_left(self, honest: list[str], text: str) -> None:
        facts = self.facts
        places = {name: facts.cell.where(name) for name in facts.names}
        for _ in range(2):
            facts.cell.run(CLOSED)
            for name in facts.names:
                came = abs(facts.cell.where(name) - places[name])
                told = f"{facts.cell.told(name)}, {came:g} deg on; {text!r}"
                facts.must(name in honest or came <= WAY or facts.hangs(name), "closed stays so", told)
                facts.cell.free(name)

    def forget(self) -> None:
        """Drop the handles without reading them."""
        for asked in self.facts.asked:
            if not asked.handle.busy:
                asked.handle.exception()
        module = [] if self._beside is None else self._beside.given
        for handle in [*self._switched, *module]:
            if not handle.busy:
                handle.exception()


def _with(facts: Facts) -> None:
    with facts.cell.machine:
        pass


def _exception(facts: Facts) -> None:
    """Errors while stopping are in the notes of the exception that ended the block."""
    try:
        with facts.cell.machine:
            raise _Own
    except _Own as error:
        raise AxisbusError("\0".join(getattr(error, "__notes__", ()))) from None


def _longest(facts: Facts) -> float:
    """Return how long closing may take, in s."""
    return max(_LONGEST * len(facts.names), *map(facts.stops_in, facts.names))


class _Own(Exception):
    """The user's own."""


def _ctrl_c(facts: Facts) -> None:
    failures = facts.cell.ctrl_c(_longest(facts))
    text = _error_of(facts.cell.machine.close)
    raise AxisbusError("\0".join([*map(str, failures), text]))


def _twice(facts: Facts) -> None:
    text = _error_of(facts.cell.machine.close)
    again = _error_of(facts.cell.machine.close)
    raise AxisbusError("\0".join([text, again]))


def _busy(facts: Facts) -> None:
    """Commands are running when it is closed."""
    for axis in facts.cell.machine:
        _error_of(lambda axis=axis: axis.move_velocity(60.0))
        _error_of(axis.reset)
    if facts.scene.pair:
        _error_of(lambda: facts.cell.machine.gantry(NAME).move_velocity(60.0))
    facts.cell.machine.close()


ENDINGS: dict[str, Callable[[Facts], None]] = {
    "close": lambda facts: facts.cell.machine.close(),
    "with": _with,
    "exception": _exception,
    "ctrl-c": _ctrl_c,
    "closed-twice": _twice,
    "busy-close": _busy,
}


def _error_of(leave: Callable[[], object]) -> str:
    """The texts of all errors, apart from each other; empty where there was none."""
    try:
        leave()
    except (AxisbusError, ExceptionGroup) as error:
        return _all_text(error)
    return ""


def _all_text(error: BaseException) -> str:
    if isinstance(error, BaseExceptionGroup):
        return "\0".join(_all_text(one) for one in error.exceptions)
    return str(error)
