"""The machine: opens, boots and scans a cell, and stops its axes whenever it is closed, for whatever reason."""

from __future__ import annotations

import atexit
import logging
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Unpack

from axisbus.bus.link.fork_guard import disown_in_children
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.errors import ArgumentError, AxisbusError, StateError, UnknownNameError, with_alarm
from axisbus.link import StopResult
from axisbus.machine.axis import Axis
from axisbus.machine.axis_registry import AxisRegistry
from axisbus.machine.closing import Closing
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.gantry import Gantry
from axisbus.machine.groups import Group
from axisbus.machine.handle import Handle
from axisbus.machine.notebook_interrupts import interactive
from axisbus.machine.opening import attached, opened, out_of_reach, simulated
from axisbus.machine.request import hold_of, override_of
from axisbus.machine.signal_shutdown import EXIT, ShutdownRequest
from axisbus.motion.group.commands import CellSetOverride
from axisbus.motion.numbers import number, short_repr
from axisbus.session import ClientProgram, LatenessReport, MachineSession

if TYPE_CHECKING:  # programs that only use axes do not need these
    from axisbus.boot.report import Booted, NodeReport
    from axisbus.bus.link.controller import ControllerEvent
    from axisbus.bus.node.events import NodeEvent
    from axisbus.cia301.dropped_frames import Drop
    from axisbus.cia301.frame import BusTraffic
    from axisbus.cia301.sdo_counts import SdoCount
    from axisbus.core.core import CoreInterface
    from axisbus.core.simulated_nodes import SimulatedNode
    from axisbus.machine.io import InputsOutputs
    from axisbus.machine.node_access import NodeAccess
    from axisbus.machine.streaming.options import StreamKeywords
    from axisbus.machine.streaming.points import PointStream
    from axisbus.machine.user_kinematics.kinematics import UserKinematics
    from axisbus.machine.web_process import WebPage
    from axisbus.motion.group.kinematics import Kinematics
    from axisbus.record.capture import Capture
    from axisbus.record.condition import Condition
    from axisbus.record.last_motion import LastMinute, RecordingPlot
    from axisbus.record.recording import Recording
    from axisbus.sim.device import Device

log = logging.getLogger("axisbus")
_NEXT_CYCLE = 0.5  # seconds within which the next cycle must come


