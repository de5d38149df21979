"""One thread per node that executes SDO transfers in order, except that an urgent transfer goes first.

Theory of operation
-------------------
The scan must not wait for SDO. A port therefore passes its transfers to this worker, which reports the end of each by a callback in
its thread. The queue is first in, first out, shared by all axes of the node, and bounded. ``urgent`` is for a quick stop by SDO: it
empties the queue, aborts the running transfer, and goes first. The callback of every job is called exactly once, unless the job is
cancelled.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from typing import NamedTuple

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sdo.transfer import Call
from axisbus.bus.sdo.value import checked_bytes
from axisbus.cia301 import abort
from axisbus.clock import ClockThread
from axisbus.errors import ArgumentError, BusError, Interrupted, LimitError, SdoAbort

QUEUE_LIMIT = 256
CLOSE_PATIENCE = 2.0
WRONG_TYPE = 0x0607_0010
INVALID_VALUE = 0x0609_0030

Done = Callable[[int | None, int | None], None]


class SdoJob(NamedTuple):
    """One transfer: ``value`` None reads; ``done(value, abort)`` reports its end; ``cancel`` selects it by ``key``."""

    key: Hashable
    index: int  # type: ignore[assignment]  # hides tuple.index, which is not needed here
    subindex: int
    value: int | None
    done: Done


class SdoWorker:
    """Executes jobs; holds state: the queue, the running job, and the thread (a daemon, started with the first job)."""

    def __init__(self, channel: Channel, sdo: SdoClient) -> None:
        self.clock = channel.clock
        self._channel = channel
        self._sdo = sdo
        self._queue: deque[SdoJob] = deque()
        self._running: SdoJob | None = None
        self._call: Call | None = None  # handle to cancel the running job's transfer
        self.began = 0.0  # start time of the running transfer, or of the last one
        self._forgotten = False  # whether the running job's callback is no longer wanted
        self._urgent: deque[SdoJob] = deque()
        self._wanted = self.clock.condition()
        self._closing = False
        self._thread: ClockThread | None = None

    @property
    def idle(self) -> bool:
        """Whether no job runs or waits."""
        return self._running is None and not self._urgent and not self._queue

    def submit(self, job: SdoJob) -> None:
        """Queue a job; does not block. If 256 are waiting, it ends at once with the abort code *out of memory*."""
        with self._wanted:
            accepted = len(self._queue) < QUEUE_LIMIT and not self._closing
            if accepted:
                self._queue.append(job)
                self._start()
                self._wanted.notify()
        if not accepted:
            job.done(None, abort.OUT_OF_MEMORY)

    def urgent(self, job: SdoJob) -> None:
        """Run ``job`` before all others but earlier urgent ones; does not block.

        The queue is emptied and the running transfer aborted; those jobs end with *timed out*.
        """
        with self._wanted:
            dropped = list(self._queue)
            self._queue.clear()
            if self._closing:
                dropped.append(job)
            else:
                self._urgent.append(job)
                self._start()
                self._wanted.notify()
            self._cancel_running()
        self._sdo.cancel()  # a user's transfer may hold the client's lock
        for other in dropped:
            other.done(None, abort.TIMED_OUT)

    def cancel(self, keys: set[Hashable]) -> None:
        """Cancel the jobs with these keys: waiting ones never run, the running one is aborted; ``done`` is not called."""
        with self._wanted:
            self._queue = deque(job for job in self._queue if job.key not in keys)
            if self._running is not None and self._running.key in keys:
                self._forgotten = True
                self._cancel_running()

    def clear(self) -> None:
        """End all jobs but urgent ones with *timed out*: they are from before the node was lost. Does not block."""
        with self._wanted:
            dropped = list(self._queue)
            self._queue.clear()
            if self._call is not None and not self._call.urgent:
                self._cancel_running()
        for job in dropped:
            job.done(None, abort.TIMED_OUT)

    def close(self) -> None:
        """End the running transfer and the thread; waiting jobs end with *timed out*.

        Blocks up to about 2 s, usually not at all.
        """
        with self._wanted:
            self._closing = True
            dropped = [*self._urgent, *self._queue]
            self._urgent.clear()
            self._queue.clear()
            self._wanted.notify()
            self._cancel_running()
        for job in dropped:
            job.done(None, abort.TIMED_OUT)
        if self._thread is not None and not self.clock.is_current(self._thread):
            self._thread.join(CLOSE_PATIENCE)

    # -- the thread ---------------------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        if self._thread is None:
            name = f"axisbus SDO node {self._sdo.node_id}"
            self._thread = self.clock.thread(self._work, name)
            self._thread.start()

    def _cancel_running(self) -> None:
        """End the running job's transfer, also if not begun yet; not an urgent one, which has its own call. Needs the lock."""
        if self._call is not None:
            self._sdo.cancel(self._call)

    def _work(self) -> None:
        while True:
            job, call = self._next()
            if job is None:
                return
            self.began = self.clock.now()
            value, code = self._carry_out(job, call)
            with self._wanted:
                done = _forget if self._forgotten else job.done
            try:
                done(value, code)
            except Exception as error:  # noqa: BLE001 - an internal error must stop the machine, not only this thread
                self._channel.fail(_worker_failed(self._sdo.node_id, error))
            with self._wanted:
                self._running = self._call = None

    def _next(self) -> tuple[SdoJob | None, Call]:
        with self._wanted:
            while not self._queue and not self._urgent:
                if self._closing:
                    return None, Call()
                self._wanted.wait()
            self._call = Call(urgent=bool(self._urgent))
            self._running = (self._urgent or self._queue).popleft()
            self._forgotten = False
            return self._running, self._call

    def _carry_out(self, job: SdoJob, call: Call) -> tuple[int | None, int | None]:
        """Run one transfer and return its value and abort code."""
        try:
            return self._transfer(job, call), None
        except SdoAbort as error:
            return None, error.code
        except LimitError:
            return None, INVALID_VALUE
        except ArgumentError:
            return None, WRONG_TYPE
        except (BusError, Interrupted):
            return None, abort.TIMED_OUT
        except Exception as error:  # noqa: BLE001 - an internal error must stop the machine, not only this thread
            self._channel.fail(_worker_failed(self._sdo.node_id, error))
            return None, abort.GENERAL

    def _transfer(self, job: SdoJob, call: Call) -> int | None:
        if job.value is None:
            value = self._sdo.read(job.index, job.subindex, call=call)
            if not isinstance(value, (int, float)):
                raise ArgumentError(f"{self._sdo.describe(job.index, job.subindex)} is not a number")
            return int(value)
        # The limits of an EDS are often wrong, and must not keep a stop from the drive. It refuses by itself what it does not take.
        data = checked_bytes(self._sdo.dictionary.entry(job.index, job.subindex), job.value, limits=False)
        if call.urgent:
            self._sdo.download_urgent(job.index, job.subindex, data)
        else:
            self._sdo.download(job.index, job.subindex, data, call=call)
        return None


def _forget(_value: int | None, _abort: int | None) -> None:
    """Ignore the end of a cancelled job."""


def _worker_failed(node_id: int, error: Exception) -> BusError:
    failure = BusError(
        f"the SDO worker of node {node_id} failed",
        observed=f"{type(error).__name__}: {error}",
        remedy="this is a fault of the library: please report it with the traceback of the cause",
    )
    failure.__cause__ = error
    return failure
