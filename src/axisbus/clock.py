"""The clock of everything that waits for a bus: time, waiting and threads, real or virtual.

Theory of operation
-------------------
Code that waits for frames takes its time, locks, conditions and threads from the ``Clock`` of its channel. With a ``SystemClock``
these are those of Python. With a ``VirtualClock`` the same code runs in simulated time: computing takes no time, waiting takes no
real time, and every run of a program is the same.

In virtual time only one thread runs at a time. A thread of the program that waits (in ``Machine.sleep``, for example) *leads*: it
gives the turn to each thread of the clock that can continue, one after the other, until all of them wait again. Then it advances
the time to the next event and repeats this, until its own wait is over. Events are the frames and plants of the simulated bus
(``EventSource``), and the time-outs of the waits. While no thread of the program waits, the time stands still.
"""

from __future__ import annotations

import _thread
import heapq
import itertools
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Protocol

from axisbus.errors import StateError

_END_PATIENCE = 1.0  # real seconds that a thread may take to end when its clock is closed


class ClockCondition(Protocol):
    """As ``threading.Condition``."""

    def __enter__(self) -> bool: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def wait(self, timeout: float | None = None) -> bool:
        """Release the lock, wait at most ``timeout`` seconds for a notification, and take the lock again."""

    def wait_for(self, predicate: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait as ``wait`` until ``predicate()``, at most ``timeout`` seconds in all; return whether it is true."""

    def notify(self, n: int = 1) -> None:
        """Wake ``n`` waiting threads."""

    def notify_all(self) -> None:
        """Wake all waiting threads."""


class ClockEvent(Protocol):
    """As ``threading.Event``."""

    def is_set(self) -> bool:
        """Whether it is set."""

    def set(self) -> None:
        """Set it, and wake all threads that wait for it."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, at most ``timeout`` seconds; return whether it is."""


class ClockLock(Protocol):
    """As ``threading.Lock``; it may be held while waiting."""

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Take the lock; wait at most ``timeout`` seconds for it, if that is not negative."""

    def release(self) -> None:
        """Release the lock."""

    def __enter__(self) -> bool: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class ClockThread(Protocol):
    """As ``threading.Thread``, a daemon."""

    def start(self) -> None:
        """Start it."""

    def is_alive(self) -> bool:
        """Whether it has started and not ended."""

    def join(self, timeout: float | None = None) -> None:
        """Wait until it has ended, at most ``timeout`` seconds."""


class Clock(Protocol):
    """Time in seconds from an arbitrary start, and everything that waits."""

    realtime: bool  # whether time passes by itself

    def now(self) -> float:
        """Return the time in seconds."""

    def sleep(self, seconds: float) -> None:
        """Block for so many seconds."""

    def condition(self) -> ClockCondition:
        """Return a new condition."""

    def event(self) -> ClockEvent:
        """Return a new event."""

    def lock(self) -> ClockLock:
        """Return a new lock that may be held while waiting."""

    def thread(self, run: Callable[[], object], name: str) -> ClockThread:
        """Return a new thread that will call ``run``."""

    def is_current(self, thread: ClockThread | None) -> bool:
        """Whether the caller runs in ``thread``."""


def sleep_until(clock: Clock, when: float) -> None:
    """Block until the time ``when`` of the clock, in seconds; not at all if it has passed."""
    clock.sleep(max(0.0, when - clock.now()))


def poll_until(clock: Clock, done: Callable[[], bool], deadline: float, period: float) -> bool:
    """Block until ``done()``, asked every ``period`` seconds, or until ``deadline``, in seconds; return whether it is done."""
    while not done():
        if clock.now() >= deadline:
            return False
        clock.sleep(period)
    return True


class FairLock:
    """A lock for threads of a clock, which get it in the order in which they ask; it may be held while waiting.

    A thread that takes another lock again at once can keep the others from it for ever.
    """

    def __init__(self, clock: Clock) -> None:
        self._changed = clock.condition()
        self._turns: deque[object] = deque()  # the first holds the lock

    def acquire(self, timeout: float | None = None) -> bool:
        """Take the lock, and return whether that was possible within ``timeout`` seconds (None: wait without a limit)."""
        turn = object()
        with self._changed:
            self._turns.append(turn)
            taken = False
            try:
                taken = self._changed.wait_for(lambda: self._turns[0] is turn, timeout)
            finally:
                if not taken:
                    self._turns.remove(turn)
                    self._changed.notify_all()
        return taken

    def release(self) -> None:
        """Release the lock."""
        with self._changed:
            self._turns.popleft()
            self._changed.notify_all()

    def locked(self) -> bool:
        """Whether a thread holds the lock."""
        return bool(self._turns)

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


class SystemClock:
    """The monotonic clock of the computer, and Python's threads."""

    realtime = True

    def now(self) -> float:
        """Return ``time.monotonic()``."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """As ``Clock.sleep``."""
        time.sleep(seconds)

    def condition(self) -> ClockCondition:
        """As ``Clock.condition``."""
        return threading.Condition()

    def event(self) -> ClockEvent:
        """As ``Clock.event``."""
        return threading.Event()

    def lock(self) -> ClockLock:
        """As ``Clock.lock``."""
        return threading.Lock()

    def thread(self, run: Callable[[], object], name: str) -> ClockThread:
        """As ``Clock.thread``."""
        return threading.Thread(target=run, name=name, daemon=True)

    def is_current(self, thread: ClockThread | None) -> bool:
        """As ``Clock.is_current``."""
        return threading.current_thread() is thread


REAL = SystemClock()


# -- Virtual time ------------------------------------------------------------------------------------------------------


class EventSource(Protocol):
    """Events that occur in virtual time without a request: the frames of a bus, the motion of plants."""

    @property
    def due(self) -> float:
        """Time of its next event; infinity: none."""

    def run(self, now: float, until: float) -> None:
        """Execute the events that are due at ``now``; must not wait.

        Continue with later ones up to ``until``, with the clock's ``go_to`` before each, while ``news`` of the clock is not set.
        """

    def catch_up(self, now: float) -> None:
        """Make the state of plants that of ``now``: the leading thread continues, and may look at them."""


class RealSpeed:
    """An event source that makes virtual time pass as fast as that of the computer, or more slowly while the computer is busy.

    A pause of the computer only delays what follows: it is not made up for.
    """

    _STEP = 0.01  # seconds

    def __init__(self) -> None:
        self.due = 0.0
        self._real = REAL.now()  # of the last event

    def run(self, now: float, until: float) -> None:  # noqa: ARG002  the shape of every source
        """Wait, in real time, until the computer's clock has advanced as far as the virtual one."""
        REAL.sleep(max(0.0, self._real + self._STEP - REAL.now()))
        self._real = REAL.now()
        self.due = now + self._STEP

    def catch_up(self, now: float) -> None:
        """Do nothing: it has no state to read."""


class ClockClosed(SystemExit):
    """Raised in each thread of a virtual clock that still waits when the clock is closed; it ends the thread."""


class _Wait:
    """One wait of a thread; ``thread`` None: of the thread that leads."""

    __slots__ = ("over", "thread", "woken")

    def __init__(self) -> None:
        self.thread: VirtualThread | None = None
        self.woken = False  # by a notification, and not by its time-out
        self.over = False


def _held_lock() -> _thread.LockType:
    """Return a lock whose release lets one waiting thread continue: the fastest way to hand the turn over."""
    lock = _thread.allocate_lock()
    lock.acquire()
    return lock


def _let_go(lock: _thread.LockType) -> None:
    """Release a lock if it is held; it is still free if no thread has taken it since its last release."""
    if lock.locked():
        lock.release()


class VirtualClock:
    """Virtual time; holds the time, its threads, and the sources of events. Its methods may be called from any thread."""

    realtime = False

    def __init__(self) -> None:
        self._now = 0.0
        self._sources: tuple[EventSource, ...] = ()
        self._timers: list[tuple[float, int, _Wait]] = []
        self._order = itertools.count()
        self._ready: deque[VirtualThread] = deque()
        self._threads: dict[int, VirtualThread] = {}  # by their identifiers
        self._lead = threading.RLock()  # held by the thread that lets time pass
        # A thread of this clock runs while it is ``_running``. It takes itself out of ``_ready``, and clears ``_running`` when it
        # waits again or ends. The locks only wake waiting threads: a signal handler may raise between any two steps of the leading
        # thread.
        self._running: VirtualThread | None = None
        self._back = _held_lock()
        self._closed = False
        self.news = False  # a wait has ended: a thread, or the leading one, can continue

    def now(self) -> float:
        """Return the virtual time in seconds."""
        return self._now

    def go_to(self, now: float) -> None:
        """Advance the time; for the event source that runs."""
        self._now = now

    def catch_up(self) -> None:
        """Bring the state of all sources up to the present time before it is read."""
        for source in self._sources:
            source.catch_up(self._now)

    def add(self, source: EventSource) -> None:
        """Execute the events of ``source`` from now on."""
        self._sources = (*self._sources, source)

    def sleep(self, seconds: float) -> None:
        """As ``Clock.sleep``."""
        self.block(_Wait(), self._now + max(0.0, seconds))

    def condition(self) -> VirtualCondition:
        """As ``Clock.condition``."""
        return VirtualCondition(self)

    def event(self) -> VirtualEvent:
        """As ``Clock.event``."""
        return VirtualEvent(self)

    def lock(self) -> VirtualLock:
        """As ``Clock.lock``."""
        return VirtualLock(self)

    def thread(self, run: Callable[[], object], name: str) -> VirtualThread:
        """As ``Clock.thread``."""
        return VirtualThread(self, run, name)

    def is_current(self, thread: ClockThread | None) -> bool:
        """As ``Clock.is_current``."""
        return thread is not None and self.current is thread

    @property
    def closed(self) -> bool:
        """Whether it was closed: its time does not pass any more."""
        return self._closed

    @property
    def current(self) -> VirtualThread | None:
        """The thread of this clock in which the caller runs; None in any other thread."""
        return self._threads.get(threading.get_ident())

    def close(self) -> None:
        """End all threads of this clock, wherever they wait; nothing can wait in it any more. For a thread of the program."""
        with self._lead:
            self._closed = True
            for thread in tuple(self._threads.values()):
                _let_go(thread.turn)
                thread.end()

    # -- waiting -------------------------------------------------------------------------------------------------------

    def block(self, wait: _Wait, until: float) -> bool:
        """Block until ``wait`` is woken, at most until ``until``; return whether it was woken.

        Raises:
            StateError: nothing can ever wake it.
        """
        thread = self._threads.get(threading.get_ident())
        if self._closed:
            if thread is not None:
                raise ClockClosed
            return wait.woken
        if thread is None:
            return self._let_pass(wait, until)
        wait.thread = thread
        if until < math.inf:
            heapq.heappush(self._timers, (until, next(self._order), wait))
        self._give_back()
        self._await_turn(thread)
        if self._closed:
            raise ClockClosed
        return wait.woken

    def wake(self, wait: _Wait) -> None:
        """End a wait; its thread continues when the threads before it wait again."""
        if not wait.over:
            wait.over = wait.woken = self.news = True
            if wait.thread is not None:
                self._ready.append(wait.thread)

    def _let_pass(self, wait: _Wait, until: float) -> bool:
        """Let the other threads run and time pass until a wait of the leading thread is over."""
        with self._lead:
            while not wait.woken:
                if self._ready:
                    self._run()
                elif not self._advance(until):
                    self.catch_up()
                    break
            wait.over = True
            return wait.woken

    def _run(self) -> None:
        """Let the first ready thread run until it waits again or ends; an interrupt is raised after that."""
        interrupt: BaseException | None = None
        thread = self._running = self._ready[0]
        while True:
            try:
                while self._running is not None:
                    _let_go(thread.turn)
                    self._back.acquire()
                break
            except BaseException as error:  # noqa: BLE001 - of a signal handler; two threads must not run at once
                interrupt = error
        if interrupt is not None:
            raise interrupt

    def _await_turn(self, thread: VirtualThread) -> None:
        while self._running is not thread and not self._closed:
            thread.turn.acquire()
        if not self._closed:
            self._ready.popleft()

    def _give_back(self) -> None:
        self._running = None
        _let_go(self._back)

    def _advance(self, until: float) -> bool:
        """Go to the next event and execute it; return False if there is none up to ``until``, which is the time then."""
        due = until
        for source in self._sources:
            if source.due < due:
                due = source.due
        timers = self._timers
        if timers and timers[0][0] < due:
            due = timers[0][0]
        if due > self._now:
            if due == math.inf:
                raise StateError(
                    "nothing more can happen in virtual time: every thread waits without a time-out",
                    remedy="wait with a time-out",
                )
            self._now = due
        now, ran, self.news = self._now, False, False
        for source in self._sources:
            if source.due <= now:
                source.run(now, self._horizon(source, until))
                now, ran = self._now, True
        while timers and timers[0][0] <= now:
            wait = heapq.heappop(timers)[2]
            if not wait.over:
                wait.over = ran = True
                assert wait.thread is not None
                self._ready.append(wait.thread)
        return ran or now < until

    def _horizon(self, running: EventSource, until: float) -> float:
        """Return the time until which ``running`` may continue alone."""
        if self._timers and self._timers[0][0] < until:
            until = self._timers[0][0]
        for source in self._sources:
            if source is not running and source.due < until:
                until = source.due
        return until

    # -- threads -------------------------------------------------------------------------------------------------------

    def begin(self, thread: VirtualThread) -> None:
        """Make a new thread ready."""
        self._ready.append(thread)

    def enter(self, thread: VirtualThread) -> None:
        """Wait for the first turn, in the new thread."""
        self._threads[threading.get_ident()] = thread
        self._await_turn(thread)

    def leave(self) -> None:
        """Give the turn back at the end of a thread."""
        del self._threads[threading.get_ident()]
        if not self._closed:
            self._give_back()


class VirtualThread:
    """A thread in virtual time: it runs when it has the turn, until it waits."""

    def __init__(self, clock: VirtualClock, run: Callable[[], object], name: str) -> None:
        self.turn = _held_lock()
        self._clock = clock
        self._run = run
        self._ended = clock.event()
        self._thread = threading.Thread(target=self._live, name=name, daemon=True)

    def start(self) -> None:
        """As ``ClockThread.start``: it begins when the caller waits."""
        self._thread.start()
        self._clock.begin(self)

    def is_alive(self) -> bool:
        """As ``ClockThread.is_alive``."""
        return self._thread.is_alive() and not self._ended.is_set()

    def join(self, timeout: float | None = None) -> None:
        """As ``ClockThread.join``, in virtual time."""
        if self._ended.wait(timeout):
            self._thread.join(_END_PATIENCE)

    def end(self) -> None:
        """Wait in real time until the thread has ended, after its clock was closed."""
        self._thread.join(_END_PATIENCE)

    def _live(self) -> None:
        self._clock.enter(self)
        try:
            if not self._clock._closed:
                self._run()
        except ClockClosed:
            pass
        finally:
            self._ended.set()
            self._clock.leave()


class VirtualCondition:
    """As ``threading.Condition``, in virtual time."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._waits: deque[_Wait] = deque()

    def __enter__(self) -> bool:
        return self._lock.__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.__exit__(kind, error, trace)

    def wait(self, timeout: float | None = None) -> bool:
        """As ``ClockCondition.wait``; the caller holds the lock once."""
        wait = _Wait()
        self._waits.append(wait)
        self._lock.release()
        try:
            return self._clock.block(wait, math.inf if timeout is None else self._clock.now() + timeout)
        finally:
            self._lock.acquire()
            if wait in self._waits:
                self._waits.remove(wait)

    def wait_for(self, predicate: Callable[[], bool], timeout: float | None = None) -> bool:
        """As ``ClockCondition.wait_for``."""
        until = math.inf if timeout is None else self._clock.now() + timeout
        while not predicate():
            left = until - self._clock.now()
            if left <= 0.0:
                return False
            self.wait(None if timeout is None else left)
        return True

    def notify(self, n: int = 1) -> None:
        """As ``ClockCondition.notify``."""
        for _ in range(min(n, len(self._waits))):
            self._clock.wake(self._waits.popleft())

    def notify_all(self) -> None:
        """As ``ClockCondition.notify_all``."""
        self.notify(len(self._waits))


class VirtualEvent:
    """As ``threading.Event``, in virtual time."""

    def __init__(self, clock: VirtualClock) -> None:
        self._changed = VirtualCondition(clock)
        self._set = False

    def is_set(self) -> bool:
        """As ``ClockEvent.is_set``."""
        return self._set

    def set(self) -> None:
        """As ``ClockEvent.set``."""
        with self._changed:
            self._set = True
            self._changed.notify_all()

    def wait(self, timeout: float | None = None) -> bool:
        """As ``ClockEvent.wait``."""
        with self._changed:
            return self._set or self._changed.wait(timeout) or self._set


class VirtualLock:
    """As ``threading.Lock``, in virtual time."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._held = False
        self._waits: deque[_Wait] = deque()
        self._guard = threading.Lock()  # of both, against threads that are not of this clock

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """As ``ClockLock.acquire``."""
        until = math.inf if timeout < 0 else self._clock.now() + timeout
        while True:
            with self._guard:
                if not self._held:
                    self._held = True
                    return True
                if not blocking:
                    return False
                wait = _Wait()
                self._waits.append(wait)
            if not self._clock.block(wait, until):
                return self._give_up(wait)

    def _give_up(self, wait: _Wait) -> bool:
        """End a wait whose time is over; return whether the lock was free at that time, and is held now."""
        with self._guard:
            if wait in self._waits:
                self._waits.remove(wait)
        return self.acquire(blocking=False)

    def release(self) -> None:
        """As ``ClockLock.release``."""
        with self._guard:
            self._held = False
            if self._waits:
                self._clock.wake(self._waits.popleft())

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
