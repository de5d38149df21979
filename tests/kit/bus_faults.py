"""Faults of the bus of a cell in virtual time: frames that are not sent, a computer that is late, and a wire that loses frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from axisbus.bus.cycle import CanCycle
from axisbus.clock import Clock
from axisbus.sim.virtual_can import FrameFaults, VirtualWire


class BusFaults:
    """May be changed at any time.

    receive, commit, sync, heartbeat, wait: an exception that the call of this name raises
    send_blocks: seconds of virtual time that the next ``commit`` takes, as with a driver that does not return
    wait_late: seconds by which ``wait_until`` returns too late
    """

    __slots__ = (
        *("receive", "commit", "sync", "heartbeat", "wait", "send_blocks", "wait_late"),
        *("_clock", "_stall", "_wire"),
    )

    def __init__(self, cycle: CanCycle, clock: Clock, wire: VirtualWire) -> None:
        self.receive: BaseException | None = None
        self.commit: BaseException | None = None
        self.heartbeat: BaseException | None = None
        self.sync: BaseException | None = None
        self.wait: BaseException | None = None
        self.send_blocks = 0.0
        self.wait_late = 0.0
        self._stall = 0.0
        self._clock, self._wire = clock, wire
        commit, sync, wait_until = cycle.commit, cycle.sync, cycle.wait_until
        at: Any = cycle
        at.commit = self._raising("commit", lambda: (self._block(), commit()))
        at.sync = self._raising("sync", sync)
        at.receive = self._raising("receive", cycle.receive)
        at.heartbeat = self._raising("heartbeat", cycle.heartbeat)
        at.wait_until = self._raising("wait", lambda t: self._late(wait_until, t))

    @property
    def sync_lost(self) -> bool:
        """Whether the master's SYNC is lost."""
        return self._wire.faults.sync_lost

    @sync_lost.setter
    def sync_lost(self, lost: bool) -> None:
        self._wire.faults.sync_lost = lost

    @property
    def heartbeat_lost(self) -> bool:
        """Whether the master's heartbeats are lost."""
        return self._wire.faults.heartbeat_lost

    @heartbeat_lost.setter
    def heartbeat_lost(self, lost: bool) -> None:
        self._wire.faults.heartbeat_lost = lost

    def lose(self, cob_id: int) -> None:
        """Let the frames of an identifier arrive no more."""
        self._wire.faults.by_id[cob_id] = FrameFaults(loss=1.0)

    def stall(self, seconds: float) -> None:
        """Let the next cycle come so many seconds late, as if the program did not run."""
        self._stall = seconds

    def _raising(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*given: Any) -> Any:
            error = getattr(self, name)
            if error is not None:
                raise error
            return call(*given)

        return called

    def _block(self) -> None:
        blocked, self.send_blocks = self.send_blocks, 0.0
        if blocked > 0.0:
            self._clock.sleep(blocked)

    def _late(self, wait_until: Callable[[float], float | None], t: float) -> float | None:
        due = wait_until(t)
        late, self._stall = self.wait_late + self._stall, 0.0
        if late > 0.0:
            self._clock.sleep(late)
        return due
