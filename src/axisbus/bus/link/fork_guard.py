"""Objects that a forked child inherits and must not use: adapters and threads belong to the process that opened them.

Theory of operation
-------------------
``os.fork`` copies the objects and the file descriptors, but none of the threads. A child that sent on its copy of the adapter's
socket would be a second master on the same bus. A child that closed an adapter could take it away from its parent. The owner of
such an object registers it here. ``disown`` is then called in every forked child, before anything else runs in it. ``disown`` must
not take a lock: a thread that no longer exists may hold it. A child's own children inherit the registrations.
"""

from __future__ import annotations

import os
import sys
import weakref
from typing import Protocol


class Inherited(Protocol):
    """An object that only the process that made it may use."""

    def disown(self) -> None:
        """Become unusable, and affect nothing outside this process; called in a forked child, and again in its children."""


_things: weakref.WeakSet[Inherited] = weakref.WeakSet()


def disown_in_children(thing: Inherited) -> None:
    """Call ``thing.disown()`` in every child that this process forks."""
    _things.add(thing)


def _in_child() -> None:
    for thing in list(_things):
        try:
            thing.disown()
        except Exception as error:  # noqa: BLE001  # no error may keep the others from being disowned
            os.write(2, f"axisbus: in a forked child: {type(error).__name__}: {error}\n".encode())


if sys.platform != "win32":  # Windows has no fork
    os.register_at_fork(after_in_child=_in_child)
