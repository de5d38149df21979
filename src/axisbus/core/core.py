"""The core: the owner of a bus, which runs the scan over the booted nodes, adds late optional ones, and leaves all of them."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import Enum, auto
from functools import partial
from typing import TYPE_CHECKING, Protocol

from axisbus.boot.objects import Progress
from axisbus.boot.program_facts import ProgramOrder, ProgramWritten, read_programs, require_writable
from axisbus.boot.program_write import write_program
from axisbus.boot.report import Booted
from axisbus.bus.node.events import BAD, NodeEvent
from axisbus.cell.gantry import gantries_of
from axisbus.cell.model import AUTOMATIC, CellConfig
from axisbus.cia302.types import Address
from axisbus.cia401.port import SignalValidity
from axisbus.cia402.ip_as_csp import as_csp_capable
from axisbus.cia402.port import Port, Waiter
from axisbus.clock import Clock, VirtualClock
from axisbus.configuration.replacement import DriveReplacement, find_drives
from axisbus.configuration.replacement_order import (
    FoundDrive,
    ReplacementOrder,
    ReplacementOutcome,
    ReplacementStep,
    Tell,
)
from axisbus.core.inprocess import InProcess
from axisbus.core.io import IoScan, add_io, confirm_safe_outputs, not_safe, unconfirmed
from axisbus.core.late_boot import (
    LEAVE_TIME,
    LateBoot,
    ReturningNode,
    adapter_reopened,
    adapter_reopened_without_boot,
    being_booted,
    being_written,
    boot_interrupted,
    booted_again,
    identity_of,
    not_booted,
    not_written,
    program_not_written,
    program_was_written,
    same_device,
)
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.node_shutdown import ended, lost_without_axes, refused_while_leaving, scan_failure
from axisbus.core.realtime_setup import IN_A_THREAD
from axisbus.core.runtime import Runtime
from axisbus.core.scan import Scan
from axisbus.core.scan_thread import ScanThread
from axisbus.core.virtual_axes import virtual_axes
from axisbus.core.waiting import ThreadWaiter, VirtualWaiter
from axisbus.errors import AdapterError, AxisbusError, ScanError, SecondMasterError, StateError
from axisbus.link import StopResult, Unsafe
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.stop.policy import GroupFault, LostNode
from axisbus.session import MachineSession

if TYPE_CHECKING:
    from axisbus.core.simulated_nodes import SimulatedNode

_CLOSE_MARGIN = 2.0  # seconds
_FIRST_VALUES = 1.0  # seconds for the first answers to SYNC; later ones concern only their axes
_JOIN_TIME = 2.0  # seconds until the scan has added an axis; one cycle is enough
_REOPEN_TIME = 1.0  # seconds for opening a failed adapter again to stop the drives
_REOPEN_PAUSE = 0.05
_OUTPUTS_TIME = 0.5  # seconds until outputs have been sent as safe; a few cycles are enough


Joined = Callable[[Booted], None]
OnStep = Callable[[str], None]


def _nothing() -> None:
    """Do nothing."""


def _ignore(_: object) -> None:
    """Show no step."""


class CoreInterface(Protocol):
    """The owner of one bus: made with its nodes booted, then ``begin``, and ``leave`` at the end."""

    @property
    def session(self) -> MachineSession:
        """A program's connection to the axes."""

    @property
    def booted(self) -> Mapping[int, Booted]:
        """The boot result of each node."""

    @property
    def nodes(self) -> Mapping[int, NodeParts]:
        """The parts for direct access to each node."""

    @property
    def simulated_nodes(self) -> Mapping[int, SimulatedNode]:
        """The simulated drives, if there are any and they can be reached."""

    @property
    def realtime(self) -> bool:
        """Whether it runs in threads of its own, in real time."""

    @property
    def clock(self) -> Clock:
        """The clock of its cycles and of what waits for them."""

    @property
    def outlives_program(self) -> bool:
        """Whether it continues when this process ends."""

    @property
    def real_time_status(self) -> str:
        """The real-time status, as text."""

    @property
    def joined(self) -> bool:
        """Whether another program has opened it."""

    @property
    def commanded_by(self) -> str:
        """The program with control when this program joined; empty if control was free, or this program opened the machine."""

    @property
    def in_cycle(self) -> Callable[[], bool] | None:
        """In virtual time: a function that returns whether the caller is within a cycle."""

    def begin(self, joined: Joined, after_cycle: Callable[[], None] = _nothing) -> None:
        """Start the scan.

        ``joined`` is called for optional nodes that have come up late, ``after_cycle`` between cycles in virtual time.
        """

    def await_values(self) -> None:
        """Block until every axis has its first values since the scan began, or the scan has ended, at most a second."""

    def boot_node(self, node_id: int, on_step: OnStep = _ignore) -> Booted:
        """Boot one node while the scan runs; blocks. Raises StateError, BootError.

        ``on_step`` is called in this thread with the name of each step as it begins.
        """

    def find_replacement(self, node_id: int) -> list[FoundDrive]:
        """Return the drives that may replace that of a node; blocks. Raises StateError, LssError."""

    def replace_drive(self, order: ReplacementOrder, on_step: Tell = _ignore) -> ReplacementOutcome:
        """Configure and boot the new drive of a node while the scan runs; blocks. Raises StateError, BootError and others.

        ``on_step`` is called in this thread as each step begins.
        """

    def write_program(
        self, node_id: int, order: ProgramOrder, progress: Progress | None = None
    ) -> ProgramWritten:
        """Replace the program of one node while the scan runs; blocks. Raises StateError, NodeError."""

    def require_unclaimed(self, node_id: int, what: str) -> None:
        """Check that a node is not being booted and its program not written, for a write or an NMT command. Raises StateError."""

    def reconnect(self) -> list[StopResult]:
        """Open the adapter again after it has failed; blocks. Raises StateError, AdapterError, SecondMasterError."""

    def leave(self, reason: str) -> list[AxisbusError]:
        """Stop every commanded axis, leave each node as appropriate, and return the failures; blocks."""

    def disown(self) -> None:
        """Make this object unusable in a forked child, which must neither command nor close its parent's machine."""


