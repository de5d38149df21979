"""Queue from the receive thread to the thread that waits, in order, with a wait that always ends at its deadline.

``queue.SimpleQueue.get`` is not used. In CPython 3.11 and 3.12 a time-out that has expired when ``get`` checks its lock again
becomes negative, which the lock takes for "without end". A wait of a few microseconds for an empty queue then never returns.
"""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

from axisbus.clock import Clock

T = TypeVar("T")


class UnboundedQueue(Generic[T]):
    """First in, first out, without a bound; holds state: the items not yet taken. May be used from any thread."""

    __slots__ = ("_arrived", "_clock", "_items")

    def __init__(self, clock: Clock) -> None:
        self._items: deque[T] = deque()
        self._clock = clock
        self._arrived = clock.condition()

    def __len__(self) -> int:
        """Return the number of items not yet taken."""
        return len(self._items)

    def put(self, item: T) -> None:
        """Add an item, and wake one waiting thread; does not block."""
        with self._arrived:
            self._items.append(item)
            self._arrived.notify()

    def take(self, until: float) -> T | None:
        """Return the oldest item; blocks until there is one, at the latest until ``until`` (clock, s), then returns None.

        An available item is returned even if ``until`` has passed.
        """
        with self._arrived:
            while not self._items:
                left = until - self._clock.now()
                if left <= 0.0:
                    return None
                self._arrived.wait(left)
            return self._items.popleft()
