"""Virtual time for tests with threads: the same code and threads as on hardware, independent of the load of the computer.

Theory of operation
-------------------
Inside ``virtual_time`` only one thread runs at a time, until it blocks on a lock, condition, queue, file descriptor or sleep. The
next thread is then the one that has been ready longest. If no thread is ready, the clock advances to the earliest deadline. Waiting
therefore takes no real time, computing takes no virtual time, and the order of events is the same in every run.

This works below ``threading``: its locks, its thread start, the clock functions and blocking calls of sockets are replaced, so
``Condition``, ``Event``, ``Queue``, ``Timer``, thread pools and ``asyncio`` follow. Locks that already exist are not replaced; a
thread must not block while it holds one. The kernel delivers data of TCP and of terminals a moment after they were sent: the clock
does not advance in that moment.

Not suitable: tests with other processes, and tests that poll in a loop without sleeping.
"""

from __future__ import annotations

import _thread
import concurrent.futures.thread
import errno
import heapq
import itertools
import os
import queue
import select
import selectors
import socket
import socketserver
import struct
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any
from unittest import mock

import can.bus

from axisbus import clock

_START = "_start_new_thread" if hasattr(threading, "_start_new_thread") else "_start_joinable_thread"
_allocate = _thread.allocate_lock
_monotonic, _sleep = time.monotonic, time.sleep
_poll = select.poll
_CLOCK_STEP = 1e-6  # seconds that each reading of the clock takes, so that a polling loop ends
_TIMEVAL = struct.Struct("ll")
_READING = {"recv": 1, "recv_into": 2, "recvmsg": 2, "accept": 0}  # of a socket; and where their flags are
_SIZES: dict[str, Callable[[Any], int]] = {  # bytes that each of them has received, by its result
    "recv": len,
    "recv_into": int,
    "recvmsg": lambda found: len(found[0]),
}
_SELECTORS = (
    (selectors, "DefaultSelector"),
    (socketserver, "_ServerSelector"),
    (subprocess, "_PopenSelector"),
)
_FOREVER = float("inf")
_POLL_SLICE = 0.2  # real seconds; between two rounds of _next() while only descriptors are waited for
_POLL_LIMIT = 60.0  # real seconds after which a wait for descriptors alone counts as a deadlock
_QUEUE_ROUND = 0.001  # virtual seconds between two attempts to connect to a local server whose queue is full
_DELIVERY = 0.01  # real seconds; the kernel delivers data on loopback and of terminals in threads of its own
_STOP_LIMIT = 5.0  # real seconds that the remaining threads may take to end


class ThreadStopped(SystemExit):
    """Raised in each thread that is still blocked when the test ends; ``threading`` ignores SystemExit."""


class Deadlock(AssertionError):
    """All threads are blocked, and none has a deadline."""


class VirtualThread:
    """A thread under the scheduler; it runs while it holds its baton."""

    def __init__(self) -> None:
        self.baton = _allocate()
        self.baton.acquire()
        self.waits = False
        self.number = 0  # of the current wait; timers of earlier waits are stale
        self.result: Any = None
        self.ended = False
        self.joiners: list[VirtualThread] = []


Direction = tuple[Any, Any]  # of a connection: the addresses of the socket that sends and of the other


