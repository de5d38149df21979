"""The queue of commands from a program's threads to the scan: limited, and never an obstacle to a stop.

Theory of operation
-------------------
A cycle takes at most ``AT_ONCE`` commands, in the order of submission; the others wait for the next cycle. At most ``MOST``
commands are queued, and any further one is refused: neither the scan nor the memory can be flooded. Two rules make this harmless.

- **A stop never waits.** Halt, stop, quick stop and disable are taken in the present cycle, however many commands are queued before
  them. Queued commands for the same axes end as stopped and are not begun. A stop is accepted even if the queue is full.
- **A repeated command is one command.** If the same command is submitted again while it is queued, with no other command for its
  axes in between, both submissions share one ticket. This applies to commands with no additional effect when repeated
  (``_IDEMPOTENT``, and the renewal of a jog).

The scan takes commands without a lock; only submitting threads exclude each other. A command is taken out only once (``_out``).
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

AT_ONCE = 32  # commands in one cycle: about half a millisecond
MOST = 1024  # queued commands
_STOPS = frozenset({c.Halt, c.Stop, c.QuickStop, c.Disable})
_IDEMPOTENT = _STOPS | {c.EnableCommand, c.ResetCommand, c.Release}


class Waiting:
    """A command that waits for the scan; ``taken`` is set when the scan has taken it."""

    __slots__ = ("__weakref__", "axes", "command", "is_stop", "taken", "target", "ticket")

    def __init__(self, target: Target, command: AnyCommand, ticket: CommandStatus) -> None:
        self.target = target
        self.command = command
        self.ticket = ticket
        self.axes = _concerned(target, command)
        self.is_stop = is_stop(command)
        self.taken = False

    @property
    def for_group(self) -> bool:
        """Whether it is for a group."""
        return isinstance(self.command, GroupCommand)

    def is_again(self, other: Waiting) -> bool:
        """Whether it is the same command as ``other``, with no additional effect when repeated."""
        if self.target != other.target or self.command != other.command:
            return False
        return all(type(one) in _IDEMPOTENT or _is_jog(one) for one in _single(self.command))


def is_stop(command: AnyCommand) -> bool:
    """Whether a command only stops axes, or takes their power: it never waits for others."""
    return all(type(one) in _STOPS for one in _single(command))


class CommandQueue:
    """Holds the queued commands, in order: ``_given`` by any thread, ``_left`` by the scan from the previous cycle."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # re-entrant: logging in here may stop an axis
        self._given: deque[Waiting] = deque()
        self._left: deque[Waiting] = deque()
        self._last: WeakValueDictionary[str, Waiting] = WeakValueDictionary()  # the last one for each axis
        self._late: WeakSet[Waiting] = WeakSet()  # stops that were accepted while the queue was full
        self._closed = False

    def __len__(self) -> int:
        return len(self._given) + len(self._left)

    def put(self, waiting: Waiting) -> Waiting | None:
        """Queue a command; return it, or the same one that is already queued. None if the queue is full. Any thread."""
        with self._lock:
            if self._closed:
                return None
            same = self._same(waiting)
            if same is not None:
                return same
            if len(self) < MOST:
                self._late.clear()
            elif waiting.is_stop:
                self._late.add(waiting)
            else:
                return None
            self._given.append(waiting)
            for axis in waiting.axes:
                self._last[axis] = waiting
            return waiting

    def take(self) -> list[Waiting]:
        """Return the commands for this cycle, in order; the scan's thread."""
        if not self._given and not self._left:
            return []
        self._left.extend(_out(self._given, len(self._given)))
        taken = list(_out(self._left, AT_ONCE))
        if self._left:
            taken += self._stops()
        for waiting in taken:
            waiting.taken = True
        return taken

    def close(self) -> None:
        """Accept no more commands."""
        with self._lock:
            self._closed = True

    def open(self) -> None:
        """Accept commands again."""
        with self._lock:
            self._closed = False

    def clear(self) -> Iterator[Waiting]:
        """Take out all commands; any thread, each command goes to only one."""
        for queue in (self._left, self._given):
            for waiting in _out(queue, len(queue)):
                waiting.taken = True
                yield waiting

    def _same(self, waiting: Waiting) -> Waiting | None:
        """Return an equal queued command if no other command for its axes follows it (after a late stop none does)."""
        last = {self._last.get(axis) for axis in waiting.axes}
        candidates = [*(last if len(last) == 1 else ()), *self._late]
        return next((one for one in candidates if one and not one.taken and waiting.is_again(one)), None)

    def _stops(self) -> list[Waiting]:
        """Take the stops out of the remaining commands, and end the commands that they overtake."""
        left = list(self._left)
        if not any(waiting.is_stop for waiting in left):
            return []
        stops: list[Waiting] = []
        kept: deque[Waiting] = deque()
        by: dict[str, Waiting] = {}
        for waiting in reversed(left):
            stop = next((by[axis] for axis in waiting.axes if axis in by), None)
            if waiting.is_stop:
                stops.append(waiting)
                by.update(dict.fromkeys(waiting.axes, waiting))
            elif stop is None:
                kept.appendleft(waiting)
            else:
                _overtaken(waiting, stop)
        self._left = kept
        return stops[::-1]


def _out(queue: deque[Waiting], most: int) -> Iterator[Waiting]:
    """Take out at most ``most`` commands; another thread may do so at the same time."""
    for _ in range(most):
        try:
            yield queue.popleft()
        except IndexError:
            return


def _overtaken(waiting: Waiting, stop: Waiting) -> None:
    waiting.taken = True
    error = Stopped(
        f"{waiting.ticket.name} had not begun when {stop.ticket.name} was commanded",
        observed=f"it waited behind other commands: the scan accepts {AT_ONCE} in each of its cycles",
        remedy="give it again, and wait for the handles of commands before you give more",
    )
    waiting.ticket.finish(Status.ABORTED, error)


def _single(command: AnyCommand) -> tuple[object, ...]:
    """Return the commands for single axes that it consists of."""
    return tuple(command.commands.values()) if isinstance(command, ForEach) else (command,)


def _is_jog(command: object) -> bool:
    return isinstance(command, c.MoveVelocity) and command.life is not None


def _concerned(target: Target, command: AnyCommand) -> tuple[str, ...]:
    if isinstance(command, SetOutputs):
        return ()
    if isinstance(command, GroupCommand):
        return command.axes
    if isinstance(command, c.SetOverride | c.SetTorqueOffset):
        return ()  # a stop does not affect them
    return (target,) if isinstance(target, str) else target
