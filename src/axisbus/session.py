"""What crosses between a user's program and the core that owns its bus: commands and questions in; the image, ends and samples out.

Theory of operation
-------------------
``Axis``, ``Group``, ``Machine``, ``Recorder`` and the command line know the core by this alone. A command goes in with a number
that its owner chose, and comes back as ``CommandEvent``s with that number: one when it has control of its axis, one when it has
ended. Values come as whole images of a cycle, so that they are consistent with each other. Nothing here blocks but ``waiter``.
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
from axisbus.motion.command_status import Status
from axisbus.motion.commands import Command
from axisbus.motion.group.commands import GroupCommand
from axisbus.motion.io.commands import SetOutputs
from axisbus.motion.io.reading import IoReading
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.probing.capture import ProbeCapture
from axisbus.motion.snapshot import Snapshot
from axisbus.wording import counted

AnyCommand = Command | GroupCommand | SetOutputs
Target = str | tuple[str, ...]  # an axis or a group by name, or a group by its axes
IO: Target = ()  # the target of a command that sets outputs
Observer = Callable[[float, Mapping[str, Snapshot]], None]
HearFrames = Callable[[Sequence[CanFrame]], None]


class CommandEvent(NamedTuple):
    """How a command goes on: ``status`` and, at its end, the error that ended it and what else is to be known of it.

    ``capture``: what a touch probe has latched for it.
    """

    number: int
    status: Status
    error: AxisbusError | None
    note: str
    capture: ProbeCapture | None = None


class CommandSeen(NamedTuple):
    """A command that a core was given, by whatever program; times in seconds of the monotonic clock, ``ended`` None while it runs.

    ``name`` says what was asked, ``error`` what ended it, both for people.
    """

    given: float
    name: str
    status: Status
    ended: float | None = None
    error: str = ""


class ClientProgram(NamedTuple):
    """A program that is at a machine: ``who`` it is, for people, and whether it has the machine's command.

    ``lost_cycles`` and ``lost_frames``: of what it observes and taps, how much was left out since it came, as it did not take it in
    time.
    """

    who: str
    commands: bool
    lost_cycles: int = 0
    lost_frames: int = 0


class AxisFacts(NamedTuple):
    """What is known of an axis before anything moves: its parameters, and how its values travel."""

    parameters: AxisParameters
    capabilities: Capabilities


# Seconds: powers of two, 7.6 µs to 0.25 s, and the last takes all. The core counts in classes that end there: nothing is guessed.
LATENESS_BOUNDS = (*(2.0**exponent for exponent in range(-17, -1)), inf)


@dataclass(frozen=True, slots=True)
class LatenessReport:
    """How late the cycles were so far: times in seconds after their point of the grid; a look, which does not go on counting.

    ``p50`` and ``p99`` are rounded up by at most an eighth; ``causes``: skipped cycles, by what kept them from being done.
    ``total`` is the sum of all delays; ``within``: for each of ``LATENESS_BOUNDS``, how many cycles were less late than that.
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
        """How late they were in the mean."""
        return self.total / self.cycles if self.cycles else 0.0

    def __str__(self) -> str:
        if not self.cycles:
            return "no cycle yet"
        late = f"half of them at most {self.p50 * 1e6:.0f} µs late, 99 % {self.p99 * 1e6:.0f}, the worst {self.worst * 1e6:.0f}"
        causes = ", ".join(f"{count} because of {cause}" for cause, count in self.causes.items())
        skipped = f"; {self.skipped} skipped ({causes})" if self.skipped else ""
        return f"{counted(self.cycles, 'cycle')}, {late}{skipped}"


