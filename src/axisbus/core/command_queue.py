"""Commands on their way from a program's threads to the scan: bounded, and never in the way of a stop.

Theory of operation
-------------------
A cycle takes at most ``AT_ONCE`` commands, in the order in which they were given; the others wait for the next. At most ``MOST``
wait, and one more is refused: neither the scan nor its program's memory can be flooded. Two rules keep that harmless.

- **A stop never waits.** Halt, stop, quick stop and disable are taken in the present cycle, however many commands wait before
  them. Of those, what concerns the same axes ends as stopped and is not begun any more. A stop finds room when nothing else does.
- **The same again is the same.** A command that is asked for again while it waits, with nothing else for its axes in between, is
  one command with one ticket, where asking twice means nothing more (``_IDEMPOTENT``, and the renewal of a jog).

The scan takes without a lock; only those who give exclude each other. What is taken out of a queue is taken once (``_out``).
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
from axisbus.motion.io.commands import SetOutputs
from axisbus.session import AnyCommand, Target

AT_ONCE = 32  # commands in one cycle: about half a millisecond
MOST = 1024  # commands that wait
_STOPS = frozenset({c.Halt, c.Stop, c.QuickStop, c.Disable})
_IDEMPOTENT = _STOPS | {c.EnableCommand, c.ResetCommand, c.Release}


class Waiting:
    """A command that waits for the scan; ``taken`` when it does no longer."""

    __slots__ = ("__weakref__", "axes", "command", "is_stop", "taken", "target", "ticket")

    def __init__(self, target: Target, command: AnyCommand, ticket: CommandStatus) -> None:
        self.target = target
        self.command = command
        self.ticket = ticket
        self.axes = _concerned(target, command)
        self.is_stop = all(type(one) in _STOPS for one in _single(command))
        self.taken = False

    @property
    def for_group(self) -> bool:
        """Whether a group is to take it."""
        return isinstance(self.command, GroupCommand)

    def is_again(self, other: Waiting) -> bool:
        """Whether it asks for the same as ``other``, and asking twice means nothing more."""
        if self.target != other.target or self.command != other.command:
            return False
        return all(type(one) in _IDEMPOTENT or _is_jog(one) for one in _single(self.command))


class CommandQueue:
    """Holds what waits, in order: ``_given`` by any thread, ``_left`` by the scan from the cycle before."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # what collects garbage in here may log, and who logs may stop an axis
        self._given: deque[Waiting] = deque()
        self._left: deque[Waiting] = deque()
        self._last: WeakValueDictionary[str, Waiting] = WeakValueDictionary()  # given last for each axis
        self._late: WeakSet[Waiting] = WeakSet()  # stops that were given when nothing else found room
        self._closed = False

    def __len__(self) -> int:
        return len(self._given) + len(self._left)

    def put(self, waiting: Waiting) -> Waiting | None:
        """Let a command wait; return it, or the same one that waits already. None where it finds no room. Any thread."""
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
        """Return what is to be done in this cycle, in order; the scan's thread."""
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
        """Let no more commands in."""
        with self._lock:
            self._closed = True

    def clear(self) -> Iterator[Waiting]:
        """Take out all that waits; any thread, each gets what no other does."""
        for queue in (self._left, self._given):
            for waiting in _out(queue, len(queue)):
                waiting.taken = True
                yield waiting

    def _same(self, waiting: Waiting) -> Waiting | None:
        """The same command that waits already: nothing else for its axes came after it, as nothing does after a late stop."""
        last = {self._last.get(axis) for axis in waiting.axes}
        candidates = [*(last if len(last) == 1 else ()), *self._late]
        return next((one for one in candidates if one and not one.taken and waiting.is_again(one)), None)

    def _stops(self) -> list[Waiting]:
        """Take the stops out of what is left, and end what they overtake."""
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
    """Take out at most so many; another thread may be taking out too."""
    for _ in range(most):
        try:
            yield queue.popleft()
        except IndexError:
            return


def _overtaken(waiting: Waiting, stop: Waiting) -> None:
    waiting.taken = True
    error = Stopped(
        f"{waiting.ticket.name} had not begun when {stop.ticket.name} was asked for",
        observed=f"it waited behind other commands: the scan takes {AT_ONCE} in each of its cycles",
        remedy="ask for it again, and wait for the handles of commands before giving more",
    )
    waiting.ticket.finish(Status.ABORTED, error)


def _single(command: AnyCommand) -> tuple[object, ...]:
    """The commands for single axes that it is made of."""
    return tuple(command.commands.values()) if isinstance(command, ForEach) else (command,)


def _is_jog(command: object) -> bool:
    return isinstance(command, c.MoveVelocity) and command.life is not None


def _concerned(target: Target, command: AnyCommand) -> tuple[str, ...]:
    if isinstance(command, SetOutputs):
        return ()
    if isinstance(command, GroupCommand):
        return command.axes
    if isinstance(command, c.SetOverride | c.SetTorqueOffset):
        return ()  # a stop leaves them as they are
    return (target,) if isinstance(target, str) else target
