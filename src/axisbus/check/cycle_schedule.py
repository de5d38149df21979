"""The timetable of a cycle: the latest end of each of its frames, and the shortest period for which the bus is fast enough.

Theory of operation
-------------------
The timetable assumes that all frames after a SYNC are ready at once, and that CAN's arbitration sends them in the order of their
identifiers. A frame then ends after the longest frame that may be on the bus when the cycle begins (SYNC has to wait for it), all
frames with lower identifiers, and itself. Each frame counts with the maximum number of stuff bits. This is the worst case: a
frame that leaves later, because its drive or the computer needs time, finds the bus less busy.

Frames that come with every n-th SYNC, or by a timer, are in the timetable of the cycle in which all of them coincide. The shortest
period fulfils two conditions. First, the frames of *every* cycle end before the next SYNC, with the other frames on average and
one SDO request with its answer. Second, the load stays below the limit of ``check``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from axisbus.cell.model import AxisConfig, CellConfig, NodeConfig
from axisbus.cell.other_protocols import canopen_nodes, keys_of, node_frames
from axisbus.cell.pdo_plan import travelling
from axisbus.cell.pdo_tables import requested_pdos
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import cob
from axisbus.cia301.frame import worst_bits
from axisbus.cia301.pdo import PdoConfiguration
from axisbus.cia402 import objects
from axisbus.cia402.axes import first_axis
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, LimitError
from axisbus.motion.moves.interpolation import interpolation_period

ERROR_LOAD = 0.9  # a cell with more is not opened
WARNING_LOAD = 0.6
LONGEST_FRAME = worst_bits(8)
SDO_TRANSFER = 2 * worst_bits(8)  # a request and its answer
_STEP = 0.0001  # seconds
_LONGEST_PERIOD = 1.0
_ROUNDING = 1e-9
_TIME_BYTES = 6
_TARGETS = frozenset({objects.TARGET_POSITION, objects.TARGET_VELOCITY, objects.TARGET_TORQUE})


@dataclass(frozen=True, slots=True)
class CycleSlot:
    """One frame of a cycle: ``begin`` and ``end`` are its latest times (s after the point of the grid); and its contents.

    ``kind``: SYNC, TPDO, RPDO, request (a remote frame), heartbeat or TIME; ``node`` is None for frames of no node; ``share``: the
    average number of such frames in a cycle, below 1 if the frame does not come in each cycle.
    """

    can_id: int
    kind: str
    node: int | None
    name: str
    carries: tuple[str, ...]
    data_bytes: int
    share: float = 1.0
    begin: float = 0.0
    end: float = 0.0

    @property
    def bits(self) -> int:
        """The length of the frame in bits, with the maximum number of stuff bits."""
        return worst_bits(self.data_bytes, self.can_id > cob.ID_MASK_11)

    @property
    def times(self) -> int:
        """The number of these frames in the fullest cycle."""
        return max(1, math.ceil(self.share - _ROUNDING))

    @property
    def rank(self) -> tuple[int, int]:
        """The arbitration rank, lowest first: the first 11 bits, then 11-bit before 29-bit identifiers, then the 18 others."""
        extended = self.can_id > cob.ID_MASK_11
        return (self.can_id >> 18, 1 + self.can_id) if extended else (self.can_id, 0)


@dataclass(frozen=True, slots=True)
class Timetable:
    """The cycle of a cell at a bit rate (bit/s), with its frames in the order of transmission."""

    bitrate: int
    period: float
    slots: tuple[CycleSlot, ...]

    @property
    def waits(self) -> float:
        """The longest time in seconds that SYNC waits for a frame that is on the bus."""
        return LONGEST_FRAME / self.bitrate

    @property
    def fullest(self) -> float:
        """The end of the last frame in the fullest cycle, in seconds."""
        return max((slot.end for slot in self.slots), default=0.0)

    @property
    def every(self) -> float:
        """The end of the last frame if only the frames of every cycle are sent, in seconds."""
        return (
            LONGEST_FRAME + sum(slot.bits * slot.times for slot in self.slots if slot.share >= 1)
        ) / self.bitrate

    @property
    def load(self) -> float:
        """The worst-case load of the bus on average, from 0 to 1."""
        return self.bits / (self.bitrate * self.period)

    @property
    def left(self) -> float:
        """The time that an average cycle leaves for SDO, EMCY and NMT, in seconds; negative if the cycle does not fit."""
        return self.period - (LONGEST_FRAME + self.bits) / self.bitrate

    @property
    def fits(self) -> bool:
        """Whether the bus is fast enough for this period."""
        return self.holds(ERROR_LOAD)

    def holds(self, load: float) -> bool:
        """Return whether this period has room for an SDO transfer, with a bus load of at most ``load`` (0 to 1)."""
        needed = LONGEST_FRAME + SDO_TRANSFER + self.bits
        return needed <= self.bitrate * self.period + _ROUNDING and self.load <= load + _ROUNDING

    @property
    def bits(self) -> float:
        """The number of bits in an average cycle, with the maximum number of stuff bits."""
        return sum(slot.bits * slot.share for slot in self.slots)


def timetable(cell: CellConfig, files: Mapping[int, Eds], bitrate: int) -> Timetable:
    """Return the timetable of a cell; ``files``: the EDS of each node by its ID."""
    frames = sorted(_frames(cell, files), key=lambda slot: slot.rank)
    scheduled, time = [], LONGEST_FRAME / bitrate
    for slot in frames:
        end = time + slot.bits * slot.times / bitrate
        scheduled.append(replace(slot, begin=time, end=end))
        time = end
    return Timetable(bitrate, cell.bus.scan_period, tuple(scheduled))


def shortest(
    cell: CellConfig, files: Mapping[int, Eds], bitrate: int, load: float = ERROR_LOAD
) -> float | None:
    """Return the shortest scan period for which the bus is fast enough, in tenths of a millisecond; None if even 1 s is too short.

    ``load``: the highest allowed bus load, from 0 to 1.

    The timetable is calculated for each tried period, because the planner may send PDOs less often at another period.
    """
    if not timetable(_with_period(cell, _LONGEST_PERIOD), files, bitrate).holds(load):
        return None
    low, high = 0, round(_LONGEST_PERIOD / _STEP)  # low does not fit, high does
    while high - low > 1:
        middle = (low + high) // 2
        if timetable(_with_period(cell, middle * _STEP), files, bitrate).holds(load):
            high = middle
        else:
            low = middle
    return round(high * _STEP, 4)


def _with_period(cell: CellConfig, period: float) -> CellConfig:
    return replace(cell, bus=replace(cell.bus, scan_period=period))


# -- the frames of a cell ---------------------------------------------------------------------------------------------------


def _frames(cell: CellConfig, files: Mapping[int, Eds]) -> Iterator[CycleSlot]:
    bus = cell.bus
    if bus.sync:
        yield CycleSlot(bus.sync_cob_id, "SYNC", None, "SYNC", (), 1 if bus.sync_counter else 0)
    if bus.time is not None:
        share = bus.scan_period / bus.time
        yield CycleSlot(bus.time_cob_id, "TIME", None, "TIME", (), _TIME_BYTES, share)
    for node, eds, dictionary in CheckContext(cell, files).nodes:
        for receive, pdo in travelling(cell, node, eds, dictionary):
            yield from _of_pdo(cell, node, dictionary, receive, pdo)
    if bus.heartbeat is not None:
        share = bus.scan_period / bus.heartbeat
        for node_id in (*canopen_nodes(cell), bus.master_id):
            yield CycleSlot(cob.HEARTBEAT + node_id, "heartbeat", node_id, "heartbeat", (), 1, share)
    for each in node_frames(cell):
        share = each.rate * bus.scan_period
        yield CycleSlot(each.can_id, each.kind, each.node, each.name, (), each.data_bytes, share)


def _of_pdo(
    cell: CellConfig, node: NodeConfig, dictionary: Dictionary, receive: bool, pdo: PdoConfiguration
) -> Iterator[CycleSlot]:
    kind = "RPDO" if receive else "TPDO"
    name, share = f"{kind}{pdo.number}", per_cycle(pdo, receive, cell, node.node_id)
    request_interval = None if receive else requested_pdos(node.pdos).get(pdo.number)
    if request_interval is not None:
        share = cell.bus.scan_period / request_interval
        yield CycleSlot(pdo.cob_id, "request", node.node_id, name, (), 0, share)
    if share:
        yield CycleSlot(pdo.cob_id, kind, node.node_id, name, _signal_names(pdo, dictionary), pdo.size, share)


def _signal_names(pdo: PdoConfiguration, dictionary: Dictionary) -> tuple[str, ...]:
    """Return the names of the objects in a PDO."""
    entries = (dictionary.entry(mapped.index, mapped.subindex) for mapped in pdo.mapping)
    return tuple(entry.name or f"{entry.index:04X}h:{entry.subindex:02X}" for entry in entries)


def per_cycle(pdo: PdoConfiguration, receive: bool, cell: CellConfig, node_id: int) -> float:
    """Return how often a PDO of a node is sent per cycle at worst: an event-driven TPDO once, or less with an inhibit time.

    The master sends an event-driven RPDO when its values change, which may be in each cycle. An RPDO that holds only targets of
    unused modes counts as 0: it is sent once at a stop.
    """
    bus = cell.bus
    if receive and not _serves(pdo, cell, node_id):
        return 0.0
    if pdo.synchronous and pdo.transmission_type > 0 and not receive:
        return 1 / pdo.transmission_type
    if not receive and pdo.inhibit_time:
        return min(1.0, bus.scan_period / (pdo.inhibit_time * 1e-4))
    return 1.0


def _serves(pdo: PdoConfiguration, cell: CellConfig, node_id: int) -> bool:
    """Whether an RPDO holds more than targets of modes that none of the node's axes uses."""
    mapped_objects = {first_axis(mapped.index) for mapped in pdo.mapping if not mapped.is_dummy}
    if not mapped_objects <= _TARGETS:
        return True
    used = (mode for axis in cell.axes_of(node_id) for mode in _modes_of(axis))
    return any(mapped_objects.intersection(FACTS[mode].required) for mode in used)


