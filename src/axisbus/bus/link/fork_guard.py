"""What a forked child process inherits and must not use: an adapter and its threads belong to the process that opened them.

Theory of operation
-------------------
``os.fork`` copies the objects and the file descriptors, and none of the threads. A child that sent on its copy of the adapter's
socket would be a second master on the same bus, and one that closed an adapter could take it away from its parent. So whatever owns
such a thing enters it here, and ``disown`` is called in every child that is forked, before anything else runs in it. It must not
take a lock: a thread that is not there any more may hold it. A child's own children inherit the entries.
"""

from __future__ import annotations

import os
import sys
import weakref
from typing import Protocol


class Inherited(Protocol):
    """Something that only the process that made it may use."""

    def disown(self) -> None:
        """Become unusable, and touch nothing outside this process; called in a forked child, and again in its children."""


_things: weakref.WeakSet[Inherited] = weakref.WeakSet()


def disown_in_children(thing: Inherited) -> None:
    """Have ``thing.disown()`` called in every child that this process forks."""
    _things.add(thing)


def _in_child() -> None:
    for thing in list(_things):
        try:
            thing.disown()
        except Exception as error:  # noqa: BLE001  # nothing may keep the others from being disowned
            os.write(2, f"axisbus: in a forked child: {type(error).__name__}: {error}\n".encode())


if sys.platform != "win32":  # where nothing forks
    os.register_at_fork(after_in_child=_in_child)
