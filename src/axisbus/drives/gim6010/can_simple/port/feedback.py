"""State, faults, position and current of one module as received, and the requests for values that it does not send unasked.

Theory of operation
-------------------
``take`` receives each frame with its time of receipt. Every value is stored with that time, so that a caller can treat an old value
as unknown. Heartbeats report the state. If no heartbeat arrives for three periods, the module counts as silent.

When a silent module returns, its life counter shows whether it has restarted: the counter must have advanced by the number of
heartbeats that fit into the silence. If it has not, or if there is no counter, the module has restarted: its positions start from a
new zero, and its settings are the saved ones. A counter that has advanced by less is accepted: those are heartbeats which this
computer received late.

Heartbeats that were not received, and messages that the firmware does not answer, are events as those of TPDOs are (``PdoEvent``).
"""

from __future__ import annotations

import math
from collections import deque

from axisbus.bus.pdo.tpdo_timeout import HISTORY, PdoEvent, Reception
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtState
from axisbus.drives.gim6010.can_simple import codec, heartbeat
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, Unexpected
from axisbus.drives.gim6010.can_simple.error_query import GET_ERROR
from axisbus.drives.gim6010.can_simple.heartbeat import Heartbeat, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import can_id, split
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, named
from axisbus.drives.gim6010.can_simple.port.error_words import WAIT, ModuleErrors
from axisbus.drives.gim6010.can_simple.port.rotor_position import RotorPosition
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings

_LOST = 3.0  # periods of the heartbeat
_SLACK = 1.0  # heartbeats by which a life counter may be off after a silence, plus a tenth of the heartbeats due in that time
_YOUNG = 10  # a life counter below this may belong to a module that has just started
CURRENT_EVERY = 0.02  # s at least between two requests for the current
_COUNTS = 0.008  # s at least between two requests for the encoder's counts
SELDOM = 0.1  # s between two requests for values that are only compared or displayed
_LATE = 1.5  # scan periods without an unasked estimate, after which it is requested


