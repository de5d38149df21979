"""Stopping one node without the scan: a quick stop by SDO that lasts, beside whoever else is on the bus.

Theory of operation
-------------------
Another master may be alive and go on sending *enable operation* by PDO in every cycle, which ends a quick stop at once (transition
16). So each drive gets its quick stop by SDO; if it is enabled again, its node is sent to pre-operational, where PDOs no longer
reach it, and gets the quick stop once more.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from axisbus.bus import nmt
from axisbus.bus.node import Node
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402 import objects as o
from axisbus.cia402.controlword import Command
from axisbus.cia402.state import ENERGISED, State, decode
from axisbus.errors import BusError, SdoTimeout
from axisbus.machine.access import read_int
from axisbus.machine.cell import AxisConfig
from axisbus.machine.parameters import standstill_speed
from axisbus.machine.parting import Stopped
from axisbus.machine.scales import units_of
from axisbus.machine.writes import own_index

_STANDS_FOR = 0.1
_LONGEST = 5.0
_POLL = 0.02


class NodeStop:
    """One node on its way to a stop; holds whether its PDOs were cut off."""

    def __init__(self, node: Node, axes: Sequence[AxisConfig]) -> None:
        """``axes`` are those of the node to be stopped."""
        self._node = node
        self._axes = axes
        self._cut_off = False

    def run(self) -> list[Stopped]:
        """Stop the axes; blocks until they stand, at most about 5 s each. What fails stands in the result, and is not raised."""
        try:
            return [self._stop(axis) for axis in self._axes]
        except BusError as error:
            return [
                Stopped(axis.name, False, f"NOT CONFIRMED as stopped: {error.message}") for axis in self._axes
            ]

    def _stop(self, axis: AxisConfig) -> Stopped:
        state = self._state(axis)
        if state not in ENERGISED and state is not State.UNKNOWN:
            return Stopped(axis.name, True, f"was not energised ({state.value})")
        self._quick_stop(axis)
        return self._await(axis)

    def _await(self, axis: AxisConfig) -> Stopped:
        deadline = time.monotonic() + _LONGEST
        stands = _Standstill(axis)
        while time.monotonic() < deadline:
            state = self._state(axis)
            if state is State.OPERATION_ENABLED:
                self._enabled_again(axis)
            if state not in ENERGISED and state is not State.UNKNOWN:
                return Stopped(axis.name, True, f"stopped, power is off ({state.value})")
            position = read_int(self._node.sdo, own_index(o.POSITION_ACTUAL, axis.drive_axis))
            if state is State.QUICK_STOP_ACTIVE and stands.note(position, time.monotonic()):
                return Stopped(axis.name, True, "stands, held in quick stop")
            time.sleep(_POLL)
        return Stopped(
            axis.name,
            False,
            f"NOT CONFIRMED as stopped after {_LONGEST:g} s (state {self._state(axis).value}): use the emergency stop",
        )

    def _enabled_again(self, axis: AxisConfig) -> None:
        """Not yet obeyed, or another master enables it in every cycle: keep its PDOs away, and repeat."""
        if not self._cut_off:
            nmt.send(self._node.channel, NmtCommand.ENTER_PRE_OPERATIONAL, self._node.node_id)
            self._cut_off = True
        self._quick_stop(axis)

    def _quick_stop(self, axis: AxisConfig) -> None:
        index = own_index(o.CONTROLWORD, axis.drive_axis)
        self._node.sdo.download_urgent(index, 0, Command.QUICK_STOP.word.to_bytes(2, "little"))

    def _state(self, axis: AxisConfig) -> State:
        try:
            word = read_int(self._node.sdo, own_index(o.STATUSWORD, axis.drive_axis))
        except SdoTimeout:
            return State.UNKNOWN
        return State.UNKNOWN if word is None else decode(word)


class _Standstill:
    """Whether positions stay together for a while; holds the first of them."""

    def __init__(self, axis: AxisConfig) -> None:
        speed = standstill_speed(axis, units_of(axis)) or 0.0
        self._tolerance = max(2.0, speed * _STANDS_FOR)
        self._anchor: tuple[int, float] | None = None

    def note(self, position: int | None, now: float) -> bool:
        if position is None:
            return False
        if self._anchor is None or abs(position - self._anchor[0]) > self._tolerance:
            self._anchor = position, now
        return now - self._anchor[1] >= _STANDS_FOR