class AxisSession(Protocol):
    """A program's way to the axes of a core. Each property may be read, and each method called, in any thread."""

    @property
    def axes(self) -> Mapping[str, AxisFacts]:
        """The axes that are there, by name; those of optional nodes may come later."""

    @property
    def snapshots(self) -> Mapping[str, Snapshot]:
        """The image of the last cycle: every axis by name, in increments."""

    @property
    def dead(self) -> str | None:
        """Why nothing is known of any axis, and will not be; None while the core lives, and after it was ended well."""

    @property
    def silent(self) -> str | None:
        """Why the image is no longer of now, None while it is."""

    @property
    def ended(self) -> bool:
        """Whether no cycle will come any more."""

    @property
    def failed(self) -> bool:
        """Whether the core has ended by a failure."""

    @property
    def leaving_because(self) -> str | None:
        """Why no command is taken any more; None while they are."""

    @property
    def lateness(self) -> LatenessReport:
        """How late the cycles were so far, how many were skipped, and why."""

    @property
    def waiter(self) -> Waiter:
        """How a program waits: in real time, or in virtual time by letting it pass."""

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> int:
        """Let a command for an axis, a group or outputs (``IO``) wait for the next cycles; ``name`` is for people.

        Return its number: that of the same command where it waits already. A command that is not taken ends by an event.

        Raises:
            StateError: this is a forked child, in which no core runs.
        """

    def listen(self, hear: Callable[[CommandEvent], None]) -> None:
        """Let ``hear`` have every event of a command; it is called in the core's threads, so it must be quick and not raise."""

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """Make a group of axes that cell.toml does not name, once."""

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """Ask for the stop of all that this program has commanded, and take no command any more; safe in a signal handler."""

    def request_halt(self, reason: str, number: int) -> None:
        """Ask for a halt of all that this program has commanded, and end what waits; it may command on. Safe in a signal handler.

        ``number`` (from 1) tells one interrupt, which may be told twice, from the next: that is a quick stop while something moves.
        """

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """Halt everything that this program has commanded unless this is said again within ``seconds``; None: no more.

        ``continuous``: the same while an axis is in continuous motion, in velocity or under torque; None: as long.
        """

    def observe(self, observer: Observer) -> None:
        """Let ``observer`` have the time and the image after each cycle, in the core's thread."""

    def forget(self, observer: Observer) -> None:
        """Let ``observer`` have no more."""


class MachineSession(AxisSession, Protocol):
    """A program's way to the core: its axes, and what it has to tell of the nodes and the bus; also after it has ended."""

    @property
    def readings(self) -> Mapping[str, IoReading]:
        """What is known of every input and output after the last cycle, by name; none of nodes that are not there."""

    @property
    def left(self) -> tuple[float, str] | None:
        """Since when (seconds, monotonic) and why no command is taken any more; None while they are."""

    @property
    def node_events(self) -> list[NodeEvent]:
        """What error control has told of all nodes since the scan began."""

    @property
    def bus_events(self) -> list[ControllerEvent]:
        """What the CAN controller has told, oldest first; empty without a bus."""

    @property
    def commands(self) -> list[CommandSeen]:
        """The last 256 commands that were given, by whatever program, oldest first."""

    @property
    def drops(self) -> tuple[Drop, ...]:
        """Frames that were dropped, counted by reason and node; empty without a bus."""

    @property
    def sdo_counts(self) -> tuple[SdoCount, ...]:
        """How the SDO transfers with each node ended so far, by node; empty without a bus."""

    @property
    def carried(self) -> BusTraffic | None:
        """What the bus has carried so far, in both directions; None without a bus."""

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """The programs that are at this machine, the one that opened it first; empty where no other can join."""

    @property
    def has_command(self) -> bool:
        """Whether this program has the command of the machine; it may block for an answer."""

    def take_command(self) -> None:
        """Let this program have the command, after all that moves has halted; blocks until that is done. Harmless where it has it.

        Raises:
            StateError: an axis does not come to rest.
            Stopped: this program has been told to stop.
        """

    def tap(self, hear: HearFrames, can_ids: Collection[int] = ()) -> None:
        """Let ``hear`` have the frames of the bus, a few at a time, as they come and go: those of ``can_ids``, or all.

        It is called in threads of the core, or in the one that tells events, and must not block. Without a bus it never is. What
        nobody takes in time is left out.
        """

    def untap(self, hear: HearFrames) -> None:
        """Let ``hear`` have no more."""

    @property
    def bus_time(self) -> datetime | None:
        """The time of day by another device's TIME messages, in UTC; None where none was heard."""