class ModuleFeedback:
    """The newest value of each kind with its time (s), and ``missing``: the last events of missing messages, oldest first.

    It is a ``bus.node.events.Monitored`` too: a restart counts as a boot-up. A second module with this node ID is not detected.
    """

    guarded = False
    duplicate = ""

    def __init__(self, settings: ModuleSettings) -> None:
        self._settings = settings
        self.node_id = settings.node
        self._beats = Heartbeats()
        self.beat_at = -math.inf
        self.place = RotorPosition(settings.velocity_limit)
        self.trouble = ModuleErrors(settings.node, settings.fresh if settings.relayed else WAIT)
        self.current: tuple[float, float] | None = None  # torque-producing current in A, and its time
        self.bootups = 0  # since listening began
        self.bootup_stamp: float | None = None
        self.trusts_estimates = True  # no request for idle since the last request for closed loop
        self.missing: deque[PdoEvent] = deque(maxlen=HISTORY)
        names = ("Get_Encoder_Estimates", "Get_Encoder_Count", "Get_Iq")
        self._estimates, self._counts, self._iq = self._questions = [
            PolledMessage(self.node_id, each, remote=settings.remote) for each in names
        ]
        self._silent_since: dict[PolledMessage, float] = {}

    # Received state.

    @property
    def beat(self) -> Heartbeat | None:
        return self._beats.last

    @property
    def reports(self) -> int:
        """Number of heartbeats."""
        return self._beats.heard

    @property
    def stamp(self) -> float | None:
        """Time of the newest heartbeat."""
        return None if self.beat is None else self.beat_at

    @property
    def is_new(self) -> bool:
        """Whether positions have a new zero: the module has restarted, or its position is not continuous with the earlier one."""
        return self.bootups > 0 or self.place.lost

    @property
    def state(self) -> NmtState:
        """NMT state that a CANopen node would report by heartbeat; a restarted module is pre-operational until it is configured."""
        if self.beat is None:
            return NmtState.UNKNOWN
        return NmtState.PRE_OPERATIONAL if self.is_new else NmtState.OPERATIONAL

    @property
    def faulty(self) -> bool:
        """Whether the newest heartbeat reports a fault."""
        return self.beat is not None and bool(self.beat.faults)

    @property
    def closed(self) -> bool:
        """Whether the newest heartbeat reports closed loop."""
        return self.beat is not None and self.beat.state == CLOSED_LOOP

    @property
    def missed(self) -> int:
        """Number of heartbeats that were sent but not received, according to the life counter."""
        return self._beats.missed

    @property
    def deadline(self) -> float:
        """Time from which the module counts as silent if no further heartbeat arrives."""
        return self.beat_at + _LOST * self._settings.heartbeat + 1e-9

    def overdue(self, now: float) -> bool:
        """Whether the module counts as silent."""
        return now > self.deadline

    def let_go(self) -> None:
        """Note that idle is being requested: from now on, estimates of the position are ignored."""
        self.trusts_estimates = False
        self.place.shut()

    def trust(self) -> None:
        """Note that closed loop is being requested: estimates count as soon as a heartbeat reports closed loop."""
        self.trusts_estimates = True

    # Reception.

    def take(self, frame: CanFrame, at: float) -> None:
        """Take a frame received at ``at``; frames of other modules, and frames that are not standard data frames, are ignored."""
        if frame.remote or frame.error or frame.extended or not 0 <= frame.can_id < 0x800:
            return
        node, command = split(frame.can_id)
        if node != self.node_id:
            return
        if command == heartbeat.COMMAND:
            self._take_beat(frame.data, at)
        elif command == GET_ERROR.command:
            if self.faulty:
                self.trouble.take(frame.data)
        else:
            found = codec.decode(frame.can_id, frame.data, from_module=True)
            if isinstance(found, DecodedMessage):
                self._take_reading(found, at)

    def _take_beat(self, data: bytes, at: float) -> None:
        before = self._beats
        after = before.after(self.node_id, data)
        if isinstance(after, Unexpected):
            return
        self._beats, silence, self.beat_at = after, at - self.beat_at, at
        if before.last is not None:
            self._look_at_life(before, silence, at)
        self._look_at_fault(before.last)
        if self.closed and not self.faulty and self.trusts_estimates:
            self.place.open()
        elif not self.closed:
            self.place.shut()

    def _look_at_life(self, before: Heartbeats, silence: float, at: float) -> None:
        """Report heartbeats that are missing according to the life counter, and detect a restart of the module."""
        life, last = self._beats.last, before.last
        assert life is not None
        assert last is not None
        was_silent = silence > _LOST * self._settings.heartbeat
        anew = was_silent and not self._goes_on(last.life, life.life, silence)
        if anew or self._beats.restarts > before.restarts:
            self.bootups, self.bootup_stamp = self.bootups + 1, at
        elif self._beats.gap:
            self._note_missing("Heartbeat", Reception.RETURNED, silence, self._settings.heartbeat, at)

    def _goes_on(self, before: int | None, now: int | None, silence: float) -> bool:
        if before is None or now is None or self._settings.relayed:  # the relay counts, not the module
            return False
        passed = silence / self._settings.heartbeat
        off = ((now - before) - passed + 128) % 256 - 128
        # Heartbeats that were read late arrive together: their counter is only behind the elapsed time.
        behind = now >= _YOUNG and 1 <= now - before <= passed
        return behind or abs(off) <= _SLACK + 0.1 * passed

    def _look_at_fault(self, before: Heartbeat | None) -> None:
        beat = self.beat
        assert beat is not None
        if not beat.faults:
            self.trouble.clear()
        elif before is None or not before.faults:
            self.trouble.begin(beat.axis_error)
        else:
            self.trouble.note(beat.axis_error)

    def _take_reading(self, found: DecodedMessage, at: float) -> None:
        values = [float(each) for each in found.values.values()]
        if found.message.name == self._estimates.name:
            self._estimates.take(at)
            self.place.take_estimate(values[0], values[1], at)
        elif found.message.name == self._counts.name:
            self._counts.take(at)
            self.place.take_count(int(values[1]), at)
        elif found.message.name == self._iq.name:
            self._iq.take(at)
            self.current = (values[1], at)

    # Requests.

    def ask(self, now: float) -> list[Outgoing]:
        """Return the requests that are due; none while the module is silent, since its answers could not be received then."""
        if self.overdue(now):
            return []
        period = self._settings.period
        due = [self.trouble.ask(now) if self.faulty else None]
        if not self._settings.relayed:  # a relay sends all of these unasked
            counts = self._counts.ask(now, SELDOM if self.place.joined else max(_COUNTS, period))
            has_torque = self._settings.torque is not None
            current = self._iq.ask(now, max(CURRENT_EVERY, period)) if has_torque else None
            due = [self._ask_estimates(now), counts, current, *due]
        self._look_for_silent(now)
        return [each for each in due if each is not None]

    def _ask_estimates(self, now: float) -> Outgoing | None:
        """Request the estimates if they count and the module does not send them unasked."""
        if not (self.closed and self.trusts_estimates):
            return None
        allowed = max(_LATE * self._settings.period, 0.015)
        late = self._estimates.answered_at is None or now - self._estimates.answered_at > allowed
        return self._estimates.ask(now, self._settings.period) if late else None

    def _look_for_silent(self, now: float) -> None:
        """Report once each message that this firmware does not answer, and that it answers again."""
        for each in self._questions:
            since = self._silent_since.get(each)
            if each.silent and since is None:
                since = now - _WAITED if each.answered_at is None else each.answered_at
                self._silent_since[each] = since
                never = each.answered_at is None
                self._note_missing(each.name, Reception.MISSING, now - since, _WAITED, now, never=never)
            elif since is not None and not each.silent:
                del self._silent_since[each]
                self._note_missing(each.name, Reception.RETURNED, now - since, _WAITED, now)

    def _note_missing(
        self, name: str, what: Reception, age: float, deadline: float, now: float, *, never: bool = False
    ) -> None:
        identifier = can_id(self.node_id, named(name).command)
        self.missing.append(PdoEvent(self.node_id, name, identifier, what, age, deadline, now, never))


