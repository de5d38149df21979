"""TIME on the bus (CiA 301 7.2.6): sent by the master periodically, or received from another producer."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

from axisbus.bus.link.channel import Channel
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.timeofday import TimeOfDay, parse


def utc_now() -> datetime:
    """Return the computer's time."""
    return datetime.now(UTC)


class TimeProducer:
    """Sends the computer's time in UTC; holds state: when TIME is due."""

    def __init__(
        self,
        channel: Channel,
        period: float,
        cob_id: int = cob.TIME,
        wall_clock: Callable[[], datetime] = utc_now,
    ) -> None:
        """``period`` in seconds; ``cob_id`` is that of the nodes' 1012h."""
        self._channel = channel
        self._period = period
        self._cob_id = cob_id
        self._wall_clock = wall_clock
        self._due = float("-inf")

    def step(self, now: float) -> None:
        """Send TIME if it is due; ``now`` in seconds of any steady clock.

        Raises:
            BusError: the channel refuses.
        """
        if now < self._due:
            return
        due = self._due + self._period
        self._due = due if due > now else now + self._period
        self._channel.send(self._cob_id, TimeOfDay.of(self._wall_clock()).encode())


class TimeConsumer:
    """Receiver of TIME; holds state: the newest message with its receipt time. ``malformed`` counts invalid messages."""

    def __init__(self, channel: Channel, cob_id: int = cob.TIME) -> None:
        self.malformed = 0
        self._channel = channel
        self._cob_id = cob_id
        self._latest: tuple[TimeOfDay, float] | None = None
        channel.subscribe(cob_id, self._on_frame)

    @property
    def latest(self) -> tuple[TimeOfDay, float] | None:
        """The newest message and its receipt time (seconds, monotonic); None if there is none."""
        return self._latest

    def at(self, now: float) -> datetime | None:
        """Return the time of the producer's clock at ``now`` (seconds, monotonic), in UTC; None if no TIME has come."""
        latest = self._latest
        return None if latest is None else latest[0].moment + timedelta(seconds=now - latest[1])

    def close(self) -> None:
        """Stop listening."""
        self._channel.unsubscribe(self._cob_id, self._on_frame)

    def _on_frame(self, data: bytes, stamp: float) -> None:
        time = parse(data)
        if time is None:
            self.malformed += 1
            self._channel.drops.note(DropReason.TIME, None, stamp, self._cob_id, data)
        else:
            self._latest = (time, stamp)
