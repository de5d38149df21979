"""Listen to the SYNC of another producer, which then starts each cycle of the scan."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

from axisbus.bus.link.channel import Channel
from axisbus.cia301 import cob, sync
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.sync import SyncWatch
from axisbus.cia301.timeofday import TimeOfDay, parse
from axisbus.cpu_starvation import REMEDY, Starvation
from axisbus.errors import BusError, SyncError
from axisbus.wording import counted

_SLICE = 0.05  # seconds between two checks of the channel
FIRST_PATIENCE = 3.0  # seconds that the producer may take to begin


class SyncConsumer:
    """Receiver of SYNC; holds state: the receipt times of SYNCs not yet used.

    ``wait`` and ``await_steady`` are for one thread, the scan's. If SYNC fails, stopping does not need it: the quick stop is also
    sent by SDO, and the rest of the stop sequence by SDO and NMT.
    """

    def __init__(
        self,
        channel: Channel,
        cob_id: int,
        period: float,
        patience: float | None = None,
    ) -> None:
        """Listen; ``period`` and ``patience`` in seconds, see ``SyncWatch``."""
        self.cob_id = cob_id
        self._watch = SyncWatch(period, patience)
        self._channel = channel
        self._clock = channel.clock.now
        self._changed = channel.clock.condition()
        self._stamps: list[float] = []  # of the SYNCs not yet used
        self._starvation = Starvation()
        channel.subscribe(cob_id, self._on_frame)

    @property
    def skipped(self) -> int:
        """Number of SYNCs that began no cycle, because the cycle before was not finished or they came too close together."""
        return self._watch.skipped

    def await_steady(self, timeout: float = FIRST_PATIENCE) -> float:
        """Wait until SYNC comes, and return its measured period in seconds; blocks up to ``timeout`` seconds.

        Raises:
            SyncError: no SYNC is received, or its period is not that of the master.
            BusError: the channel failed.
        """
        deadline = self._clock() + timeout
        with self._changed:
            self._stamps.clear()
            while True:
                newest = self._stamps[-1 - sync.MEASURED :]
                measured = sync.measured_period(newest) if len(newest) > sync.MEASURED else None
                if measured is not None and sync.fits(measured, self._watch.period):
                    self._stamps.clear()
                    return measured
                if self._clock() > deadline:
                    raise (
                        self._absent(len(newest), timeout)
                        if measured is None
                        else self._other_period(measured)
                    )
                self._channel.check()
                self._changed.wait(_SLICE)

    def wait(self) -> float:
        """Wait for the SYNC that begins the next cycle and return its time in seconds; blocks at most until it counts as missing.

        Raises:
            SyncError: it is missing, or comes too fast.
            BusError: the channel failed.
        """
        excused = False
        while True:
            stamps = self._take(self._watch.deadline)
            if stamps:
                if self._watch.take(stamps[-1], len(stamps)):
                    break
                continue
            now, deadline = self._clock(), self._watch.deadline
            if deadline is None or now < deadline:
                continue
            if excused or now - deadline < self._watch.period / 2:
                raise self._missing(now, deadline)
            excused = True  # the scan itself is late: SYNCs that came meanwhile may still wait to be read
            self._take(now + self._watch.period / 2, keep=True)
        too_fast = self._watch.too_fast
        if too_fast is not None:
            raise self._other_period(too_fast)
        return stamps[-1]

    def close(self) -> None:
        """Stop listening."""
        self._channel.unsubscribe(self.cob_id, self._on_frame)

    def _take(self, deadline: float | None, keep: bool = False) -> list[float]:
        """Return the received SYNCs as soon as there is one; empty after ``deadline`` or after a slice of time."""
        self._channel.check()
        with self._changed:
            if not self._stamps:
                left = _SLICE if deadline is None else deadline - self._clock()
                self._wait(min(max(left, 0.0), _SLICE))
            stamps = list(self._stamps)
            if not keep:
                self._stamps.clear()
        return stamps

    def _wait(self, seconds: float) -> None:
        """Wait for a SYNC; if the wait ends far too late, note a lack of processor time, which is no fault of the producer."""
        began = self._clock()
        self._changed.wait(seconds)
        late = self._clock() - began - seconds
        if late > _SLICE / 2:
            self._starvation.note(self._clock(), late)

    def _on_frame(self, data: bytes, stamp: float) -> None:
        if len(data) > sync.LONGEST:  # only the counter is permitted (CiA 301 7.2.5)
            self._channel.drops.note(DropReason.SYNC, None, stamp, self.cob_id, data)
            return
        with self._changed:
            self._stamps.append(stamp)
            del self._stamps[: -4 * sync.WINDOW]
            self._changed.notify()

    def _absent(self, count: int, timeout: float) -> BusError:
        seen = counted(count, "SYNC") if count else "none"
        return SyncError(
            f"no steady SYNC on {self.cob_id:03X}h, which another device must send",
            observed=f"{seen} within {timeout:g} s",
            remedy='start its producer (1005h bit 30, 1006h), correct sync_cob_id, or write sync_producer = "master"',
        )

    def _other_period(self, measured: float) -> BusError:
        period = self._watch.period
        return SyncError(
            f"SYNC comes every {measured * 1000:.3g} ms, but scan_period is {period * 1000:g} ms",
            observed="the axes would move at a speed other than commanded",
            remedy=f'write scan_period = "{measured * 1000:.3g}ms", or set 1006h of the producer to {period * 1e6:.0f}',
        )

    def _missing(self, now: float, deadline: float) -> BusError:
        since = deadline - self._watch.patience
        remedy = "check the device that sends SYNC (lost, stopped, reset?); sync_timeout in [bus] allows it more time"
        starved = self._starvation.text(now)
        return SyncError(
            f"{starved}, and SYNC was not received" if starved else "SYNC of the other producer is missing",
            observed=f"none on {self.cob_id:03X}h for {(now - since) * 1000:.1f} ms, expected within "
            f"{self._watch.patience * 1000:g} ms",
            remedy=f"{REMEDY}; if it is still missing: {remedy}" if starved else remedy,
        )


# -- TIME on the bus (CiA 301 7.2.6): sent by the master periodically, or received from another producer ---------------


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