# ----------------------------------------------------------------------------------------------------------------------
# Messages that are requested periodically: when, by which kind of frame, and when the firmware counts as not answering them.


_TRIES = 5  # requests by a remote frame, and as many by eight bytes of 0
_SELDOM = 1.0  # s between two requests for a message that is not answered
_GIVEN_UP = 0.05  # s after which a request counts as not answered
_WAITED = 2 * _TRIES * _GIVEN_UP  # s of all requests, after which the message counts as not answered


class PolledMessage:
    """One periodically requested message, with the time of the last request and the number of requests without an answer.

    Owners saw answers to remote frames, and the maker's program sends eight bytes of 0. After some remote frames without an answer,
    the data frame is used; if the bus carries no remote frames, only the data frame is used. A message that is answered to neither
    is *not answered by this firmware*: this is reported once, and the message is then requested rarely.
    """

    def __init__(self, node: int, name: str, *, remote: bool = True) -> None:
        """``node``: 0 to 63; ``name``: the manual's name of a message that an empty request asks for.

        ``remote``: whether the bus carries remote frames.
        """
        self.name = name
        self._frames = [codec.request(node, named(name), remote=way) for way in (remote, False)]
        self._asked_at: float | None = None
        self._open = False
        self._vain = 0
        self.answered_at: float | None = None

    @property
    def silent(self) -> bool:
        """Whether both kinds of request had no answer."""
        return self._vain >= 2 * _TRIES

    def ask(self, now: float, every: float) -> Outgoing | None:
        """Return the request if it is due, with a period of ``every`` s; otherwise None."""
        since = None if self._asked_at is None else now - self._asked_at
        if self._open and since is not None and since >= _GIVEN_UP:
            self._open = False
            self._vain += 1
        pause = _SELDOM if self.silent else every
        if self._open or (since is not None and since < pause - 1e-9):
            return None
        self._asked_at, self._open = now, True
        return self._frames[self._way]

    def take(self, at: float) -> None:
        """Note that the message arrived at ``at``, requested or not."""
        self.answered_at = at
        self._open = False
        self._vain = _TRIES * self._way if self._vain < 2 * _TRIES else 0

    @property
    def _way(self) -> int:
        return int(self._vain >= _TRIES) if not self.silent else self._vain % 2
