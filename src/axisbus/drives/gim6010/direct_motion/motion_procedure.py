"""What every dialogue has in common that moves one module: it listens first, is followed by the heartbeat, and always lets go.

Theory of operation
-------------------
It begins only where one module beats under its node ID, idle and without a fault. Whatever ends it afterwards (an interrupt, the
bus, what its own way finds wrong), the power is taken away, idle first and then ESTOP, and how the module was left is said. An
interrupt is a wish that the next step heeds, so that a signal handler may tell it.
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
    """How far it is."""

    LISTENING = "listening"
    LED = "led"
    ENDING = "being ended"
    DONE = "over"


class ModuleMotionProcedure(ABC):
    """One module that is led; ``news`` are lines for people, ``why`` says why it did not come to its own end.

    ``left`` is how the module stands, and ``confirmed`` whether there is surely no power on its motor.
    """

    def __init__(self, node: int) -> None:
        """``node`` 0 to 63.

        Raises:
            ArgumentError: it is none.
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
        self._begun = 0.0  # when it was asked for
        self._to_brake = False  # before its power is taken away

    # What it does in its own way.

    @abstractmethod
    def _begin(self) -> Outgoing:
        """Return the first frame that moves it, or makes ready for that."""

    @abstractmethod
    def _lead(self, now: float) -> Outgoing | None:
        """Go on; called after ``_begin`` until it has ended."""

    @abstractmethod
    def _hear(self, command: int, frame: CanFrame) -> None:
        """Take another frame of the module than its heartbeat."""

    @abstractmethod
    def _follow(self, time: float) -> None:
        """Take a heartbeat that came after the beginning."""

    def _brake(self, now: float) -> Outgoing | None:  # noqa: ARG002  # what has set ``_to_brake`` does it
        """Brake it on its way out; ``_to_brake`` ends that."""
        self._to_brake = False
        return None

    # What a dialogue is asked.

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.stage is ModuleMotionStage.DONE

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """What takes the power away, for whoever cannot go on with it."""
        return (idle(self.node),)

    def note(self, frame: CanFrame) -> None:
        """Take a frame that was heard."""
        if self._pulse.take(frame):
            if self.stage is ModuleMotionStage.LED and frame.time > self._begun:
                self._follow(frame.time)
        elif not (frame.extended or frame.remote) and split(frame.can_id).node == self.node:
            self._hear(split(frame.can_id).command, frame)

    def trouble(self, words: str) -> None:
        """Hear that a request was not acknowledged, or not sent."""
        self._end(f"the bus: {words}")

    def interrupt(self, why: str) -> None:
        """Have it ended with the next step, from any thread or signal handler; a second time goes on to ESTOP at once."""
        self._wishes.append(why)

    def step(self, now: float) -> Outgoing | None:
        """Let time pass, and return what is to be sent now."""
        while self._wishes:
            self._heed(self._wishes.popleft())
        if self.stage is ModuleMotionStage.LISTENING:
            return self._listen(now)
        if self.stage is ModuleMotionStage.LED:
            return self._lead(now)
        if self.stage is ModuleMotionStage.DONE:
            return None
        return self._brake(now) if self._to_brake else self._let_go(now)

    # How it ends.

    def _end(self, why: str) -> None:
        """End it for this reason; where nothing was asked for there is nothing to end."""
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
