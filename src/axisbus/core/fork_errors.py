"""The error of a forked child that uses its parent's machine."""

from __future__ import annotations

from axisbus.errors import StateError


def inherited(what: str) -> StateError:
    """Return the error: a forked child has a copy of the machine without a scan."""
    return StateError(
        f"{what}: the machine belongs to the process that opened it",
        observed="this process was forked from that one: it has no scan, and its copy of the adapter is not used",
        remedy="command the machine in the process that opened it, and exchange data by a queue or a pipe; start worker "
        "processes before it is opened, or with multiprocessing's start method 'spawn'",
    )
