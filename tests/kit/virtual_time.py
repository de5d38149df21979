"""Threads in virtual time: a test of the bus runs with the threads that it has on hardware, and depends on no computer.

Theory of operation
-------------------
Within ``virtual_time`` one thread runs at a time, until it waits: for a lock, a condition, a queue, a descriptor, or a time. Then
the next one that can run is chosen, in the order in which they became able to. When none can, the clock goes on to the earliest
time that one of them waits for. So a wait takes no time of the computer's, what is computed takes none of the clock's, and the same
test gives the same order of everything, whatever else the computer does.

This is done below ``threading``: its locks, its start of a thread, and the clock that it reads are replaced while it lasts, so that
``Condition``, ``Event``, ``Queue``, ``Timer`` and thread pools follow. Locks that were made before stay what they were; they must
not be held while a thread waits. What another process does is not seen in time: such a test belongs in real time, and so does one
that asks again and again without waiting.
"""

from __future__ import annotations

import _thread
import concurrent.futures.thread
import heapq
import itertools
import queue
import select
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import can.bus

from axisbus.boot.can_simple.module import ModuleBoot
from axisbus.boot.requests import Answerer
from axisbus.bus.cycle import CanCycle
from axisbus.bus.sync import SyncConsumer
from axisbus.core.can_simple.modules import Modules

_START = "_start_new_thread" if hasattr(threading, "_start_new_thread") else "_start_joinable_thread"
_allocate = _thread.allocate_lock
_monotonic, _sleep = time.monotonic, time.sleep
_poll = select.poll
_READING = 1e-6  # seconds that a look at the clock takes, so that who looks again and again gets on
_FOR_EVER = float("inf")
_LOOK = 0.2  # seconds of the computer's between two looks at descriptors, where nothing else is waited for
_HOPELESS = 60.0  # seconds of the computer's after which nobody will write to them any more
_PARTING = 5.0  # seconds of the computer's that threads which are ended may take


class Left(SystemExit):
    """What ends a thread that still waits when the test has ended."""


class Deadlock(AssertionError):
    """Every thread waits, and none for a time."""


class Waiter:
    """A thread of the world; holds what it waits for."""

    def __init__(self) -> None:
        self.baton = _allocate()
        self.baton.acquire()
        self.waits = False
        self.number = 0  # of its wait: a time that belongs to an earlier one is past
        self.found: Any = None
        self.ended = False
        self.awaited_by: list[Waiter] = []


