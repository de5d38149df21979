"""The session with a core in the program's own process."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from datetime import datetime

from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.frame import BusTraffic, CanFrame
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia402.port import Waiter
from axisbus.core.runtime import Runtime
from axisbus.core.scan import Scan
from axisbus.errors import with_alarm
from axisbus.motion.command_status import ENDED, CommandStatus, Status
from axisbus.motion.commands import ControllerOutput
from axisbus.motion.io import IoReading
from axisbus.motion.point_stream.commands import AddPoints
from axisbus.motion.snapshot import Snapshot
from axisbus.session import (
    AnyCommand,
    AxisFacts,
    ClientProgram,
    CommandEvent,
    CommandSeen,
    LatenessReport,
    Observer,
    OnFrames,
    Target,
)

PARTS = (
    AddPoints,
    ControllerOutput,
)  # parts of active commands: not commands of their own, and too many to log


class InProcess:
    """A ``MachineSession`` with the scan of this process; holds the listeners for command events."""

    def __init__(self, scan: Scan, waiter: Waiter, runtime: Runtime) -> None:
        """``waiter``: how this process waits for ``scan``; ``runtime``: the runtime of the scan."""
        self._scan = scan
        self._runtime = runtime
        self._waiter = waiter
        self._listeners: tuple[Callable[[CommandEvent], None], ...] = ()
        self._taps: dict[OnFrames, Callable[[CanFrame], None]] = {}
        self._command_log = CommandLog(lambda: scan.cycle.now())

    @property
    def axes(self) -> Mapping[str, AxisFacts]:
        """The axes of the scan."""
        return {name: AxisFacts(core.parameters, core.capabilities) for name, core in self._scan.axes.items()}

    @property
    def snapshots(self) -> Mapping[str, Snapshot]:
        """As ``AxisSession.snapshots``."""
        return self._scan.snapshots

    @property
    def readings(self) -> Mapping[str, IoReading]:
        """As ``MachineSession.readings``."""
        return self._scan.io.readings

    @property
    def dead(self) -> str | None:
        """As ``AxisSession.dead``."""
        return self._scan.dead

    @property
    def silent(self) -> str | None:
        """As ``AxisSession.silent``."""
        return self._scan.silent

    @property
    def ended(self) -> bool:
        """As ``AxisSession.ended``."""
        return self._scan.ended

    @property
    def failed(self) -> bool:
        """As ``AxisSession.failed``."""
        return self._scan.failure is not None

    @property
    def leaving_because(self) -> str | None:
        """As ``AxisSession.leaving_because``."""
        return self._scan.leaving_because

    @property
    def left(self) -> tuple[float, str] | None:
        """As ``MachineSession.left``."""
        reason = self._scan.leaving_because
        return None if reason is None else (self._scan.leaving_since, reason)

    @property
    def node_events(self) -> list[NodeEvent]:
        """As ``MachineSession.node_events``."""
        logs = [parts.events for parts in self._runtime.nodes.values() if parts.events is not None]
        return [event for log in logs for event in log.events] + list(self._runtime.link.other_masters())

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """As ``MachineSession.bus_events``."""
        return list(self._runtime.link.incidents())

    @property
    def commands(self) -> list[CommandSeen]:
        """As ``MachineSession.commands``."""
        return self._command_log.seen

    @property
    def drops(self) -> tuple[Drop, ...]:
        """As ``MachineSession.drops``."""
        return tuple(self._runtime.link.drops())

    @property
    def sdo_counts(self) -> tuple[SdoCount, ...]:
        """As ``MachineSession.sdo_counts``."""
        return tuple(self._runtime.link.sdo_counts())

    @property
    def bus_time(self) -> datetime | None:
        """As ``MachineSession.bus_time``."""
        return self._runtime.link.bus_time(self._runtime.link.clock.now())

    @property
    def carried(self) -> BusTraffic | None:
        """As ``MachineSession.carried``."""
        return self._runtime.link.carried()

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """As ``MachineSession.programs``."""
        return ()

    @property
    def has_control(self) -> bool:
        """As ``MachineSession.has_control``."""
        return True

    def take_control(self) -> None:
        """As ``MachineSession.take_control``."""

    @property
    def lateness(self) -> LatenessReport:
        """As ``AxisSession.lateness``."""
        return self._scan.lateness.report()

    @property
    def waiter(self) -> Waiter:
        """As ``AxisSession.waiter``."""
        return self._waiter

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> int:
        """As ``AxisSession.submit``."""
        if not isinstance(command, PARTS):
            self._command_log.add(number, name)  # before it may end
        queued_number = self._scan.submit(target, command, CommandStatus(name, self._report, number)).number
        if queued_number != number:
            self._command_log.retract(number)
        return queued_number

    def listen(self, callback: Callable[[CommandEvent], None]) -> None:
        """As ``AxisSession.listen``."""
        self._listeners = (*self._listeners, callback)

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """As ``AxisSession.add_group``."""
        self._scan.add_group(key, members)

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """As ``AxisSession.request_stop``."""
        self._scan.request_stop(reason, quick)

    def request_halt(self, reason: str, number: int) -> None:
        """As ``AxisSession.request_halt``."""
        self._scan.request_halt(reason, number)

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """As ``AxisSession.hold_to_run``."""
        self._scan.hold_to_run(seconds, "its program", continuous)

    def observe(self, observer: Observer) -> None:
        """As ``AxisSession.observe``."""
        self._scan.observers.append(observer)

    def forget(self, observer: Observer) -> None:
        """As ``AxisSession.forget``."""
        self._scan.observers.remove(observer)

    def tap(self, callback: OnFrames, can_ids: Collection[int] = ()) -> None:
        """As ``MachineSession.tap``; in the thread that has the frame."""
        wanted = frozenset(can_ids)

        def handler(frame: CanFrame) -> None:
            if not wanted or frame.can_id in wanted:
                callback((frame,))

        self._taps[callback] = handler
        self._runtime.link.tap(handler)

    def untap(self, callback: OnFrames) -> None:
        """As ``MachineSession.untap``."""
        handler = self._taps.pop(callback, None)
        if handler is not None:
            self._runtime.link.untap(handler)

    def _report(self, ticket: CommandStatus) -> None:
        event = CommandEvent(ticket.number, ticket.status, ticket.error, ticket.note, ticket.capture)
        self._command_log.note(event)
        for callback in self._listeners:
            callback(event)


# -- The last commands of a core, from any program, with their results -------------------------------------------------


_HISTORY = 256


class CommandLog:
    """Holds the commands by their numbers, oldest first. Every method may be called in any thread; none waits for another."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """``clock`` returns the time of the cycles, in seconds."""
        self._clock = clock
        self._seen: dict[int, CommandSeen] = {}

    @property
    def seen(self) -> list[CommandSeen]:
        """All stored commands, oldest first."""
        return list(self._seen.values())

    def add(self, number: int, name: str) -> None:
        """Store a command before it is submitted; if there are too many, remove the oldest."""
        self._seen[number] = CommandSeen(self._clock(), name, Status.BUSY)
        if len(self._seen) > _HISTORY:
            for oldest in list(self._seen)[:-_HISTORY]:
                self._seen.pop(oldest, None)

    def retract(self, number: int) -> None:
        """Remove a command that was not submitted, because the same one is already queued."""
        self._seen.pop(number, None)

    def note(self, event: CommandEvent) -> None:
        """Store a change of a command's status."""
        seen = self._seen.get(event.number)
        if seen is not None:
            ended = self._clock() if event.status in ENDED else None
            error = "" if event.error is None else with_alarm(event.error.message, event.error)
            self._seen[event.number] = seen._replace(status=event.status, ended=ended, error=error)
