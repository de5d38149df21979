"""The session with a core in a process of its own (``session.MachineSession``): commands as messages, values from shared memory."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from datetime import datetime

from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.frame import BusTraffic
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia402.port import Waiter
from axisbus.core.command_queue import is_stop
from axisbus.core.inprocess import PARTS
from axisbus.core.lateness import hang_text
from axisbus.core.process.rpc_client import RpcClient, ended_error
from axisbus.core.process.shared_counters import SharedCounters
from axisbus.core.process.trajectory_feeder import Trajectories
from axisbus.core.waiting import ThreadWaiter, inherited
from axisbus.errors import AxisbusError, StateError
from axisbus.interrupt_guard import sheltered
from axisbus.ipc import messages as m
from axisbus.ipc.frames import unpacked
from axisbus.ipc.image import ImageReader
from axisbus.ipc.io_image import IoImage
from axisbus.ipc.rate import COMMAND_BURST, COMMAND_RATE, Bucket
from axisbus.motion.command_status import ENDED, Status
from axisbus.motion.io import IoReading
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

log = logging.getLogger("axisbus")
_ERRORS = 64  # of each axis, which are stored
_PATIENCE = 0.5  # seconds within which an error must follow its number
_CORE_ENDED = "the core of this machine has ended"


def _rate_error(what: str) -> StateError:
    return StateError(
        f"{what}: this program gives commands too fast",
        observed=f"a program that has joined may give {COMMAND_BURST:g} commands at once, and {COMMAND_RATE:g} per second; "
        "stops are always accepted",
        remedy="wait for the handles of commands before you give more, and add a short sleep to a loop that gives commands",
    )


class Errors:
    """The errors that images contain by number; holds the newest of each axis: a client can run for years."""

    def __init__(self) -> None:
        self._found: dict[int, AxisbusError] = {}
        self._numbers: dict[str, deque[int]] = {}  # of each axis, oldest first
        self._arrived = threading.Condition()

    def take(self, message: m.ErrorMessage) -> None:
        """Store an error, and wake the waiting threads."""
        with self._arrived:
            numbers = self._numbers.setdefault(message.axis, deque())
            if message.number not in self._found:
                numbers.append(message.number)
            self._found[message.number] = message.error
            if len(numbers) > _ERRORS:
                self._found.pop(numbers.popleft(), None)
            self._arrived.notify_all()

    @sheltered  # the thread that stores the next one uses the condition too
    def of(self, number: int) -> AxisbusError | None:
        """Return an error by its number; blocks until it has arrived, which takes less than a cycle."""
        found = self._found.get(number)
        if found is None:
            with self._arrived:
                self._arrived.wait_for(lambda: number in self._found, _PATIENCE)
            found = self._found.get(number)
        return (
            found
            if found is not None
            else ended_error("the reason for the ErrorStop of this axis was requested")
        )

    def disown(self) -> None:
        """Make this object usable in a forked child, where the thread that held the lock does not run."""
        self._arrived = threading.Condition()


class RemoteSession:
    """Holds the last messages of the core, the listeners, and the active commands."""

    def __init__(
        self,
        rpc: RpcClient,
        image: ImageReader,
        io: IoImage,
        counters: SharedCounters,
        errors: Errors,
        axes: Mapping[str, AxisFacts],
        period: float,
        *,
        joined: bool = False,
    ) -> None:
        """``axes``: the present axes; ``period``: of the scan, in seconds; ``joined``: to the machine of another program."""
        self._rpc = rpc
        self._image = image
        self._io = io
        self._counters = counters
        self._errors = errors
        self._axes = dict(axes)
        self._period = period
        self._waiter = ThreadWaiter()
        self._waiter.callback_thread = rpc.events
        self.trajectories = Trajectories(rpc.send, period)
        self._condition = m.CoreCondition()
        self._listeners: tuple[Callable[[CommandEvent], None], ...] = ()
        self._observers: tuple[Observer, ...] = ()
        self._taps: dict[OnFrames, frozenset[int]] = {}
        self._busy: dict[int, str] = {}
        self._stop_request: tuple[float, str] | None = None  # the stop requested by this program
        self._inherited = False
        self._rate = Bucket(COMMAND_RATE, COMMAND_BURST) if joined else None
        self._rate_lock = threading.RLock()  # re-entrant: a signal handler may give a command in here

    # -- state of the core ---------------------------------------------------------------------------------------------

    @property
    def axes(self) -> Mapping[str, AxisFacts]:
        """As ``AxisSession.axes``."""
        return self._axes

    @property
    def snapshots(self) -> Mapping[str, Snapshot]:
        """As ``AxisSession.snapshots``."""
        return self._image.read()

    @property
    def readings(self) -> Mapping[str, IoReading]:
        """As ``MachineSession.readings``."""
        return self._io.read()

    @property
    def dead(self) -> str | None:
        """As ``AxisSession.dead``."""
        if self._inherited:
            return "this process was forked from the one that has the machine: nothing is received here"
        if self._condition.dead is None and self._rpc.over and not self._condition.ended:
            rescued = self._rpc.rescued
            return _CORE_ENDED if rescued is None else f"{_CORE_ENDED}: {rescued.why}"
        return self._condition.dead

    @property
    def silent(self) -> str | None:
        """As ``AxisSession.silent``."""
        if self.dead is not None:
            return self.dead
        if self._condition.ended:
            return "the machine is closed: nothing more is received"
        return hang_text(time.monotonic() - self._image.read().time, self._period)

    @property
    def ended(self) -> bool:
        """As ``AxisSession.ended``."""
        return self._condition.ended or self._rpc.over

    @property
    def failed(self) -> bool:
        """As ``AxisSession.failed``."""
        return self._condition.failed or (self._rpc.over and not self._condition.ended)

    @property
    def leaving_because(self) -> str | None:
        """As ``AxisSession.leaving_because``."""
        left = self.left
        return None if left is None else left[1]

    @property
    def left(self) -> tuple[float, str] | None:
        """As ``MachineSession.left``."""
        return self._condition.left or self._stop_request

    @property
    def waiter(self) -> Waiter:
        """As ``AxisSession.waiter``."""
        return self._waiter

    @property
    def lateness(self) -> LatenessReport:
        """As ``AxisSession.lateness``."""
        return self._counters.lateness

    @property
    def carried(self) -> BusTraffic | None:
        """As ``MachineSession.carried``, up to the last cycle."""
        return self._counters.carried

    # -- requests ------------------------------------------------------------------------------------------------------

    @property
    def node_events(self) -> list[NodeEvent]:
        """As ``MachineSession.node_events``; blocks for an answer of the core."""
        return list(self._rpc.ask("node_events"))

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """As ``MachineSession.bus_events``; blocks for an answer of the core."""
        return list(self._rpc.ask("bus_events"))

    @property
    def commands(self) -> list[CommandSeen]:
        """As ``MachineSession.commands``; blocks for an answer of the core."""
        return list(self._rpc.ask("commands"))

    @property
    def drops(self) -> tuple[Drop, ...]:
        """As ``MachineSession.drops``; blocks for an answer of the core."""
        return tuple(self._rpc.ask("drops"))

    @property
    def sdo_counts(self) -> tuple[SdoCount, ...]:
        """As ``MachineSession.sdo_counts``; blocks for an answer of the core."""
        return tuple(self._rpc.ask("sdo_counts"))

    @property
    def bus_time(self) -> datetime | None:
        """As ``MachineSession.bus_time``; blocks for an answer of the core."""
        found: datetime | None = self._rpc.ask("bus_time")
        return found

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """As ``MachineSession.programs``; blocks for an answer of the core."""
        return tuple(self._rpc.ask("programs"))

    @property
    def has_control(self) -> bool:
        """As ``MachineSession.has_control``; blocks for an answer of the core."""
        return bool(self._rpc.ask("has_control"))

    def take_control(self) -> None:
        """As ``MachineSession.take_control``."""
        self._rpc.ask("take_control")

    # -- commands ------------------------------------------------------------------------------------------------------

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> int:
        """As ``AxisSession.submit``; a command that is identical to a queued one ends together with it."""
        if self._inherited:
            raise inherited(name)
        if not is_stop(command) and not isinstance(command, PARTS) and self._is_too_fast():
            self._busy[number] = name
            self.deliver(m.CommandEvents((CommandEvent(number, Status.ERROR, _rate_error(name), ""),)))
            return number
        message = m.CODEC.pack(self.trajectories.submit(number, target, command, name))
        self._busy[number] = name
        self._rpc.send(message)
        if self._rpc.over:
            self.end_all()
        return number

    def _is_too_fast(self) -> bool:
        """Count a command; return whether the core would delay it. Then a later stop would have to wait behind it."""
        if self._rate is None:
            return False
        with self._rate_lock:
            return not self._rate.take(time.monotonic())

    def listen(self, callback: Callable[[CommandEvent], None]) -> None:
        """As ``AxisSession.listen``; in the thread that delivers events."""
        self._listeners = (*self._listeners, callback)

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """As ``AxisSession.add_group``."""
        self._rpc.send(m.AddGroup(key, tuple(members)))

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """As ``AxisSession.request_stop``."""
        self._stop_request = self._stop_request or (time.monotonic(), reason)
        self._rpc.send(m.RequestStop(reason, quick))

    def request_halt(self, reason: str, number: int) -> None:
        """As ``AxisSession.request_halt``."""
        self._rpc.send(m.RequestHalt(reason, number))

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """As ``AxisSession.hold_to_run``."""
        self._rpc.send(m.HoldToRunMessage(seconds, continuous))

    def observe(self, observer: Observer) -> None:
        """As ``AxisSession.observe``; in the thread that delivers events, a few cycles at a time."""
        self._observers = (*self._observers, observer)
        self._rpc.send(m.Observe(True))

    def forget(self, observer: Observer) -> None:
        """As ``AxisSession.forget``."""
        self._observers = tuple(one for one in self._observers if one != observer)
        if not self._observers:
            self._rpc.send(m.Observe(False))

    def tap(self, callback: OnFrames, can_ids: Collection[int] = ()) -> None:
        """As ``MachineSession.tap``; in the thread that delivers events."""
        self._taps = {**self._taps, callback: frozenset(can_ids)}
        self._request_frames()

    def untap(self, callback: OnFrames) -> None:
        """As ``MachineSession.untap``."""
        self._taps = {other: ids for other, ids in self._taps.items() if other != callback}
        self._request_frames()

    def _request_frames(self) -> None:
        sets = self._taps.values()
        all_of_them = tuple(sorted(frozenset().union(*sets))) if all(sets) else ()
        self._rpc.send(m.Tap(bool(self._taps), all_of_them))

    # -- messages of the core ------------------------------------------------------------------------------------------

    def deliver(self, message: m.CommandEvents) -> None:
        """Deliver the command events of a cycle to the listeners."""
        for event in message.events:
            if event.status in ENDED:
                self._busy.pop(event.number, None)
            for callback in self._listeners:
                callback(event)
        self._waiter.notify()

    def deliver_images(self, cycles: m.CycleImages) -> None:
        """Deliver the images of some cycles to the observers."""
        if cycles.lost:
            log.warning(
                "%d cycles are missing in the recording: this program did not read them in time",
                cycles.lost,
            )
        for now, data in cycles.images:
            image = self._image.image(data)
            for observer in self._observers:
                observer(now, image)

    def deliver_frames(self, message: m.Frames) -> None:
        """Deliver frames to the taps."""
        if message.lost:
            log.warning("%d frames are missing: this program did not read them in time", message.lost)
        frames = list(unpacked(message.packed))
        for callback, can_ids in self._taps.items():
            wanted = [frame for frame in frames if not can_ids or frame.can_id in can_ids]
            if wanted:
                callback(wanted)

    def take(self, condition: m.CoreCondition) -> None:
        """Store the condition of the core."""
        self._condition = condition
        self._waiter.notify()

    def join(self, axes: Mapping[str, AxisFacts]) -> None:
        """Add the axes of an optional node that has come up late."""
        self._axes = {**self._axes, **axes}

    def end_all(self) -> None:
        """End every command that the core has not ended, because the core is gone."""
        while self._busy:
            number, name = self._busy.popitem()
            error = self._rpc.ended_error(f"{name} was ended")
            self.deliver(m.CommandEvents((CommandEvent(number, Status.ERROR, error, ""),)))
        self._waiter.notify()

    def disown(self) -> None:
        """Make this object unusable in a forked child."""
        self._inherited = True
        self._waiter.disown()
        self.trajectories.feeder.disown()
        self._errors.disown()