class Scheduler:
    """Holds the virtual clock and its threads, and decides which one runs."""

    def __init__(self) -> None:
        self.now = _monotonic()
        self.stopped = False
        self._past = time.time() - self.now
        self._threads: dict[int, VirtualThread] = {}  # by thread identifier
        self._started: dict[threading.Thread, VirtualThread] = {}
        self._ready: deque[VirtualThread] = deque()
        self._timers: list[tuple[float, int, int, VirtualThread]] = []
        self._order = itertools.count()
        self._polling: dict[VirtualThread, dict[int, int]] = {}
        self._arrival = 0.0  # real time until which something that was sent may be in transit
        self._transit: dict[Direction, tuple[int, float]] = {}  # bytes not yet received, and that time

    # -- threads -----------------------------------------------------------------------------------------------------------

    def current(self) -> VirtualThread | None:
        """Return the calling thread, or None if it is not under this scheduler."""
        return self._threads.get(_thread.get_ident())

    def add_current(self) -> None:
        """Put the calling thread under this scheduler, as the first one."""
        self._threads[_thread.get_ident()] = VirtualThread()

    def of(self, thread: threading.Thread) -> VirtualThread | None:
        """Return a thread that was started under this scheduler, else None."""
        return self._started.get(thread)

    def started(self, bootstrap: Callable[[], object]) -> Callable[[], object]:
        """Return a wrapper of ``Thread._bootstrap`` that waits for its turn before it begins."""
        if self.current() is None:
            return bootstrap
        me = VirtualThread()
        self._started[bootstrap.__self__] = me  # type: ignore[attr-defined]  # a method of the thread
        self._ready.append(me)

        def run() -> None:
            self._threads[_thread.get_ident()] = me
            me.baton.acquire()
            try:
                if not self.stopped:
                    bootstrap()
            finally:
                self._end(me)

        return run

    def _end(self, me: VirtualThread) -> None:
        me.ended = True
        del self._threads[_thread.get_ident()]
        if not self.stopped:
            for thread in me.joiners:
                self.wake(thread, True)
            self._next().baton.release()

    def stop(self) -> None:
        """Stop all threads except the calling one, wherever they are blocked."""
        self.stopped = True
        del self._threads[_thread.get_ident()]
        for thread in {*self._threads.values(), *self._ready}:
            thread.baton.release()
        until = _monotonic() + _STOP_LIMIT
        while self._threads and _monotonic() < until:
            _sleep(0.001)

    def join(self, thread: VirtualThread, seconds: float | None) -> None:
        """Wait until ``thread`` has ended, at most ``seconds`` of virtual time."""
        me = self.current()
        if me is not None and not thread.ended:
            thread.joiners.append(me)
            self.wait(_FOREVER if seconds is None else self.now + max(0.0, seconds))
            thread.joiners.remove(me)

    # -- waiting -----------------------------------------------------------------------------------------------------------

    def wait(self, until: float = _FOREVER, descriptors: dict[int, int] | None = None) -> Any:
        """Block the calling thread until ``wake``, at most until ``until``; returns the result of ``wake``, or None."""
        me = self._threads[_thread.get_ident()]
        if self.stopped:
            raise ThreadStopped
        me.waits, me.result = True, None
        me.number += 1
        if until != _FOREVER:
            heapq.heappush(self._timers, (until, next(self._order), me.number, me))
        if descriptors:
            self._polling[me] = descriptors
        self._switch(me)
        return me.result

    def wake(self, thread: VirtualThread, result: Any) -> None:
        """Make a blocked thread ready; has no effect on a thread that is ready already."""
        if thread.waits:
            thread.waits, thread.result = False, result
            self._polling.pop(thread, None)
            self._ready.append(thread)

    def _switch(self, me: VirtualThread) -> None:
        following = self._next()
        if following is not me:
            following.baton.release()
            me.baton.acquire()
            if self.stopped:
                raise ThreadStopped

    def _next(self) -> VirtualThread:
        """Return the thread that runs next; advances the clock if none is ready."""
        began = _monotonic()
        while not self._ready:
            arrival = max(self._arrival, *(until for _, until in self._transit.values()), 0.0)
            if self._polling and self._poll_descriptors(max(0.0, arrival - _monotonic())):
                continue
            while self._timers:
                at, _, number, thread = heapq.heappop(self._timers)
                if thread.waits and thread.number == number:
                    self.now = max(self.now, at)
                    self.wake(thread, None)
                    break
            else:
                if not self._polling or _monotonic() - began > _POLL_LIMIT:
                    raise Deadlock("all threads are blocked, and none has a deadline")
                self._poll_descriptors(_POLL_SLICE)
        return self._ready.popleft()

    def _poll_descriptors(self, seconds: float) -> bool:
        """Wake the threads whose descriptors are ready; blocks at most ``seconds`` of real time. Returns whether there were any."""
        poll = _poll()
        for descriptors in self._polling.values():
            for descriptor, events in descriptors.items():
                poll.register(descriptor, events)
        ready = dict(poll.poll(seconds * 1000.0))
        for thread, descriptors in list(self._polling.items()):
            events = [(descriptor, ready[descriptor]) for descriptor in descriptors if descriptor in ready]
            if events:
                self.wake(thread, events)
        return bool(ready)

    def has_sent(self) -> None:
        """Stop the clock until that has arrived: the kernel delivers what goes through TCP and terminals a moment later."""
        self._arrival = _monotonic() + _DELIVERY

    def has_sent_data(self, direction: Direction, size: int) -> None:
        """Stop the clock until these bytes are received, or as long as ``has_sent`` does."""
        waiting, _ = self._transit.get(direction, (0, 0.0))
        self._transit[direction] = waiting + size, _monotonic() + _DELIVERY

    def has_received(self, direction: Direction, size: int) -> None:
        """Note received bytes."""
        waiting, until = self._transit.pop(direction, (0, 0.0))
        if waiting > size:
            self._transit[direction] = waiting - size, until

    # -- replacements of the functions of time ---------------------------------------------------------------------------------

    def monotonic(self) -> float:
        """Replaces ``time.monotonic``."""
        if self.current() is None:
            return _monotonic()
        self.now += _CLOCK_STEP
        return self.now

    def time(self) -> float:
        """Replaces ``time.time``."""
        return self.monotonic() + self._past

    def sleep(self, seconds: float) -> None:
        """Replaces ``time.sleep``."""
        if self.current() is None:
            _sleep(seconds)
        else:
            self.wait(self.now + max(0.0, seconds))