def _needs_rescue(core: AxisCore) -> bool:
    """Whether a drive may keep moving without the scan; a virtual axis cannot."""
    return core.touched and not core.parameters.virtual


class AdapterLoss(Enum):
    """The actions of a core after the failure of its adapter has ended its scan."""

    STOPPING = auto()  # it opens the adapter again, and stops its drives
    STOPPED = auto()  # as far as that was possible
    OVER = auto()  # the scan runs again


class Rescue:
    """The stop of the axes without the scan, done once: when the scan has failed, otherwise when its result is needed."""

    def __init__(self, clock: Clock, stop: Callable[[], list[StopResult]]) -> None:
        """``stop`` stops the axes and returns the result of each; it blocks."""
        self._stop = stop
        self._stopped: list[StopResult] | None = None
        self._clock = clock
        self._lock = clock.lock()

    def begin(self) -> None:
        """Begin in a thread of its own; does not block. While the interpreter ends, no thread can be started."""
        with suppress(RuntimeError):
            self._clock.thread(self.result, "axisbus rescue").start()

    def result(self) -> list[StopResult]:
        """Return the result of each axis; blocks until the stop has ended."""
        with self._lock:
            if self._stopped is None:
                self._stopped = self._stop()
            return self._stopped


def members(cell: CellConfig, present_axes: Iterable[str]) -> dict[str, list[str]]:
    """Return the groups of the cell, each with those of its axes that are in ``present_axes``."""
    present = set(present_axes)
    found = {name: [axis for axis in group.axes if axis in present] for name, group in cell.groups.items()}
    return {name: axes for name, axes in found.items() if axes}


