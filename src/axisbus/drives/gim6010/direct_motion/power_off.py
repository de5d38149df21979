"""Removes the power of a module: by idle, or by ESTOP if its heartbeat does not show idle in time; reports the final state."""

from __future__ import annotations

from axisbus.drives.gim6010.can_simple.codec import Outgoing, encode
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.states import IDLE
from axisbus.drives.gim6010.direct_motion.heartbeat_monitor import HeartbeatMonitor

_STATE, _ESTOP = named("Set_Axis_State"), named("Estop")
_AGAIN = 0.05  # s between two frames
RUNG = 1.5  # s, plus two periods of the heartbeat: deadline for idle, then for ESTOP


def idle(node: int) -> Outgoing:
    """Return the frame that requests idle."""
    return encode(node, _STATE, {"Axis_Requested_State": IDLE})


class PowerOff:
    """Progress of removing the power; ``left`` is empty until the end, ``confirmed`` whether the module was seen to be idle."""

    def __init__(self, pulse: HeartbeatMonitor) -> None:
        self.left = ""
        self.confirmed = False
        self._pulse = pulse
        self._estop = False
        self._start: float | None = None  # of the step
        self._last = 0.0  # time of the last frame

    @property
    def over(self) -> bool:
        """Whether it has ended."""
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
            self._end(f"module {self._pulse.node} is idle by its heartbeat, after {after}", confirmed=True)
        elif now - self._start > RUNG + 2.0 * self._pulse.period:
            self._late(now)
        elif not now - self._last < _AGAIN - 1e-9:
            self._last = now
            return encode(self._pulse.node, _ESTOP) if self._estop else idle(self._pulse.node)
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
