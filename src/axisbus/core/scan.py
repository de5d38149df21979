"""The scan: one loop per bus that reads every axis, steps it, and sends its set-points, with a fixed period.

Theory of operation
-------------------
One cycle (``once``) is: wait for the grid, SYNC, receive, take the commands, then for each axis read, step, write; then commit,
heartbeat.

- **SYNC at the grid.** It is sent before any computation, so that the drives sample and act at even distances, however long a
  cycle's own work takes. The frames of a cycle take effect at the next SYNC; the values that it reads were sampled at the previous
  one. After a delay that stops the axes, SYNC is sent last: the frames waiting in the drives are old, and must be replaced before
  they act.
- **One writer.** Only the scan uses cores and ports. Other threads queue commands (``submit``, see ``command_queue``) and read
  snapshots.
- **Absolute grid.** Cycle k belongs to t0 + k * period. A late cycle is executed late. The missed ones are skipped and counted,
  never caught up in a burst: between two cycles there is always half a period or more. Motion advances one period per executed
  cycle, so a late axis is late and does not jump.
- **A command fails alone.** An exception while a command is taken, planned or stepped ends it and stops its axes.
- **Its end is never silent.** Whatever ends the loop ends every command with a reason, after a quick stop of all drives.

In real time ``run`` calls ``once`` in a thread. In virtual time it is called while the program waits (``waiting.VirtualWaiter``).
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Protocol

from axisbus.cia402.port import BusCycle, Port
from axisbus.core.command_queue import CommandQueue, QueuedCommand
from axisbus.core.io import IoScan
from axisbus.core.lateness import Lateness, cause_of, hang_text
from axisbus.core.node_shutdown import ended, interrupted, queue_full, refused_while_leaving
from axisbus.core.realtime_setup import COLLECTOR
from axisbus.core.waiting import inherited
from axisbus.cpu_starvation import DRIVES, Starvation
from axisbus.errors import AxisbusError, SecondMasterError, one_line
from axisbus.motion.axis.accept import accept, require_override
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, broken, unattended
from axisbus.motion.commands import PolicyStop, Shutdown
from axisbus.motion.gantry.core import GantryCore
from axisbus.motion.gantry.interlock import Pairs
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.group.commands import CellSetOverride
from axisbus.motion.group.core import GroupCore
from axisbus.motion.io import SetOutputs
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.motion.stop.hold_to_run import HoldToRun
from axisbus.motion.stop.policy import FaultPolicy, GroupFault, LostNode
from axisbus.motion.stop.shutdown_stop import Halting, ShutdownStop
from axisbus.session import AnyCommand, Observer, Target


class Wakes(Protocol):
    """Wakes a program that waits for the end of a command."""

    def notify(self) -> None:
        """Wake all waiting threads."""


class Scan:
    """The loop over one bus; owns the cores and groups of its axes."""

    def __init__(
        self,
        cycle: BusCycle,
        ports: Mapping[str, Port],
        axes: Mapping[str, AxisCore],
        period: float,
        groups: Mapping[str, Sequence[str]] | None = None,
        on_lost_node: LostNode = LostNode.GROUP,
        on_fault: Mapping[str, GroupFault] | None = None,
        io: IoScan | None = None,
        gantries: Mapping[str, GantryParameters] | None = None,
    ) -> None:
        """``ports`` and ``axes`` have the same names; ``period`` in seconds; ``io``: the inputs and outputs.

        ``groups``: the axes of each group by its name; ``on_fault``: how a failure stops the group, if not on its path.
        ``gantries``: the pairs of axes that carry one beam, by name.
        """
        self.cycle = cycle
        self.axes = dict(axes)
        self.period = period
        self._pairs = Pairs(gantries or {})
        self.groups: dict[Target, GroupCore] = {
            name: self._group_core(members) for name, members in (groups or {}).items()
        }
        self.groups.update(self._gantry_cores())
        self.io = IoScan() if io is None else io
        self.lateness = Lateness()
        self.starvation = Starvation()
        self.snapshots: dict[str, Snapshot] = {}
        self.observers: list[Observer] = []
        self.failure: BaseException | None = None
        # stops the axes without the scan; called once, must not block
        self.on_failure: Callable[[], None] | None = None
        self.ended = False
        self.waiter: Wakes | None = None
        self._work = [(name, ports[name], core) for name, core in self.axes.items()]
        self._members = {name: list(axes) for name, axes in (groups or {}).items()}
        self._on_lost_node, self._on_fault = on_lost_node, dict(on_fault or {})
        self._policy = self._make_policy()
        self._override = 1.0  # of the cell
        self._calls: deque[Callable[[], None]] = deque()
        self.renewals: list[str] = []  # axes that have begun again, in this order
        self._commands = CommandQueue()
        self._next: float | None = None
        self._last_cycle = math.inf  # start of the previous cycle
        self._collected = COLLECTOR.seconds  # of the garbage collector, at the start of the previous cycle
        self._done_at = self._sending = -math.inf  # of the previous cycle: its end, and its time in sending
        self._stop_requests: deque[tuple[str, bool]] = deque()
        self._halt_requests: deque[tuple[str, int]] = deque()
        self._halting = Halting()
        self._hold_to_run = HoldToRun()
        self._trips: deque[AxisbusError] = deque()
        self._intrusions: deque[tuple[SecondMasterError, Sequence[str]]] = deque()
        self._stops_wanted = 0
        self._stops_begun = 0
        self._shutdown = ShutdownStop()
        self._given_up = False
        self._quitting = False
        self._quick_stop_sent = False  # at the end of a scan that has failed
        self._leaving_reason: str | None = None  # why no more commands are accepted
        self.leaving_since = math.inf  # seconds of the cycle's clock
        self._inherited = False  # by a forked child
        self._lock = threading.Lock()

    # -- for other threads -------------------------------------------------------------------------------------------

    def submit(self, target: Target, command: AnyCommand, ticket: CommandStatus) -> CommandStatus:
        """Queue a command for an axis or group for the next cycles; does not block.

        Return its ticket: that of the same command, if one is already queued (see ``command_queue``).

        Raises:
            StateError: this is a forked child, whose scan does not run.
        """
        if self._inherited:
            raise inherited(ticket.name)
        waiting = (
            None
            if self._leaving_reason is not None
            else self._commands.put(QueuedCommand(target, command, ticket))
        )
        if waiting is not None:
            return waiting.ticket
        ticket.finish(Status.ERROR, self._refusal(ticket.name))
        return ticket

    def between_cycles(self, work: Callable[[], None]) -> None:
        """Execute ``work`` in the scan's thread at the next cycle, before the axes; it must not block or raise. Does not block."""
        self._calls.append(work)

    def add_group(self, name: Target, members: Sequence[str]) -> None:
        """Make a group of axes that cell.toml does not name, once; the fault policy ignores it."""
        with self._lock:
            if name not in self.groups:
                self.groups = {**self.groups, name: self._group_core(members)}

    def _gantry_cores(self) -> dict[Target, GroupCore]:
        """Make the gantry pairs that have both axes, and that do not exist yet."""
        found = self._pairs.by_name.items()
        here = [
            (name, pair)
            for name, pair in found
            if self.axes.keys() >= set(pair.axes) and name not in self.groups
        ]
        return {
            name: GantryCore(
                pair, {axis: self.axes[axis] for axis in pair.axes}, self.period, lambda: self.groups.values()
            )
            for name, pair in here
        }

    def _group_core(self, members: Sequence[str]) -> GroupCore:
        return GroupCore({axis: self.axes[axis] for axis in members}, self.period)

    @property
    def due(self) -> float:
        """Time of the next cycle, by the cycle's clock."""
        return self.cycle.now() if self._next is None else self._next

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """Request the stop of all axes that this program has commanded; safe in a signal handler. Does not block.

        From here on the machine can only be closed: no command is accepted, and queued ones end.
        """
        if self._leaving_reason is None:
            self._leaving_reason, self.leaving_since = reason, self.cycle.now()
        self._stop_requests.append((reason, quick))
        self._stops_wanted += 1

    def request_halt(self, reason: str, number: int) -> None:
        """Request a halt of all commanded axes, and end queued commands; safe in a signal handler. Does not block.

        Later commands are accepted. ``number``: see ``motion.stop.shutdown_stop``.
        """
        self._halt_requests.append((reason, number))

    def hold_to_run(self, seconds: float | None, client_name: str, continuous: float | None = None) -> None:
        """Halt all axes unless this is called again within ``seconds``; None ends this. Does not block.

        ``continuous``: as in ``HoldToRun.hold``.
        """
        if seconds is None:
            self._hold_to_run.let_go()
        else:
            self._hold_to_run.hold(self.cycle.now(), seconds, client_name, continuous)

    def _has_continuous_motion(self) -> bool:
        """Whether an axis moves until another command stops it."""
        return any(core.state is AxisState.CONTINUOUS_MOTION for core in self.axes.values())

    @property
    def leaving_because(self) -> str | None:
        """Why no more commands are accepted, since ``leaving_since``; None while they are."""
        return self._leaving_reason

    def trip(self, error: AxisbusError) -> None:
        """Stop the whole cell for a cause outside the axes; takes effect in this cycle or the next. Does not block."""
        if self._on_lost_node is not LostNode.REPORT:
            self._trips.append(error)

    def intrude(self, error: SecondMasterError, names: Sequence[str]) -> None:
        """Stop these axes in the next cycle, because another master commands them. For any thread; does not block."""
        self._intrusions.append((error, names))

    def _refuse_waiting(self) -> None:
        for waiting in self._commands.clear():
            waiting.ticket.finish(Status.ERROR, self._refusal(waiting.ticket.name))

    @property
    def has_stopped(self) -> bool:
        """Whether every requested stop has ended (or the scan has)."""
        if self.ended:
            return True
        outputs_too = not self.io or not self._stops_wanted or self.io.outputs_left
        return self._stops_begun >= self._stops_wanted and self._shutdown.over and outputs_too

    @property
    def has_run(self) -> bool:
        """Whether a cycle was completed since the scan began, or began again after the loss of the adapter."""
        return self._done_at > -math.inf

    @property
    def silent(self) -> str | None:
        """Why the snapshots are no longer up to date, None while they are."""
        if self.dead is not None:
            return self.dead
        if self.ended:
            return "the machine is closed: nothing more is received"
        seen = [snapshot.now for snapshot in self.snapshots.values()]
        seen += [reading.now for reading in self.io.readings.values()]
        last = max(seen, default=0.0)
        return hang_text(self.cycle.now() - last, self.period)

    @property
    def dead(self) -> str | None:
        """Why all axes are unknown for good: the scan has failed, or runs in another process.

        None while it runs, and after the machine was closed: the last snapshots are then the final state of the axes.
        """
        if self._inherited:
            return "this process was forked from the one that has the machine: nothing is received here"
        return None if self.failure is None else f"the scan of the bus has failed: {one_line(self.failure)}"

    def disown(self) -> None:
        """Make this object unusable: this is a forked child, in which the scan does not run."""
        self._inherited = self.ended = True
        self._lock = threading.Lock()

    def give_up(self) -> None:
        """Do not wait any longer for axes that do not come to rest: outputs become safe without that. Does not block."""
        self._given_up = True

    def quit(self) -> None:
        """End ``run`` after the present cycle."""
        self._quitting = True

    # -- the loop ----------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Cycle until ``quit``; for a thread of its own. Any exception is stored in ``self.failure``."""
        try:
            while not self._quitting and not self.ended:
                self.once()
        except BaseException as error:  # noqa: BLE001  # a scan that ends must stop the drives, whatever ended it
            self.failure = error
        finally:
            self.end()

    def once(self) -> None:
        """Execute one cycle. Raises the errors of the bus (``BusError``)."""
        cycle = self.cycle
        woken = self._wait(cycle)
        gap = woken - self._last_cycle
        overdue = gap > 2 * self.period and gap > self._longest_gap
        if not overdue and not self.ended:
            cycle.sync()
        if self.ended:  # taken over during the wait, or a frame was stuck: nothing may follow
            return
        behind = cycle.receive()
        now = cycle.now()  # after a send that may have blocked: a motion that begins now has all of its time
        self._last_cycle = now
        if behind:
            self._note_behind(now)
        self._take_commands(now)
        for group in self.groups.values():
            group.step()
        snapshots, has_events = self.snapshots, self._stops_begun > 0
        for name, port, core in self._work:
            port.write(core.step(port.read(now)))
            snapshots[name] = core.snapshot()
            # Checked here and not in a loop of its own after the sends, because it is cheaper.
            if core.tripped is not None or core.running.ended:
                has_events = True
        if self._stops_begun:
            self._shutdown.step(now)
        if self.io:
            has_events = self._do_io(now) or has_events
        began = cycle.now()
        cycle.commit()
        if self.ended:
            return
        if overdue:
            cycle.sync()
        cycle.heartbeat()
        self._sending = (now - woken) + (cycle.now() - began)
        if has_events or self._trips:
            self._apply_policy()
            self._wake()
        elif self.groups:
            self._wake_for_groups(False)
        for observer in self.observers:
            observer(now, snapshots)
        self._done_at = cycle.now()

    def _do_io(self, now: float) -> bool:
        """Read and write inputs and outputs. During closing they become safe when the axes are at standstill, or never will be."""
        if self._given_up or (self._stops_begun >= max(1, self._stops_wanted) and self._shutdown.over):
            self.io.leave()
        self.io.step(now)
        return self.io.changed

    def fail(self, error: BaseException) -> None:
        """End because of ``error``, which was found outside of a cycle."""
        self.failure = error
        self.end()

    def end(self) -> None:
        """End every command; if the scan has failed, quick-stop all drives first. A repeated call only repeats the quick stop."""
        if self.failure is not None:
            self._quick_stop_sent = self.cycle.quick_stop_all()
        failed, self.on_failure = self.on_failure if self.failure is not None else None, None
        self.ended = True
        self._commands.close()
        self._refuse_waiting()
        for core in self.axes.values():
            core.abandon(self._ended)
        for group in self.groups.values():
            group.abandon(self._ended)
        self.io.abandon(self._ended("setting outputs"))
        if self.waiter is not None:
            self.waiter.notify()
        if failed is not None:
            failed()

    def revive(self, renew: Mapping[str, Callable[[AxisCore], None]]) -> None:
        """Prepare to run again after the adapter had failed, and was opened again; the scan must have ended.

        ``renew``: what to do with each axis, by name; all its commands have ended. The cycle begins a new grid.
        """
        for name, work in renew.items():
            work(self.axes[name])
            self.axes[name].set_override(cell=self._override)
        for group in self.groups.values():
            group.forget()
        for queue in (self._calls, self._halt_requests, self._trips, self._intrusions):
            queue.clear()
        self._halting = Halting()
        self._hold_to_run.let_go()
        self._next, self._last_cycle = None, math.inf
        self._done_at = self._sending = -math.inf
        self._quick_stop_sent = False
        self._commands.open()
        self.failure = None
        self.ended = False

    def stop_failures(self) -> list[AxisbusError]:
        """Return why axes could not be stopped as requested; empty when all went well."""
        return self._shutdown.failures()

    def _refusal(self, what: str) -> AxisbusError:
        if self.ended:
            return self._ended(what)
        return (
            queue_full(what)
            if self._leaving_reason is None
            else refused_while_leaving(what, self._leaving_reason)
        )

    def _ended(self, what: str) -> AxisbusError:
        return ended(what, self.failure, self._quick_stop_sent)

    @property
    def _longest_gap(self) -> float:
        """Seconds between two cycles after which an axis is stopped."""
        return min((core.supervision.longest_gap for core in self.axes.values()), default=math.inf)

    def _wait(self, cycle: BusCycle) -> float:
        """Wait for the next point of the grid; skip and count those that have passed, or are less than half a period ahead.

        Two cycles close together would be a burst: two SYNCs within a fraction of the drives' interpolation time.
        """
        if self._next is None:
            self._next = cycle.now()
        due = cycle.wait_until(self._next)
        if due is not None:  # another device's SYNC is the grid, so its clock decides
            self._skip(max(0, int((due - self._next) / self.period + 0.5)), due)
            self._next = due
        now = cycle.now()
        late = now - self._next
        self.lateness.note(late)
        missed = int(late / self.period + 0.5)
        if missed:
            self._skip(missed, now)
            self.starvation.note(now, late)
        self._collected = COLLECTOR.seconds
        self._next += (1 + missed) * self.period
        return now

    def _skip(self, cycles: int, now: float) -> None:
        if cycles:
            assert self._next is not None
            collecting = COLLECTOR.seconds - self._collected
            cause = cause_of(now - self._next, self._done_at - self._next, self._sending, collecting)
            self.lateness.skip(cycles, cause)

    def _note_behind(self, now: float) -> None:
        for starvation in (self.starvation, *(core.image.starvation for core in self.axes.values())):
            starvation.note(now, self.period, DRIVES)

    def _execute_calls(self) -> None:
        while self._calls:
            self._calls.popleft()()
        self._wake_all()

    def add_axis(self, name: str, port: Port, core: AxisCore, groups: Mapping[str, Sequence[str]]) -> None:
        """Add an axis; ``groups`` replaces the groups that the fault policy knows. Only ``between_cycles``."""
        self._members = {group: list(axes) for group, axes in groups.items()}
        self.axes = {**self.axes, name: core}
        core.set_override(cell=self._override)
        self._work.append((name, port, core))
        mates = {group: axes for group, axes in self._members.items() if name in axes}
        with self._lock:
            self.groups = {**self.groups, **{group: self._group_core(mates[group]) for group in mates}}
            self.groups = {**self.groups, **self._gantry_cores()}
        self._policy = self._make_policy()

    def take_out(self, names: Sequence[str], error: AxisbusError) -> None:
        """Put axes at rest into ErrorStop, because their node is going to be booted again. Only ``between_cycles``.

        Raises:
            StateError: one of them moves, or is enabled; then none is changed.
        """
        for name in names:
            self.axes[name].require_rest_for_boot()
        for name in names:
            self.axes[name].take_out(error)

    def renew_axis(
        self, name: str, port: Port, parameters: AxisParameters, error: AxisbusError, *, absolute: bool
    ) -> None:
        """Let an axis begin again over ``port``, as ``AxisCore.begin_again``: its node was booted. Only ``between_cycles``."""
        core = self.axes[name]
        core.begin_again(parameters, port.capabilities, error, absolute=absolute)
        core.set_override(cell=self._override)
        self._work = [(each, port if each == name else overdue, axis) for each, overdue, axis in self._work]
        for group in self.groups.values():
            if name in group.axes:
                group.forget()
        self.renewals.append(name)

    def _make_policy(self) -> FaultPolicy:
        mates = {axis: mate for axis, mate in self._pairs.mates.items() if {axis, mate} <= self.axes.keys()}
        return FaultPolicy(tuple(self.axes), self._members, self._on_lost_node, self._on_fault, mates)

    def _take_commands(self, now: float) -> None:
        if self._calls:
            self._execute_calls()
        while self._intrusions:
            error, names = self._intrusions.popleft()
            for name in self.axes.keys() & names:
                self.axes[name].stop_for_second_master(copy(error))
        while self._stop_requests:
            self._shutdown.begin(self.axes, Shutdown(*self._stop_requests.popleft()), now)
            self._stops_begun += 1
        if self._leaving_reason is not None:  # commands that were queued when the stop was requested
            self._refuse_waiting()
            return
        while self._halt_requests:
            self._halt(*self._halt_requests.popleft())
        if (silence := self._hold_to_run.broken(now, self._has_continuous_motion)) is not None:
            self._halt(silence, 0)
        for waiting in self._commands.take():
            self._accept(waiting)

    def _halt(self, reason: str, number: int) -> None:
        """Halt moving axes because of an interrupt; of the queued commands only stops are executed."""
        for waiting in self._commands.clear():
            if waiting.is_stop:
                self._accept(waiting)
            else:
                waiting.ticket.finish(Status.ABORTED, interrupted(waiting.ticket.name, reason))
        self._halting.begin(self.axes, reason, number)

    def _accept(self, waiting: QueuedCommand) -> None:
        """Execute a command; an exception ends only this command, and stops its axes."""
        command, ticket = waiting.command, waiting.ticket
        if self._pairs and waiting.axes:
            refusal: AxisbusError | None = self._pairs.refusal(
                waiting.target, command, waiting.axes, ticket.name
            )
            refusal = refusal or self._gantry_refusal(waiting)
            if refusal is not None:
                ticket.finish(Status.ERROR, refusal)
                self._wake_all()
                return
        try:
            if isinstance(command, CellSetOverride):
                self._set_override(command.factor, ticket)
            elif isinstance(command, SetOutputs):
                self.io.accept(command, ticket)
            elif waiting.for_group:
                self.groups[waiting.target].accept(command, ticket)  # type: ignore[arg-type]
            else:
                accept(self.axes[waiting.target], command, ticket)  # type: ignore[arg-type,index]
        except Exception as error:  # noqa: BLE001  # the error of a command; an error of the scan itself ends the scan
            failure = broken(error, ticket.name)
            for name in self.axes.keys() & waiting.axes:
                self.axes[name].break_off(failure)
            ticket.finish(Status.ERROR, failure)
        if self._pairs and waiting.is_stop:
            for name, stop in self._pairs.partner_stops(command, waiting.axes, self.axes).items():
                accept(self.axes[name], stop, unattended(f"{name}.stop, because {ticket.name} was commanded"))

    def _gantry_refusal(self, waiting: QueuedCommand) -> AxisbusError | None:
        """Return why a path of a group must not move a gantry pair with other axes now."""
        for name in self._pairs.pairs_moved(waiting.target, waiting.command, waiting.axes):
            pair = self.groups.get(name)
            if (
                isinstance(pair, GantryCore)
                and (found := pair.permit_group_path(waiting.ticket.name)) is not None
            ):
                return found
        return None

    def _wake_all(self) -> None:
        if self.waiter is not None:
            self.waiter.notify()

    def _set_override(self, factor: float, ticket: CommandStatus) -> None:
        """Multiply the velocities of all axes; if one of them cannot accept the factor, none does."""
        try:
            for core in self.axes.values():
                require_override(core, factor, ticket)
        except AxisbusError as error:
            ticket.finish(Status.ERROR, error)
        else:
            self._override = factor
            for core in self.axes.values():
                core.set_override(cell=factor)
            ticket.finish(Status.DONE)
        self._wake_all()

    def _apply_policy(self) -> None:
        while self._trips:
            message = self._trips.popleft().message
            self._policy_stop(dict.fromkeys(self.axes, (message, GroupFault.PATH)))
        tripped: dict[str, AxisbusError] = {}
        for name, _, core in self._work:
            if core.tripped is not None:
                tripped[name] = core.tripped
        if not tripped:
            return
        causes = self._policy.all_stops(tripped)
        how = self._policy.how
        self._policy_stop(
            {name: (tripped[cause].message, how(name, cause)) for name, cause in causes.items()}
        )

    def _policy_stop(self, reasons: Mapping[str, tuple[str, GroupFault]]) -> None:
        for name, (reason, how) in reasons.items():
            stop = PolicyStop(f"{name} was stopped because {reason}", how)
            accept(self.axes[name], stop, unattended(f"{name}.stop"))

    def _wake(self) -> None:
        ended = self._stops_begun > 0 or self.io.changed  # closing waits for more than the end of a command
        for _, _, core in self._work:
            if core.running.ended:
                core.running.ended, ended = False, True
        self._wake_for_groups(ended)

    def _wake_for_groups(self, ended: bool) -> None:
        """Wake waiting programs, if a group's command has ended, or if ``ended``."""
        for group in self.groups.values():
            ended = group.take_ended() or ended
        if ended and self.waiter is not None:
            self.waiter.notify()