class Machine:
    """A cell of axes. Use it in a ``with`` block: leaving the block, for any reason, stops the axes that this program has moved.

    Iterating yields the axes; ``machine["x"]`` is one by name, ``machine.group("x", "y")`` several that move together,
    ``machine.node(1)`` direct access to a device.
    """

    def __init__(self, cell: CellConfig, core: CoreInterface) -> None:
        """Use ``Machine.open`` or ``Machine.simulated``."""
        self.cell = cell
        self._core = core
        self._commanding = CommandDispatcher(self.session)
        self._nodes: dict[int, NodeAccess] = {}
        self._io: InputsOutputs | None = None
        self._registry = AxisRegistry(cell, core.booted, self._commanding, self.node)
        self._closing = Closing(self._leave, self.session.request_stop, self._core.in_cycle)
        self._recordings: list[Recording | Capture] = []
        self._pages: list[WebPage] = []
        self._inherited = False  # by a forked child
        self._last: LastMinute | None = None

    @property
    def session(self) -> MachineSession:
        """The connection to the core, which moves the axes."""
        return self._core.session

    @classmethod
    def open(cls, path: str | Path, *, allow_other_master: bool = False, shared: bool = False) -> Machine:
        """Check, open, boot and configure the cell of a ``cell.toml``, and start its scan; energises nothing.

        Blocks until all nodes are up. With ``interface = "sim"`` the nodes are simulated on a private bus, in real time. On any
        other interface the method first listens for another master, for at most 0.5 s. ``allow_other_master`` opens the cell even
        if another master is heard (as ``allow_other_master`` in ``[bus]``). The core runs in a process of its own, if the cell and
        the platform allow it (``process`` in ``[bus]``). Other programs of the same user can join it (``attach``), to read values
        and to halt. With ``shared`` this program has no control of the machine, and one of the other programs may take it.

        Raises:
            StateError: ``shared`` is set, and the core cannot have a process of its own.
            ConfigError, EdsError: the cell file or an EDS is wrong (``axisbus check`` lists everything).
            AdapterError: the bus cannot be opened.
            SecondMasterError: another master is heard on the bus; nothing was sent.
            BootError: a node did not come up (several: an ExceptionGroup of them).
            SyncError: another device is configured to send SYNC, and sends none, or not at scan_period.
        """
        return cls(*opened(path, allow_other_master, shared))._started()

    @classmethod
    def attach(cls, path: str | Path, *, command: bool = False, force: bool = False) -> Machine:
        """Join the machine of a ``cell.toml`` that another program of this user has opened on this computer. Blocks for a moment.

        Leaving the machine does not change it. Without ``command`` this program may only read, halt and quick-stop, which locks
        no other program out; everything else is refused. ``command``: get control of the machine, which one program has at a
        time. ``force``: get control even if another program has it, after all moving axes have halted. If the program with
        control ends, for any reason, it loses control: moving axes halt, and stay enabled. Control then returns to the program
        that opened the machine, unless that program shares the machine.

        Raises:
            StateError: no machine of this cell runs, or it has another version of axisbus, or the text of the file has changed.
            OwnershipError: another program has control.
            ConfigError, EdsError, ScanError: as ``open``.
        """
        machine = cls.try_attach(path, command=command, force=force)
        if machine is None:
            raise StateError(
                f"no machine of {path} runs on this computer, so this program cannot join one",
                observed=out_of_reach(path),
                remedy=f"start one: axisbus run {path}; or open the cell in this program: Machine.open",
            )
        return machine

    @classmethod
    def try_attach(cls, path: str | Path, *, command: bool = False, force: bool = False) -> Machine | None:
        """As ``attach``, but return None if no machine of this cell runs."""
        core = attached(path, command=command, take=force)
        return None if core is None else cls(*core)._started()

    @classmethod
    def simulated(
        cls, path: str | Path, devices: Mapping[int, Device] | None = None, *, at_real_speed: bool = False
    ) -> Machine:
        """Run the same cell on simulated drives and a simulated wire, in virtual time: time passes only while the program waits.

        ``devices`` replaces simulated drives, by node-ID. ``at_real_speed``: while the program waits, time passes as fast as that
        of the computer, to watch a motion; a pause of the computer delays it and disturbs nothing. Raises as ``open``.
        """
        return cls(*simulated(path, devices, at_real_speed=at_real_speed))._started()

    def _started(self) -> Machine:
        """Start the scan, and return this machine."""
        try:
            self._begin()
            if interactive():
                self._keep_last()
        except BaseException:  # a signal, as a rule: the caller cannot close the machine yet
            self._close("opening it was interrupted")
            EXIT.take()
            raise
        return self

    def _keep_last(self) -> None:
        from axisbus.record.last_motion import LastMinute

        self._last = LastMinute(self)
        self._last.begin()

    # -- contents ----------------------------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Axis]:
        return iter(self._registry.axes.values())

    def __len__(self) -> int:
        return len(self._registry.axes)

    def __contains__(self, name: object) -> bool:
        return name in self._registry.axes

    def __getitem__(self, name: str) -> Axis:
        """Return the axis ``name``.

        Raises:
            StateError: the cell has no such axis.
        """
        return self._registry[name]

    def __repr__(self) -> str:
        """Return the cell file's name and the axes, each with its state."""
        axes = ", ".join(f"{name} {self.session.snapshots[name].state.value}" for name in self.axes)
        return f"<Machine {Path(self.cell.file).name}: {axes}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        from axisbus.machine.notebook_display import machine_html  # only a notebook needs it

        return machine_html(self)

    @property
    def axes(self) -> Mapping[str, Axis]:
        """The axes of the booted nodes, by name, in the order of cell.toml."""
        return dict(self._registry.axes)

    @property
    def groups(self) -> Mapping[str, Group]:
        """The groups of cell.toml with all of their axes present, by name."""
        return self._registry.groups

    def group(
        self,
        *names: str,
        kinematics: Kinematics | UserKinematics | None = None,
        accuracy: float | None = None,
    ) -> Group:
        """Return the group of this name in cell.toml, or a group of the named axes, in this order.

        ``kinematics`` and ``accuracy``: as ``Group.with_kinematics``; without them, those of cell.toml.

        Raises:
            StateError: no such group or axis.
            ArgumentError: an axis is named twice, or as ``Group.with_kinematics``.
        """
        group = self._registry.group(names)
        return group if kinematics is None else group.with_kinematics(kinematics, accuracy=accuracy)

    def gantry(self, name: str) -> Gantry:
        """Return the pair of axes that carry one beam, ``[gantries.NAME]`` of cell.toml.

        Raises:
            StateError: there is no such pair, or one of its axes is absent.
        """
        return self._registry.gantry(name)

    @property
    def override(self) -> float:
        """The last factor of ``set_override`` from any program; 1 before that, and if the cell has no axis."""
        return max((snapshot.cell_override for snapshot in self.session.snapshots.values()), default=1.0)

    def set_override(self, factor: float) -> Handle:
        """Multiply the velocities of all axes, including axes added later, by ``factor``: 0 (all hold) to 1.5. Does not block.

        It multiplies the factors of ``Axis.set_override``; the product is at most 1.5. If it is unknown with which acceleration one
        of the axes may change its velocity, the handle ends with a StateError, and nothing changes.

        Raises:
            ArgumentError: not a number from 0 to 1.5.
        """
        found = override_of("cell.set_override", factor)
        return self._commanding.submit("", CellSetOverride(found), f"cell.set_override({found:g})")

    @property
    def io(self) -> InputsOutputs:
        """The named inputs and outputs: ``machine.io["lamp"]``. If a node has not come up, its values are unknown."""
        if self._io is None:
            from axisbus.cell.io_signals import all_points  # most cells have none
            from axisbus.machine.io import InputsOutputs

            dictionaries = {node_id: parts.eds for node_id, parts in self._core.nodes.items()}
            points = all_points(self.cell, dictionaries)
            ordered = {name: points[name] for name in self.cell.io if name in points}
            self._io = InputsOutputs(ordered, self.session, self._commanding)
        return self._io

    def stream(self, *names: str, **options: Unpack[StreamKeywords]) -> PointStream:
        """Follow points that this program gives at its own pace, with a group or the named axes: ``group(*names).stream(...)``.

        ``options`` and exceptions are those of ``Group.stream``; the exceptions of ``group`` are raised as well.
        """
        return self.group(*names).stream(**options)

    def node(self, node_id: int) -> NodeAccess:
        """Return direct access to a node; raises StateError if the cell has no such node."""
        known = isinstance(node_id, int) and not isinstance(node_id, bool)
        parts = self._core.nodes.get(node_id) if known else None
        if parts is None:
            raise UnknownNameError(
                f"the cell has no node {short_repr(node_id)}",
                observed=f"it has {', '.join(map(str, self._core.nodes))}",
            )
        # a node that came up late has new parts
        if node_id not in self._nodes or self._nodes[node_id].parts is not parts:
            from axisbus.machine.node_access import NodeAccess

            self._nodes[node_id] = NodeAccess(parts, self._await_cycle, self._core)
        return self._nodes[node_id]

    def reconnect(self) -> list[StopResult]:
        """Open the CAN adapter again, without closing the machine, after it was unplugged, its link was taken down, or bus-off.

        Return how each axis that had been commanded was stopped afterwards; an axis with ``ok`` false may still move. After a
        bus-off the list is empty, because the scan stops the axes. All axes remain in ErrorStop, and nothing is enabled. Then boot
        each CANopen node (``node(N).boot()``), and reset its axes. Blocks for the adapter and these stops, at most some seconds.

        Raises:
            StateError: the adapter works, or cannot be opened again while the machine is open; or the machine is being closed.
            OwnershipError: this program has no control.
            AdapterError: the adapter cannot be opened; try again later. SecondMasterError: another master is heard.
        """
        return self._core.reconnect()

    def _await_cycle(self) -> None:
        """Wait until the axes have the values of a cycle that began after this call; for at most a second."""
        session, in_cycle = self.session, self._core.in_cycle
        if not session.snapshots or (in_cycle is not None and in_cycle()):
            return
        for _ in range(2):  # the first cycle that ends may have begun before this call
            before = _newest(session)
            with suppress(StateError):  # a callback cannot wait for a cycle
                session.waiter.wait(
                    lambda before=before: session.ended or _newest(session) > before,  # type: ignore[misc]
                    _NEXT_CYCLE,
                )

    def simulated_node(self, node_id: int) -> SimulatedNode:
        """Return the simulated drive of a node: its plant, its fault settings, and faults on demand.

        Raises:
            StateError: the cell runs on hardware, or has no such node.
        """
        if not isinstance(node_id, int) or node_id not in self._core.simulated_nodes:
            raise StateError(
                f"node {short_repr(node_id)} is not simulated here",
                remedy='simulated drives exist with interface = "sim"',
            )
        return self._core.simulated_nodes[node_id]

    @property
    def is_simulated(self) -> bool:
        """Whether the drives are simulated."""
        return self.cell.bus.interface == SIMULATED or not self._core.realtime

    @property
    def is_attached(self) -> bool:
        """Whether another program has opened the machine (``attach``)."""
        return self._core.joined

    @property
    def control_owner(self) -> str:
        """The program that had control when this program joined, as text; empty if control was free or this program's."""
        return self._core.commanded_by

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """The programs connected to this machine (``who``, and whether it ``commands``), beginning with the one that opened it.

        ``lost_cycles`` and ``lost_frames`` are the numbers of cycles and frames that each program did not read in time. Empty
        if no other program can join, because the core is in this program.
        """
        return self.session.programs

    @property
    def has_control(self) -> bool:
        """Whether this program has control of the machine now; blocks until the core answers.

        Raises:
            ScanError: the core is gone.
        """
        return self.session.has_control

    def take_control(self) -> None:
        """Take control of the machine from the program that has it, after all moving axes have halted; blocks until that is done.

        As ``force`` of ``attach``, for a program that has already joined: one that only reads, or that has lost control to another
        program. The program that had control is notified. Harmless if this program has control.

        Raises:
            StateError: an axis does not come to rest.
            Stopped: this program has been asked to stop.
            ScanError: the core is gone.
        """
        self.session.take_control()

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """Halt the axes that this program has set in motion unless it calls this again within ``seconds``; they stay enabled.

        This is a hold-to-run control (ISO 12100) for programs. A program that acts for a person, a browser or a network promises a
        call within 0.05 to 60 s. If the program is stopped, hangs or starves, the core halts the axes in its place, once; the
        program may command again afterwards. ``continuous``: the same with a shorter time, for an axis in continuous motion (at a
        velocity or under torque), which has no end of its own; None: the same time. If ``seconds`` is None, the promise ends, and
        moving axes continue as without this call. The call has no effect in a program without control. Does not block.

        Raises:
            ArgumentError: not a time in this range.
        """
        call = "cell.hold_to_run"
        times = [None if each is None else hold_of(call, each) for each in (seconds, continuous)]
        self.session.hold_to_run(*times)

    @property
    def bus_traffic(self) -> BusTraffic | None:
        """The numbers of sent and received frames and octets up to a ``time``; None before the first cycle.

        ``later.load(before, bitrate)`` returns the bus load between two of these values: without stuff bits, and with the maximum
        number of them.
        """
        return self.session.carried

    @property
    def reports(self) -> list[NodeReport]:
        """The boot report of each node."""
        return [booted.report for booted in self._core.booted.values()]

    @property
    def events(self) -> list[NodeEvent | ShutdownRequest]:
        """Events of error control for all nodes, signs of another master, and the reason why the machine was closed.

        Since the scan began, in the order of time.
        """
        left = self.session.left
        found: list[NodeEvent | ShutdownRequest] = [
            *self.session.node_events,
            *([] if left is None else [ShutdownRequest(*left)]),
        ]
        return sorted(found, key=lambda event: event.stamp)

    @property
    def fault_recordings(self) -> list[Path]:
        """The files of the cell's last 20 faults, oldest first: each with 1.5 s before and 1 s after it, for ``plot``.

        The core stores them automatically if it has a process of its own. The file of a fault exists one second after the fault, or
        when the machine has been closed.
        """
        from axisbus.core.process.launch import path_of
        from axisbus.core.process.persistence.journal import faults_of

        return faults_of(path_of(self.cell))

    @property
    def cycle_jitter(self) -> LatenessReport:
        """The lateness of the cycles so far (median, 99th percentile, worst) in seconds, and skipped cycles by cause."""
        return self.session.lateness

    @property
    def real_time_status(self) -> str:
        """The real-time status as text: where the core runs, and which real-time functions the operating system permits."""
        return self._core.real_time_status

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """The events of the CAN controller: error warning, passive, bus-off, restarted; at most the last 64, oldest first.

        During bus-off nothing is sent; every axis is in ErrorStop, and stays there after the restart until it is reset.
        Empty with adapters that report nothing.
        """
        return self.session.bus_events

    @property
    def dropped_frames(self) -> tuple[Drop, ...]:
        """Dropped frames of this cell's nodes, and of no node, since the machine was opened, counted by reason and node.

        Examples are PDOs too short for their mapping, answers to no request, and malformed messages. Frames of a node that the cell
        does not use, such as PDOs that are not configured, are included.
        """
        drops = self.session.drops
        return tuple(drop for drop in drops if drop.node is None or drop.node in self.cell.nodes)

    @property
    def sdo_counts(self) -> tuple[SdoCount, ...]:
        """The numbers of SDO transfers with this cell's nodes since the machine was opened, by node and result, and of retries."""
        return tuple(count for count in self.session.sdo_counts if count.node in self.cell.nodes)

    @property
    def bus_time(self) -> datetime | None:
        """The time of day by another device's TIME messages (CiA 301 7.2.6), in UTC; None if none was received."""
        return self.session.bus_time

    def sleep(self, seconds: float) -> None:
        """Let ``seconds`` pass: real time, or virtual time in a simulated machine.

        Raises:
            ArgumentError: not a finite number.
        """
        passing = number(seconds)
        if passing is None:
            raise ArgumentError(
                f"cell.sleep: {short_repr(seconds)} is not a number of seconds",
                remedy="give seconds, such as 0.5; no time has passed",
            )
        self.session.waiter.wait(lambda: False, passing)

    def recording(
        self, path: str | Path, *, axes: Iterable[str] | None = None, objects: Iterable[str] = ()
    ) -> Recording:
        """Record each cycle of the axes, and events, into an MCAP file, for a ``with`` block; ``axisbus plot`` draws it.

        ``axes``: all, if None. ``objects`` are recorded as well, such as ``"x:6074"``, ``"3:1001"``, or an input or output by its
        name: each frame of a PDO that contains one, otherwise read by SDO, in turn. The file grows while the recording runs.
        However the program ends, the file can be read up to its last second. Values that cannot be written in time are left out,
        and a full disk ends the recording, never the motion; both are reported. If an error ends the block, the stop of the axes is
        still recorded, until the machine is closed.

        Raises:
            StateError, ArgumentError: no such axis, node or object.
            UserError (entering it): the package mcap is not installed, or the file cannot be written.
        """
        from axisbus.record.recording import Recording

        made = Recording(self, path, axes=axes, objects=objects, clock=self._core.clock)
        self._recordings.append(made)
        return made

    def capture(
        self,
        path: str | Path,
        when: str | Condition,
        *,
        before: float = 0.5,
        after: float = 1.5,
        axes: Iterable[str] | None = None,
    ) -> Capture:
        """Store the cycles around a moment in an MCAP file, for a ``with`` block: seconds ``before`` and ``after`` it (0 to 60).

        ``when`` is one of these:

        - ``"x.velocity > 100"``, ``"|x.following_error| > 0.5"``, ``"x.state = ErrorStop"`` or ``"fault"``, in the axes' units;
        - ``"part = true"`` or ``"level > 2.5"`` of an input or output by its name;
        - ``"x.probe"``: a touch probe has latched an edge, for any program;
        - a function of the values by axis and column, which is called in each cycle and must be quick.

        The moment is the first change from false to true; a change from unknown to true does not count. If the moment does not come
        (``fired``), no file is written. ``wait()`` waits until the file exists.

        Raises:
            StateError, ArgumentError: no such axis, value, input or output, no condition, or no such time.
            UserError (entering it): the package mcap is not installed.
        """
        from axisbus.record.capture import Capture

        made = Capture(self, path, when, before=before, after=after, axes=axes, realtime=self._core.realtime)
        self._recordings.append(made)
        return made

    def serve_web(self, *, port: int = 0, command: bool = False) -> WebPage:
        """Serve the web page of this machine in a process of its own, until the page or the machine is closed.

        ``port`` of this computer's loopback, 0 for a free one. The page displays, and may halt and stop. With ``command`` the page
        takes control of the machine, after all moving axes have halted; when the page is closed, this program has control again.
        Blocks until the page is served, about 3 s.

        Raises:
            StateError: no other program can join this machine, or the page cannot be served.
            UserError: the extra ``web`` is not installed.
        """
        from axisbus.machine.opening import runs
        from axisbus.machine.web_process import WebPage, require_joinable, require_nicegui

        require_nicegui()
        require_joinable(self._core.realtime and runs(self.cell.file, joinable=True))
        page = WebPage(self.cell.file, port, command=command)
        self._pages.append(page)
        return page

    def plot_last(self, seconds: float | None = None, *, axes: Iterable[str] | None = None) -> RecordingPlot:
        """Draw the last motion, from shortly before it until shortly after its end, or until now; a notebook shows the picture.

        ``seconds``: draw this many seconds until now instead (at most 60 are stored). ``axes``: None for the axes that moved.
        The picture has a ``save(path)``. Blocks while it is drawn, and until the core has reported the events of that time. The
        last minute is stored only in interactive sessions: in a notebook, in IPython, and in Python's own interpreter; also
        after the machine was closed.

        Raises:
            StateError: the last minute is not stored here, nothing has moved in it, or there is no such axis.
            ArgumentError: no such time.
            UserError: matplotlib is not installed.
        """
        if self._last is None:
            raise StateError(
                "the last motion is stored only in an interactive session",
                remedy="begin a recording before the motion, and plot its file",
            )
        return self._last.picture(seconds, axes)

    def _joined(self, booted: Booted) -> None:
        self._registry.join(booted)

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
            EXIT.take()  # a signal that came meanwhile: the program is already ending
            _add_notes(error, failures)

    async def __aenter__(self) -> Machine:
        """Enter as ``with`` does, in an asyncio program; leaving waits in a thread, so that the event loop continues."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._core.realtime:  # nothing else runs in virtual time
            self.__exit__(kind, error, trace)
            return
        try:
            import asyncio

            await asyncio.to_thread(self.__exit__, kind, error, trace)
        finally:
            EXIT.part(self.session)  # again, because only the main thread can restore the signal handlers

    def close(self) -> None:
        """Stop every axis that this program has enabled or commanded, disable it, and release the bus. Harmless when repeated.

        Blocks until all axes are at standstill, at most for the time limits of the stop sequences.

        Raises:
            DriveError: an axis could not be stopped as requested (several: an ExceptionGroup).
            ScanError: the scan had failed before.
            KeyboardInterrupt, SystemExit: Ctrl-C or SIGTERM came meanwhile.
        """
        self._raise(self._close("the machine was closed"))

    def _begin(self) -> None:
        core = self._core
        disown_in_children(self)
        if not core.realtime:
            core.begin(self._joined, self._closing.finish)
            core.await_values()
            EXIT.join(self.session, listen=False)
            return
        core.begin(self._joined)
        atexit.register(self._at_exit)
        EXIT.join(self.session, listen=True, alone=not core.outlives_program)
        core.await_values()

    def _close(self, reason: str) -> list[AxisbusError]:
        """Close, or wait for the thread that closes; return the failures. In a forked child there is nothing to close."""
        if self._inherited:
            return []
        failures = self._closing.run(reason)
        if self._closing.over:
            EXIT.part(self.session)  # again, because only the main thread can restore the signal handlers
        return failures

    def _leave(self, reason: str) -> list[AxisbusError]:
        try:
            return self._core.leave(reason)
        finally:
            for page in self._pages:
                page.close()
            self._end_recordings()
            atexit.unregister(self._at_exit)
            EXIT.part(self.session)

    def _end_recordings(self) -> None:
        """End the recordings that had to contain the stop as well."""
        for recording in self._recordings:
            try:
                recording.close()
            except Exception:
                log.exception("the recording %s was not ended", recording.path)

    def _raise(self, failures: list[AxisbusError]) -> None:
        """Raise the exception of a signal that arrived during closing, otherwise the failures."""
        pending = EXIT.take()  # if all went well, no call from here on can be interrupted by a signal
        if pending is not None:
            _add_notes(pending, failures)
            raise pending
        if failures:
            _raise(failures)

    def _at_exit(self) -> None:
        for failure in self._close("the program ended"):
            log.error("while the program ended: %s", failure)

    def disown(self) -> None:
        """Make this object unusable in a forked child, which must neither command nor close its parent's machine."""
        self._inherited = True
        self._core.disown()
        self._commanding.disown()
        atexit.unregister(self._at_exit)


EXIT.defer_within(Machine.__exit__, Machine.close, Machine._close)


def _newest(session: MachineSession) -> float:
    """Return the time of the newest snapshot of an axis (seconds, monotonic)."""
    return max(each.now for each in session.snapshots.values())


def _add_notes(error: BaseException, failures: list[AxisbusError]) -> None:
    """Add the failures of the stop to the text of ``error``, and log them for SystemExit, which Python ends without any text."""
    for failure in failures:
        error.add_note(f"while stopping: {failure}")
        if isinstance(error, SystemExit):
            log.error("while stopping: %s", failure)


def _raise(failures: list[AxisbusError]) -> None:
    if len(failures) == 1:
        raise failures[0]
    raise ExceptionGroup(with_alarm("not everything could be stopped as commanded", *failures), failures)
