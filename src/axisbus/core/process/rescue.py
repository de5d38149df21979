"""Stop the drives of a dead core: its last frames as quick stop, SYNC, then by SDO until each axis is seen at standstill.

Nodes of other protocols are stopped at the same time, by their own messages.
"""

from __future__ import annotations

import math
import mmap
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from axisbus.bus.cycle import repeating_frames
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.port import CanPort
from axisbus.cell.io_signals import all_points
from axisbus.cell.model import CellConfig
from axisbus.cia401.signal import IoPoint
from axisbus.core.core import Core
from axisbus.core.files import read_once
from axisbus.core.io import make_safe
from axisbus.core.other_protocols import parts_of, stop_drives
from axisbus.core.process.bus_factory import open_bus
from axisbus.core.process.startup_args import StartupArgs
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError
from axisbus.ipc import image, rescue_memory
from axisbus.ipc.io_image import IoImage
from axisbus.ipc.messages import CODEC, Rescued
from axisbus.ipc.rescue_memory import NO_WORD, CoreStage, LifelineWriter, RescueRpdo
from axisbus.ipc.stream import MessageStream
from axisbus.link import StopResult, Unsafe
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.snapshot import Snapshot

OPEN_RETRY_TIME = 1.0  # seconds: a driver may take a moment to notice that its last user is dead
_PAUSE = 0.05
_HUNG_TIME = 0.5  # seconds without a cycle, at least, after which a core that should run counts as hung
_UNCOMMANDED_TIME = 10.0  # the same while no axis was commanded and no output set: nothing is to be stopped, a computer may pause
_REOPEN_TIME = 10.0  # seconds for a core whose adapter has failed to open it again and to stop its drives; a driver may block
_CYCLIC_STAGES = (CoreStage.RUNNING, CoreStage.LEAVING)  # a core runs cycles
_RELEASE_TIME = 20.0  # seconds for a core that has stopped its axes to end its scan, and to leave its nodes
_END_TIME = 10.0  # seconds for a core that has left its nodes to report it, and to end
_CLOSE_TIME = 2.0  # seconds for the report to the program


class CrashStop:
    """The data of a watchdog process for a rescue, read while the core boots; holds the memory with the core's stage."""

    def __init__(self, startup_args: StartupArgs) -> None:
        self._startup_args = startup_args
        self._memory = mmap.mmap(startup_args.memory, 0)
        self._offset = image.size_of(startup_args.axes)
        self._cell, self._dictionaries = read_once(startup_args.cell)
        parts_of(self._cell)  # imports the plug-ins of other protocols: a rescue must not wait for that
        bus = self._cell.bus
        hung = max(_HUNG_TIME, 25 * bus.scan_period, _HUNG_TIME + (bus.sync_timeout or 0.0))
        self._patience = {
            CoreStage.RUNNING: hung,
            CoreStage.LEAVING: hung,
            CoreStage.LOST: _REOPEN_TIME,
            CoreStage.RELEASING: _RELEASE_TIME,
            CoreStage.LEFT: _END_TIME,
        }

    @property
    def number(self) -> int:
        """The number of the newest image."""
        return image.number_of(self._memory)

    @property
    def stage(self) -> CoreStage:
        """The stage of the core."""
        return rescue_memory.stage_of(self._memory, self._offset)

    def patience(self, stage: CoreStage) -> float:
        """Return for how many seconds a core may run no cycle in a stage."""
        return self._patience.get(stage, math.inf)

    def is_hung(self, stage: CoreStage, idle: float) -> bool:
        """Whether a core that has run no cycle for ``idle`` seconds in a stage shall be killed."""
        if idle <= self.patience(stage):
            return False
        return stage not in _CYCLIC_STAGES or idle > _UNCOMMANDED_TIME or self._has_commanded

    @property
    def _has_commanded(self) -> bool:
        return bool(rescue_memory.found(self._memory, self._offset).axes or self._outputs())

    @property
    def is_needed(self) -> bool:
        """Whether the dead core has not left its drives properly."""
        return self.stage not in (CoreStage.OPENING, CoreStage.LEFT)

    def rescue(self, why: str) -> Rescued:
        """Stop the drives, make outputs safe, report to the program, and return the report; blocks. ``why``: how the core ended."""
        found = rescue_memory.found(self._memory, self._offset)
        names = [list(self._cell.axes)[axis] for axis in found.axes]
        rescued = self._stop(why, names, found.frames)
        self._report(rescued)
        return rescued

    def report(self, why: str) -> None:
        """Report to the program how a core ended whose drives need no stop; blocks."""
        self._report(Rescued(why, (), left=self.stage is CoreStage.LEFT))

    def _report(self, rescued: Rescued) -> None:
        stream = MessageStream(
            socket.socket(fileno=self._startup_args.report_line), CODEC.pack, "axisbus watchdog"
        )
        stream.send(rescued)
        stream.close(_CLOSE_TIME)
        stream.finish()

    def _stop(self, why: str, names: Sequence[str], frames: Sequence[tuple[int, bytes]]) -> Rescued:
        outputs = self._outputs()
        if not names and not outputs:
            return Rescued(why, ())
        stopped, unsafe = stop(self._cell, self._dictionaries, self._open, names, frames, outputs)
        unconfirmed = {each.output for each in unsafe}
        safe = tuple(point.name for point in outputs if point.name not in unconfirmed)
        return Rescued(why, tuple(stopped), tuple(unsafe), safe)

    def _outputs(self) -> list[IoPoint]:
        """Return the outputs that had been set."""
        readings = IoImage(self._memory, self._startup_args.axes, tuple(self._cell.io)).read()
        points = all_points(self._cell, self._dictionaries)
        return [
            point for point in points.values() if (seen := readings.get(point.name)) is not None and seen.set
        ]

    def _open(self) -> Channel:
        drives = self._startup_args.drives
        return open_bus(self._cell, socket.socket(fileno=drives) if drives >= 0 else None)


