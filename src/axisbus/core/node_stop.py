"""Stop one node without the scan: a lasting quick stop by SDO, even if another master is on the bus.

Theory of operation
-------------------
The quick stop is sent to every axis of the node before any waiting: an axis that does not answer delays no other. It is also sent
to a drive that reports power off, which ignores it. Then each axis is checked until it is seen stopped:

1. Another master may be alive and send *enable operation* by PDO in every cycle, which ends a quick stop at once (transition 16).
   If a drive is enabled again, its node is set to pre-operational, where PDOs have no effect, and the quick stop is sent once more.
2. A drive that has not stopped within its ``quick_stop_time`` gets *disable voltage*, unless this lets a load fall.
3. If an axis of the node is not seen stopped in the end, the node gets NMT stop, with the same exception. This may stop its drives,
   but it cannot be verified, because a stopped node answers no SDO. The result remains *not confirmed*.

A drive that is off, or held, counts as stopped when its position does not change and nothing pulls. If each request gets two
answers, two devices have the node-ID, and the answers may come from the one that does not move: then nothing is confirmed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress

from axisbus.bus.cycle import send_bounded
from axisbus.bus.node import nmt
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.cell.axis_description import of_make
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.parameters import highest_speed, standstill_speed, stop_times
from axisbus.cell.quantities import units_of
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import own_index
from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.state import ENERGISED, PowerState, decode
from axisbus.clock import Clock
from axisbus.errors import AdapterError, BusError, BusOff, SdoAbort
from axisbus.link import StopResult
from axisbus.motion.parameters import NOISE, DemandUse, pull_window, standstill_time
from axisbus.motion.stop.settled_value import SettledValue
from axisbus.units import wrap

_STANDSTILL_TIME = 0.1
_MAX_TIME = 5.0
_COASTING_TIME = 3.0  # seconds within which a drive without power must come to rest
_FIRST_TIMEOUT = 0.1  # seconds for the first check, before the stop is sent
_POLL = 0.02
_DOWNLOAD_2_BYTES = 0x2B  # SDO, expedited (CiA 301 7.2.4.3.3)


def stop_nodes(
    clock: Clock, cell: CellConfig, nodes: Iterable[CanopenNode], names: Collection[str]
) -> list[StopResult]:
    """Stop the axes of these names, all nodes at the same time, and return the result of each; blocks as ``NodeStop.run``."""
    nodes = list(nodes)
    axes = [axes_to_stop(cell, node, names) for node in nodes]
    results = in_parallel(clock, lambda node, own: NodeStop(node, own).run(), nodes, axes)
    return [result for node in results for result in node]


def axes_to_stop(cell: CellConfig, node: CanopenNode, names: Collection[str]) -> list[AxisConfig]:
    """Return the axes of a node with these names; with the behaviour of their make, if the node's EDS is known."""
    axes = [axis for axis in cell.axes_of(node.node_id) if axis.name in names]
    return axes if node.eds is None else [of_make(axis, cell.nodes[node.node_id], node.eds) for axis in axes]


