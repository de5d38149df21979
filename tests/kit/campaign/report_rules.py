"""Rules of truth: nothing stale passes as fresh, every command ends in time, and an error names the cause."""

from __future__ import annotations

from axisbus.errors import AxisbusError, CommandError, Interrupted, LimitError, StateError
from kit.campaign import can_simple_rules
from kit.campaign.commands import OVERRIDES
from kit.campaign.facts import Facts, GivenCommand, Trouble
from kit.campaign.gantry.skew_rules import has_bent
from kit.campaign.motion_rules import TAKES_SET_POINT

_LATEST = 20.0  # s after which no command may be running
_LATEST_PATH = 80.0  # s: that of follow_on is 60 s long
_STEP = 10.0  # increments of progress, however slow
_FAR = 2**28  # increments: hours at any speed
_HALF_COUNT = 2**31  # increments: half the span of INTEGER32
_FARTHEST = 600.0  # s, the same where it moves: a drive that leapt to an old target may be tens of thousands of degrees away
_ARRIVES = 3.0  # s that a command may take when its axes have stopped
_BLIND_FOR = 6.0  # s for which a node may be silent after the cause
_READS = 2.0  # s in which an error may say that its code is being read: a stalled drive answers late
_NEAR = 1.5  # deg by which a position that is shown may be off
_COUNTS = 1.5  # increments, the same: of a coarse encoder
_USUAL_AGE = 1.2  # s: the age of a value that is sent on change only, or polled
_BY_ANSWERS = 0.1  # s, besides: a delay that grows is known by the second slow answer only (docs/stopping.md)
_REFUSED = (CommandError, StateError, LimitError)  # the command cannot be executed; no fault
_TOO_LATE = "come too late"  # of process data that the master takes for delayed
_COUNTED = range(1, 241)  # transmission types of a TPDO that answers SYNC
# Errors of a command by its own user, without any fault.
_OWN = (
    "limit",
    "torque",
    "quick stop",
    "coast",
    "disable",
    "not homed",
    "another axis",
    "was never received",
    "master",  # of a gear or a cam: lost, or too fast for its slave
    "failed",
    "no edge",  # of a search that found none
    "a switch was not found",  # of a pair that goes away from them
    "do not agree",  # where it began between them
)


