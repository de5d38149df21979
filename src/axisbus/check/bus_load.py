"""Whether the frames of one cycle fit its period at the bus's rate, with the arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

from axisbus.cell import pdo_tables
from axisbus.cell.can_simple.module import READERS
from axisbus.cell.can_simple.modules import canopen_nodes
from axisbus.cell.can_simple.traffic import module_frames
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.pdo_plan import travelling
from axisbus.check.case import Case, Check, Found
from axisbus.cia301.frame import worst_bits
from axisbus.cia301.pdo import Pdo
from axisbus.cia402 import objects
from axisbus.cia402.axes import first_axis
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.errors import ArgumentError, LimitError
from axisbus.motion.moves.interpolation import interpolation_period

ERROR_LOAD = 0.9
WARNING_LOAD = 0.6
_TRIES = 20  # periods, each a little longer
_LATE = 0.001  # seconds; a shorter period depends on the computer
_NO_WIRE = frozenset({"sim", "virtual", "udp_multicast"})
_HEARTBEAT_BYTES = 1
_TIME_BYTES = 6

_TARGETS = frozenset({objects.TARGET_POSITION, objects.TARGET_VELOCITY, objects.TARGET_TORQUE})


class Traffic(NamedTuple):
    """Frames of one kind: how many in one cycle on average, and how long each is at worst."""

    what: str
    frames: float
    bits: int

    @property
    def total(self) -> float:
        return self.frames * self.bits

    def __str__(self) -> str:
        return f"{self.frames:.3g} {self.what} x {self.bits}"


def bus_load(case: Case) -> Found:
    """Work out how much of the bus one cycle takes at worst."""
    bus = case.cell.bus
    if not bus.at.sound("bitrate", "scan_period", "sync", "heartbeat", "interface") or not case.eds:
        return
    if bus.bitrate is None:
        if bus.interface not in _NO_WIRE:
            yield case.note(
                bus.at.line,
                "the bus load cannot be worked out: the bitrate is not known",
                remedy="write bitrate = 1_000_000 (the bus's own) in [bus]; where the link sets it, it is then compared",
            )
        return
    traffic = [each for each in _traffic(case, case.cell) if each.frames]
    bits = sum(each.total for each in traffic)
    room = bus.bitrate * bus.scan_period
    load = bits / room
    message = f"the bus load is {load:.0%} at worst"
    observed = (
        f"in {bus.scan_period * 1000:g} ms: {' + '.join(map(str, traffic))} = {bits:.0f} bits, "
        f"of {bus.bitrate / 1000:g} kbit/s x {bus.scan_period * 1000:g} ms = {room:.0f} bits"
    )
    line = bus.at.of("scan_period")
    if load > WARNING_LOAD:
        fits = _fitting_period(case, bits / bus.bitrate / WARNING_LOAD)
        report = case.error if load > ERROR_LOAD else case.warning
        yield report(
            line,
            message,
            observed,
            f'a scan_period from "{fits * 1000:g}ms" on, a higher bitrate, or fewer PDOs',
        )
    else:
        yield case.note(line, message, observed)


def _fitting_period(case: Case, period: float) -> float:
    """Return a period that fits, at least ``period`` seconds, in tenths of a millisecond: in a longer one more may travel."""
    assert case.cell.bus.bitrate is not None
    for _ in range(_TRIES):
        period = math.ceil(period * 10_000 - 1e-6) / 10_000
        cell = replace(case.cell, bus=replace(case.cell.bus, scan_period=period))
        needed = sum(each.total for each in _traffic(case, cell)) / case.cell.bus.bitrate / WARNING_LOAD
        if needed <= period:
            break
        period = needed
    return period


def _traffic(case: Case, cell: CellConfig) -> Iterator[Traffic]:
    bus = cell.bus
    if bus.sync:
        yield Traffic("SYNC", 1, worst_bits(1 if bus.sync_counter else 0))
    if bus.time is not None:
        yield Traffic("TIME", bus.scan_period / bus.time, worst_bits(_TIME_BYTES))
    frames: dict[tuple[str, int], float] = {}
    for node, eds, dictionary in case.nodes:
        for receive, pdo in travelling(cell, node, eds, dictionary):
            key = ("RPDO" if receive else "TPDO", worst_bits(pdo.size))
            asked_every = None if receive else pdo_tables.requested_pdos(node.pdos).get(pdo.number)
            count = (
                per_cycle(pdo, receive, cell, node.node_id)
                if asked_every is None
                else bus.scan_period / asked_every
            )
            frames[key] = frames.get(key, 0.0) + count
            if asked_every is not None:
                remote = ("remote frame", worst_bits(0))
                frames[remote] = frames.get(remote, 0.0) + count
    for (what, bits), count in sorted(frames.items()):
        yield Traffic(what, count, bits)
    if bus.heartbeat is not None:
        beats = (len(canopen_nodes(cell)) + 1) * bus.scan_period / bus.heartbeat
        yield Traffic("heartbeats", beats, worst_bits(_HEARTBEAT_BYTES))
    yield from _of_modules(cell)


def _of_modules(cell: CellConfig) -> Iterator[Traffic]:
    """Those of modules whose table is sound; what is wrong with another is told for itself."""
    sound = all(node.module.at.sound(*READERS) for node in cell.nodes.values() if node.module is not None)
    sizes: dict[int, float] = {}
    with suppress(ArgumentError, LimitError):
        for each in module_frames(cell) if sound else ():
            sizes[each.data_bytes] = sizes.get(each.data_bytes, 0.0) + each.rate * cell.bus.scan_period
    for size, count in sorted(sizes.items()):
        yield Traffic("frames of CAN Simple" if size else "requests of CAN Simple", count, worst_bits(size))


def per_cycle(pdo: Pdo, receive: bool, cell: CellConfig, node_id: int) -> float:
    """Return how often a PDO of a node travels in one cycle at worst: an event-driven one as its inhibit time lets it, or once.

    The master sends an event-driven RPDO when its values change, which may be in every cycle; one that holds only targets of modes
    that are not in use, once at a stop.
    """
    bus = cell.bus
    if receive and not _serves(pdo, cell, node_id):
        return 0.0
    if pdo.synchronous and pdo.transmission_type > 0 and not receive:
        return 1 / pdo.transmission_type
    if not receive and pdo.inhibit_time:
        return min(1.0, bus.scan_period / (pdo.inhibit_time * 1e-4))
    return 1.0


def _serves(pdo: Pdo, cell: CellConfig, node_id: int) -> bool:
    """Whether an RPDO holds more than targets of modes that none of the node's axes uses."""
    held = {first_axis(mapped.index) for mapped in pdo.mapping if not mapped.is_dummy}
    if not held <= _TARGETS:
        return True
    used = (mode for axis in cell.axes_of(node_id) for mode in _modes_of(axis))
    return any(held.intersection(FACTS[mode].required) for mode in used)


