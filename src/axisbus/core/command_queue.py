"""The queue of commands from a program's threads to the scan: limited, and never an obstacle to a stop.

Theory of operation
-------------------
A cycle takes at most ``COMMANDS_PER_CYCLE`` commands, in the order of submission; the others wait for the next cycle. At most
``QUEUE_LIMIT`` commands are queued, and any further one is refused: neither the scan nor the memory can be flooded. Two rules make
this harmless.

- **A stop never waits.** Halt, stop, quick stop and disable are taken in the present cycle, however many commands are queued before
  them. Queued commands for the same axes end as stopped and are not begun. A stop is accepted even if the queue is full.
- **A repeated command is one command.** If the same command is submitted again while it is queued, with no other command for its
  axes in between, both submissions share one ticket. This applies to commands with no additional effect when repeated
  (``_IDEMPOTENT``, and the renewal of a jog).

The scan takes commands without a lock; only submitting threads exclude each other. A command is taken out only once (``_pop``).
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from weakref import WeakSet, WeakValueDictionary

from axisbus.errors import Stopped
from axisbus.motion import commands as c
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.group.commands import ForEach, GroupCommand
from axisbus.motion.io import SetOutputs
from axisbus.session import AnyCommand, Target

COMMANDS_PER_CYCLE = 32  # commands in one cycle: about half a millisecond
QUEUE_LIMIT = 1024  # queued commands
_STOP_COMMANDS = frozenset({c.Halt, c.Stop, c.QuickStop, c.Disable})
_IDEMPOTENT = _STOP_COMMANDS | {c.EnableCommand, c.ResetCommand, c.Release}


class QueuedCommand:
    """A command that waits for the scan; ``taken`` is set when the scan has taken it."""

    __slots__ = ("__weakref__", "axes", "command", "is_stop", "taken", "target", "ticket")

    def __init__(self, target: Target, command: AnyCommand, ticket: CommandStatus) -> None:
        self.target = target
        self.command = command
        self.ticket = ticket
        self.axes = _axes_of(target, command)
        self.is_stop = is_stop(command)
        self.taken = False

    @property
    def for_group(self) -> bool:
        """Whether it is for a group."""
        return isinstance(self.command, GroupCommand)

    def repeats(self, other: QueuedCommand) -> bool:
        """Whether it is the same command as ``other``, with no additional effect when repeated."""
        if self.target != other.target or self.command != other.command:
            return False
        return all(type(one) in _IDEMPOTENT or _is_jog(one) for one in _single_commands(self.command))


def is_stop(command: AnyCommand) -> bool:
    """Whether a command only stops axes, or takes their power: it never waits for others."""
    return all(type(one) in _STOP_COMMANDS for one in _single_commands(command))


class CommandQueue:
    """Holds the queued commands, in order: ``_incoming`` by any thread, ``_remaining`` by the scan from the previous cycle."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # re-entrant: logging in here may stop an axis
        self._incoming: deque[QueuedCommand] = deque()
        self._remaining: deque[QueuedCommand] = deque()
        self._last: WeakValueDictionary[str, QueuedCommand] = (
            WeakValueDictionary()
        )  # the last one for each axis
        self._late_stops: WeakSet[QueuedCommand] = (
            WeakSet()
        )  # stops that were accepted while the queue was full
        self._closed = False

    def __len__(self) -> int:
        return len(self._incoming) + len(self._remaining)

    def put(self, queued: QueuedCommand) -> QueuedCommand | None:
        """Queue a command; return it, or the same one that is already queued. None if the queue is full. Any thread."""
        with self._lock:
            if self._closed:
                return None
            same = self._equal_queued(queued)
            if same is not None:
                return same
            if len(self) < QUEUE_LIMIT:
                self._late_stops.clear()
            elif queued.is_stop:
                self._late_stops.add(queued)
            else:
                return None
            self._incoming.append(queued)
            for axis in queued.axes:
                self._last[axis] = queued
            return queued

    def take(self) -> list[QueuedCommand]:
        """Return the commands for this cycle, in order; the scan's thread."""
        if not self._incoming and not self._remaining:
            return []
        self._remaining.extend(_pop(self._incoming, len(self._incoming)))
        taken = list(_pop(self._remaining, COMMANDS_PER_CYCLE))
        if self._remaining:
            taken += self._take_stops()
        for queued in taken:
            queued.taken = True
        return taken

    def close(self) -> None:
        """Accept no more commands."""
        with self._lock:
            self._closed = True

    def open(self) -> None:
        """Accept commands again."""
        with self._lock:
            self._closed = False

    def clear(self) -> Iterator[QueuedCommand]:
        """Take out all commands; any thread, each command goes to only one."""
        for queue in (self._remaining, self._incoming):
            for queued in _pop(queue, len(queue)):
                queued.taken = True
                yield queued

    def _equal_queued(self, queued: QueuedCommand) -> QueuedCommand | None:
        """Return an equal queued command if no other command for its axes follows it (after a late stop none does)."""
        last = {self._last.get(axis) for axis in queued.axes}
        candidates = [*(last if len(last) == 1 else ()), *self._late_stops]
        return next((one for one in candidates if one and not one.taken and queued.repeats(one)), None)

    def _take_stops(self) -> list[QueuedCommand]:
        """Take the stops out of the remaining commands, and end the commands that they overtake."""
        remaining = list(self._remaining)
        if not any(queued.is_stop for queued in remaining):
            return []
        stops: list[QueuedCommand] = []
        remaining_commands: deque[QueuedCommand] = deque()
        stop_of_axis: dict[str, QueuedCommand] = {}
        for queued in reversed(remaining):
            stop = next((stop_of_axis[axis] for axis in queued.axes if axis in stop_of_axis), None)
            if queued.is_stop:
                stops.append(queued)
                stop_of_axis.update(dict.fromkeys(queued.axes, queued))
            elif stop is None:
                remaining_commands.appendleft(queued)
            else:
                _end_overtaken(queued, stop)
        self._remaining = remaining_commands
        return stops[::-1]


def _pop(queue: deque[QueuedCommand], limit: int) -> Iterator[QueuedCommand]:
    """Take out at most ``limit`` commands; another thread may do so at the same time."""
    for _ in range(limit):
        try:
            yield queue.popleft()
        except IndexError:
            return


def _end_overtaken(queued: QueuedCommand, stop: QueuedCommand) -> None:
    queued.taken = True
    error = Stopped(
        f"{queued.ticket.name} had not begun when {stop.ticket.name} was commanded",
        observed=f"it waited behind other commands: the scan accepts {COMMANDS_PER_CYCLE} in each of its cycles",
        remedy="give it again, and wait for the handles of commands before you give more",
    )
    queued.ticket.finish(Status.ABORTED, error)


def _single_commands(command: AnyCommand) -> tuple[object, ...]:
    """Return the commands for single axes that it consists of."""
    return tuple(command.commands.values()) if isinstance(command, ForEach) else (command,)


def _is_jog(command: object) -> bool:
    return isinstance(command, c.MoveVelocity) and command.life is not None


def _axes_of(target: Target, command: AnyCommand) -> tuple[str, ...]:
    if isinstance(command, SetOutputs):
        return ()
    if isinstance(command, GroupCommand):
        return command.axes
    if isinstance(command, c.SetOverride | c.SetTorqueOffset):
        return ()  # a stop does not affect them
    return (target,) if isinstance(target, str) else target
