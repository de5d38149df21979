"""Check that the frames of one cycle fit into its period at the bus's bit rate; the finding shows the calculation."""

from __future__ import annotations

from axisbus.cell.can_simple.module import READERS
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.check.cycle_schedule import ERROR_LOAD, WARNING_LOAD, CycleSlot, Timetable, shortest, timetable
from axisbus.errors import ArgumentError, LimitError
from axisbus.motion.moves.interpolation import interpolation_period

_LATE = 0.001  # seconds; whether a shorter period is kept depends on the computer
_NO_WIRE = frozenset({"sim", "virtual", "udp_multicast"})
_KINDS = {"heartbeat": "heartbeats", "answer": "answers of CAN Simple", "target": "targets of CAN Simple"}


def bus_load(case: CheckContext) -> Problems:
    """Calculate the worst-case bus load of one cycle."""
    bus = case.cell.bus
    if not bus.at.sound("bitrate", "scan_period", "sync", "heartbeat", "interface") or not case.eds:
        return
    if bus.bitrate is None:
        if bus.interface not in _NO_WIRE:
            yield case.note(
                bus.at.line,
                "the bus load cannot be computed: the bitrate is not known",
                remedy="write bitrate = 1_000_000 (the bus's own) in [bus]; if the link sets a bitrate, the two are then "
                "compared",
            )
        return
    if not _modules_sound(case):
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
    least, calm = (shortest(case.cell, case.eds, bitrate, load) for load in (ERROR_LOAD, WARNING_LOAD))
    if least is None or calm is None:
        return ""
    return (
        f'scan_period = "{calm * 1000:g}ms" or longer, with which the load is at most {WARNING_LOAD:.0%} (the shortest that '
        f'the bus can carry is "{least * 1000:g}ms": axisbus plan), '
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


def _modules_sound(case: CheckContext) -> bool:
    """Whether the frames of the cell's CAN Simple modules are known; another check reports errors in their tables."""
    return all(node.module.at.sound(*READERS) for node in case.cell.nodes.values() if node.module is not None)


# -- the period itself -----------------------------------------------------------------------------------------------


def short_period(case: CheckContext) -> Problems:
    """Warn of a period that an ordinary computer does not keep."""
    bus = case.cell.bus
    if bus.at.sound("scan_period") and bus.scan_period < _LATE:
        yield case.warning(
            bus.at.of("scan_period"),
            f"a scan_period of {bus.scan_period * 1000:g} ms is shorter than an ordinary computer can keep",
            "late cycles are skipped and counted; the axes are late by as much, and never jump",
            'scan_period = "2ms" or longer, unless the drives need it and the lateness was measured',
        )


def interpolation(case: CheckContext) -> Problems:
    """Warn of a period that 60C2h cannot hold, if the cell uses cyclic modes."""
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
