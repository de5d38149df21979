"""Stopping one node without the scan: a quick stop by SDO that lasts, beside whoever else is on the bus.

Theory of operation
-------------------
Another master may be alive and go on sending *enable operation* by PDO in every cycle, which ends a quick stop at once (transition
16). So each drive gets its quick stop by SDO; if it is enabled again, its node is sent to pre-operational, where PDOs no longer
reach it, and gets the quick stop once more. A drive that is off, or held, has stopped when its position says so, and nothing pulls.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Sequence

from axisbus.boot.objects import read_int
from axisbus.bus.node import nmt
from axisbus.bus.node.node import Node
from axisbus.bus.parallel import in_parallel
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.parameters import standstill_speed
from axisbus.cell.scales import units_of
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import own_index
from axisbus.cia402.controlword import Command
from axisbus.cia402.state import ENERGISED, State, decode
from axisbus.errors import BusError, SdoTimeout
from axisbus.link import Stopped
from axisbus.motion.parameters import DemandUse, pull_window
from axisbus.motion.stop.still import Still
from axisbus.units import wrap

_STANDS_FOR = 0.1
_LONGEST = 5.0
_COASTS = 3.0  # seconds that a drive found without power may take to come to rest
_POLL = 0.02


def stop_nodes(cell: CellConfig, nodes: Iterable[Node], names: Collection[str]) -> list[Stopped]:
    """Stop the axes of these names, all nodes at a time, and return how each was left; blocks as ``NodeStop.run``."""
    nodes = list(nodes)
    axes = [[axis for axis in cell.axes_of(node.node_id) if axis.name in names] for node in nodes]
    results = in_parallel(lambda node, own: NodeStop(node, own).run(), nodes, axes)
    return [result for node in results for result in node]


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
        look = _Look(axis)
        state = self._state(axis)
        if _is_off(state):
            return self._await_rest(axis, look, "was not energised", time.monotonic() + _COASTS)
        self._quick_stop(axis)
        return self._await(axis, look)

    def _await(self, axis: AxisConfig, look: _Look) -> Stopped:
        deadline = time.monotonic() + _LONGEST
        while time.monotonic() < deadline:
            state = self._state(axis)
            if state is State.OPERATION_ENABLED:
                self._enabled_again(axis)
            if _is_off(state):
                return self._await_rest(axis, look, "stopped, power is off", deadline)
            stands = look.note(self._read(axis, o.POSITION_ACTUAL), time.monotonic())
            if (
                state is State.QUICK_STOP_ACTIVE
                and stands
                and not look.pulls(self._read(axis, o.POSITION_DEMAND))
            ):
                return Stopped(axis.name, True, "stands, held in quick stop")
            time.sleep(_POLL)
        return Stopped(
            axis.name,
            False,
            f"NOT CONFIRMED as stopped after {_LONGEST:g} s (state {self._state(axis).value}{look.text}): use the emergency stop",
        )

    def _await_rest(self, axis: AxisConfig, look: _Look, said: str, deadline: float) -> Stopped:
        """Off is not yet stopped: the motor may turn on without power, as long as 6064h does not say that it stands."""
        while True:
            state, position = self._state(axis), self._read(axis, o.POSITION_ACTUAL)
            if position is None:
                return Stopped(
                    axis.name,
                    True,
                    f"{said} ({state.value}); it has no position that tells whether it stands",
                )
            if look.note(position, time.monotonic()):
                return Stopped(axis.name, True, f"{said} ({state.value})")
            if time.monotonic() > deadline:
                text = f"NOT CONFIRMED as stopped: its power is off ({state.value}), and it still moves{look.text}"
                return Stopped(axis.name, False, text)
            time.sleep(_POLL)

    def _enabled_again(self, axis: AxisConfig) -> None:
        """Not yet obeyed, or another master enables it in every cycle: keep its PDOs away, and repeat."""
        if not self._cut_off:
            nmt.send(self._node.channel, NmtCommand.ENTER_PRE_OPERATIONAL, self._node.node_id)
            self._cut_off = True
        self._quick_stop(axis)

    def _quick_stop(self, axis: AxisConfig) -> None:
        index = own_index(o.CONTROLWORD, axis.drive_axis)
        self._node.sdo.download_urgent(index, 0, Command.QUICK_STOP.word.to_bytes(2, "little"))

    def _read(self, axis: AxisConfig, index: int) -> int | None:
        return read_int(self._node.sdo, own_index(index, axis.drive_axis))

    def _state(self, axis: AxisConfig) -> State:
        try:
            word = read_int(self._node.sdo, own_index(o.STATUSWORD, axis.drive_axis))
        except SdoTimeout:
            return State.UNKNOWN
        return State.UNKNOWN if word is None else decode(word)


def _is_off(state: State) -> bool:
    return state not in ENERGISED and state is not State.UNKNOWN


class _Look:
    """Whether positions stay together for a while, and nothing pulls; holds the last one and the speed between two of them."""

    def __init__(self, axis: AxisConfig) -> None:
        units = units_of(axis)
        speed, factor = standstill_speed(axis, units) or 0.0, abs(units.position.factor)
        self._still = Still(max(2.0, speed * _STANDS_FOR), _STANDS_FOR)
        fastest = (axis.max_velocity or axis.defaults.velocity or 0.0) * factor
        self._pull = pull_window(
            None if axis.standstill_window is None else axis.standstill_window * factor,
            None if axis.position_window is None else axis.position_window * factor,
            fastest,
        )
        self._position = units.position
        self._uses_demand = axis.demand != DemandUse.IGNORE.value
        self._last: tuple[int, float] | None = None
        self._speed = 0.0

    def note(self, position: int | None, now: float) -> bool:
        """Take a position; return whether the axis does not move."""
        if position is None:
            return False
        if self._last is not None and now > self._last[1]:
            self._speed = wrap(position - self._last[0]) / (now - self._last[1])
        self._last = position, now
        return self._still.feed(position, now)

    def pulls(self, demand: int | None) -> bool:
        """Whether the drive leads the axis to somewhere else than where it is."""
        if not self._uses_demand or demand is None or self._last is None:
            return False
        return abs(wrap(demand - self._last[0])) > self._pull

    @property
    def text(self) -> str:
        """Where it was seen last, and how fast."""
        if self._last is None:
            return ""
        scale = self._position
        where, speed = scale.to_units(self._last[0]), abs(scale.to_units(self._speed))
        return f", at {where:g} {scale.unit} with about {speed:.3g} {scale.unit}/s"
