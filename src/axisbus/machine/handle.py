"""The handle of a command: a program can wait for it or await it, and a failure is never silent."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

from axisbus.cia402.port import Waiter
from axisbus.errors import ArgumentError, AxisbusError, StateError, with_alarm
from axisbus.interrupt_guard import in_thread_of_ours, is_own
from axisbus.motion.command_status import ENDED, Status
from axisbus.motion.numbers import number, short_repr
from axisbus.session import CommandEvent
from axisbus.wording import counted

log = logging.getLogger("axisbus")


class Handle:
    """One command and its status.

    ``wait`` blocks a thread, ``await`` an asyncio task; both return the handle, or raise the error that ended the command. The
    handle is a coroutine as well (``asyncio.create_task(handle)``, ``asyncio.gather``), in any number of tasks at once. If the
    handle of a failed command is dropped and its status was never read, the failure is logged with the command's name. ``note``
    holds a remark about a successful end. For a stop, it names the evidence of standstill if this was not the position, or the
    reason why the axis lost its power although it had to keep it.
    """

    __slots__ = (
        "__weakref__",
        "_callbacks",
        "_tasks",
        "_waiter",
        "_was_read",
        "error",
        "name",
        "note",
        "status",
    )

    def __init__(self, name: str, waiter: Waiter) -> None:
        """``name``: the text of the call, such as ``x.move_absolute(90.0 deg)``."""
        self.name = name
        self.status = Status.BUSY
        self.error: AxisbusError | None = None
        self.note = ""
        self._waiter = waiter
        self._was_read = False
        self._callbacks: deque[Callable[[], None]] = deque()
        self._tasks: dict[int, Generator[object, None, Handle]] = {}  # the waits, by id of the task

    def __repr__(self) -> str:
        note = f" ({self.note})" if self.note else ""
        return f"<Handle {self.name}: {self.status.value}{note}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        from axisbus.machine.notebook_display import handle_html  # only a notebook needs it

        return handle_html(self)

    @property
    def busy(self) -> bool:
        """Whether the command has not ended."""
        return self.status not in ENDED

    @property
    def active(self) -> bool:
        """Whether the command controls the axis."""
        return self.status is Status.ACTIVE

    @property
    def done(self) -> bool:
        """Whether the command ended successfully."""
        return self._read_end() is Status.DONE

    @property
    def aborted(self) -> bool:
        """Whether another command replaced this one."""
        return self._read_end() is Status.ABORTED

    def exception(self) -> AxisbusError | None:
        """Return the error that ended the command, None if there is none (yet)."""
        self._read_end()
        return self.error

    def wait(self, timeout: float | None = None) -> Handle:
        """Block until the command has ended, at most ``timeout`` seconds, and return the handle.

        Raises:
            TimeoutError: the command has not ended; it continues.
            AxisbusError: the error that ended the command. ArgumentError: ``timeout`` is not a number.
        """
        if not self._waiter.wait(self._ended, timeout_seconds(self.name, timeout)):
            raise TimeoutError(f"{self.name}: not ended after {timeout:g} s; it continues")
        self._read_end()
        if self.error is not None:
            raise self.error
        return self

    def __await__(self) -> Generator[object, None, Handle]:
        """Wait within asyncio; cancelling the task cancels the wait, not the motion."""
        yield from _await(self, self._waiter).__await__()
        self._read_end()
        if self.error is not None:
            raise self.error
        return self

    # Coroutine protocol: asyncio drives the wait of each task with these three methods.

    def send(self, value: None) -> object:
        """Continue the wait of the present task, as asyncio does; ends by StopIteration."""
        return self._task_wait().send(value)

    def throw(self, *error: Any) -> object:
        """End the wait of the present task with an exception, as asyncio does when the task is cancelled."""
        return self._task_wait().throw(*error)

    def close(self) -> None:
        """Drop the wait of the present task; the command continues."""
        waiting = self._tasks.pop(_task(), None)
        if waiting is not None:
            waiting.close()

    def _task_wait(self) -> Generator[object, None, Handle]:
        return self._tasks.setdefault(_task(), self._begin_task_wait(_task()))

    def _begin_task_wait(self, task: int) -> Generator[object, None, Handle]:
        try:
            return (yield from self.__await__())
        finally:
            self._tasks.pop(task, None)

    def _on_event(self, event: CommandEvent) -> None:
        """Apply a change of the command's status."""
        if event.status in ENDED:
            self.note = event.note
            self._finish(event.status, event.error)
        elif self.busy:
            self.status = event.status

    def _finish(self, status: Status, error: AxisbusError | None = None) -> None:
        """End the command; a second call changes nothing."""
        if self.status in ENDED:
            return
        self.error = error
        self.status = status
        self._call_back()

    def add_done_callback(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` when the command has ended; at once if it has. It runs in the scan's thread, so it must be quick.

        A callback may give commands, but it cannot wait for one (StateError): while it waits, no command can end. If a callback
        fails, its traceback is logged: a callback must not end the scan.
        """
        self._callbacks.append(callback)
        if self._ended():
            self._call_back()

    def _call_back(self) -> None:
        """Call every callback once. Taking a callback out of the queue is atomic, so only one thread calls it."""
        while True:
            try:
                callback = self._callbacks.popleft()
            except IndexError:
                return
            try:
                callback()
            except BaseException as error:
                if not is_own(error):
                    raise
                _log_in_thread("a callback of %s failed", self.name, error)

    def _ended(self) -> bool:
        return self.status in ENDED

    def _read_end(self) -> Status:
        if self._ended():
            self._was_read = True
        return self.status

    def __del__(self) -> None:
        if self.status is Status.ERROR and not self._was_read:
            log.error("%s failed, and its handle was not read:\n%s", self.name, self.error)


def mark_end_as_read(handle: Handle) -> None:
    """Mark the end of ``handle`` as read, so that its failure is not logged: another handle reports the reason."""
    handle.add_done_callback(lambda: _read_end(handle))


def end_with(halt: Handle, error: BaseException | None) -> None:
    """Wait until ``halt`` has ended, at the end of a ``with`` block. If ``error`` ends the block, a failed halt is noted on it.

    Raises:
        AxisbusError: the halt has failed, and there is no ``error``.
    """
    try:
        halt.wait()
    except AxisbusError as failure:
        if error is None:
            raise
        if not isinstance(failure, StateError) and failure.message not in str(error):
            # after a StateError the machine is being closed, which stops the axes
            error.add_note(f"while halting: {failure}")


def _read_end(handle: Handle) -> None:
    handle.exception()


def _log_in_thread(text: str, name: str, error: BaseException) -> None:
    """Log a failure with its traceback in a thread of its own, because reading the source files would delay the scan's thread."""
    notify = partial(log.error, text, name, exc_info=error)
    if not in_thread_of_ours():
        notify()
        return
    try:
        threading.Thread(target=notify, name="log of axisbus", daemon=True).start()
    except RuntimeError:  # the interpreter is ending and starts no more threads
        notify()


def _task() -> int:
    import asyncio  # only a program that awaits needs asyncio

    return id(asyncio.current_task())


async def _await(handle: Handle, waiter: Waiter) -> None:
    import asyncio

    run_cycle = getattr(waiter, "run_cycle", None)
    if run_cycle is not None:
        while handle.busy:
            run_cycle()
            await asyncio.sleep(0)
        return
    loop = asyncio.get_running_loop()
    ended = loop.create_future()

    def notify() -> None:
        if not ended.done():
            ended.set_result(None)

    def notify_loop() -> None:
        with suppress(RuntimeError):  # the loop is closed: no task waits any more
            loop.call_soon_threadsafe(notify)

    handle.add_done_callback(notify_loop)
    await ended


def timeout_seconds(call: str, timeout: object) -> float | None:
    """Return the maximum time in seconds that a call waits; None (also for infinity) means without limit.

    Raises:
        ArgumentError: ``timeout`` is not a number; ``call`` names the waiting call in its text.
    """
    if timeout is None or (isinstance(timeout, float) and timeout == math.inf):
        return None
    found = number(timeout)
    if found is None:
        raise ArgumentError(
            f"{call}: timeout {short_repr(timeout)} is not a number of seconds",
            remedy="give seconds, such as 5.0, or None to wait without a limit; nothing was changed",
        )
    return found


def wait(*handles: Handle | Iterable[Handle], timeout: float | None = None) -> list[Handle]:
    """Block until all commands have ended, at most ``timeout`` seconds in total; return their handles.

    Raises:
        TimeoutError: some have not ended; they continue.
        ExceptionGroup: all failures, after all commands have ended. The first failure alone stops no axis; the fault policy does.
    """
    flat = _flatten(handles)
    _wait_for_all(flat, timeout_seconds("wait", timeout))
    failures = [error for handle in flat if (error := handle.exception()) is not None]
    if failures:
        text = f"{len(failures)} of {counted(len(flat), 'command')} failed"
        raise ExceptionGroup(with_alarm(text, *failures), failures)
    return flat


def _wait_for_all(handles: list[Handle], timeout: float | None) -> None:
    """Block until no command is busy. One waiter waits for all of its handles together, so that virtual time counts once."""
    deadline = None if timeout is None else time.monotonic() + timeout
    waiters = {id(handle._waiter): handle._waiter for handle in handles}
    for waiter in waiters.values():
        own = [handle for handle in handles if handle._waiter is waiter]
        left = timeout if deadline is None or len(waiters) == 1 else max(0.0, deadline - time.monotonic())
        waiter.wait(partial(_none_busy, own), left)
    busy = [handle.name for handle in handles if handle.busy]
    if busy:
        after = "" if timeout is None else f" after {timeout:g} s"
        raise TimeoutError(f"{', '.join(busy)}: not ended{after}; they continue")


def _none_busy(handles: list[Handle]) -> bool:
    return not any(handle.busy for handle in handles)


def _flatten(handles: tuple[Handle | Iterable[Handle], ...]) -> list[Handle]:
    flat: list[Handle] = []
    for item in handles:
        if isinstance(item, Handle):
            flat.append(item)
        else:
            flat.extend(item)
    return flat


class _Nobody:
    """A waiter that does not wait, for handles that only the scan uses."""

    realtime = False

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:  # noqa: ARG002  # the protocol's shape
        """Return whether the command has already ended."""
        return done()


NOBODY = _Nobody()
