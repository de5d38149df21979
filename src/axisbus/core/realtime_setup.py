"""Settings of Python and the system while machines run in real time: made once for all of them, and restored by the last."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from axisbus.bus.link.fork_guard import disown_in_children

# seconds; Python's own 5 ms would let another thread delay the scan by a whole period
_SWITCH_INTERVAL = 0.0005
# seconds at most before a cycle is due, in which the scan only polls the clock: see ``bus.cycle``
SPIN = 0.0001
OWN_PROCESS, IN_A_THREAD = "in a process of its own", "in a thread of the program"
FIFO, LOCKED, ISOLATED = "SCHED_FIFO", "memory locked", "an isolated processor"
QUICK_WAKING = "quick waking"
_ISOLATED = Path("/sys/devices/system/cpu/isolated")
# a process that holds it open sets the allowed wake-up time of the processors
_LATENCY = Path("/dev/cpu_dma_latency")
_NO_LATENCY = (0).to_bytes(4, sys.byteorder)  # µs
_CAP_IPC_LOCK, _CAP_SYS_NICE = 14, 23  # linux/capability.h
_GENERATIONS = range(3)
_MARGIN = 3.0  # multiple of the last duration that must be left
_DECAY = 0.99  # per cycle without any collection
# multiple of the object count at which the youngest generation is usually collected
_FORCED_COLLECTION_RATIO = 100
_PR_SET_NAME, _PR_SET_TIMERSLACK = 15, 29  # linux/prctl.h
# Real-time priorities: above every normal thread, below the kernel's own for its devices.
_PRIORITY_OF_OTHERS, _PRIORITY_OF_SCAN = 10, 50
# MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT (linux/mman.h): only used pages, not every byte of each thread's stack
_LOCKED = 1 | 2 | 4


def wake_in_time() -> None:
    """Let the calling thread's sleeps end on time, and not up to 50 µs later to save energy (Linux)."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library: it wakes a little later
            ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def set_process_name(name: str) -> None:
    """Set the short name of this process (Linux; 15 characters)."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode(), 0, 0, 0)


def set_real_time_priority() -> list[str]:
    """Give all threads of this process real-time priority, and lock its memory, as far as permitted (Linux).

    Return the result as texts. Later threads inherit it. The threads alternate with others of the same priority (SCHED_RR): of
    several cores, watchdog processes and drives, none can block the others. Only a scan has a higher priority
    (``raise_scan_priority``).
    """
    granted = []
    with suppress(OSError):
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_RR, os.sched_param(_PRIORITY_OF_OTHERS))
        granted.append(FIFO)
    with suppress(OSError, AttributeError):
        if ctypes.CDLL(None, use_errno=True).mlockall(_LOCKED) == 0:
            granted.append(LOCKED)
    return granted


def prevent_deep_sleep() -> list[str]:
    """Prevent deep sleep of this computer's processors while this process lives, if permitted (Linux).

    Return the result as texts. Waking up from deep sleep takes long, and leaves cold caches. Preventing it costs power.
    """
    with suppress(OSError):
        os.write(os.open(_LATENCY, os.O_WRONLY | os.O_CLOEXEC), _NO_LATENCY)  # open until the process ends
        return [QUICK_WAKING]
    return []


def _threads() -> list[int]:
    """Return the thread IDs of this process (Linux)."""
    return [int(task.name) for task in Path("/proc/self/task").iterdir()]


def pin_to_isolated_processor() -> list[str]:
    """Run all threads of this process on one isolated processor (``isolcpus``), if there is any (Linux).

    Return the result as texts. The choice depends on the process, so that the cores of several programs are spread.
    """
    processors = isolated()
    if not processors:
        return []
    one = {processors[os.getpid() % len(processors)]}
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, one)
    except OSError:  # a container without permission
        return []
    return [ISOLATED]


def isolated() -> list[int]:
    """Return the isolated processors, which run no normal programs (Linux)."""
    found: list[int] = []
    with suppress(OSError, ValueError):
        for part in _ISOLATED.read_text(encoding="ascii").strip().split(","):
            first, _, last = part.partition("-")
            found += range(int(first), int(last or first) + 1)
    return found


def permitted() -> list[str]:
    """Return the texts that ``set_real_time_priority`` and ``prevent_deep_sleep`` would return; changes nothing (Linux)."""
    if sys.platform != "linux":
        return []
    import resource  # only Unix has it

    effective_capabilities = _effective_capabilities()
    highest_priority, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    memory, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    permissions = {
        FIFO: effective_capabilities >> _CAP_SYS_NICE & 1
        or highest_priority == resource.RLIM_INFINITY
        or highest_priority >= _PRIORITY_OF_SCAN,
        LOCKED: effective_capabilities >> _CAP_IPC_LOCK & 1 or memory == resource.RLIM_INFINITY,
        QUICK_WAKING: os.access(_LATENCY, os.W_OK),
    }
    return [what for what, allowed in permissions.items() if allowed]


def _effective_capabilities() -> int:
    with suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return int(next(line for line in lines if line.startswith("CapEff:")).split()[1], 16)
    return 0


def raise_scan_priority() -> None:
    """Give the calling thread, that of a scan, SCHED_FIFO above the other threads of its process, if they have priority at all."""
    with suppress(OSError, AttributeError):
        if os.sched_getscheduler(0) == os.SCHED_RR:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY_OF_SCAN))


class Collector:
    """Measures how long Python's garbage collector has held the interpreter, in seconds."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._began = 0.0

    def watch(self) -> None:
        """Begin to measure."""
        gc.callbacks.append(self._on_collection)

    def forget(self) -> None:
        """End measuring."""
        if self._on_collection in gc.callbacks:
            gc.callbacks.remove(self._on_collection)

    def _on_collection(self, phase: str, _: dict[str, int]) -> None:
        now = time.monotonic()
        if phase == "start":
            self._began = now
        else:
            self.seconds += now - self._began


