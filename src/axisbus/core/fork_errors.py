"""What a forked child is told that uses the machine of its parent."""

from __future__ import annotations

from axisbus.errors import StateError


def inherited(what: str) -> StateError:
    """A forked child has a copy of the machine, and nothing that moves it."""
    return StateError(
        f"{what}: the machine belongs to the process that opened it",
        observed="this process was forked from that one: it has no scan, and its copy of the adapter is not used",
        remedy="command the machine in the process that opened it, and hand things over by a queue or a pipe; begin worker "
        "processes before it is opened, or with multiprocessing's start method 'spawn'",
    )