def _modes_of(axis: AxisConfig) -> Iterator[ModeOfOperation]:
    return (mode for mode, facts in FACTS.items() if axis.modes is None or facts.short in axis.modes)


# -- Check that the frames of one cycle fit into its period at the bus's bit rate; the finding shows the calculation ----


_SHORT_PERIOD = 0.001  # seconds; whether a shorter period is kept depends on the computer
_WITHOUT_WIRE = frozenset({"sim", "virtual", "udp_multicast"})
_KINDS = {"heartbeat": "heartbeats", "answer": "answers of CAN Simple", "target": "targets of CAN Simple"}


def bus_load(case: CheckContext) -> Problems:
    """Calculate the worst-case bus load of one cycle."""
    bus = case.cell.bus
    if not bus.at.sound("bitrate", "scan_period", "sync", "heartbeat", "interface") or not case.eds:
        return
    if bus.bitrate is None:
        if bus.interface not in _WITHOUT_WIRE:
            yield case.note(
                bus.at.line,
                "the bus load cannot be computed: the bitrate is not known",
                remedy="write bitrate = 1_000_000 (the bus's own) in [bus]; if the link sets a bitrate, the two are then "
                "compared",
            )
        return
    if not _modules_are_valid(case):
        return
    try:
        table = timetable(case.cell, case.eds, bus.bitrate)
    except (ArgumentError, LimitError):
        return  # an error of a module; another check reports it
    message = f"the bus load is {table.load:.0%} at worst"
    bits, room = table.bits, bus.bitrate * bus.scan_period
    observed = (
        f"in {bus.scan_period * 1000:g} ms: {_arithmetic(table)} = {bits:.0f} bits, "
        f"of {bus.bitrate / 1000:g} kbit/s x {bus.scan_period * 1000:g} ms = {room:.0f} bits"
    )
    line = bus.at.of("scan_period")
    if table.load > WARNING_LOAD:
        report = case.error if table.load > ERROR_LOAD else case.warning
        yield report(line, message, observed, f"{_periods(case, bus.bitrate)}a higher bitrate, or fewer PDOs")
    else:
        yield case.note(line, message, observed)


