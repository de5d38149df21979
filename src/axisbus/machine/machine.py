"""The machine: a cell opened, booted, scanned, and stopped again on every way out."""

from __future__ import annotations

import asyncio
import atexit
import gc
import itertools
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from types import TracebackType

from axisbus.boot.node import Booted
from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.link.inherited import disown_in_children
from axisbus.bus.node.events import BAD, NodeEvent
from axisbus.cell.model import CellConfig
from axisbus.check.checked import checked
from axisbus.cia301.drops import Drop
from axisbus.cia402.port import Port, Waiter
from axisbus.core.direct import build_direct
from axisbus.core.node_access import NodeAccess
from axisbus.core.parting import Stopped, lost_without_axes, scan_failure
from axisbus.core.pickup import Pickup
from axisbus.core.runtime import Runtime, load_dictionaries, require_all
from axisbus.core.scan import PumpWaiter, Scan
from axisbus.core.scanthread import ScanThread
from axisbus.core.stand_in import StandIn
from axisbus.errors import AxisbusError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.closing import Closing
from axisbus.machine.exit import EXIT, Leaving
from axisbus.machine.groups import Group
from axisbus.machine.roster import Roster, members
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.handle import ThreadWaiter
from axisbus.motion.stop.leaving import ladder_time
from axisbus.motion.stop.policy import LostNode
from axisbus.sim.device import Device

log = logging.getLogger("axisbus")

_CLOSE_MARGIN = 2.0
_FIRST_VALUES = (
    1.0  # seconds that opening waits for the first answers to SYNC; later ones are the axes' own matter
)