class NodeStop:
    """The stop of one node; holds whether its PDOs were disabled, and the last values of each of its axes."""

    def __init__(self, node: CanopenNode, axes: Sequence[AxisConfig]) -> None:
        """``axes``: the axes of the node to be stopped."""
        self._node = node
        self._clock = node.channel.clock
        self._axes = [_AxisStop(axis, self._clock.now()) for axis in axes]
        self._pdos_disabled = False
        self._no_answer = ""  # why the node is unknown, by the last request
        self._channel_failed = False
        self._unrequested_answers: int | None = None  # answers without a request, before the checks began

    def run(self) -> list[StopResult]:
        """Stop the axes; blocks until standstill, at most about 6 s. Failures are in the result, and are not raised."""
        for axis in self._axes:
            axis.found_off = _is_off(self._state(axis, _FIRST_TIMEOUT))
        for axis in self._axes:
            self._send_controlword(axis)
        deadline = self._clock.now() + _MAX_TIME
        while (
            pending := [axis for axis in self._axes if axis.result is None]
        ) and self._clock.now() < deadline:
            self._check_axes(pending)
            if self._channel_failed:
                break  # it brings no more answers
            self._clock.sleep(_POLL)
        if any(axis.result is None for axis in self._axes):
            self._stop_node()
        return [axis.result or self._not_confirmed(axis) for axis in self._axes]

    def _stop_node(self) -> None:
        """Stop the node by NMT, the last resort, unless this lets a load fall."""
        if not any(axis.config.holds_load for axis in self._axes):
            send_bounded(self._node.channel, [(cob.NMT, bytes((NmtCommand.STOP, self._node.node_id)))])

    def _check_axes(self, axes: Sequence[_AxisStop]) -> None:
        for axis in axes:
            axis.result = self._step(axis)
            if self._no_answer:  # the next axes would have to wait as long: send their stop now
                for each in axes:
                    self._send_controlword(each)
                return
        if (
            self._unrequested_answers is None
        ):  # earlier ones are answers to stops that were sent without waiting
            self._unrequested_answers = self._count_unrequested_answers()

    def _step(self, axis: _AxisStop) -> StopResult | None:
        """Check one axis, repeat the stop if needed, and return its result when it is known."""
        now, state = self._clock.now(), self._state(axis)
        if axis.disable_at <= now and state in ENERGISED and axis.word is not PowerCommand.DISABLE_VOLTAGE:
            axis.word = PowerCommand.DISABLE_VOLTAGE
            self._write_controlword(axis)
        elif state is PowerState.OPERATION_ENABLED:
            self._enabled_again(axis)
        position = self._read(axis, o.POSITION_ACTUAL, 4, signed=True)
        at_standstill = axis.standstill.note(position, self._clock.now())
        if self._no_answer:
            return None
        if _is_off(state):
            return self._result_when_off(axis, state, position, at_standstill)
        if state is not PowerState.QUICK_STOP_ACTIVE or not at_standstill:
            return None
        deviates = axis.standstill.deviates(self._read(axis, o.POSITION_DEMAND, 4, signed=True))
        return None if deviates else self._stopped_result(axis, "is at standstill, held in quick stop")

    def _result_when_off(
        self, axis: _AxisStop, state: PowerState, position: int | None, at_standstill: bool
    ) -> StopResult | None:
        """Return the result of an axis with power off. The motor may turn without power until 6064h shows standstill."""
        said = "was not energised" if axis.found_off else "stopped, power is off"
        axis.off_since = axis.off_since or self._clock.now()
        if position is None:
            return self._stopped_result(
                axis, f"{said} ({state.value}); it has no position value, so standstill cannot be observed"
            )
        if at_standstill:
            return self._stopped_result(axis, f"{said} ({state.value})")
        if self._clock.now() - axis.off_since > _COASTING_TIME:
            text = f"its power is off ({state.value}), and it still moves{axis.standstill.text}"
            return StopResult(axis.config.name, False, f"NOT CONFIRMED as stopped: {text}")
        return None

    def _stopped_result(self, axis: _AxisStop, text: str) -> StopResult | None:
        """Return that the axis was seen stopped, unless a second device may have given the answers."""
        if self._unrequested_answers is None:
            return None  # the number of answering devices is not known yet
        if self._count_unrequested_answers() > self._unrequested_answers:
            why = f"each request is answered twice, so two devices have node-ID {self._node.node_id}"
            return StopResult(axis.config.name, False, f"NOT CONFIRMED as stopped: {why}")
        return StopResult(axis.config.name, True, text)

    def _not_confirmed(self, axis: _AxisStop) -> StopResult:
        seen = (
            f"after {_MAX_TIME:g} s (state {axis.state.value}{axis.standstill.text}): use the emergency stop"
        )
        why = self._no_answer or seen
        return StopResult(axis.config.name, False, f"NOT CONFIRMED as stopped: {why}")

    def _count_unrequested_answers(self) -> int:
        """Return the number of answers without a request; late answers do not count."""
        if any(count.retries or count.unanswered for count in self._counts()):
            return 0
        found = self._node.channel.drops.found
        return sum(
            drop.count for drop in found if drop.fault is DropReason.SDO and drop.node == self._node.node_id
        )

    def _counts(self) -> list[SdoCount]:
        counts = self._node.channel.sdo_counts.found
        return [count for count in counts if count.node == self._node.node_id]

    def _enabled_again(self, axis: _AxisStop) -> None:
        """Disable the PDOs and repeat the stop: the drive has not obeyed yet, or another master enables it in every cycle."""
        if not self._pdos_disabled:
            with suppress(BusError):
                nmt.send(self._node.channel, NmtCommand.ENTER_PRE_OPERATIONAL, self._node.node_id)
            self._pdos_disabled = True
        self._write_controlword(axis)

    def _write_controlword(self, axis: _AxisStop) -> None:
        """Write the controlword of the stop; if it is refused or not answered, the next check repeats it."""
        try:
            self._node.sdo.download_urgent(
                self._index(axis, o.CONTROLWORD), 0, axis.word.word.to_bytes(2, "little")
            )
        except BusError as error:
            self._note_error(error)

    def _note_error(self, error: BusError) -> None:
        self._no_answer = error.message
        self._channel_failed = isinstance(error, AdapterError) and not isinstance(error, BusOff)

    def _send_controlword(self, axis: _AxisStop) -> None:
        """Send the controlword of the stop by SDO without waiting for the answer."""
        index = self._index(axis, o.CONTROLWORD).to_bytes(2, "little")
        data = bytes((_DOWNLOAD_2_BYTES,)) + index + b"\0" + axis.word.word.to_bytes(4, "little")
        # In any state of the channel: an adapter that does not receive may still send.
        send_bounded(self._node.channel, [(cob.SDO_RX + self._node.node_id, data)])

    def _state(self, axis: _AxisStop, timeout: float | None = None) -> PowerState:
        word = self._read(axis, o.STATUSWORD, 2, timeout=timeout)
        axis.state = PowerState.UNKNOWN if word is None else decode(word)
        return axis.state

    def _read(
        self, axis: _AxisStop, index: int, size: int, *, signed: bool = False, timeout: float | None = None
    ) -> int | None:
        """Read an integer once; None if the drive has no such object, or does not answer (``_no_answer``)."""
        self._no_answer = ""
        try:
            data = self._node.sdo.upload(self._index(axis, index), 0, timeout=timeout, tries=1)
        except SdoAbort:
            return None
        except BusError as error:
            self._note_error(error)
            return None
        return int.from_bytes(data[:size], "little", signed=signed)

    @staticmethod
    def _index(axis: _AxisStop, index: int) -> int:
        return own_index(index, axis.config.drive_axis)


