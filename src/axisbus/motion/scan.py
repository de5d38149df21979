"""The scan: one loop per bus that reads every axis, steps it, and sends what it wants, at a fixed period.

Theory of operation
-------------------
One cycle (``once``) is: wait for the grid, take the commands, then for each axis read, step, write; then commit, SYNC, heartbeat.

- **One writer.** Only the scan touches cores and ports. Other threads put commands into a queue (``submit``) and read snapshots.
- **Absolute grid.** Cycle k belongs to t0 + k * period. A late cycle is done late, the missed ones are skipped and counted, never
  caught up in a burst: between two cycles there is always half a period or more. Motion advances one period per executed cycle,
  so a late axis is late and does not jump.
- **It dies loudly.** Whatever ends the loop ends every handle with a reason, after a quick stop of all drives.

In virtual time the same ``once`` is pumped by whoever waits (``PumpWaiter``); in real time ``run`` does it in a thread.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from axisbus.cia402.port import Cycle, Port
from axisbus.errors import AxisbusError, ScanError, StateError
from axisbus.motion.accept import accept
from axisbus.motion.commands import Command, PolicyStop, Shutdown
from axisbus.motion.core import AxisCore
from axisbus.motion.group import GroupCommand, GroupCore
from axisbus.motion.handle import NOBODY, Handle, Status, ThreadWaiter
from axisbus.motion.policy import FaultPolicy
from axisbus.motion.snapshot import Snapshot

Observer = Callable[[float, Mapping[str, Snapshot]], None]


class Lateness:
    """How late the cycles were, in seconds; a handful of numbers, no history."""

    __slots__ = ("cycles", "last", "skipped", "total", "worst")

    def __init__(self) -> None:
        self.cycles = 0
        self.skipped = 0
        self.last = 0.0
        self.worst = 0.0
        self.total = 0.0

    def note(self, late: float) -> None:
        """Count one cycle."""
        self.cycles += 1
        self.last = late
        self.total += late
        if late > self.worst:
            self.worst = late


class Scan:
    """The loop over one bus; owns the cores and groups of its axes."""

    def __init__(
        self,
        cycle: Cycle,
        ports: Mapping[str, Port],
        axes: Mapping[str, AxisCore],
        period: float,
        groups: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        """``ports`` and ``axes`` have the same names; ``period`` in seconds; ``groups``: the axes of each group by its name."""
        self.cycle = cycle
        self.axes = dict(axes)
        self.period = period
        self.groups = {
            name: GroupCore(name, {axis: self.axes[axis] for axis in members}, period)
            for name, members in (groups or {}).items()
        }
        self.lateness = Lateness()
        self.snapshots: dict[str, Snapshot] = {}
        self.observers: list[Observer] = []
        self.failure: BaseException | None = None
        self.ended = False
        self.waiter: ThreadWaiter | None = None
        self._work = [(name, ports[name], core) for name, core in self.axes.items()]
        self._policy = FaultPolicy(tuple(self.axes), groups or {})
        self._queue: deque[tuple[str, Command | GroupCommand, Handle]] = deque()
        self._next: float | None = None
        self._stop_requests: deque[tuple[str, bool]] = deque()
        self._stops_wanted = 0
        self._stops_begun = 0
        self._stopping: list[Handle] = []
        self._quitting = False
        self._refusing = False
        self._lock = threading.Lock()

    # -- for other threads -------------------------------------------------------------------------------------------

    def submit(self, name: str, command: Command | GroupCommand, handle: Handle) -> None:
        """Queue a command for the axis or group ``name``; it is taken in the next cycle. Does not block."""
        with self._lock:
            if not self.ended and not self._refusing:
                self._queue.append((name, command, handle))
                return
        handle.finish(Status.ERROR, self._refusal(handle.name))

    def add_group(self, name: str, members: Sequence[str]) -> None:
        """Make a group of axes that cell.toml does not name; the fault policy does not know it."""
        group = GroupCore(name, {axis: self.axes[axis] for axis in members}, self.period)
        self.groups = {**self.groups, name: group}

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """Ask for the stop of everything that this program has commanded; safe in a signal handler. Does not block."""
        self._stop_requests.append((reason, quick))
        self._stops_wanted += 1

    def refuse_commands(self) -> None:
        """Take no more commands, also none that wait: from here on there is only the way out. Does not block."""
        with self._lock:
            self._refusing = True
            queued, self._queue = list(self._queue), deque()
        for _, _, handle in queued:
            handle.finish(Status.ERROR, self._refusal(handle.name))

    @property
    def has_stopped(self) -> bool:
        """Whether every stop that was asked for has come to its end (or the scan has)."""
        if self.ended:
            return True
        return self._stops_begun >= self._stops_wanted and not any(handle.busy for handle in self._stopping)

    def quit(self) -> None:
        """End ``run`` after the present cycle."""
        self._quitting = True

    # -- the loop ----------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Cycle until ``quit``; for a thread of its own. Whatever goes wrong ends in ``self.failure``."""
        try:
            while not self._quitting and not self.ended:
                self.once()
        except BaseException as error:  # noqa: BLE001  # a dead scan must stop the drives, whatever killed it
            self.failure = error
        finally:
            self.end()

    def once(self) -> None:
        """Do one cycle. Raises what the bus raises (``BusError``)."""
        cycle = self.cycle
        now = self._wait(cycle)
        self._take_commands()
        for group in self.groups.values():
            group.step()
        for name, port, core in self._work:
            port.write(core.step(port.read(now)))
            self.snapshots[name] = core.snapshot()
        cycle.commit()
        if self.ended:  # the supervisor has taken over while a frame was stuck: nothing may follow it
            return
        cycle.sync()
        cycle.heartbeat()
        self._apply_policy()
        self._wake()
        for observer in self.observers:
            observer(now, self.snapshots)

    def end(self) -> None:
        """End every handle; quick-stop all drives first if the scan failed. When repeated, only the quick stop is."""
        if self.failure is not None:
            self.cycle.quick_stop_all()
        with self._lock:
            self.ended = True
            queued, self._queue = list(self._queue), deque()
        for _, _, handle in queued:
            handle.finish(Status.ERROR, self._end_error(handle.name))
        for core in self.axes.values():
            core.abandon(self._end_error(f"{core.parameters.name}'s command"))
        for group in self.groups.values():
            group.abandon(self._end_error(f"{group.name}'s command"))
        if self.waiter is not None:
            self.waiter.notify()

    def stop_failures(self) -> list[AxisbusError]:
        """Return why axes could not be stopped as asked; empty when all went well."""
        return [error for handle in self._stopping if (error := handle.exception()) is not None]

    def _refusal(self, what: str) -> AxisbusError:
        if self.ended:
            return self._end_error(what)
        return StateError(f"{what}: the machine is being closed", remedy="open it again")

    def _end_error(self, what: str) -> AxisbusError:
        if self.failure is None:
            return ScanError(f"{what} was ended: the machine was closed", remedy="open it again to go on")
        return ScanError(
            f"{what} was ended: the scan of the bus has failed",
            observed=f"{type(self.failure).__name__}: {self.failure}",
            remedy="all drives were sent a quick stop; make sure that they stand, mend the cause, and open the machine again",
        )

    def _wait(self, cycle: Cycle) -> float:
        """Wait for the next point of the grid; skip and count those that have passed, or lie less than half a period ahead.

        Two cycles close together would be a burst: two SYNCs within a fraction of the time that the drives interpolate over.
        """
        if self._next is None:
            self._next = cycle.now()
        due = cycle.wait_until(self._next)
        if due is not None:  # another device's SYNC is the grid, so its clock is the one that counts
            self.lateness.skipped += max(0, int((due - self._next) / self.period + 0.5))
            self._next = due
        now = cycle.now()
        late = now - self._next
        self.lateness.note(late)
        missed = int(late / self.period + 0.5)
        self.lateness.skipped += missed
        self._next += (1 + missed) * self.period
        return now

    def _take_commands(self) -> None:
        while self._stop_requests:
            self._stopping = self._stop_all(*self._stop_requests.popleft())
            self._stops_begun += 1
        while self._queue:
            name, command, handle = self._queue.popleft()
            if name in self.axes:
                accept(self.axes[name], command, handle)  # type: ignore[arg-type]  # axes get axis commands
            else:
                self.groups[name].accept(command, handle)  # type: ignore[arg-type]

    def _stop_all(self, reason: str, quick: bool) -> list[Handle]:
        """Let the stop ladder run on every axis that this program has commanded; return its handles."""
        handles = []
        for name, core in self.axes.items():
            handle = Handle(f"{name}.stop ({reason})", NOBODY)
            accept(core, Shutdown(reason, quick), handle)
            handles.append(handle)
        return handles

    def _apply_policy(self) -> None:
        tripped = [name for name, core in self.axes.items() if core.tripped is not None]
        if not tripped:
            return
        for name, cause in self._policy.all_stops(tripped).items():
            reason = f"{name} was stopped because {self.axes[cause].tripped.message}"  # type: ignore[union-attr]
            accept(self.axes[name], PolicyStop(reason), Handle(f"{name}.stop", NOBODY))

    def _wake(self) -> None:
        ended = False
        for core in self.axes.values():
            if core.has_ended:
                ended = True
                core.has_ended = False
        for group in self.groups.values():
            ended = group.take_ended() or ended
        if ended and self.waiter is not None:
            self.waiter.notify()


class PumpWaiter:
    """Waiting in virtual time: the scan is pumped by whoever waits."""

    def __init__(self, scan: Scan) -> None:
        self._scan = scan

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Pump the scan until ``done()`` or until ``timeout`` seconds of virtual time have passed; see ``Waiter``."""
        until = None if timeout is None else self._scan.cycle.now() + timeout
        while not done() and not self._scan.ended:
            if until is not None and self._scan.cycle.now() >= until:
                break
            self.pump()
        return done()

    def pump(self) -> None:
        """Do one cycle; a failing scan ends every handle and raises here."""
        scan = self._scan
        if scan.ended:
            return
        try:
            scan.once()
        except BaseException as error:
            scan.failure = error
            scan.end()
            if not isinstance(error, AxisbusError):
                raise
