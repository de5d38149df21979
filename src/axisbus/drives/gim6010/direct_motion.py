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
from axisbus.drives.gim6010.can_simple.heartbeat import HeartbeatMonitor
from axisbus.drives.gim6010.can_simple.identifier import split
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, state_words
from axisbus.drives.gim6010.can_simple.orders import Orders

LISTEN = 1.5  # s before it begins
BRAKE_TIME, STILL = 2.0, 0.1  # s of braking at most, and of standstill that ends it


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
        """``node`` 0 to 63. Raises ArgumentError: the node ID is invalid."""
        self.node = node
        self.stage = ModuleMotionStage.LISTENING
        self.news: deque[str] = deque()
        self.why = self.left = ""
        self.confirmed = True
        self._pulse = HeartbeatMonitor(node)
        self._orders = Orders(node)
        self._letting_go = PowerOff(self._pulse)
        self._wishes: deque[str] = deque()
        self._since: float | None = None
        self._begun = 0.0  # time of the first frame
        self._to_brake = False  # before the power is removed
        self._braking_since: float | None = None
        self._still_since: float | None = None

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

    def _follow(self, time: float) -> None:  # noqa: B027  # an optional hook
        """Take a heartbeat received after the beginning; unless overridden, only the steps evaluate the last one."""

    def _brake(self, now: float) -> Outgoing | None:  # noqa: ARG002  # subclasses that set ``_to_brake`` override it
        """Brake before the power is removed; setting ``_to_brake`` to False ends the braking."""
        self._to_brake = False
        return None

    def _has_braked(self, now: float, *, stands: bool, longest: float = BRAKE_TIME) -> bool:
        """End the braking at standstill, without closed loop, or after ``longest`` s; return whether it has ended.

        ``stands``: the module reports standstill now.
        """
        if self._braking_since is None:
            self._braking_since = now
        self._still_since = (now if self._still_since is None else self._still_since) if stands else None
        last = self._pulse.last
        off = last is not None and last.state != CLOSED_LOOP and self._pulse.at > self._braking_since
        is_still = self._still_since is not None and now - self._still_since >= STILL
        self._to_brake = not (off or is_still or now - self._braking_since > longest)
        return not self._to_brake

    def _against(self, now: float, *states: int) -> bool:
        """End the procedure if the module is lost, has errors, or is in none of these states; return whether that is so."""
        last, errors = self._pulse.last, self._pulse.errors()
        why = self._pulse.lost(now)
        if not why and errors:
            why = f"the module reports errors: {'; '.join(errors)}"
        elif not why and last is not None and last.state not in states:
            why = f"the module is in {state_words(last.state)}"
        if why:
            self._end(why)
        return bool(why)

    # For callers.

    @property
    def done(self) -> bool:
        return self.stage is ModuleMotionStage.DONE

    @property
    def parting(self) -> tuple[Outgoing, ...]:
        """Frames that remove the power, for a caller that cannot continue."""
        return (self._orders.idle(),)

    def note(self, frame: CanFrame) -> None:
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


# ----------------------------------------------------------------------------------------------------------------------
# Removes the power of a module: by idle, or by ESTOP if its heartbeat does not show idle in time; reports the final state.


_AGAIN = 0.05  # s between two frames
RUNG = 1.5  # s, plus two periods of the heartbeat: deadline for idle, then for ESTOP


class PowerOff:
    """Progress of removing the power; ``left`` is empty until the end, ``confirmed`` whether the module was seen to be idle."""

    def __init__(self, pulse: HeartbeatMonitor) -> None:
        self.left = ""
        self.confirmed = False
        self._pulse = pulse
        self._orders = Orders(pulse.node)
        self._estop = False
        self._start: float | None = None  # of the step
        self._last = 0.0  # time of the last frame

    @property
    def over(self) -> bool:
        return bool(self.left)

    def escalate(self) -> None:
        """Skip to ESTOP at once; harmless when repeated."""
        if not self._estop:
            self._estop, self._start = True, None

    def step(self, now: float) -> Outgoing | None:
        """Advance to ``now``, and return the frame to be sent now."""
        if self._start is None:
            self._start, self._last = now, now - _AGAIN
        if self._is_idle(self._start):
            after = "ESTOP, whose error latches until it is cleared" if self._estop else "idle was sent"
            self._end(
                f"module {self._pulse.node} is idle according to its heartbeat, after {after}", confirmed=True
            )
        elif now - self._start > RUNG + 2.0 * self._pulse.period:
            self._late(now)
        elif not now - self._last < _AGAIN - 1e-9:
            self._last = now
            return self._orders.estop() if self._estop else self._orders.idle()
        return None

    def _is_idle(self, start: float) -> bool:
        """Whether a heartbeat shows idle that arrived well after the first frame, when the second one had been sent."""
        last = self._pulse.last
        return self._pulse.at > start + _AGAIN and last is not None and last.state == IDLE

    def _late(self, now: float) -> None:
        if not self._estop:
            self.escalate()
            return
        heard = "is not heard" if self._pulse.is_silent(now) else "is heard, and does not show idle"
        self._end(
            f"NOT CONFIRMED: module {self._pulse.node} {heard} after idle and ESTOP; switch its supply off",
            confirmed=False,
        )

    def _end(self, text: str, *, confirmed: bool) -> None:
        self.left, self.confirmed = text, confirmed
