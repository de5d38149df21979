"""One axis of a cell of a fleet, for programs: the library's commands over the network, and values with their age."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Mapping
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING

from axisbus.errors import ArgumentError, StaleError
from axisbus.fleet.messages import AxisStateMessage, Value
from axisbus.machine.handle import Handle
from axisbus.motion.states import AxisState

if TYPE_CHECKING:
    from axisbus.fleet.cell import FleetCell

NO_VALUES: Mapping[str, Value] = MappingProxyType({})
_UNSHOWN = frozenset({"press", "sent"})
_PRESS = 0.15  # seconds without a jog call after which the next call counts as a new press
_STATES = {state.value: state for state in AxisState}


class FleetAxis:
    """An axis of a cell that another computer runs. Commands return a ``Handle`` at once, as those of ``Axis``.

    All commands but ``halt`` and ``quick_stop`` need control of the cell (``FleetCell.command``); without it they raise
    ``OwnershipError``. Values are the last ones that the cell reported, in the axis's unit. If a value is too old or the cell is
    gone, reading it raises ``StaleError``. If the cell rejects a command, for example because of a limit of the axis, its handle
    ends with the error.
    """

    name: str

    def __init__(self, name: str, cell: FleetCell) -> None:
        self.name = name
        self._cell = cell
        self._presses = itertools.count(1)
        self._jog: tuple[float, int, float] = (math.nan, 0, -math.inf)  # velocity, press, when

    def __repr__(self) -> str:
        last = self._cell.last_state(self.name)
        if last is None or not last.fresh:
            return f"<FleetAxis {self._path}: unknown>"
        where = "" if last.state.position is None else f" at {last.state.position:g} {last.state.unit}"
        return f"<FleetAxis {self._path}: {last.state.state}{where}>"

    @property
    def _path(self) -> str:
        return f"{self._cell.name}.{self.name}"

    # -- description and values ----------------------------------------------------------------------------------------

    @property
    def unit(self) -> str:
        """The unit of its positions; empty if nothing has been received from the cell yet."""
        info, last = self._cell.axis_info(self.name), self._cell.last_state(self.name)
        return info.unit if info is not None else last.state.unit if last is not None else ""

    @property
    def limits(self) -> dict[str, float]:
        """The limits that the master enforces, by name, as reported by the cell: ``max_velocity`` and so on."""
        info = self._cell.axis_info(self.name)
        return {} if info is None else dict(info.limits)

    @property
    def age(self) -> float | None:
        """Seconds since the state of the axis was made, by the cell's clock and then by the local clock; None if it is unknown."""
        last = self._cell.last_state(self.name)
        return None if last is None else last.age

    @property
    def state(self) -> AxisState:
        """The PLCopen state.

        Raises:
            StaleError: the state is unknown now.
        """
        message = self._fresh_state("state")
        if message.state not in _STATES:
            raise self._stale(
                "state", f"the cell reports the state {message.state!r}, which this version does not know"
            )
        return _STATES[message.state]

    @property
    def error(self) -> str:
        """The message of the axis's error; empty if there is none. Raises StaleError if it is unknown now."""
        return self._fresh_state("error").error or ""

    @property
    def homed(self) -> bool:
        """Whether the position is confirmed by homing; raises StaleError if that is unknown now."""
        homed = self._fresh_state("homed").homed
        if homed is None:
            raise self._stale("homed", "unknown to the cell")
        return homed

    @property
    def position(self) -> float:
        """Actual position in the axis's unit; raises StaleError if it is unknown now."""
        return self._value("position")

    @property
    def velocity(self) -> float:
        """Actual velocity in unit/s; raises StaleError if it is unknown now."""
        return self._value("velocity")

    @property
    def torque(self) -> float:
        """Actual torque in N·m, or as a fraction of the rated torque; raises StaleError if it is unknown now."""
        return self._value("torque")

    @property
    def following_error(self) -> float:
        """Following error in the axis's unit; raises StaleError if it is unknown now."""
        return self._value("following_error")

    def _value(self, what: str) -> float:
        value: float | None = getattr(self._fresh_state(what), what)
        if value is None:
            raise self._stale(what, "unknown to the cell: never received there, or too old")
        return value

    def _fresh_state(self, what: str) -> AxisStateMessage:
        last = self._cell.last_state(self.name)
        if last is None:
            raise self._stale(what, self._cell.offline_reason or "nothing was received from it")
        if not last.fresh:
            old = "of nothing known" if last.age is None else f"{last.age:.1f} s old"
            raise self._stale(what, self._cell.offline_reason or f"the last received state is {old}")
        return last.state

    def _stale(self, what: str, observed: str) -> StaleError:
        return StaleError(
            f"{self._path}: its {what} is unknown",
            axis=self.name,
            observed=observed,
            remedy="check that the cell and its bridge run, and that this program reaches them (axisbus fleet list)",
        )

    # -- power and stopping --------------------------------------------------------------------------------------------

    def halt(self) -> Handle:
        """Brake to Standstill, whichever client has control (MC_Halt)."""
        return self._cell.stop_axes("halt", (self.name,))

    def quick_stop(self) -> Handle:
        """Make the drive do its quick stop, whichever client has control; afterwards the axis is Disabled, or held in Stopping."""
        return self._cell.stop_axes("quick_stop", (self.name,))

    def enable(self, *, allow_moving: bool = False) -> Handle:
        """Switch the power stage on (MC_Power); ``allow_moving`` also enables an axis that moves without power."""
        return self._send("enable", allow_moving=allow_moving or None)

    def disable(self, *, coast: bool = False) -> Handle:
        """Halt, then switch the power stage off; ``coast`` cuts the power at once."""
        return self._send("disable", coast=coast or None)

    def reset(self) -> Handle:
        """Reset a fault or ErrorStop (MC_Reset); never enables."""
        return self._send("reset")

    def stop(self) -> Handle:
        """Brake to a stop and lock the axis in Stopping (MC_Stop) until ``release()``."""
        return self._send("stop")

    def release(self) -> Handle:
        """End the lock of ``stop()``, once the axis is at standstill."""
        return self._send("release")

    # -- motion --------------------------------------------------------------------------------------------------------

    def home(self, method: int | None = None, *, timeout: float | None = None) -> Handle:
        """Home the axis (MC_Home) by ``method`` of 6098h, by default that of its cell file; ``timeout`` in seconds."""
        return self._send("home", method=method, timeout=timeout)

    def set_position(self, position: float) -> Handle:
        """Define the actual position as ``position`` from now on (MC_SetPosition)."""
        return self._send("set_position", {"position": position})

    def set_override(self, factor: float) -> Handle:
        """Scale the velocity of its commands by this factor from now on: 0 (it holds) to 1.5."""
        return self._send("set_override", {"factor": factor})

    def move_absolute(
        self,
        position: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        direction: int = 0,
        jerk: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move to ``position`` (MC_MoveAbsolute); the parameters are those of ``Axis.move_absolute``.

        Raises:
            ArgumentError: a value is not a finite number.
            OwnershipError: this program does not have control of the cell.
        """
        return self._send(
            "move_absolute",
            {"position": position},
            velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            direction=direction or None,
            jerk=jerk,
            timeout=timeout,
        )

    def move_relative(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move by ``distance`` from the actual position at the start (MC_MoveRelative); raises as ``move_absolute``."""
        return self._send(
            "move_relative",
            {"distance": distance},
            velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            timeout=timeout,
        )

    def move_additive(
        self,
        distance: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move by ``distance`` from the last commanded position (MC_MoveAdditive); raises as ``move_absolute``."""
        return self._send(
            "move_additive",
            {"distance": distance},
            velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            timeout=timeout,
        )

    def move_velocity(
        self,
        velocity: float,
        *,
        acceleration: float | None = None,
        deceleration: float | None = None,
        jerk: float | None = None,
        timeout: float | None = None,
    ) -> Handle:
        """Move at ``velocity`` (signed, unit/s) until another command takes over (MC_MoveVelocity); raises as ``move_absolute``."""
        return self._send(
            "move_velocity",
            {"velocity": velocity},
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            timeout=timeout,
        )

    def torque_control(
        self, torque: float, *, slope: float | None = None, timeout: float | None = None
    ) -> Handle:
        """Apply ``torque`` (signed, N·m) with ``slope`` (N·m/s) (MC_TorqueControl); raises as ``move_absolute``."""
        return self._send("torque_control", {"torque": torque}, slope=slope, timeout=timeout)

    def jog(self, velocity: float, *, acceleration: float | None = None) -> Handle:
        """Move at ``velocity`` for 200 ms; to continue, call it again with the same values, at least ten times a second.

        The handle ends when the cell has accepted the call. A late jog request is ignored: the button may have been released.
        """
        now = time.monotonic()
        before, press, at = self._jog
        if velocity != before or now - at > _PRESS:
            press = next(self._presses)
        self._jog = velocity, press, now
        return self._send(
            "jog", {"velocity": velocity, "press": press, "sent": now}, acceleration=acceleration
        )

    def _send(self, verb: str, needs: Mapping[str, Value] = NO_VALUES, **optional: Value) -> Handle:
        """Send a command with its required values ``needs``, and with those optional values ``optional`` that are given."""
        given = {**needs, **{name: value for name, value in optional.items() if value is not None}}
        shown = ", ".join(f"{name}={value}" for name, value in given.items() if name not in _UNSHOWN)
        name = f"{self._path}.{verb}({shown})"
        return self._cell._send_command(
            verb, (self.name,), {each: _number(name, each, given[each]) for each in given}, name
        )


def _number(call: str, name: str, value: Value) -> Value:
    """Return a value for a message; convert other kinds of numbers, such as numpy's, to Python's."""
    if isinstance(value, bool):
        return value
    if not isinstance(value, Real) or not math.isfinite(value):
        raise ArgumentError(
            f"{call}: {name} is not a number that can be sent: {value!r}", remedy="give a finite number"
        )
    return int(value) if isinstance(value, int) else float(value)
