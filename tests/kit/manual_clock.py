"""A clock that a test sets by hand: its time passes only during a sleep, or when the test sets it."""

from __future__ import annotations

from axisbus.clock import ClockCondition, SystemClock


class HandClock(SystemClock):
    """A ``Clock`` whose time is ``time``, in seconds; locks, conditions and threads are real. Holds how long was ``slept``.

    ``passing``: threads that wait at a condition are not notified; the time of each wait passes at once.
    """

    def __init__(self, time: float = 0.0, *, passing: bool = False) -> None:
        self.time = time
        self.slept: list[float] = []
        self._passing = passing

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.time += seconds

    def condition(self) -> ClockCondition:
        return _Passing(self) if self._passing else super().condition()


class _Passing:
    """A condition on which waiting lets the clock continue."""

    def __init__(self, clock: HandClock) -> None:
        self._clock = clock

    def __enter__(self) -> bool:
        return True

    def __exit__(self, *_: object) -> None: ...

    def notify(self, n: int = 1) -> None: ...

    def notify_all(self) -> None: ...

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None, "nobody would ever wake it"
        self._clock.time += timeout
        return False