def _modes_of(axis: AxisConfig) -> Iterator[ModeOfOperation]:
    return (mode for mode, facts in FACTS.items() if axis.modes is None or facts.short in axis.modes)


# -- the period itself -----------------------------------------------------------------------------------------------


def short_period(case: Case) -> Found:
    """Warn of a period that no ordinary computer keeps."""
    bus = case.cell.bus
    if bus.at.sound("scan_period") and bus.scan_period < _LATE:
        yield case.warning(
            bus.at.of("scan_period"),
            f"a scan_period of {bus.scan_period * 1000:g} ms is shorter than an ordinary computer keeps",
            "late cycles are skipped and counted; the axes are late by as much, and never jump",
            'scan_period = "2ms" or longer, unless the drives need it and the lateness was measured',
        )


def interpolation(case: Case) -> Found:
    """Warn of a period that 60C2h cannot hold, where cyclic modes are wanted."""
    bus = case.cell.bus
    wanted = [
        drive.axis.name
        for drive in case.drives
        if any(case.cell.groups_of(drive.axis.name))
        or {"csp", "csv", "cst", "ip"} & set(drive.axis.modes or ())
    ]
    if not wanted or not bus.at.sound("scan_period", "sync") or not bus.sync:
        return
    try:
        interpolation_period(bus.scan_period)
    except LimitError as error:
        yield case.warning(
            bus.at.of("scan_period"),
            f"cyclic modes will be refused on {', '.join(wanted)}: {error.message}",
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
