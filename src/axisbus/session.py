"""The interface between a user's program and its core: commands and requests in; process images, command ends and samples out.

Theory of operation
-------------------
``Axis``, ``Group``, ``Machine``, ``Recorder`` and the command line use the core only through this interface. A command goes in with
a number that its caller chose, and comes back as ``CommandEvent``s with that number: one when it has control of its axis, one when
it has ended. Values come as whole process images of a cycle, so that they are consistent with each other. Only ``waiter`` blocks.
``core.inprocess`` runs the core in the process of the program.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from math import inf
from typing import NamedTuple, Protocol

from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.frame import BusTraffic, CanFrame
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia402.port import Capabilities, Waiter
from axisbus.errors import AxisbusError
from axisbus.motion.command_status import ProbeCapture, Status
from axisbus.motion.commands import Command
from axisbus.motion.group.commands import GroupCommand
from axisbus.motion.io import IoReading, SetOutputs
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.wording import counted

AnyCommand = Command | GroupCommand | SetOutputs
Target = str | tuple[str, ...]  # an axis or a group by name, or a group by its axes
IO: Target = ()  # the target of a command that sets outputs
Observer = Callable[[float, Mapping[str, Snapshot]], None]
OnFrames = Callable[[Sequence[CanFrame]], None]


class CommandEvent(NamedTuple):
    """A change of a command's status: ``status`` and, at its end, the error that ended it and a remark.

    ``capture``: a position that a touch probe has latched for it.
    """

    number: int
    status: Status
    error: AxisbusError | None
    note: str
    capture: ProbeCapture | None = None


class CommandSeen(NamedTuple):
    """A command from any program; times in seconds of the monotonic clock, ``ended`` is None while it runs.

    ``name`` is the text of the call, ``error`` that of the error that ended it.
    """

    given: float
    name: str
    status: Status
    ended: float | None = None
    error: str = ""


class ClientProgram(NamedTuple):
    """A program that is connected to a machine: ``who`` it is, as text, and whether it has control of the machine.

    ``lost_cycles`` and ``lost_frames``: the observed cycles and tapped frames that were left out since it connected, because it did
    not take them in time.
    """

    who: str
    commands: bool
    lost_cycles: int = 0
    lost_frames: int = 0


class AxisFacts(NamedTuple):
    """The facts about an axis before any motion: its parameters, and how its values are transported."""

    parameters: AxisParameters
    capabilities: Capabilities


# Seconds: powers of two, 7.6 µs to 0.25 s; the last class has no upper bound. The core counts in classes with these bounds.
LATENESS_BOUNDS = (*(2.0**exponent for exponent in range(-17, -1)), inf)


@dataclass(frozen=True, slots=True)
class LatenessReport:
    """The lateness of the cycles so far: seconds after their time of the grid. A copy that does not change afterwards.

    ``p50`` and ``p99`` are rounded up by at most an eighth; ``causes``: skipped cycles by cause. ``total`` is the sum of all
    delays; ``within``: for each of ``LATENESS_BOUNDS``, the number of cycles with less lateness.
    """

    cycles: int = 0
    skipped: int = 0
    total: float = 0.0
    p50: float = 0.0
    p99: float = 0.0
    worst: float = 0.0
    causes: Mapping[str, int] = field(default_factory=dict)
    within: tuple[int, ...] = (0,) * len(LATENESS_BOUNDS)

    @property
    def mean(self) -> float:
        """Mean lateness in seconds."""
        return self.total / self.cycles if self.cycles else 0.0

    def __str__(self) -> str:
        if not self.cycles:
            return "no cycle yet"
        late = f"half of them at most {self.p50 * 1e6:.0f} µs late, 99 % {self.p99 * 1e6:.0f}, the worst {self.worst * 1e6:.0f}"
        causes = ", ".join(f"{count} because of {cause}" for cause, count in self.causes.items())
        skipped = f"; {self.skipped} skipped ({causes})" if self.skipped else ""
        return f"{counted(self.cycles, 'cycle')}, {late}{skipped}"


class AxisSession(Protocol):
    """A program's connection to the axes of a core. Any thread may read its properties and call its methods."""

    @property
    def axes(self) -> Mapping[str, AxisFacts]:
        """The present axes, by name; those of optional nodes may come later."""

    @property
    def snapshots(self) -> Mapping[str, Snapshot]:
        """The process image of the last cycle: every axis by name, in increments."""

    @property
    def dead(self) -> str | None:
        """Why all axes are unknown for good; None while the core runs, and after it was ended in the normal manner."""

    @property
    def silent(self) -> str | None:
        """Why the process image is no longer up to date, None while it is."""

    @property
    def ended(self) -> bool:
        """Whether there will be no further cycle."""

    @property
    def failed(self) -> bool:
        """Whether the core has ended by a failure."""

    @property
    def leaving_because(self) -> str | None:
        """Why no more commands are accepted; None while they are."""

    @property
    def lateness(self) -> LatenessReport:
        """The lateness of the cycles so far, and the skipped cycles with their causes."""

    @property
    def waiter(self) -> Waiter:
        """How a program waits: in real time, or in virtual time by advancing it."""

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> int:
        """Queue a command for an axis, a group or outputs (``IO``) for the next cycles; ``name`` is a text for messages.

        Return its number: that of the same command, if one is already queued. A command that is rejected ends by an event.

        Raises:
            StateError: this is a forked child, in which no core runs.
        """

    def listen(self, callback: Callable[[CommandEvent], None]) -> None:
        """Call ``callback`` with every command event, in the core's threads: it must be quick and must not raise."""

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """Make a group of axes that cell.toml does not name, once."""

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """Request the stop of all axes that this program has commanded, and accept no more commands; safe in a signal handler."""

    def request_halt(self, reason: str, number: int) -> None:
        """Request a halt of all axes that this program has commanded, and end queued commands. Safe in a signal handler.

        The program may command again afterwards. ``number`` (from 1) identifies an interrupt, which may be reported twice. The next
        interrupt is a quick stop while an axis moves.
        """

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """Halt the axes that this program has commanded unless this is called again within ``seconds``; None ends this.

        ``continuous``: the same while an axis is in continuous motion, in velocity or under torque; None: the same time.
        """

    def observe(self, observer: Observer) -> None:
        """Call ``observer`` with the time and the process image after each cycle, in the core's thread."""

    def forget(self, observer: Observer) -> None:
        """Stop calling ``observer``."""


