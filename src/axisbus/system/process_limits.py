"""The priority of a process and its limits of memory, processor time and descriptors: Unix only, no limit on Windows."""

from __future__ import annotations

import os
import sys

if sys.platform != "win32":
    import resource


def lower_priority(nice: int, process: int = 0) -> None:
    """Set the nice value of a process; 0: this one."""
    if sys.platform != "win32":
        os.setpriority(os.PRIO_PROCESS, process, nice)


def limit(memory: int, processor_time: int) -> None:
    """Limit the address space of this process, in bytes (Linux only), and its processor time, in s."""
    if sys.platform == "linux":  # macOS refuses a limit below what it has already reserved
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    if sys.platform != "win32":
        resource.setrlimit(resource.RLIMIT_CPU, (processor_time, processor_time))


def most_descriptors() -> int | None:
    """Return how many descriptors this process may have; None if there is no limit."""
    if sys.platform != "win32":
        most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        return None if most == resource.RLIM_INFINITY else most
    return None