class World:
    """The clock, the threads that live in it, and which of them runs."""

    def __init__(self) -> None:
        self.now = _monotonic()
        self.over = False
        self._past = time.time() - self.now
        self._threads: dict[int, Waiter] = {}  # by their identifier
        self._started: dict[threading.Thread, Waiter] = {}
        self._able: deque[Waiter] = deque()
        self._times: list[tuple[float, int, int, Waiter]] = []
        self._order = itertools.count()
        self._listening: dict[Waiter, dict[int, int]] = {}

    # -- threads -----------------------------------------------------------------------------------------------------------

    def here(self) -> Waiter | None:
        """The thread that asks, if it is one of this world's."""
        return self._threads.get(_thread.get_ident())

    def enter(self) -> None:
        """Make the thread that asks the first of this world."""
        self._threads[_thread.get_ident()] = Waiter()

    def of(self, thread: threading.Thread) -> Waiter | None:
        """A thread that was started in this world."""
        return self._started.get(thread)

    def started(self, bootstrap: Callable[[], object]) -> Callable[[], object]:
        """Return what a thread runs instead of its own beginning: it waits for its turn first."""
        if self.here() is None:
            return bootstrap
        me = Waiter()
        self._started[bootstrap.__self__] = me  # type: ignore[attr-defined]  # a method of the thread
        self._able.append(me)

        def lives() -> None:
            self._threads[_thread.get_ident()] = me
            me.baton.acquire()
            try:
                if not self.over:
                    bootstrap()
            finally:
                self._end(me)

        return lives

    def _end(self, me: Waiter) -> None:
        me.ended = True
        del self._threads[_thread.get_ident()]
        if not self.over:
            for thread in me.awaited_by:
                self.wake(thread, True)
            self._next().baton.release()

    def leave(self) -> None:
        """End all threads but the one that asks, wherever they wait."""
        self.over = True
        del self._threads[_thread.get_ident()]
        for thread in {*self._threads.values(), *self._able}:
            thread.baton.release()
        until = _monotonic() + _PARTING
        while self._threads and _monotonic() < until:
            _sleep(0.001)

    def join(self, thread: Waiter, seconds: float | None) -> None:
        """Wait until a thread has ended, or so long."""
        me = self.here()
        if me is not None and not thread.ended:
            thread.awaited_by.append(me)
            self.wait(_FOR_EVER if seconds is None else self.now + max(0.0, seconds))
            thread.awaited_by.remove(me)

    # -- waiting -----------------------------------------------------------------------------------------------------------

    def wait(self, until: float = _FOR_EVER, descriptors: dict[int, int] | None = None) -> Any:
        """Let others run until ``wake`` is called for this thread, or a time; return what it was woken with, else None."""
        me = self._threads[_thread.get_ident()]
        if self.over:
            raise Left
        me.waits, me.found = True, None
        me.number += 1
        if until != _FOR_EVER:
            heapq.heappush(self._times, (until, next(self._order), me.number, me))
        if descriptors:
            self._listening[me] = descriptors
        self._switch(me)
        return me.found

    def wake(self, thread: Waiter, found: Any) -> None:
        """Make a thread that waits able to run; in vain if it does not wait any more."""
        if thread.waits:
            thread.waits, thread.found = False, found
            self._listening.pop(thread, None)
            self._able.append(thread)

    def _switch(self, me: Waiter) -> None:
        following = self._next()
        if following is not me:
            following.baton.release()
            me.baton.acquire()
            if self.over:
                raise Left

    def _next(self) -> Waiter:
        """Choose who runs now; lets the time pass where nobody can."""
        began = _monotonic()
        while not self._able:
            if self._listening and self._hear(0.0):
                continue
            while self._times:
                at, _, number, thread = heapq.heappop(self._times)
                if thread.waits and thread.number == number:
                    self.now = max(self.now, at)
                    self.wake(thread, None)
                    break
            else:
                if not self._listening or _monotonic() - began > _HOPELESS:
                    raise Deadlock("every thread waits, and none for a time")
                self._hear(_LOOK)
        return self._able.popleft()

    def _hear(self, seconds: float) -> bool:
        """Wake who waits for a descriptor that is ready; wait for one so long in the computer's time."""
        poll = _poll()
        for descriptors in self._listening.values():
            for descriptor, events in descriptors.items():
                poll.register(descriptor, events)
        ready = dict(poll.poll(seconds * 1000.0))
        for thread, descriptors in list(self._listening.items()):
            found = [(descriptor, ready[descriptor]) for descriptor in descriptors if descriptor in ready]
            if found:
                self.wake(thread, found)
        return bool(ready)

    # -- what stands in for time, locks and descriptors --------------------------------------------------------------------------

    def monotonic(self) -> float:
        """As ``time.monotonic``."""
        if self.here() is None:
            return _monotonic()
        self.now += _READING
        return self.now

    def time(self) -> float:
        """As ``time.time``."""
        return self.monotonic() + self._past

    def sleep(self, seconds: float) -> None:
        """As ``time.sleep``."""
        if self.here() is None:
            _sleep(seconds)
        else:
            self.wait(self.now + max(0.0, seconds))


class Lock:
    """As ``threading.Lock``. A thread of a world waits for it in the world's time; any other one as ever."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._lock = _allocate()
        self._queue: deque[Waiter] = deque()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Take it, or wait until it is let go."""
        me = self._world.here()
        if me is None or self._world.over:
            return self._lock.acquire(blocking, timeout)
        until = _FOR_EVER if timeout < 0 else self._world.now + timeout
        while not self._lock.acquire(False):
            if not blocking or self._world.now >= until:
                return False
            self._queue.append(me)
            if self._world.wait(until) is None:
                self._queue.remove(me)
        return True

    def release(self) -> None:
        """Let it go."""
        self._lock.release()
        if self._queue:
            self._world.wake(self._queue.popleft(), True)

    def locked(self) -> bool:
        """Whether anybody has it."""
        return self._lock.locked()

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _at_fork_reinit(self) -> None:
        self._lock = _allocate()
        self._queue.clear()


def _poll_class(world: World) -> Callable[[], Any]:
    class Poll:
        """As ``select.poll``."""

        def __init__(self) -> None:
            self._poll = _poll()
            self._events: dict[int, int] = {}

        def register(self, file: Any, events: int = select.POLLIN | select.POLLPRI | select.POLLOUT) -> None:
            self._events[_descriptor(file)] = events
            self._poll.register(file, events)

        modify = register

        def unregister(self, file: Any) -> None:
            del self._events[_descriptor(file)]
            self._poll.unregister(file)

        def poll(self, timeout: float | None = None) -> list[tuple[int, int]]:
            if world.here() is None:
                return self._poll.poll(timeout)
            ready = self._poll.poll(0)
            if ready or timeout == 0:
                return ready
            until = _FOR_EVER if timeout is None or timeout < 0 else world.now + timeout / 1000.0
            return world.wait(until, dict(self._events)) or []

    return Poll