COLLECTOR = Collector()


class IdleCollector:
    """Runs Python's garbage collector only in the idle time of a cycle; holds its last duration, by generation.

    For a process that is only a core. If no collection ever fits, the youngest generation is collected nevertheless when it is far
    too large.
    """

    def __init__(self, period: float) -> None:
        """``period`` of the cycles, in s; disables the automatic collector."""
        self._period = period
        self._durations = [0.0, 0.0, 0.0]
        gc.disable()

    def after_cycle(self, now: float, _: object = None) -> None:
        """Collect the generation that is due, if it fits; ``now`` is the start of the cycle (monotonic)."""
        counts, due = gc.get_count(), gc.get_threshold()
        found = [generation for generation in _GENERATIONS if counts[generation] > due[generation]]
        if not found:
            return
        left = now + self._period - time.monotonic() - SPIN
        fitting = [generation for generation in found if _MARGIN * self._durations[generation] < left]
        if fitting:
            self._collect(fitting[-1])
        elif counts[0] > _FORCED_COLLECTION_RATIO * due[0]:
            self._collect(0)
        else:  # a collection that was interrupted, and took long because of that, must run again some time
            self._durations = [_DECAY * seconds for seconds in self._durations]

    def _collect(self, generation: int) -> None:
        began = time.monotonic()
        gc.collect(generation)
        self._durations[generation] = time.monotonic() - began


class RealtimeSetup:
    """Counts its users; holds the switch interval from before the first."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._count = 0
        self._before = 0.0

    def take(self) -> None:
        """Set a short switch interval, and exclude the present objects from garbage collection."""
        with self._lock:
            if not self._count:
                self._before = sys.getswitchinterval()
                sys.setswitchinterval(_SWITCH_INTERVAL)
                COLLECTOR.watch()
            self._count += 1
            gc.freeze()  # a full collection over the dictionaries takes several periods

    def release(self) -> None:
        """End ``take``, after the last user; a switch interval that other code has set since is kept."""
        with self._lock:
            self._count -= 1
            if not self._count:
                self._restore()

    def disown(self) -> None:
        """End it in a forked child, in which no machine runs."""
        self._lock = threading.Lock()
        if self._count:
            self._restore()
        self._count = 0

    def _restore(self) -> None:
        if abs(sys.getswitchinterval() - _SWITCH_INTERVAL) < _SWITCH_INTERVAL / 100:
            sys.setswitchinterval(self._before)
        COLLECTOR.forget()
        gc.unfreeze()


REALTIME_SETUP = RealtimeSetup()
disown_in_children(REALTIME_SETUP)