def _is_off(state: PowerState) -> bool:
    return state not in ENERGISED and state is not PowerState.UNKNOWN


class _AxisStop:
    """The stop of one axis; holds its controlword, the last values, and its ``result``."""

    def __init__(self, config: AxisConfig, now: float) -> None:
        self.config = config
        self.standstill = _StandstillCheck(config)
        self.word = PowerCommand.QUICK_STOP
        may_drop = config.holds_load is None
        self.disable_at = now + stop_times(config).quick_stop if may_drop else float("inf")
        self.found_off = False  # before the stop was sent
        self.off_since: float | None = None
        self.state = PowerState.UNKNOWN
        self.result: StopResult | None = None


class _StandstillCheck:
    """Checks whether positions do not change for a while, and nothing pulls; holds the last position and the speed."""

    def __init__(self, axis: AxisConfig) -> None:
        units = units_of(axis)
        speed, factor = standstill_speed(axis, units) or 0.0, abs(units.position.factor)
        fastest = highest_speed(axis, units)
        settle_time = max(_STANDSTILL_TIME, standstill_time(fastest))
        self._settled = SettledValue(max(0.5 * NOISE, speed * settle_time), settle_time)
        self._deviation_window = pull_window(
            None if axis.standstill_window is None else axis.standstill_window * factor,
            None if axis.position_window is None else axis.position_window * factor,
            fastest,
        )
        self._position = units.position
        self._uses_demand = axis.demand != DemandUse.IGNORE.value
        self._last: tuple[int, float] | None = None
        self._speed = 0.0

    def note(self, position: int | None, now: float) -> bool:
        """Take a position; return whether the axis is at standstill."""
        if position is None:
            return False
        if self._last is not None and now > self._last[1]:
            self._speed = wrap(position - self._last[0]) / (now - self._last[1])
        self._last = position, now
        return self._settled.feed(position, now)

    def deviates(self, demand: int | None) -> bool:
        """Whether the drive's demand position differs from the actual position."""
        if not self._uses_demand or demand is None or self._last is None:
            return False
        return abs(wrap(demand - self._last[0])) > self._deviation_window

    @property
    def text(self) -> str:
        """The last position and speed, as text."""
        if self._last is None:
            return ""
        scale = self._position
        where, speed = scale.to_units(self._last[0]), abs(scale.to_units(self._speed))
        return f", at {where:g} {scale.unit} with about {speed:.3g} {scale.unit}/s"
