"""Base of all procedures that move one module directly: listen first, monitor the heartbeat, always remove the power at the end.

Theory of operation
-------------------
A procedure begins only if exactly one module sends heartbeats under its node ID, is idle and has no fault. Afterwards the procedure
always removes the power at its end, also after an interrupt, a bus error or a failed check. It requests idle, then ESTOP if the
heartbeat does not show idle in time, and reports the final state of the module. An interrupt is stored and executed in the next
step, so that a signal handler may request it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from enum import Enum

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.identifier import split
from axisbus.drives.gim6010.direct_motion.heartbeat_monitor import HeartbeatMonitor
from axisbus.drives.gim6010.direct_motion.power_off import PowerOff, idle

LISTEN = 1.5  # s before it begins


class ModuleMotionStage(Enum):
    """Stage of a procedure."""

    LISTENING = "listening"
    LED = "led"
    ENDING = "being ended"
    DONE = "over"


class ModuleMotionProcedure(ABC):
    """A procedure that moves one module; ``news`` are lines for the user, ``why`` is the reason if it ended early.

    ``left`` is the final state of the module, and ``confirmed`` whether it is certain that there is no power on its motor.
    """

    def __init__(self, node: int) -> None:
        """``node`` 0 to 63.

        Raises:
            ArgumentError: the node ID is invalid.
        """
        self.node = node
        self.stage = ModuleMotionStage.LISTENING
        self.news: deque[str] = deque()
        self.why = self.left = ""
        self.confirmed = True
        self._pulse = HeartbeatMonitor(node)
        self._letting_go = PowerOff(self._pulse)
        self._wishes: deque[str] = deque()
        self._since: float | None = None
        self._begun = 0.0  # time of the first frame
        self._to_brake = False  # before the power is removed

    # For subclasses.

    @abstractmethod
    def _begin(self) -> Outgoing:
        """Return the first frame that moves the module, or prepares that."""

    @abstractmethod
    def _lead(self, now: float) -> Outgoing | None:
        """Continue; called after ``_begin`` until the procedure has ended."""

    @abstractmethod
    def _hear(self, command: int, frame: CanFrame) -> None:
        """Take a frame of the module other than its heartbeat."""

    @abstractmethod
    def _follow(self, time: float) -> None:
        """Take a heartbeat received after the beginning."""

    def _brake(self, now: float) -> Outgoing | None:  # noqa: ARG002  # subclasses that set ``_to_brake`` override it
        """Brake before the power is removed; setting ``_to_brake`` to False ends the braking."""
        self._to_brake = False
        return None

    # For callers.

    @property
    def done(self) -> bool:
        """Whether the procedure is over."""
        return self.stage is ModuleMotionStage.DONE

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """Frames that remove the power, for a caller that cannot continue."""
        return (idle(self.node),)

    def note(self, frame: CanFrame) -> None:
        """Take a received frame."""
        if self._pulse.take(frame):
            if self.stage is ModuleMotionStage.LED and frame.time > self._begun:
                self._follow(frame.time)
        elif not (frame.extended or frame.remote) and split(frame.can_id).node == self.node:
            self._hear(split(frame.can_id).command, frame)

    def trouble(self, words: str) -> None:
        """Note that a request was not acknowledged, or not sent."""
        self._end(f"the bus: {words}")

    def interrupt(self, why: str) -> None:
        """End the procedure with the next step, from any thread or signal handler; a second call skips to ESTOP."""
        self._wishes.append(why)

    def step(self, now: float) -> Outgoing | None:
        """Advance to ``now``, and return the frame to be sent now."""
        while self._wishes:
            self._heed(self._wishes.popleft())
        if self.stage is ModuleMotionStage.LISTENING:
            return self._listen(now)
        if self.stage is ModuleMotionStage.LED:
            return self._lead(now)
        if self.stage is ModuleMotionStage.DONE:
            return None
        return self._brake(now) if self._to_brake else self._let_go(now)

    # Ending.

    def _end(self, why: str) -> None:
        """End the procedure for this reason; before the first frame, it ends without sending anything."""
        if self.stage is ModuleMotionStage.DONE:
            return
        self.why = self.why or why
        if self.stage is ModuleMotionStage.LISTENING:
            self.left, self.stage = "nothing was sent that moves it", ModuleMotionStage.DONE
        else:
            self.stage = ModuleMotionStage.ENDING

    def _heed(self, why: str) -> None:
        if self.stage is ModuleMotionStage.ENDING:
            self._to_brake = False
            self._letting_go.escalate()
        else:
            self._end(why)

    def _listen(self, now: float) -> Outgoing | None:
        self._since = now if self._since is None else self._since
        if now - self._since < LISTEN:
            return None
        self._pulse.settle()
        against = self._pulse.against(now)
        if against:
            self._end(against)
            return None
        self.stage, self._begun = ModuleMotionStage.LED, now
        return self._begin()

    def _let_go(self, now: float) -> Outgoing | None:
        frame = self._letting_go.step(now)
        if self._letting_go.over:
            self.left, self.confirmed = self._letting_go.left, self._letting_go.confirmed
            self.stage = ModuleMotionStage.DONE
        return frame