class MachineSession(AxisSession, Protocol):
    """A program's connection to the core: its axes, and reports about nodes and the bus; also after it has ended."""

    @property
    def readings(self) -> Mapping[str, IoReading]:
        """The state of every input and output after the last cycle, by name; without those of absent nodes."""

    @property
    def left(self) -> tuple[float, str] | None:
        """Time (seconds, monotonic) and reason since when no more commands are accepted; None while they are."""

    @property
    def node_events(self) -> list[NodeEvent]:
        """The events of error control for all nodes since the scan began."""

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """The events of the CAN controller, oldest first."""

    @property
    def commands(self) -> list[CommandSeen]:
        """The last 256 commands from any program, oldest first."""

    @property
    def drops(self) -> tuple[Drop, ...]:
        """Dropped frames, counted by reason and node."""

    @property
    def sdo_counts(self) -> tuple[SdoCount, ...]:
        """The results of the SDO transfers so far, by node."""

    @property
    def carried(self) -> BusTraffic | None:
        """The traffic of the bus so far, in both directions; None before the first cycle."""

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """The programs connected to this machine, beginning with the one that opened it; empty if no other can join."""

    @property
    def has_control(self) -> bool:
        """Whether this program has control of the machine; it may block for an answer."""

    def take_control(self) -> None:
        """Give control to this program, after all moving axes have halted; blocks until then. Harmless if it has control.

        Raises:
            StateError: an axis does not come to rest.
            Stopped: this program has been asked to stop.
        """

    def tap(self, callback: OnFrames, can_ids: Collection[int] = ()) -> None:
        """Call ``callback`` with the received and sent frames of the bus, a few at a time: those of ``can_ids``, or all.

        It runs in threads of the core, or in the thread that delivers events, and must not block. Without a bus it is never called.
        Frames that are not read in time are left out.
        """

    def untap(self, callback: OnFrames) -> None:
        """Stop calling ``callback``."""

    @property
    def bus_time(self) -> datetime | None:
        """The time of day by another device's TIME messages, in UTC; None if none was received."""