def stop(
    cell: CellConfig,
    dictionaries: Mapping[int, Eds],
    open_channel: Callable[[], Channel],
    names: Sequence[str],
    frames: Sequence[tuple[int, bytes]],
    outputs: Sequence[IoPoint] = (),
) -> tuple[list[StopResult], list[Unsafe]]:
    """Stop the axes of these names, and return the result of each; blocks until standstill, at most about 6 s.

    Then ``outputs`` are set to their safe states; those without confirmation are returned too. ``frames`` stop the axes by PDO. The
    nodes are left as they are, because their own monitoring of our heartbeat is the last protection.
    """
    try:
        channel = _opened(open_channel)
    except AxisbusError as error:
        text = f"NOT STOPPED by this computer: {error.message}; only its drive's own watchdog can stop it now"
        return [StopResult(name, False, text) for name in names], [
            _out_of_reach(point, error) for point in outputs
        ]
    with channel, repeating_frames(channel, [*frames, *_sync(cell)] if frames else []):
        return _stop_by_sdo(channel, cell, dictionaries, names, outputs)


def _out_of_reach(point: IoPoint, error: AxisbusError) -> Unsafe:
    return Unsafe(point.name, point.node, f"{point.object_text} of node {point.node}: {error.message}")


def _opened(open_channel: Callable[[], Channel]) -> Channel:
    until = time.monotonic() + OPEN_RETRY_TIME
    while True:
        try:
            return open_channel()
        except AxisbusError:
            if time.monotonic() > until:
                raise
        time.sleep(_PAUSE)


def _sync(cell: CellConfig) -> list[tuple[int, bytes]]:
    """Return the SYNC that makes the PDO quick stop effective; another device's SYNC continues without the core."""
    bus = cell.bus
    return [(bus.sync_cob_id, b"\1" if bus.sync_counter else b"")] if bus.sync and not bus.hears_sync else []


def _stop_by_sdo(
    channel: Channel,
    cell: CellConfig,
    dictionaries: Mapping[int, Eds],
    names: Sequence[str],
    outputs: Sequence[IoPoint],
) -> tuple[list[StopResult], list[Unsafe]]:
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(CanopenNode(channel, node_id, eds)) for node_id, eds in dictionaries.items()
        ]
        stopped = stop_drives(cell, channel, nodes, names)
        return stopped, make_safe(channel.clock, {node.node_id: node.sdo for node in nodes}, outputs)


# ----------------------------------------------------------------------------------------------------------------------
# Maintain the lifeline of a core: the data for a rescue, stored after each cycle, and the check that its watchdog process runs.
#
# Theory of operation
# The watchdog process sends a byte every ``BEAT_PERIOD`` seconds. A missing byte may mean that the process was stopped (SIGSTOP, a
# debugger) or hangs; then nothing would stop the axes in place of the core. Or the computer is too busy to run it. Therefore only
# time counts in which the core itself checked on time, and a watchdog process that waits for a processor or a disk gets more
# time.