class Machine:
    """A cell of axes. Use it in a ``with`` block: leaving it, by whatever way, stops what this program has moved.

    Iterating yields the axes; ``machine["x"]`` is one by name, ``machine.group("x", "y")`` several that move together,
    ``machine.node(1)`` direct access to a device.
    """

    def __init__(self, cell: CellConfig, runtime: Runtime, realtime: bool) -> None:
        """Use ``Machine.open`` or ``Machine.simulated``."""
        self.cell = cell
        self._runtime = runtime
        self._realtime = realtime
        cores = {
            name: AxisCore(parameters, runtime.ports[name].capabilities)
            for name, parameters in runtime.parameters.items()
        }
        self.scan = Scan(
            runtime.cycle,
            runtime.ports,
            cores,
            cell.bus.scan_period,
            members(cell, cores),
            LostNode(cell.bus.on_lost_node),
        )
        self._pickup = Pickup(runtime.late, self._join)
        self._waiter: Waiter = ThreadWaiter() if realtime else PumpWaiter(self.scan, self._between_cycles)
        self._roster = Roster(cell, runtime.booted, self.scan, self._waiter, runtime.nodes)
        for node_id in runtime.nodes:
            self._watch_node(node_id)
        self._closing = Closing(
            self._leave, self.scan.request_stop, getattr(self._waiter, "is_pumping", None)
        )
        self._thread: ScanThread | None = None
        self._inherited = False  # by a forked child

    @classmethod
    def open(cls, path: str | Path, *, beside: bool = False) -> Machine:
        """Check, open, boot and configure the cell of a ``cell.toml``, and start its scan; energises nothing.

        Blocks until all nodes are up. With ``interface = "sim"`` the nodes are simulated on a private virtual bus, in real time; on
        any other it first listens for another master, at most 0.5 s. ``beside`` opens it all the same (as ``beside`` in ``[bus]``).

        Raises:
            ConfigError, EdsError: the cell file or an EDS is wrong (``axisbus check`` lists everything).
            AdapterError: the bus cannot be opened.
            SecondMasterError: another master is heard on the bus; nothing was sent.
            BootError: a node did not come up (several: an ExceptionGroup of them).
            SyncError: another device is to send SYNC, and does not, or not at scan_period.
        """
        from axisbus.core.wire import build_on_bus

        cell = checked(path, beside)
        dictionaries = load_dictionaries(cell)
        gc.collect()  # now: from the boot-up on, drives and master expect each other's heartbeats
        return cls._start(cell, build_on_bus(cell, dictionaries), realtime=True)

    @classmethod
    def simulated(cls, path: str | Path, devices: Mapping[int, Device] | None = None) -> Machine:
        """Run the same cell on stand-ins without a bus, in virtual time: nothing runs by itself, waiting lets time pass.

        ``devices`` replaces the stand-ins, by node ID. Raises as ``open``.
        """
        cell = checked(path)
        return cls._start(cell, build_direct(cell, load_dictionaries(cell), devices), realtime=False)

    @classmethod
    def _start(cls, cell: CellConfig, runtime: Runtime, realtime: bool) -> Machine:
        try:
            require_all(runtime.booted)
            runtime.ready()
            machine = cls(cell, runtime, realtime)
        except BaseException:
            runtime.leave()
            raise
        try:
            machine._begin()
        except BaseException:  # a signal, as a rule: nobody has the machine yet who could close it
            machine._close("opening it was interrupted")
            EXIT.take()
            raise
        return machine

    # -- what is in it -----------------------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Axis]:
        return iter(self._roster.axes.values())

    def __len__(self) -> int:
        return len(self._roster.axes)

    def __contains__(self, name: object) -> bool:
        return name in self._roster.axes

    def __getitem__(self, name: str) -> Axis:
        """Return the axis ``name``.

        Raises:
            StateError: the cell has no such axis.
        """
        return self._roster[name]

    def __repr__(self) -> str:
        """Tell the cell and its axes, each with its state."""
        axes = ", ".join(f"{name} {self.scan.snapshots[name].state.value}" for name in self.axes)
        return f"<Machine {Path(self.cell.file).name}: {axes}>"

    @property
    def axes(self) -> Mapping[str, Axis]:
        """The axes that are there, by name, in the order of cell.toml."""
        return dict(self._roster.axes)

    @property
    def groups(self) -> Mapping[str, Group]:
        """The groups of cell.toml whose axes are all there, by name."""
        return self._roster.groups

    def group(self, *names: str) -> Group:
        """Return the group of this name in cell.toml, or a group of the axes named, in this order.

        Raises:
            StateError: no such group or axis.
            ArgumentError: an axis is named twice.
        """
        return self._roster.group(names)

    def node(self, node_id: int) -> NodeAccess:
        """Return direct access to a node; raises StateError where the cell has no such node."""
        if node_id not in self._runtime.nodes:
            raise StateError(
                f"the cell has no node {node_id}",
                observed=f"it has {', '.join(map(str, self._runtime.nodes))}",
            )
        return self._runtime.nodes[node_id]

    def stand_in(self, node_id: int) -> StandIn:
        """Return the stand-in of a simulated node: its plant, its dials, and faults on demand.

        Raises:
            StateError: the cell runs on hardware, or has no such node.
        """
        if node_id not in self._runtime.stand_ins:
            raise StateError(
                f"node {node_id} is not simulated here", remedy='stand-ins exist with interface = "sim"'
            )
        return self._runtime.stand_ins[node_id]

    @property
    def is_simulated(self) -> bool:
        """Whether the drives are stand-ins."""
        return bool(self._runtime.stand_ins)

    @property
    def reports(self) -> list[NodeReport]:
        """What boot-up had to say of each node."""
        return [booted.report for booted in self._runtime.booted.values()]

    @property
    def events(self) -> list[NodeEvent | Leaving]:
        """What error control has told of all nodes since the scan began, and why the machine was left; in the order of time."""
        found: list[NodeEvent | Leaving] = [
            event for node in self._runtime.nodes.values() for event in node.events
        ]
        if self.scan.leaving_because is not None:
            found.append(Leaving(self.scan.leaving_since, self.scan.leaving_because))
        return sorted(found, key=lambda event: event.stamp)

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """What the CAN controller has told: error warning, passive, bus-off, restarted; at most the last 64, oldest first.

        While it is bus-off nothing is sent; every axis is in ErrorStop, and stays there after the restart until it is reset.
        Empty without a bus, and with adapters that tell nothing.
        """
        return list(self._runtime.bus_events())

    @property
    def dropped(self) -> tuple[Drop, ...]:
        """Frames of this cell's nodes, and of none, that were dropped since it was opened, counted by reason and node.

        Such are PDOs too short for their mapping, answers that nothing was waiting for, malformed messages. What a node sends that
        the cell does not take, such as PDOs that are not configured, is among them. Empty without a bus.
        """
        return tuple(
            drop for drop in self._runtime.drops() if drop.node is None or drop.node in self.cell.nodes
        )

    @property
    def bus_time(self) -> datetime | None:
        """The time of day by another device's TIME messages (CiA 301 7.2.6), in UTC; None where none was heard."""
        return self._runtime.bus_time(time.monotonic())

    def sleep(self, seconds: float) -> None:
        """Let ``seconds`` pass: real ones, or virtual ones in a simulated machine."""
        self._waiter.wait(lambda: False, seconds)

    def _join(self, node_id: int, booted: Booted, ports: Mapping[str, Port]) -> None:
        """Take in an optional node that has come later; what it has to say stands in ``reports``."""
        self._runtime.booted[node_id] = booted
        self._watch_node(node_id)
        if booted.report.ok:
            self._roster.join(booted, ports)

    def _watch_node(self, node_id: int) -> None:
        """A node without axes has nobody else who acts when it is lost."""
        if not any(self.cell.axes_of(node_id)):
            self._runtime.nodes[node_id].on_event(self._node_event)

    def _node_event(self, event: NodeEvent) -> None:
        if event.kind in BAD:
            self.scan.trip(lost_without_axes(event, self.scan.starvation.text(self.scan.cycle.now())))

    # -- running and closing -----------------------------------------------------------------------------------------

    def __enter__(self) -> Machine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        reason = "the with block ended" if error is None else f"{type(error).__name__} ended the with block"
        failures = self._close(reason)
        if error is None or (isinstance(error, Exception) and EXIT.pending is not None):
            self._raise(failures)
        elif error is not None:
            EXIT.take()  # a signal that came meanwhile: the program ends already
            _add_notes(error, failures)

    async def __aenter__(self) -> Machine:
        """Enter as ``with`` does, in an asyncio program; leaving waits in a thread, so that the event loop goes on."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._realtime:  # nothing goes on beside it in virtual time
            self.__exit__(kind, error, trace)
            return
        try:
            await asyncio.to_thread(self.__exit__, kind, error, trace)
        finally:
            EXIT.part(self.scan)  # once more: only the main thread can give signals back

    def close(self) -> None:
        """Stop every axis that this program has enabled or commanded, disable it, and release the bus. Harmless when repeated.

        Blocks until all stand, at most the times of the stop ladders.

        Raises:
            DriveError: an axis could not be stopped as asked (several: an ExceptionGroup).
            ScanError: the scan had failed before.
            KeyboardInterrupt, SystemExit: Ctrl-C or SIGTERM came meanwhile.
        """
        self._raise(self._close("the machine was closed"))

    def _begin(self) -> None:
        if not self._realtime:
            assert isinstance(self._waiter, PumpWaiter)
            self._waiter.pump()
            self._waiter.wait(self._roster.has_values, _FIRST_VALUES)
            EXIT.join(self.scan, listen=False)
            return
        assert isinstance(self._waiter, ThreadWaiter)
        disown_in_children(self)
        self._thread = ScanThread(self.scan, self._waiter, self.cell.bus.sync_timeout)
        self._thread.start()
        self._pickup.start()
        atexit.register(self._at_exit)
        EXIT.join(self.scan, listen=True)
        self._waiter.wait(self._roster.has_values, _FIRST_VALUES)

    def _close(self, reason: str) -> list[AxisbusError]:
        """Close, or wait for whoever closes; return what went wrong. In a forked child there is nothing to be closed."""
        if self._inherited:
            return []
        failures = self._closing.run(reason)
        if self._closing.over:
            EXIT.part(self.scan)  # once more: only the main thread can give signals back
        return failures

    def _leave(self, reason: str) -> list[AxisbusError]:
        rescued: list[Stopped] = []
        try:
            self._stop_axes(reason)
        finally:
            self._pickup.stop()
            self._end_scan()
            if self.scan.failure is not None:
                touched = [name for name, core in self.scan.axes.items() if core.touched]
                rescued = self._runtime.rescue(touched)
            self._runtime.leave(self.scan.axes, rescued)
            EXIT.part(self.scan)
        return self._failures(rescued)

    def _stop_axes(self, reason: str) -> None:
        """Stop, and see that everything stands; what interrupts the wait, such as a user's own signal handler, comes after it."""
        times = [ladder_time(core.parameters.stop_times) for core in self.scan.axes.values()]
        until = self.scan.cycle.now() + max(times, default=0.0) + _CLOSE_MARGIN
        self.scan.request_stop(reason)
        interruption: BaseException | None = None
        while not self.scan.has_stopped and self.scan.cycle.now() < until:
            try:
                self._waiter.wait(lambda: self.scan.has_stopped, until - self.scan.cycle.now())
            except BaseException as error:  # noqa: BLE001  # it is raised once everything stands
                interruption = error
        if interruption is not None:
            raise interruption

    def _end_scan(self) -> None:
        self.scan.quit()
        if not self._realtime:
            if not self.scan.ended:
                self.scan.end()
            return
        if self._thread is not None:
            self._thread.stop()
        atexit.unregister(self._at_exit)

    def _failures(self, rescued: list[Stopped]) -> list[AxisbusError]:
        if self.scan.failure is not None:
            return [scan_failure(self.scan.failure, rescued)]
        return self.scan.stop_failures()

    def _raise(self, failures: list[AxisbusError]) -> None:
        """Raise what a signal left behind while the machine was being closed, else what went wrong."""
        pending = (
            EXIT.take()
        )  # from here on nothing is called that a signal could interrupt, where all went well
        if pending is not None:
            _add_notes(pending, failures)
            raise pending
        if failures:
            _raise(failures)

    def _at_exit(self) -> None:
        for failure in self._close("the program ended"):
            log.error("while the program ended: %s", failure)

    def _between_cycles(self, now: float) -> None:
        """What threads do in real time."""
        self._pickup.look(now)
        self._closing.finish()

    def disown(self) -> None:
        """Be of no use in a forked child, which must neither command nor close what its parent has."""
        self._inherited = True
        self.scan.disown()
        assert isinstance(self._waiter, ThreadWaiter)
        self._waiter.disown()
        atexit.unregister(self._at_exit)