def _periods(case: CheckContext, bitrate: int) -> str:
    """Return the shortest period from ``axisbus plan``, and the shortest period without a warning, as text."""
    shortest_period, shortest_without_warning = (
        shortest(case.cell, case.eds, bitrate, load) for load in (ERROR_LOAD, WARNING_LOAD)
    )
    if shortest_period is None or shortest_without_warning is None:
        return ""
    return (
        f'scan_period = "{shortest_without_warning * 1000:g}ms" or longer, with which the load is at most {WARNING_LOAD:.0%} (the '
        f'shortest that the bus can carry is "{shortest_period * 1000:g}ms": axisbus plan), '
    )


def _arithmetic(table: Timetable) -> str:
    """Return the frames of a cycle by kind and length: their number on average, and the worst-case bits of each."""
    frames: dict[tuple[str, int], float] = {}
    for slot in table.slots:
        key = (_kind(slot), slot.bits)
        frames[key] = frames.get(key, 0.0) + slot.share
    return " + ".join(f"{count:.3g} {kind} x {bits}" for (kind, bits), count in frames.items())


def _kind(slot: CycleSlot) -> str:
    if slot.kind == "request":
        return "requests of CAN Simple" if slot.data_bytes else "remote frame"
    return _KINDS.get(slot.kind, slot.kind)