class Core:
    """Holds the runtime of a machine, the scan over it, and the scan's thread; ``session`` is a program's connection to it."""

    joined = outlives_program = False
    commanded_by = ""

    def __init__(self, cell: CellConfig, runtime: Runtime) -> None:
        """In real time the scan gets a thread of its own, in virtual time it runs while the program waits."""
        self.cell = cell
        self.runtime = runtime
        self._joined: Joined = lambda _: None
        self._watched: set[int] = set()  # nodes whose loss stops the cell
        self._booting: set[int] = set()  # nodes, by calls of ``boot_node``
        self._lock = threading.Lock()
        self._reconnecting = threading.Lock()
        # Of a core in a process of its own:
        self.on_adapter_loss: Callable[[AdapterLoss], None] | None = None
        self.on_axes_stopped: Callable[[], None] = _nothing  # by ``leave``, as far as possible
        self._after_cycle: Callable[[], None] = _nothing
        io_scan = IoScan()
        for node_id in runtime.nodes:
            self._take_io(io_scan, node_id)
        virtual = virtual_axes(cell, io_scan)
        ports = as_csp_capable(runtime.ports)
        cores = {
            name: AxisCore(parameters, ports[name].capabilities)
            for name, parameters in runtime.parameters.items()
        }
        cores.update({name: axis.core for name, axis in virtual.items()})
        self.scan = Scan(
            runtime.link.cycle,
            {**ports, **{name: axis.port for name, axis in virtual.items()}},
            cores,
            cell.bus.scan_period,
            members(cell, cores),
            LostNode(cell.bus.on_lost_node),
            {name: GroupFault(group.on_fault) for name, group in cell.groups.items()},
            io_scan,
            gantries_of(cell),
        )
        clock = runtime.link.clock
        self._late_boot = LateBoot(clock, runtime.absent, self._boot_absent, self._returning_nodes())
        self._virtual_waiter: VirtualWaiter | None = None
        if isinstance(clock, VirtualClock):
            self._virtual_waiter = VirtualWaiter(self.scan, clock, lambda: self._after_cycle())
        self._thread_waiter = ThreadWaiter()
        self._waiter: Waiter = self._thread_waiter if self._virtual_waiter is None else self._virtual_waiter
        self._thread: ScanThread | None = None
        self._rescue = Rescue(clock, self._stop_without_scan)
        self.session = InProcess(self.scan, self._waiter, runtime)
        for node_id in runtime.nodes:
            self._watch_node(node_id)
        runtime.link.on_command_of_others(self._commanded_by_others)

    @property
    def realtime(self) -> bool:
        """Whether it runs in threads of its own, in real time."""
        return self._virtual_waiter is None

    @property
    def clock(self) -> Clock:
        """The clock of its cycles and of what waits for them."""
        return self.runtime.link.clock

    @property
    def in_cycle(self) -> Callable[[], bool] | None:
        """In virtual time: a function that returns whether the caller is within a cycle."""
        return None if self._virtual_waiter is None else self._virtual_waiter.is_in_cycle

    @property
    def real_time_status(self) -> str:
        """The real-time status, as text."""
        return IN_A_THREAD if self.realtime else "in virtual time"

    @property
    def booted(self) -> Mapping[int, Booted]:
        """The boot result of each node."""
        return self.runtime.booted

    @property
    def nodes(self) -> Mapping[int, NodeParts]:
        """The parts for direct access to each node."""
        return self.runtime.nodes

    @property
    def simulated_nodes(self) -> Mapping[int, SimulatedNode]:
        """The simulated drives, if there are any here."""
        return self.runtime.simulated_nodes

    def begin(self, joined: Joined, after_cycle: Callable[[], None] = _nothing) -> None:
        """Start the scan.

        ``joined`` is called for optional nodes that have come up late, ``after_cycle`` between cycles in virtual time.
        """
        self._joined, self._after_cycle = joined, after_cycle
        if self._virtual_waiter is not None:
            self._virtual_waiter.begin()
            self._late_boot.start()
            return
        self._start_thread()
        self._late_boot.start()

    def await_values(self) -> None:
        """Block until every axis has its first values since the scan began, or the scan has ended, at most a second."""
        self._await(self.scan.axes, _FIRST_VALUES)

    def _await(self, names: Iterable[str], seconds: float) -> None:
        """Block until these axes and all inputs have values, or the scan has ended, at most some ``seconds``."""
        period = self.cell.bus.scan_period
        for _ in range(math.ceil(seconds / period)):
            if self._waiter.wait(lambda: self._have_values(names), period):
                return

    def leave(self, reason: str) -> list[AxisbusError]:
        """Stop every commanded axis, end the scan, leave each node as appropriate, and return the failures.

        Blocks until all axes are at standstill, at most for the time limits of the stop sequences.
        """
        rescued, unsafe = list[StopResult](), list[Unsafe]()
        try:
            self._stop_axes(reason)
        finally:
            self.on_axes_stopped()
            self._late_boot.stop()
            self._waiter.wait(lambda: not self._booting, LEAVE_TIME)
            unsafe = unconfirmed(self.scan.io)
            try:
                rescued, unsafe = self._end_and_confirm()
            finally:
                self.runtime.leave(self.scan.axes, rescued, unsafe)
        if self.scan.failure is not None:
            return [scan_failure(self.scan.failure, rescued), *map(not_safe, unsafe)]
        return [*self.scan.stop_failures(), *map(not_safe, unsafe)]

    def disown(self) -> None:
        """Make this object unusable in a forked child, which must neither command nor close its parent's machine."""
        self.scan.disown()
        self._thread_waiter.disown()

    def _have_values(self, names: Iterable[str]) -> bool:
        scan = self.scan
        heard = [self._has_first_values(name) for name in names]
        known = [reading.known is not SignalValidity.NOT_YET for reading in scan.io.readings.values()]
        return scan.ended or (all(heard) and all(known) and bool(known or not scan.io))

    def _has_first_values(self, name: str) -> bool:
        """Whether the axis has its statusword, and its position, which some drives send in another TPDO and later."""
        seen = self.scan.snapshots.get(name)
        if seen is None or seen.statusword is None:
            return False
        return seen.position is not None or "position" not in self.scan.axes[name].capabilities.inputs

    def _stop_axes(self, reason: str) -> None:
        """Stop all axes and wait for standstill. An exception during the wait, as from a signal handler, is raised afterwards."""
        scan = self.scan
        times = [core.parameters.stop_times.stop_sequence for core in scan.axes.values()]
        until = scan.cycle.now() + max(times, default=0.0) + _CLOSE_MARGIN
        scan.request_stop(reason)
        interruption: BaseException | None = None
        while not scan.has_stopped and scan.cycle.now() < until:
            try:
                self._waiter.wait(lambda: scan.has_stopped, until - scan.cycle.now())
            except BaseException as error:  # noqa: BLE001  # raised when all axes are at standstill
                interruption = error
        if scan.io and not scan.has_stopped:  # otherwise the scan would overwrite the safe states
            scan.give_up()
            self._waiter.wait(lambda: scan.ended or scan.io.outputs_left, _OUTPUTS_TIME)
        if interruption is not None:
            raise interruption

    def _end_and_confirm(self) -> tuple[list[StopResult], list[Unsafe]]:
        """End the scan, and confirm that outputs are safe, after the axes. If the scan has failed, stop the axes without it first.

        While the scan runs, outputs are read before it ends, so that our heartbeat continues: a module that does not answer must
        not cause a heartbeat fault in other nodes.
        """
        alive, unsafe = self.scan.failure is None, list[Unsafe]()
        try:
            if alive:
                unsafe = confirm_safe_outputs(self.scan.io, self.runtime.link)
        finally:
            self._end_scan()
        if self.scan.failure is None:
            return [], unsafe
        rescued = self._rescue.result()
        return rescued, unsafe if alive else confirm_safe_outputs(self.scan.io, self.runtime.link)

    def _scan_failed(self) -> None:
        if self.on_adapter_loss is not None and isinstance(self.scan.failure, AdapterError):
            self.on_adapter_loss(AdapterLoss.STOPPING)
        self._rescue.begin()

    def _stop_without_scan(self) -> list[StopResult]:
        lost = self.on_adapter_loss if isinstance(self.scan.failure, AdapterError) else None
        if lost is not None:
            self._reopen_for_rescue()
        cores = self.scan.axes.values()
        stopped = self.runtime.link.rescue([core.parameters.name for core in cores if _needs_rescue(core)])
        if lost is not None:
            lost(AdapterLoss.STOPPED)
        return stopped

    def _reopen_for_rescue(self) -> None:
        """Try for a second to open the adapter again, as a watchdog process does for a dead core, to stop the drives."""
        until = self.clock.now() + _REOPEN_TIME
        while self.clock.now() < until:
            try:
                self.runtime.link.require_reconnectable(True)
                self.runtime.link.reconnect(listen=False)
            except StateError:
                return
            except AxisbusError:
                self.clock.sleep(_REOPEN_PAUSE)
            else:
                return

    def _end_scan(self) -> None:
        self.scan.quit()
        if self._thread is not None:
            self._thread.stop()
        elif self._virtual_waiter is not None and not self.scan.ended:
            self.scan.end()

    def boot_node(self, node_id: int, on_step: OnStep = _ignore) -> Booted:
        """Boot one node while the scan runs: one that was lost, has restarted, or is only to be configured again.

        The other axes continue. The node's axes begin again, in ErrorStop until they are reset; nothing is enabled. Blocks for the
        end of a stop that is under way, and for the boot-up. Several nodes may be booted at the same time, in several threads.

        Raises:
            StateError: an axis of the node is enabled or commanded, two devices have its node-ID, or the machine is being closed.
            BootError: the boot-up has failed; its axes remain in ErrorStop, and the node may be booted again.
        """
        with self._claim_canopen_node(node_id):
            return self._boot_again(node_id, on_step=on_step)

    def find_replacement(self, node_id: int) -> list[FoundDrive]:
        """Return the drives that may replace that of a node; blocks for up to about 12 s, raises as ``find_drives``."""
        self._require_objects(node_id)
        known = (*self.cell.nodes, self.cell.bus.master_id)
        return find_drives(self.runtime.nodes[node_id].node, known, in_operation=True)

    def replace_drive(self, order: ReplacementOrder, on_step: Tell = _ignore) -> ReplacementOutcome:
        """Configure the new drive of a node as ordered, and boot it while the scan runs, as ``boot_node`` does.

        ``on_step`` is called in this thread as each step begins.

        Raises:
            StateError: as ``boot_node``; or the node was neither lost nor replaced.
            Other errors as ``boot_node`` and ``DriveReplacement.run``; the axes of the node remain in ErrorStop.
        """
        node_id, outcomes = order.node_id, list[ReplacementOutcome]()

        def configure() -> None:
            # Now, because a later boot-up may see the same identity: not every drive has a serial number.
            self._forget_positions(node_id)
            node, makes = self.runtime.nodes[node_id].node, self.cell.nodes[node_id].makes
            outcomes.append(DriveReplacement(node, order, makes, in_operation=True, on_step=on_step).run())
            on_step(ReplacementStep.BOOT)

        with self._claim_canopen_node(node_id):
            if not order.swapped and self.runtime.is_operational(node_id):
                raise not_booted(
                    node_id,
                    "it is operational, and it is not known that the drive was replaced",
                    "switch the drive off and on; or end the machine, and replace the drive then",
                )
            self._boot_again(node_id, prepare=configure)
        return outcomes[0]

    def _forget_positions(self, node_id: int) -> None:
        """Make the axes of a node not homed, even if its drives keep their positions without power."""

        def forget() -> None:
            for axis in self.cell.axes_of(node_id):
                if axis.name in self.scan.axes:
                    self.scan.axes[axis.name].forget_position()

        self._in_scan(forget)

    def _rejoin(self, node_id: int) -> Booted:
        """Boot a node that has returned, as ``boot_node``, but no other device than the one that was booted last."""
        with self._claim_canopen_node(node_id):
            return self._boot_again(node_id, identity_of(self.runtime.booted[node_id]))

    def _boot_again(
        self,
        node_id: int,
        before: Mapping[Address, int] | None = None,
        prepare: Callable[[], None] = _nothing,
        on_step: OnStep = _ignore,
    ) -> Booted:
        """Take the axes of a node out of the scan, ``prepare`` the node, boot it, and let its axes begin again.

        ``before`` and ``on_step``: as for ``CellConnection.boot``.
        """
        names = self._await_stopped(node_id)
        self._in_scan(lambda: self.scan.take_out(names, being_booted(node_id)))
        try:
            prepare()
            booted, ports = self.runtime.boot_late(node_id, before, on_step)
        except BaseException as error:  # such as Ctrl-C in this thread
            why = error if isinstance(error, AxisbusError) else boot_interrupted(node_id)
            self._show_boot_error(names, why)
            raise
        if booted.report.error is not None:
            self.runtime.booted[node_id].watch = booted.watch  # closing undoes what is armed now
            self._show_boot_error(names, booted.report.error)
            raise booted.report.error
        self._add_booted_node(node_id, booted, ports)
        return booted

    def write_program(
        self, node_id: int, order: ProgramOrder, progress: Progress | None = None
    ) -> ProgramWritten:
        """Replace the program of one node while the scan runs; the other axes continue.

        The node's axes must be at rest without power. They are in ErrorStop meanwhile, and until the node is booted again. Blocks
        for minutes, and for the end of a stop that is under way. If the machine is closed, the write is cut off after some seconds:
        the node has no program until a write has succeeded. ``progress`` is called in this thread.

        Raises:
            StateError: an axis of the node is enabled or commanded, the node is being booted, its program cannot be written over
                CANopen, or the machine is being closed; nothing was sent.
            NodeError, SdoTimeout, AdapterError: as ``boot.program_write.write_program``.
        """
        with self._claim_canopen_node(node_id, not_written):
            parts = self.runtime.nodes[node_id]
            require_writable(read_programs(node_id, parts.objects))
            names = self._await_stopped(node_id)
            try:
                self._in_scan(lambda: self.scan.take_out(names, being_written(node_id)))
            except StateError as error:
                raise not_written(node_id, error.observed or error.message, error.remedy) from None
            self._forget_positions(node_id)  # another program may count otherwise
            end = program_not_written(node_id)
            try:
                parts.node.worker.clear()
                written = write_program(parts.node, order, progress)
                end = program_was_written(node_id)
            finally:
                self._require_boot(names, end)
        return written

    def require_unclaimed(self, node_id: int, what: str) -> None:
        """As ``CoreInterface.require_unclaimed``: a boot-up or a write of the program would fail, or end in an unknown state."""
        if node_id in self._booting:
            raise StateError(
                f"node {node_id}: {what} was not sent",
                observed="the node is being booted, or its program is being written",
                remedy="wait for the end of that",
            )

    def reconnect(self) -> list[StopResult]:
        """Open the adapter again after it has failed or is bus-off, and return how each commanded axis was stopped afterwards.

        All axes remain in ErrorStop; CANopen nodes must be booted (after a bus-off, those that are not operational). Nothing is
        enabled. If the failure has ended the scan, the drives of commanded axes are stopped by SDO before the scan runs again.
        Blocks for the adapter, and for these stops, at most about 6 s.

        Raises:
            StateError: the adapter works, or cannot be opened again while the machine is open, a node is being booted, or the
                machine is being closed.
            AdapterError, SecondMasterError: the adapter cannot be opened, or another master is heard; this may be called again.
        """
        with self._reconnecting:
            scan = self.scan
            failed = scan.failure is not None
            if failed:
                self._rescue.result()
                self._await_scan_end()
            self._require_reconnectable(failed)
            if not failed:  # bus-off: the scan continues meanwhile
                self.runtime.link.reconnect()
                return []
            touched = [name for name, core in scan.axes.items() if _needs_rescue(core)]
            self._late_boot.stop()
            if self._thread is not None:
                self._thread.stop()
            self.runtime.link.reconnect()
            stopped = self.runtime.link.rescue(touched)
            scan.cycle.resume()
            scan.revive({name: partial(self._renew_after_loss, name) for name in scan.axes})
            self._rescue = Rescue(self.clock, self._stop_without_scan)
            if self._virtual_waiter is None:
                if self.on_adapter_loss is not None:
                    self.on_adapter_loss(AdapterLoss.OVER)
                self._start_thread()
            self._late_boot.restart()
            self._await_first_cycle()
            return stopped

    def _await_first_cycle(self) -> None:
        """Block until the snapshots are those of the scan that has begun again, at most a second; not in a callback."""
        scan = self.scan
        with suppress(StateError):
            self._waiter.wait(lambda: scan.has_run or scan.ended, _FIRST_VALUES)

    def _await_scan_end(self) -> None:
        """Block until the thread of a failed scan has ended, at most 2 s: one that is stuck in the driver does not end."""
        thread = self._thread
        if thread is not None:
            self._waiter.wait(lambda: not thread.is_alive(), _CLOSE_MARGIN)

    def _require_reconnectable(self, failed: bool) -> None:
        scan = self.scan
        if scan.leaving_because is not None:
            raise refused_while_leaving("opening the adapter again", scan.leaving_because)
        if self._booting:
            nodes = ", ".join(map(str, sorted(self._booting)))
            raise StateError(f"the adapter is not opened again while a node is being booted ({nodes})")
        if failed and not isinstance(scan.failure, AdapterError):
            raise ended("opening the adapter again", scan.failure)
        if failed and self._thread is not None and self._thread.is_alive():
            raise ended("opening the adapter again", scan.failure)  # it is stuck in the driver
        self.runtime.link.require_reconnectable(failed)

    def _renew_after_loss(self, name: str, core: AxisCore) -> None:
        """Let an axis begin again in ErrorStop; ``reset`` is refused until its node is booted, if that is necessary."""
        axis, touched = self.cell.axes[name], core.touched
        boots = not core.parameters.virtual and self.runtime.nodes[axis.node].has_objects
        error = (adapter_reopened if boots else adapter_reopened_without_boot)(name, axis.node)
        core.begin_again(core.parameters, core.capabilities, error, absolute=axis.homing.absolute)
        core.touched = touched
        if boots:
            core.take_out(error)
        else:
            core.take_back(error)

    def _start_thread(self) -> None:
        self.scan.on_failure = self._scan_failed
        self._thread = ScanThread(self.scan, self._thread_waiter, self.cell.bus.sync_timeout)
        self._thread.start()

    def _require_objects(
        self, node_id: int, refuse: Callable[[int, str, str], StateError] = not_booted
    ) -> None:
        if not self.runtime.nodes[node_id].has_objects:
            raise refuse(node_id, "it uses CAN Simple, which has no boot-up", "reset its axis: axis.reset()")

    @contextmanager
    def _claim_canopen_node(
        self, node_id: int, refuse: Callable[[int, str, str], StateError] = not_booted
    ) -> Iterator[None]:
        """Claim a CANopen node for one boot-up or one write of its program; closing waits a short time for its end."""
        self._require_objects(node_id, refuse)
        with self._claim(node_id, refuse):
            yield

    @contextmanager
    def _claim(
        self, node_id: int, refuse: Callable[[int, str, str], StateError] = not_booted
    ) -> Iterator[None]:
        """Claim any node, as ``_claim_canopen_node``."""
        with self._lock:
            if node_id in self._booting:
                raise refuse(
                    node_id, "it is being booted, or its program is being written", "wait for the end of that"
                )
            self._booting.add(node_id)
        try:
            yield
        finally:
            self._booting.discard(node_id)

    def _boot_absent(self, node_id: int) -> bool:
        """Boot an optional node that was absent, if it answers; return whether it has been booted, by this or by a call.

        The boot-up may have failed: then the node is booted again by a call only.
        """
        if node_id in self._booting or (
            node_id in self.runtime.absent and not self.runtime.link.answers(node_id)
        ):
            return False
        with self._claim(node_id):
            if node_id not in self.runtime.absent:
                return True
            booted, ports = self.runtime.boot_late(node_id)
            if booted.report.absent:  # it has fallen silent again
                return False
            with suppress(StateError, ScanError):  # the machine is being closed
                self._add_booted_node(node_id, booted, ports)
        return True

    def _returning_nodes(self) -> list[ReturningNode]:
        """Return the nodes that are booted automatically when they have returned."""
        return [
            ReturningNode(node_id, partial(self._has_returned, node_id), partial(self._rejoin, node_id))
            for node_id, parts in self.runtime.nodes.items()
            if self.cell.nodes[node_id].rejoin == AUTOMATIC and parts.has_objects
        ]

    def _has_returned(self, node_id: int) -> bool:
        """Whether a node that was booted before has restarted or left operational, and answers."""
        was_booted = node_id not in self._booting and self.runtime.booted[node_id].report.ok
        return was_booted and self.runtime.has_returned(node_id)

    def _await_stopped(self, node_id: int) -> list[str]:
        """Return the axes of a node when none of them is being stopped any more, or the time for a stop has passed."""
        axes = {
            axis.name: self.scan.axes[axis.name]
            for axis in self.cell.axes_of(node_id)
            if axis.name in self.scan.axes
        }
        limit = max((core.parameters.stop_times.stop_sequence for core in axes.values()), default=0.0)
        self._waiter.wait(
            lambda: all(core.stop_sequence is None for core in axes.values()), limit + _CLOSE_MARGIN
        )
        return list(axes)

    def _in_scan(self, work: Callable[[], None]) -> None:
        """Let the scan execute ``work`` between two cycles; blocks until it has, and raises its error."""
        scan, done, raised = self.scan, list[None](), list[AxisbusError]()

        def run() -> None:
            try:
                work()
            except AxisbusError as error:
                raised.append(error)
            done.append(None)

        if scan.leaving_because is not None:
            raise refused_while_leaving("booting a node", scan.leaving_because)
        scan.between_cycles(run)
        self._waiter.wait(lambda: scan.ended or bool(done), None)
        if raised:
            raise raised[0]
        if not done:
            raise ended("booting a node", scan.failure)

    def _require_boot(self, names: Sequence[str], error: AxisbusError) -> None:
        """Let the axes of a node show ``error``, and refuse a reset until the node was booted."""

        def show() -> None:
            for name in names:
                self.scan.axes[name].take_out(error)

        with suppress(StateError, ScanError):  # the machine is being closed
            self._in_scan(show)

    def _show_boot_error(self, names: Sequence[str], error: AxisbusError) -> None:
        """Let the axes of a node that did not boot show why."""

        def show() -> None:
            for name in names:
                self.scan.axes[name].take_back(error)

        with suppress(StateError, ScanError):  # the machine is being closed
            self._in_scan(show)

    def _add_booted_node(self, node_id: int, booted: Booted, ports: Mapping[str, Port]) -> None:
        """Add a node that has booted while the scan runs, or let its axes begin again. Blocks for some cycles."""
        before = self.runtime.booted[node_id]
        self.runtime.booted[node_id] = booted
        self._watch_node(node_id)
        if not booted.report.ok:
            return
        ports = as_csp_capable(ports)
        self._in_scan(lambda: self._add_to_scan(node_id, booted, ports, same_device(before, booted)))
        self._await(booted.parameters, _JOIN_TIME)
        self._joined(booted)

    def _add_to_scan(self, node_id: int, booted: Booted, ports: Mapping[str, Port], same: bool) -> None:
        scan, names = self.scan, list(self.scan.axes)
        if scan.leaving_because is not None:  # it would come after the stop
            raise refused_while_leaving("booting a node", scan.leaving_because)
        self.runtime.link.admit(node_id)
        self._take_io(scan.io, node_id)
        for name, parameters in booted.parameters.items():
            if name in scan.axes:
                absolute = same and self.cell.axes[name].homing.absolute
                error = booted_again(name, node_id, confirmed=absolute)
                scan.renew_axis(name, ports[name], parameters, error, absolute=absolute)
                continue
            names.append(name)
            core = AxisCore(parameters, ports[name].capabilities)
            scan.add_axis(name, ports[name], core, members(self.cell, names))

    def _take_io(self, io_scan: IoScan, node_id: int) -> None:
        add_io(io_scan, self.cell, self.runtime.link, node_id, self.runtime.nodes[node_id].eds)

    def _watch_node(self, node_id: int) -> None:
        """Stop the cell on the loss of a node without axes, unless its table says that the loss is only reported."""
        events = self.runtime.nodes[node_id].events
        stops = self.cell.nodes[node_id].on_lost == "stop"
        if events is None or node_id in self._watched:
            return
        if stops and not any(self.cell.axes_of(node_id)):
            self._watched.add(node_id)
            events.subscribe(self._node_event)

    def _commanded_by_others(self, error: SecondMasterError, nodes: frozenset[int]) -> None:
        self.scan.intrude(error, [axis.name for axis in self.cell.driven.values() if axis.node in nodes])

    def _node_event(self, event: NodeEvent) -> None:
        if event.kind in BAD and event.node not in self._booting:
            self.scan.trip(lost_without_axes(event, self.scan.starvation.text(self.scan.cycle.now())))