def _descriptor(file: Any) -> int:
    return file if isinstance(file, int) else file.fileno()


def _select(world: World) -> Callable[..., tuple[list[Any], list[Any], list[Any]]]:
    known = select.select

    def selects(reads: Any, writes: Any, others: Any, timeout: float | None = None) -> Any:
        found = known(reads, writes, others, 0)
        if world.here() is None or any(found) or timeout == 0:
            return found if timeout == 0 or any(found) else known(reads, writes, others, timeout)
        wanted = {_descriptor(file): select.POLLIN for file in reads}
        wanted |= {_descriptor(file): wanted.get(_descriptor(file), 0) | select.POLLOUT for file in writes}
        world.wait(_FOR_EVER if timeout is None else world.now + timeout, wanted)
        return known(reads, writes, others, 0)

    return selects


def _when_ready(world: World, name: str) -> Callable[..., Any]:
    known = getattr(socket.socket, name)

    def does(line: socket.socket, *given: Any, **named: Any) -> Any:
        limit = line.gettimeout()
        if world.here() is not None and limit != 0.0:
            until = _FOR_EVER if limit is None else world.now + limit
            wanted = {line.fileno(): select.POLLIN}
            poll = _poll()
            poll.register(line, select.POLLIN)
            if not poll.poll(0) and world.wait(until, wanted) is None:
                raise TimeoutError("timed out")
        return known(line, *given, **named)

    return does


def _defaults(world: World) -> Iterator[tuple[Any, str, Any]]:
    """The functions of the product that were defined with the computer's clock as their default, and what they have instead."""
    instead = {_monotonic: world.monotonic, _sleep: world.sleep}
    for each in (CanCycle, SyncConsumer, Answerer, ModuleBoot, Modules):
        function: Any = each.__init__
        if function.__defaults__:
            yield (
                function,
                "__defaults__",
                tuple(
                    instead.get(given, given) if callable(given) else given for given in function.__defaults__
                ),
            )
        if function.__kwdefaults__:
            named = {
                name: instead.get(given, given) if callable(given) else given
                for name, given in function.__kwdefaults__.items()
            }
            yield function, "__kwdefaults__", named


@contextmanager
def virtual_time() -> Iterator[World]:
    """Let this thread, and those that it starts, live in virtual time; those that are left at the end are ended."""
    world = World()
    joins, alive = threading.Thread.join, threading.Thread.is_alive
    start = getattr(threading, _START)

    def starts(bootstrap: Callable[[], object], *given: Any, **named: Any) -> Any:
        return start(world.started(bootstrap), *given, **named)

    def join(thread: threading.Thread, timeout: float | None = None) -> None:
        known = world.of(thread)
        if known is not None and not world.over:
            world.join(known, timeout)
            if not known.ended:
                return
        joins(thread, timeout)

    def is_alive(thread: threading.Thread) -> bool:
        known = world.of(thread)
        return alive(thread) and (known is None or not known.ended)

    told = threading.excepthook

    def excepthook(args: threading.ExceptHookArgs) -> None:
        if args.exc_type is not Left:
            told(args)

    class Selector(selectors.PollSelector):
        _selector_cls = _poll_class(world)

    changes: list[tuple[Any, str, Any]] = [
        (time, "monotonic", world.monotonic),
        (time, "perf_counter", world.monotonic),
        (time, "monotonic_ns", lambda: round(world.monotonic() * 1e9)),
        (time, "perf_counter_ns", lambda: round(world.monotonic() * 1e9)),
        (time, "time", world.time),
        (time, "time_ns", lambda: round(world.time() * 1e9)),
        (time, "sleep", world.sleep),
        (threading, "_time", world.monotonic),
        (threading, "_allocate_lock", lambda: Lock(world)),
        (threading, "Lock", lambda: Lock(world)),
        (threading, "_CRLock", None),
        (threading, _START, starts),
        (threading, "excepthook", excepthook),
        (threading.Thread, "join", join),
        (threading.Thread, "is_alive", is_alive),
        (queue, "time", world.monotonic),
        (can.bus, "time", world.time),
        (queue, "SimpleQueue", queue._PySimpleQueue),  # type: ignore[attr-defined]
        (concurrent.futures.thread, "_global_shutdown_lock", Lock(world)),
        (select, "poll", _poll_class(world)),
        (select, "select", _select(world)),
        (selectors, "DefaultSelector", Selector),
        *(
            (socket.socket, name, _when_ready(world, name))
            for name in ("recv", "recv_into", "recvmsg", "accept")
        ),
        *_defaults(world),
    ]
    with ExitStack() as stack:
        for where, name, what in changes:
            stack.enter_context(mock.patch.object(where, name, what))
        world.enter()
        try:
            yield world
        finally:
            world.leave()