def _modules_are_valid(case: CheckContext) -> bool:
    """Whether the frames of the cell's CAN Simple modules are known; another check reports errors in their tables."""
    return all(
        node.module.at.sound(*keys_of(node.module.protocol))
        for node in case.cell.nodes.values()
        if node.module is not None
    )


# -- the period itself -----------------------------------------------------------------------------------------------


def short_period(case: CheckContext) -> Problems:
    """Warn of a period that an ordinary computer does not keep."""
    bus = case.cell.bus
    if bus.at.sound("scan_period") and bus.scan_period < _SHORT_PERIOD:
        yield case.warning(
            bus.at.of("scan_period"),
            f"a scan_period of {bus.scan_period * 1000:g} ms is shorter than an ordinary computer can keep",
            "late cycles are skipped and counted; the axes are late by as much, and never jump",
            'scan_period = "2ms" or longer, unless the drives need it and the lateness was measured',
        )


def interpolation(case: CheckContext) -> Problems:
    """Warn of a period that 60C2h cannot hold, if the cell uses cyclic modes."""
    bus = case.cell.bus
    requested = [
        drive.axis.name
        for drive in case.drives
        if any(case.cell.groups_of(drive.axis.name))
        or {"csp", "csv", "cst", "ip"} & set(drive.axis.modes or ())
    ]
    if not requested or not bus.at.sound("scan_period", "sync") or not bus.sync:
        return
    try:
        interpolation_period(bus.scan_period)
    except LimitError as error:
        yield case.warning(
            bus.at.of("scan_period"),
            f"cyclic modes will be refused on {', '.join(requested)}: {error.message}",
            error.observed,
            f'the nearest that fits: scan_period = "{nearest_period(bus.scan_period) * 1000:g}ms"',
        )


def nearest_period(period: float) -> float:
    """Return the time nearest to ``period`` (seconds) that 60C2h can hold: 1 to 255 times a power of ten."""
    candidates = (
        min(255, max(1, round(period * 10.0**-exponent))) * 10.0**exponent for exponent in range(0, -7, -1)
    )
    return min(candidates, key=lambda candidate: abs(candidate - period))


CHECKS: tuple[Check, ...] = (bus_load, short_period, interpolation)