EXIT.keep_within(Machine.__exit__, Machine.close, Machine._close)


def boot(
    path: str | Path,
    progress: Callable[[int, int], None] | None = None,
    on_program: Callable[[int, int, int | None], None] | None = None,
    *,
    beside: bool = False,
) -> list[NodeReport]:
    """Boot the nodes of a cell, let them go again, and return what there is to say of each; energises nothing. Blocks.

    A node that did not come up has its ``error`` in the report. ``progress`` is called with the number of nodes that are through,
    and that of all; ``on_program`` with a node's ID, and the bytes of its new program that have arrived and that there are, in the
    thread of that node. ``beside``: even where another master is heard.

    Raises:
        ConfigError, EdsError, AdapterError, SecondMasterError: as ``Machine.open``.
    """
    from axisbus.core.wire import build_on_bus

    cell = checked(path, beside)
    lock, through = threading.Lock(), itertools.count(1)

    def told(_: Booted) -> None:
        if progress is not None:
            with lock:  # the nodes are booted in parallel
                progress(next(through), len(cell.nodes))

    runtime = build_on_bus(cell, load_dictionaries(cell), told, on_program)
    try:
        return [booted.report for booted in runtime.booted.values()]
    finally:
        runtime.leave()


def _add_notes(error: BaseException, failures: list[AxisbusError]) -> None:
    for failure in failures:
        error.add_note(f"while stopping: {failure}")


def _raise(failures: list[AxisbusError]) -> None:
    if len(failures) == 1:
        raise failures[0]
    raise ExceptionGroup("not everything could be stopped as asked", failures)