BEAT_PERIOD = 0.1  # seconds
NO_WATCHDOG = "if the core fails, nothing stops the axes"
_MAX_SILENCE = 0.6  # seconds without a byte
_MAX_STARVATION = 5.0  # the same for a watchdog process that waits
_ON_TIME = 3 * BEAT_PERIOD  # seconds between two checks; more shows that this computer did not run
_WAITING = ("R", "D")  # states of a process that waits for a processor or for a disk (proc(5))
_SEEN = 2  # checks without waiting: at the first one its byte may be on its way


class WatchdogProcessMonitor:
    """Decides by the bytes of a watchdog process whether it runs; holds the time without a byte. Times in seconds."""

    def __init__(self, now: float, state: Callable[[], str]) -> None:
        """``state`` returns the state of its process, a letter of proc(5), empty if unknown."""
        self._state = state
        self._before = now
        self._silent = 0.0
        self._seen = 0

    def poll(self, now: float, received: bool) -> str | None:
        """Return why axes must be stopped now, None while the process runs; ``received``: a byte, since the last check."""
        passed, self._before = now - self._before, now
        if received:
            self._silent, self._seen = 0.0, 0
            return None
        self._silent += passed if passed < _ON_TIME else 0.0
        if self._silent <= _MAX_SILENCE:
            return None
        waits = self._state() in _WAITING
        self._seen = 0 if waits else self._seen + 1
        if self._seen >= _SEEN:
            return (
                f"the watchdog process of the core has not answered for {self._silent:.1f} s: {NO_WATCHDOG}"
            )
        if waits and self._silent > _MAX_STARVATION:
            return f"the watchdog process of the core got no processor time for {self._silent:.1f} s: {NO_WATCHDOG}"
        return None


def state_of(process: int) -> str:
    """Return the state of a process as a letter of proc(5), empty if unknown."""
    try:
        return (
            Path(f"/proc/{process}/stat")
            .read_text(encoding="ascii", errors="replace")
            .rpartition(")")[2]
            .split()[0]
        )
    except (OSError, IndexError):
        return ""


class Lifeline:
    """Stores the last sent frames, and the commanded axes; holds the axes that it has entered. Belongs to the scan's thread.

    Virtual axes are not included: no drive would keep moving without the core. For a module no frame is stored: the frames that
    stop it are always the same, and a rescue makes them.
    """

    def __init__(self, memory: mmap.mmap, offset: int, core: Core, names: Sequence[str]) -> None:
        """``names``: all axes of the cell, in the order of their numbers."""
        self._writer = LifelineWriter(memory, offset)
        self._core = core
        self._numbers = {name: number for number, name in enumerate(names)}
        self._known: dict[str, tuple[int, AxisCore, CanPort | None]] = {}
        self._renewed = len(core.scan.renewals)
        self._virtual = core.cell.axes.keys() - core.cell.driven.keys()
        for name in (name for name in core.scan.axes if name not in self._virtual):
            self._enter(name)

    def stage(self, stage: CoreStage) -> None:
        """Store the stage of the core; before the scan begins, and after it has ended."""
        self._writer.stage(stage)

    def after_cycle(self, _now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Store the frames of this cycle; does not block."""
        while len(self._core.scan.renewals) > self._renewed:  # its RPDOs may have another mapping now
            self._enter(self._core.scan.renewals[self._renewed])
            self._renewed += 1
        if len(snapshots) > len(self._known) + len(self._virtual):
            for name in snapshots.keys() - self._known.keys() - self._virtual:
                self._enter(name)
        for number, axis, port in self._known.values():
            if axis.touched:
                self._writer.touched(number)
                if port is not None:
                    self._writer.sent(port.committed)

    def _enter(self, name: str) -> None:
        port = self._core.runtime.ports[name]
        number = self._numbers[name]
        if not isinstance(port, CanPort):
            self._writer.enter([RescueRpdo(number)])
            self._known[name] = number, self._core.scan.axes[name], None
            return
        controlword_shifts, offsets = dict(port.controlwords), dict(port.cleared_bits)
        rpdos = [
            RescueRpdo(number, cob_id, controlword_shifts.get(cob_id, NO_WORD), offsets.get(cob_id, 0))
            for cob_id in offsets | controlword_shifts
        ]
        self._writer.enter(rpdos or [RescueRpdo(number)])
        self._known[name] = number, self._core.scan.axes[name], port