class Truth:
    """Holds which errors have been judged."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._errors: dict[str, int] = {}
        self._moved: dict[str, float] = {}  # when it was seen moving last
        self._places: dict[str, float] = {}  # where it was then: it may creep
        self._locked: dict[str, float] = {}  # since when an axis has had the error that it has
        self._late_until: dict[str, float] = {}  # delayed feedback shows older values

    def look(self, name: str) -> None:
        place = self._facts.place(name)
        if self._facts.moves(name) or abs(place - self._places.get(name, place)) >= _STEP:
            self._moved[name] = self._facts.now
            self._places[name] = place
        self._places.setdefault(name, place)
        self._nothing_stale(name)
        self._error_names_its_cause(name)

    def late(self) -> None:
        """Every command has ended, or is not late yet."""
        changes = (asked.since for asked in self._facts.asked if asked.what in OVERRIDES)
        since = max(changes, default=0.0)  # from then on a command has all of its time
        for asked in self._facts.asked:
            usual = (
                _LATEST_PATH if asked.what == "follow_on" or self._ends_by_its_deadline(asked) else _LATEST
            )
            limit = max(usual, *map(self._facts.stops_in, asked.names))
            late = (
                asked.ended is None
                and self._facts.now - max(asked.since, since) > limit
                and not self._has_far_to_go(asked)
                and not self._is_slowed()
            )
            self._facts.must(not late, "every handle ends", f"{asked.handle!r} is busy after {limit:g} s")

    def _ends_by_its_deadline(self, asked: GivenCommand) -> bool:
        """Whether a move ends by twice the time it needs: another master took its set-point, or it jams within a wide 6065h."""
        names, span = asked.names, self._facts.now - asked.since
        causes = TAKES_SET_POINT | {"jam"}
        return any(each.what in causes for name in names for each in self._facts.troubled(name, span))

    def _is_slowed(self) -> bool:
        """Whether an override holds the motion, or makes it slower."""
        return any(self._facts.cell.core(name).override.factor < 1.0 for name in self._facts.names)

    def takes_hours(self, asked: GivenCommand) -> bool:
        """Whether it goes to the other end of the drive's count, at any speed, or back from where that is called a place nearby."""
        ends = [
            *asked.goals.items(),
            *((name, self._facts.drive[name].target_position) for name in asked.names),
        ]
        return asked.kind == "extreme" or any(abs(end - self._facts.place(name)) > _FAR for name, end in ends)

    def _has_far_to_go(self, asked: GivenCommand) -> bool:
        """Whether it commands an axis whose count has run far away meanwhile, and moves, or has only just arrived.

        If the drive does not report the arrival, the time for that whole distance must be over.
        """
        if self.takes_hours(asked):
            return True
        far = asked.what.startswith(("move_", "resume")) and self._facts.now - asked.since < _FARTHEST
        return far and any(
            self._facts.now - self._moved.get(name, -_FARTHEST) < _ARRIVES
            or self._facts.drive[name].dials.target_reached_never
            for name in asked.names
        )

    def ended(self, asked: GivenCommand) -> None:
        """A command that failed says why, and that has happened."""
        error = asked.error
        if error is None or isinstance(error, (Interrupted, *_REFUSED)):
            return
        for name in asked.names:
            if self._has_cause(name, error):
                return
        self._no_cause(asked.names, error)

    # -- freshness -------------------------------------------------------------------------------------------------------

    def _nothing_stale(self, name: str) -> None:
        """A position that is shown is where the motor was at most its maximum age (and a cycle) ago."""
        facts = self._facts
        position = facts.core[name].image.position
        if position is None:
            return
        off = facts.place(name) - position
        if self._may_have_restarted(name):
            off = (off + _HALF_COUNT) % (2 * _HALF_COUNT) - _HALF_COUNT
        away = facts.turned(name) * off / facts.scale[name]
        here = facts.where(name) - away
        near = max(_NEAR, _COUNTS / abs(facts.scale[name]))
        if abs(here - facts.where(name)) < near or self._restarts_count(name):
            return
        if facts.drive[name].dials.feedback_delay > 0.0:
            self._late_until[name] = facts.now + 0.3
        blocked = facts.now - facts.core[name].image.now  # the state when its cycle began
        lies = any(trouble.what in _LIES for trouble in facts.troubled(name, 0.3 + blocked))
        if lies or self._late_until.get(name, 0.0) > facts.now:
            return
        blind = any(trouble.what in _BLIND for trouble in facts.troubled(name, _BLIND_FOR))
        longest = facts.core[name].capabilities.max_age.get("position", 0.1)  # as it travels
        known_for = max(0.1, longest) + 5 * facts.scene.period
        if not self._are_tpdos_counted(name):
            known_for += _BY_ANSWERS
        age = _USUAL_AGE if blind or _polled(facts, name) else known_for
        positions = facts.cell.positions(name, facts.cell.moment(name) - blocked - age)
        low, high = min(positions) - near, max(positions) + near
        told = f"shown at {here:g} deg (of its plant), which was between {low:g} and {high:g} for {age:g} s"
        facts.must(low <= here <= high, "nothing stale is shown", told)

    def _restarts_count(self, name: str) -> bool:
        """Whether homing, or a restart, has just given the place another number."""
        restarts = ("reboots", "loses_supply")
        if any(trouble.what in restarts for trouble in self._facts.troubled(name, 2.0)):
            return True
        recent = self._facts.now - 0.5
        homes = [asked for asked in self._facts.asked if asked.what == "home" and name in asked.names]
        return any(asked.ended is None or asked.ended > recent for asked in homes)

    def _may_have_restarted(self, name: str) -> bool:
        """Whether the node was once lost, which may have been a restart.

        The master then begins again with the drive's own value. If the axis had moved past the end of INTEGER32, that value
        differs from the unwrapped position of the plant by the whole span.
        """
        return any(trouble.what in _BLIND for trouble in self._facts.troubles[name])

    # -- causes ----------------------------------------------------------------------------------------------------------

    def _error_names_its_cause(self, name: str) -> None:
        error = self._facts.core[name].error
        if error is None:
            self._locked.pop(name, None)
            return
        self._locked.setdefault(name, self._facts.now)
        being_read = "is being read" in str(error) and self._facts.now - self._locked[name] < _READS
        if being_read or self._errors.get(name) == id(error):
            return
        self._errors[name] = id(error)
        if not self._has_cause(name, error):
            self._no_cause(name, error)

    def _has_cause(self, name: str, error: AxisbusError) -> bool:
        text = str(error)
        troubles = self._troubles(name)
        if text.startswith(f"{can_simple_rules.NAME}: ") and name != can_simple_rules.NAME:
            return True  # the module beside them has stopped its group: its faults belong to its own rules
        if any(word in text for trouble in troubles for word in trouble.kind.says):
            return True
        if _TOO_LATE in text and not self._are_tpdos_counted(name):
            return any(trouble.what == "sdo_late" for trouble in troubles)
        if has_bent(self._facts, error, name):
            return True
        return any(word in text for word in _OWN)

    def _are_tpdos_counted(self, name: str) -> bool:
        """Whether each TPDO of the drive answers every n-th SYNC of the master.

        Otherwise only the SDO answers show a delay of the link: a drive that answers late looks as one behind a slow gateway. The
        master stops then, by design (``bus.pdo.freshness``).
        """
        tpdos = (pdo for pdo in self._facts.cell.port(name).plan.active if not pdo.receive)
        return all(pdo.target.transmission_type in _COUNTED for pdo in tpdos)

    def _troubles(self, name: str) -> list[Trouble]:
        """The recent faults, and those that led to the present error of the axis."""
        now = self._facts.now
        return list(
            self._facts.troubled(name, self._facts.remembers(name) + now - self._locked.get(name, now))
        )

    def _no_cause(self, names: str, error: AxisbusError) -> None:
        known = sorted({trouble.what for name in names for trouble in self._troubles(name)})
        rule = "an error names its cause" if known else "no error without a cause"
        self._facts.must(False, rule, f"{type(error).__name__} {error}; what has happened: {known}", error)


_BLIND = frozenset(
    {"dead", "pre_operational", "sync_lost", "other_stops_node", "reboots", "stalls", "inputs_lost"}
    | {"loses_supply"}
    | {"wire_loses", "wire_cut", "bus_off", "queue_full", "second_device"}
)
_LIES = frozenset(
    {"encoder_frozen", "encoder_jumps", "late_feedback", "frames_late", "stalls", "jam", "wire_jitters"}
)


def _polled(facts: Facts, name: str) -> bool:
    return facts.core[name].capabilities.max_age.get("position", 1.0) > 0.5