class Lock:
    """Replaces ``threading.Lock``: threads under the scheduler block in virtual time, other threads as usual."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._lock = _allocate()
        self._queue: deque[VirtualThread] = deque()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Acquire the lock; ``timeout`` in seconds."""
        me = self._scheduler.current()
        if me is None or self._scheduler.stopped:
            return self._lock.acquire(blocking, timeout)
        until = _FOREVER if timeout < 0 else self._scheduler.now + timeout
        while not self._lock.acquire(False):
            if not blocking or self._scheduler.now >= until:
                return False
            self._queue.append(me)
            if self._scheduler.wait(until) is None:
                self._queue.remove(me)
        return True

    def release(self) -> None:
        """Release the lock, and make the first thread that waits for it ready."""
        self._lock.release()
        if self._queue:
            self._scheduler.wake(self._queue.popleft(), True)

    def locked(self) -> bool:
        """Return whether it is held."""
        return self._lock.locked()

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _at_fork_reinit(self) -> None:
        self._lock = _allocate()
        self._queue.clear()


class Poll:
    """Replaces ``select.poll``."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._poll = _poll()
        self._events: dict[int, int] = {}

    def register(self, file: Any, events: int = select.POLLIN | select.POLLPRI | select.POLLOUT) -> None:
        """Wait for these events of a file or descriptor, too."""
        self._events[_descriptor(file)] = events
        self._poll.register(file, events)

    modify = register

    def unregister(self, file: Any) -> None:
        """Do not wait for it any more."""
        del self._events[_descriptor(file)]
        self._poll.unregister(file)

    def poll(self, timeout: float | None = None) -> list[tuple[int, int]]:
        """Return the ready ones; blocks for ``timeout`` in ms, without end if it is None or negative."""
        if self._scheduler.current() is None:
            return self._poll.poll(timeout)
        ready = self._poll.poll(0)
        if ready or timeout == 0:
            return ready
        forever = timeout is None or timeout < 0
        until = _FOREVER if forever else self._scheduler.now + timeout / 1000.0
        return self._scheduler.wait(until, dict(self._events)) or []


def _descriptor(file: Any) -> int:
    return file if isinstance(file, int) else file.fileno()


def _milliseconds(seconds: float | None) -> float | None:
    return None if seconds is None else seconds * 1000.0


def _select(scheduler: Scheduler) -> Callable[..., tuple[list[Any], list[Any], list[Any]]]:
    known = select.select

    def selects(reads: Any, writes: Any, others: Any, timeout: float | None = None) -> Any:
        if scheduler.current() is None:
            return known(reads, writes, others, timeout)
        poll = Poll(scheduler)
        for file in {*reads, *writes}:
            poll.register(file, select.POLLIN * (file in reads) | select.POLLOUT * (file in writes))
        poll.poll(_milliseconds(timeout))
        return known(reads, writes, others, 0)

    return selects


def _when_readable(scheduler: Scheduler, name: str, flags_at: int) -> Callable[..., Any]:
    known = getattr(socket.socket, name)

    def does(line: socket.socket, *given: Any, **named: Any) -> Any:
        flags = named.get("flags", 0) or (given[flags_at] if len(given) > flags_at else 0)
        if scheduler.current() is not None and not flags & socket.MSG_DONTWAIT:
            _await(scheduler, line, select.POLLIN)
        found = known(line, *given, **named)
        if name in _SIZES and not flags & socket.MSG_PEEK and (peer := _peer(line)) is not None:
            scheduler.has_received((peer, line.getsockname()), _SIZES[name](found))
        return found

    return does


def _peer(line: socket.socket) -> Any:
    """Return the address of the other socket of a TCP connection, None of anything else."""
    if line.type != socket.SOCK_STREAM or line.family == socket.AF_UNIX:
        return None
    try:
        return line.getpeername()
    except OSError:  # it is not connected any more
        return None


def _await(scheduler: Scheduler, line: socket.socket, events: int) -> None:
    """Block until a socket is ready, as long as a call of it would; ``SO_RCVTIMEO`` limits those that receive."""
    limit = line.gettimeout()
    if limit == 0.0:
        return
    kernel_limit = _receive_timeout(line) if limit is None and events == select.POLLIN else 0.0
    poll = Poll(scheduler)
    poll.register(line, events)
    if not poll.poll(_milliseconds(kernel_limit or limit)):
        raise BlockingIOError if kernel_limit else TimeoutError("timed out")


def _receive_timeout(line: socket.socket) -> float:
    """Return ``SO_RCVTIMEO`` in seconds; 0: none."""
    seconds, microseconds = _TIMEVAL.unpack(
        line.getsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _TIMEVAL.size)
    )
    return seconds + microseconds / 1e6


def _send(scheduler: Scheduler) -> Callable[..., int]:
    """Return a ``socket.send`` that blocks in virtual time."""
    to_socket, elsewhere = socket.socket.send, _marked(scheduler, "send")

    def known(line: socket.socket, data: Any, flags: int) -> int:
        if (peer := _peer(line)) is None:
            sent: int = elsewhere(line, data, flags)
            return sent
        sent = to_socket(line, data, flags)
        scheduler.has_sent_data((line.getsockname(), peer), sent)
        return sent

    def send(line: socket.socket, data: Any, flags: int = 0) -> int:
        if scheduler.current() is None or line.gettimeout() == 0.0:
            return known(line, data, flags)
        while True:
            try:
                return known(line, data, flags | socket.MSG_DONTWAIT)
            except BlockingIOError:
                if flags & socket.MSG_DONTWAIT:
                    raise
            _await(scheduler, line, select.POLLOUT)

    return send


def _send_all(scheduler: Scheduler) -> Callable[..., None]:
    """Return a ``socket.sendall`` that blocks in virtual time."""
    known = socket.socket.sendall

    def send_all(line: socket.socket, data: Any, flags: int = 0) -> None:
        if scheduler.current() is None or line.gettimeout() == 0.0:
            return known(line, data, flags)
        left = memoryview(data).cast("B")
        while left:
            left = left[line.send(left, flags) :]
        return None

    return send_all


def _connect(scheduler: Scheduler) -> Callable[..., None]:
    """Return a ``socket.connect`` that blocks in virtual time."""
    known = _marked(scheduler, "connect")

    def connect(line: socket.socket, address: Any) -> None:
        limit = line.gettimeout()
        if scheduler.current() is None or limit == 0.0:
            return known(line, address)
        line.setblocking(False)
        try:
            while True:
                try:
                    return known(line, address)
                except BlockingIOError as full:
                    if full.errno == errno.EINPROGRESS:
                        break
                    if limit is not None:
                        raise
                scheduler.sleep(_QUEUE_ROUND)
        finally:
            line.settimeout(limit)
        _await(scheduler, line, select.POLLOUT)
        if error := line.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise OSError(error, os.strerror(error))
        return None

    return connect


def _marked(scheduler: Scheduler, name: str) -> Callable[..., Any]:
    """Return a method of ``socket.socket`` after which data may be in transit through the network."""
    known = getattr(socket.socket, name)

    def does(line: socket.socket, *given: Any) -> Any:
        try:
            return known(line, *given)
        finally:
            if line.family != socket.AF_UNIX:
                scheduler.has_sent()

    return does


def _write(scheduler: Scheduler) -> Callable[[int, Any], int]:
    """Return an ``os.write`` that notes when a terminal gets data."""
    known = os.write

    def write(descriptor: int, data: Any) -> int:
        written = known(descriptor, data)
        if os.isatty(descriptor):
            scheduler.has_sent()
        return written

    return write


def _held(scheduler: Scheduler) -> Lock:
    """Replaces ``axisbus.clock._held_lock``."""
    lock = Lock(scheduler)
    lock.acquire()
    return lock


@contextmanager
def virtual_time() -> Iterator[Scheduler]:
    """Run the calling thread and all threads that it starts in virtual time; threads that are left at the end are stopped."""
    scheduler = Scheduler()
    joins, alive = threading.Thread.join, threading.Thread.is_alive
    start = getattr(threading, _START)

    def starts(bootstrap: Callable[[], object], *given: Any, **named: Any) -> Any:
        return start(scheduler.started(bootstrap), *given, **named)

    def join(thread: threading.Thread, timeout: float | None = None) -> None:
        known = scheduler.of(thread)
        if known is not None and not scheduler.stopped:
            scheduler.join(known, timeout)
            if not known.ended:
                return
        joins(thread, timeout)

    def is_alive(thread: threading.Thread) -> bool:
        known = scheduler.of(thread)
        return alive(thread) and (known is None or not known.ended)

    known_hook = threading.excepthook

    def excepthook(args: threading.ExceptHookArgs) -> None:
        if args.exc_type is not ThreadStopped:
            known_hook(args)

    class Selector(selectors.PollSelector):
        _selector_cls = staticmethod(partial(Poll, scheduler))

    changes: list[tuple[Any, str, Any]] = [
        (time, "monotonic", scheduler.monotonic),
        (time, "perf_counter", scheduler.monotonic),
        (time, "monotonic_ns", lambda: round(scheduler.monotonic() * 1e9)),
        (time, "perf_counter_ns", lambda: round(scheduler.monotonic() * 1e9)),
        (time, "time", scheduler.time),
        (time, "time_ns", lambda: round(scheduler.time() * 1e9)),
        (time, "sleep", scheduler.sleep),
        (threading, "_time", scheduler.monotonic),
        (threading, "_allocate_lock", lambda: Lock(scheduler)),
        (threading, "Lock", lambda: Lock(scheduler)),
        (threading, "_CRLock", None),
        (threading, _START, starts),
        (threading, "excepthook", excepthook),
        (threading.Thread, "join", join),
        (threading.Thread, "is_alive", is_alive),
        (clock, "_held_lock", lambda: _held(scheduler)),
        (queue, "time", scheduler.monotonic),
        (can.bus, "time", scheduler.time),
        (queue, "SimpleQueue", queue._PySimpleQueue),  # type: ignore[attr-defined]
        (concurrent.futures.thread, "_global_shutdown_lock", Lock(scheduler)),
        (os, "write", _write(scheduler)),
        (select, "poll", partial(Poll, scheduler)),
        (select, "select", _select(scheduler)),
        *((module, name, Selector) for module, name in _SELECTORS),
        *((socket.socket, name, _when_readable(scheduler, name, at)) for name, at in _READING.items()),
        *((socket.socket, name, _marked(scheduler, name)) for name in ("close", "shutdown")),
        (socket.socket, "connect", _connect(scheduler)),
        (socket.socket, "send", _send(scheduler)),
        (socket.socket, "sendall", _send_all(scheduler)),
    ]
    with ExitStack() as stack:
        for owner, name, replacement in changes:
            stack.enter_context(mock.patch.object(owner, name, replacement))
        scheduler.add_current()
        try:
            yield scheduler
        finally:
            scheduler.stop()
