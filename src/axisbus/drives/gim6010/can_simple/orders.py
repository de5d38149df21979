"""The frames that command a module; only ``closed_loop`` switches on the power, and none calibrates."""

from __future__ import annotations

from axisbus.drives.gim6010.can_simple.codec import Outgoing, encode
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, named

# Control mode and input mode (manual v2.2, 4.1.2). Direct control (1) is not among them: real modules ran away in it when
# set-points paused, and the loss of the master is a pause.
TRAPEZOID, FILTER = (3, 5), (3, 3)
VELOCITY, TORQUE, MIT = (2, 2), (1, 6), (3, 9)


class Orders:
    """Makes the frames of one module; turns, turns/s and N·m are at the rotor."""

    def __init__(self, node: int) -> None:
        """``node``: 0 to 63."""
        self._node = node

    def closed_loop(self) -> Outgoing:
        return self._frame("Set_Axis_State", CLOSED_LOOP)

    def idle(self) -> Outgoing:
        """Remove the power: the motor coasts."""
        return self._frame("Set_Axis_State", IDLE)

    def estop(self) -> Outgoing:
        """Remove the power, with a latched error."""
        return self._frame("Estop")

    def clear(self) -> Outgoing:
        return self._frame("Clear_Errors")

    def limits(self, velocity: float, current: float) -> Outgoing:
        """Limit velocity (turns/s) and current (A, 50 at most); raises LimitError as ``encode``."""
        return self._frame("Set_Limits", velocity, current)

    def mode(self, modes: tuple[int, int]) -> Outgoing:
        return self._frame("Set_Controller_Mode", *modes)

    def profile(self, speed: float, up: float, down: float) -> list[Outgoing]:
        """Set velocity, acceleration and deceleration of trapezoidal trajectories."""
        return [self._frame("Set_Traj_Vel_Limit", speed), self._frame("Set_Traj_Accel_Limits", up, down)]

    def position(self, turns: float) -> Outgoing:
        """Send a target position; feed-forward is 0, so that the module holds this position if no other follows."""
        return self._frame("Set_Input_Pos", turns, 0.0, 0.0)

    def velocity(self, velocity: float) -> Outgoing:
        return self._frame("Set_Input_Vel", velocity, 0.0)

    def torque(self, torque: float) -> Outgoing:
        return self._frame("Set_Input_Torque", torque)

    def brake(self) -> list[Outgoing]:
        """Brake to standstill on the module's own ramp, from any motion; no effect in idle."""
        return [self.mode(VELOCITY), self.velocity(0.0)]

    def _frame(self, name: str, *values: Number) -> Outgoing:
        message = named(name)
        given = dict(zip((each.name for each in message.sent), values, strict=True))
        return encode(self._node, message, given)
