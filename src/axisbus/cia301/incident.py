"""Emergency messages grouped into incidents: a fault, the messages that came with it, and the resets that followed.

Theory of operation
-------------------
One cause often makes a drive send several messages. The first message that is not a reset begins an *incident*. Further messages
within ``TOGETHER`` seconds belong to it; a later one begins another incident. A reset (error code 00xxh, CiA 301 7.2.7.1) belongs
to every open incident. If its error register is 0, the reset resolves them. If bits are left in the register, one of several errors
is gone, but the message does not say which one; the incidents stay open. A boot-up resolves all incidents too: the EMCY state
machine of CiA 301 begins free of errors (7.2.7.2). If a cause still exists, the node sends its message again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum

from axisbus.cia301.emcy import Emcy

TOGETHER = 0.1  # seconds after the first message
HISTORY = 32
LOGGED = 64  # messages, of all incidents
MESSAGES = 32  # of one incident; messages beyond these are only counted


class IncidentState(Enum):
    """State of an incident."""

    UNRESOLVED = "unresolved"
    RECOVERED = "recovered"


@dataclass(frozen=True, slots=True)
class Incident:
    """One incident of a node; times in seconds of the messages' clock.

    ``emcys`` are the fault and the messages that came with it, ``resets`` the error resets that followed. ``ended`` is None while
    the incident is unresolved. ``rebooted`` is True if a boot-up of the node ended it. ``more`` counts the messages beyond the
    first 32.
    """

    number: int
    emcys: tuple[Emcy, ...]
    resets: tuple[Emcy, ...] = ()
    ended: float | None = None
    rebooted: bool = False
    more: int = 0

    @property
    def began(self) -> float:
        """Time of the first message."""
        return self.emcys[0].stamp

    @property
    def fault(self) -> Emcy:
        """The message that began the incident."""
        return self.emcys[0]

    @property
    def codes(self) -> tuple[int, ...]:
        """The error codes, each once, in the order of reception."""
        return tuple(dict.fromkeys(emcy.code for emcy in self.emcys))

    @property
    def outcome(self) -> IncidentState:
        """Whether the node has recovered."""
        return IncidentState.UNRESOLVED if self.ended is None else IncidentState.RECOVERED

    @property
    def lasted(self) -> float | None:
        """Seconds from the fault to the recovery, None while unresolved."""
        return None if self.ended is None else self.ended - self.began

    def joined_by(self, emcy: Emcy) -> Incident:
        """Return the incident with one more message."""
        if len(self.emcys) + len(self.resets) >= MESSAGES:
            resolved = emcy.stamp if emcy.is_reset and not emcy.register else None
            return replace(self, more=self.more + 1, ended=resolved)
        if not emcy.is_reset:
            return replace(self, emcys=(*self.emcys, emcy))
        return replace(self, resets=(*self.resets, emcy), ended=None if emcy.register else emcy.stamp)


class Incidents:
    """The incidents of one node; holds state: the newest ``HISTORY`` (``len`` and iteration: oldest first).

    ``note`` and ``booted`` are for one thread; iterating is safe in any.
    """

    def __init__(self) -> None:
        self._incidents: tuple[Incident, ...] = ()
        self._count = 0

    def __iter__(self) -> Iterator[Incident]:
        return iter(self._incidents)

    def __len__(self) -> int:
        return len(self._incidents)

    @property
    def open(self) -> tuple[Incident, ...]:
        """The unresolved incidents."""
        return tuple(incident for incident in self._incidents if incident.ended is None)

    def note(self, emcy: Emcy) -> None:
        """Add a message; call in the order of reception."""
        if emcy.is_reset:
            self._incidents = tuple(
                incident.joined_by(emcy) if incident.ended is None else incident
                for incident in self._incidents
            )
            return
        last = self._incidents[-1] if self._incidents else None
        if last is not None and last.ended is None and emcy.stamp - last.began <= TOGETHER:
            self._incidents = (*self._incidents[:-1], last.joined_by(emcy))
            return
        self._count += 1
        self._incidents = (*self._incidents, Incident(self._count, (emcy,)))[-HISTORY:]

    def booted(self, stamp: float) -> None:
        """Resolve the open incidents: the node sent a boot-up message at ``stamp`` (seconds)."""
        self._incidents = tuple(
            replace(incident, ended=stamp, rebooted=True) if incident.ended is None else incident
            for incident in self._incidents
        )


class EmcyLog:
    """Emergency messages of a node; holds state: the newest 64 messages (``history``, oldest first), and their incidents."""

    def __init__(self) -> None:
        self.history: deque[Emcy] = deque(maxlen=LOGGED)
        self.incidents = Incidents()

    def note(self, emcy: Emcy) -> None:
        """Add a message; call in the order of reception."""
        self.history.append(emcy)
        self.incidents.note(emcy)


def group(emcys: Iterable[Emcy]) -> tuple[Incident, ...]:
    """Return the incidents of recorded messages, given in the order of reception."""
    incidents = Incidents()
    for emcy in emcys:
        incidents.note(emcy)
    return tuple(incidents)
