"""Stops of many clients through one connection to the core: equal stops of an axis are merged, so that a flood delays nothing.

Theory of operation
-------------------
Any client of a page's server or of a bridge may stop at any rate. All of them share one connection to the core, which accepts 500
messages per second from a joined program and lets the others wait in order: a flood of stops of one axis would delay the stops of
all other axes by seconds. Here, while a stop of an axis runs, an equal one waits for its end, and is then given once for all who
have asked meanwhile. As long as the stop runs, the axis is being stopped; if a motion takes over, the stop ends at once, and the
waiting one follows. So no stop is lost, and at most one of each kind is under way for each axis.
"""

from __future__ import annotations

from collections.abc import Collection

from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import Status

_Key = tuple[str, str]  # axis and call


class MergedStops:
    """Hold the running stop of each axis, and the one that waits for its end; for any thread. Nothing here blocks."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._running: dict[_Key, Handle] = {}
        self._waiting: dict[_Key, Handle] = {}

    # No lock is held while a stop is given: the end of another command may call back meanwhile. Single operations on the
    # dictionaries are atomic; two threads at once may give a stop twice, which is harmless.

    def send(self, axis: str, call: str) -> Handle:
        """Stop an axis by ``call``, *halt* or *quick_stop*; raises as that call."""
        key = axis, call
        running = self._running.get(key)
        if running is None or not running.busy:
            return self._begin(key)
        fresh = Handle(running.name, self._machine.session.waiter)
        waiting = self._waiting.setdefault(key, fresh)
        if waiting is fresh:
            running.add_done_callback(lambda: self._follow(key))  # at once if it has ended
        return waiting

    def overtake(self, axes: Collection[str]) -> None:
        """Note that a command for these axes is given now: stops that were asked for before it must not end it."""
        for key in [each for each in self._waiting if each[0] in axes]:
            waiting = self._waiting.pop(key, None)
            if waiting is not None:
                self._end_together(waiting, self._running[key])

    def _begin(self, key: _Key) -> Handle:
        axis, call = key
        handle: Handle = getattr(self._machine[axis], call)()
        self._running[key] = handle
        return handle

    def _follow(self, key: _Key) -> None:
        waiting = self._waiting.pop(key, None)
        if waiting is None:  # overtaken
            return
        try:
            handle = self._begin(key)
        except AxisbusError as error:
            waiting._finish(Status.ERROR, error)
            return
        mark_end_as_read(handle)
        self._end_together(waiting, handle)

    @staticmethod
    def _end_together(waiting: Handle, handle: Handle) -> None:
        """Let a handle end as another one does."""

        def end() -> None:
            waiting.note = handle.note
            waiting._finish(handle.status, handle.exception())

        handle.add_done_callback(end)
