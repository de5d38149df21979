"""Check the stop reactions of each axis: whether they stop the axis and hold its load."""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cell.axis_description import Drive
from axisbus.cell.model import NodeConfig
from axisbus.cell.quantities import units_of
from axisbus.check.context import Check, CheckContext, Problems, own_title
from axisbus.cia301 import objects as cia301
from axisbus.cia402 import objects, options
from axisbus.cia402.options import OptionCode, Ramp
from axisbus.eds.model import Eds
from axisbus.motion.parameters import StopTimes

# Reactions that matter while the axis moves, the values with which it coasts, and the better setting.
_REACTIONS: tuple[tuple[OptionCode, frozenset[int], str], ...] = (
    (options.HALT, frozenset({0}), "slow-ramp"),
    (options.QUICK_STOP, frozenset({0}), "ramp"),
    (options.DISABLE, frozenset({0}), "slow-ramp"),
    (options.FAULT, frozenset({0}), "ramp"),
    (options.CONNECTION_LOSS, frozenset({0, 2}), "quick-stop"),
)
# ``watchdog`` reports a drive without 6007h.
_SETTABLE = (options.HALT, options.QUICK_STOP, options.DISABLE, options.FAULT)
# Values that brake on the quick-stop ramp, 6085h.
_QUICK_STOPS_ON_IT = frozenset({2, 6})
_ON_QUICK_RAMP: tuple[tuple[OptionCode, frozenset[int]], ...] = (
    (options.QUICK_STOP, _QUICK_STOPS_ON_IT),
    (options.HALT, frozenset({2})),
    (options.FAULT, frozenset({2})),
)


def coasting(case: CheckContext) -> Problems:
    """Report each reaction that does not brake: an error if the axis holds a load, else a warning."""
    for drive in case.drives:
        for option, values, preferred in _REACTIONS:
            value = drive.number(option.index, option.subindex)
            if value not in values:
                continue
            write = drive.write(option.index, option.subindex)
            holds = drive.axis.holds_load is not None
            report = case.error if holds else case.warning
            source = f"by {write.source}" if write else f"by default in {drive.eds.source}"
            yield report(
                write.line if write else drive.axis.stop.at.line,
                f"axis {drive.axis.name}: {option.title}: {option.meaning(value)}"
                + (", and the axis holds a load" if holds else ""),
                f"{own_title(drive, option.index)} is {value} {source}",
                f'{option.key} = "{preferred}{_holding_note(drive, option)}" in [axes.{drive.axis.name}.stop]',
            )


def _holding_note(drive: Drive, option: OptionCode) -> str:
    return "-hold" if option is options.QUICK_STOP and drive.axis.holds_load == "torque" else ""


def not_there(case: CheckContext) -> Problems:
    """Report reactions whose object is missing, or has no default in the EDS: only the manual or the drive has the answer."""
    for drive in case.drives:
        absent = [option for option in _SETTABLE if not drive.has(option.index)]
        unknown = [
            option
            for option, _, _ in _REACTIONS
            if drive.has(option.index) and drive.value(option.index, option.subindex) is None
        ]
        line = drive.axis.stop.at.line
        if absent:
            yield case.note(
                line,
                f"axis {drive.axis.name}: the reaction of the drive to {_named(absent)} cannot be set",
                f"{drive.eds.source} lacks {', '.join(own_title(drive, option.index) for option in absent)}",
                "see the drive's manual, and try it at low speed",
            )
        if unknown:
            yield case.note(
                line,
                f"axis {drive.axis.name}: the reaction of the drive to {_named(unknown)} is not known before boot",
                f"{drive.eds.source} gives {', '.join(own_title(drive, option.index) for option in unknown)} no default",
                f"set it in [axes.{drive.axis.name}.stop], or read it by axisbus boot",
            )


def _named(found: list[OptionCode]) -> str:
    return ", ".join(option.title for option in found)


def ramp_of_quick_stop(case: CheckContext) -> Problems:
    """Warn of a quick-stop ramp that is used but has no slope (6085h is 0)."""
    for drive in case.drives:
        users = [option for option, values in _ON_QUICK_RAMP if drive.number(option.index) in values]
        if not users or not drive.has(objects.QUICK_STOP_DECELERATION):
            continue
        if drive.value(objects.QUICK_STOP_DECELERATION) == 0:
            write = drive.write(users[0].index) or drive.write(objects.QUICK_STOP_DECELERATION)
            yield case.warning(
                write.line if write else drive.axis.stop.at.line,
                f"axis {drive.axis.name}: {_named(users)}: the quick-stop ramp has a deceleration of 0",
                f"{own_title(drive, objects.QUICK_STOP_DECELERATION)} is 0 after boot: it may never stop, or stop with a jolt",
                f"deceleration = ... ({drive.axis.unit}/s²) in [axes.{drive.axis.name}.stop]",
            )


def weak_quick_stop(case: CheckContext) -> Problems:
    """Warn of a quick stop with a deceleration below the default: near a position limit it overruns the limit."""
    for drive in case.drives:
        axis, slow = drive.axis, drive.axis.defaults.deceleration
        on_ramp = drive.number(options.QUICK_STOP.index) in _QUICK_STOPS_ON_IT
        quick = axis.stop.deceleration
        if axis.position_limits is None or not on_ramp or slow is None or quick is None or quick >= slow:
            continue
        yield case.warning(
            axis.stop.at.of("deceleration"),
            f"axis {axis.name}: a quick stop decelerates less than the default, and may end beyond its position limits",
            f"with {quick:g} {axis.unit}/s²; the default deceleration is {slow:g} {axis.unit}/s²",
            f"deceleration = {slow:g} or more in [axes.{axis.name}.stop]",
        )


def unused_ramp(case: CheckContext) -> Problems:
    """Warn of a quick-stop deceleration that no reaction uses."""
    for drive in case.drives:
        stop = drive.axis.stop
        known = [drive.number(option.index) for option, _ in _ON_QUICK_RAMP]
        used = any(drive.number(option.index) in values for option, values in _ON_QUICK_RAMP)
        if stop.deceleration is not None and not used and None not in known:
            yield case.warning(
                stop.at.of("deceleration"),
                f"axis {drive.axis.name}: deceleration in [{stop.at.name}] has no effect",
                "neither quick stop, halt nor fault brakes on the quick-stop ramp",
                'write quick_stop = "ramp", or delete deceleration',
            )


def load_held(case: CheckContext) -> Problems:
    """Check that an axis whose motor holds the load stays energised after a quick stop."""
    for drive in case.drives:
        if drive.axis.holds_load != "torque":
            continue
        value = drive.number(options.QUICK_STOP.index)
        if value is not None and value not in options.HOLDING_QUICK_STOPS and value != 0:
            write = drive.write(options.QUICK_STOP.index)
            yield case.error(
                write.line if write else drive.axis.at.of("holds_load"),
                f"axis {drive.axis.name}: after a quick stop nothing holds the load",
                f"{own_title(drive, options.QUICK_STOP.index)} is {value}: {options.QUICK_STOP.meaning(value)}",
                f'quick_stop = "ramp-hold" in [axes.{drive.axis.name}.stop]',
            )
        yield case.note(
            drive.axis.at.of("holds_load"),
            f"axis {drive.axis.name}: after a fault nothing holds the load",
            "a drive in fault does not drive its motor",
            "a load that may fall needs a brake",
        )


# -- times -----------------------------------------------------------------------------------------------------------


class _Deceleration(NamedTuple):
    """A deceleration in units per s² (None: unknown), and what it is called in a message."""

    value: float | None
    name: str


def stop_sequence_times(case: CheckContext) -> Problems:
    """Warn if braking from full speed takes longer than the deadline of the step of the stop sequence."""
    drives = case.drive_of
    for axis in case.cell.axes.values():
        stop, times, drive = axis.stop, StopTimes(), drives.get(axis.name)
        speed = axis.max_velocity or axis.defaults.velocity
        slow = _fixed(drive, objects.PROFILE_DECELERATION) or _Deceleration(
            axis.defaults.deceleration or axis.defaults.acceleration, "the default deceleration"
        )
        quick = _fixed(drive, objects.QUICK_STOP_DECELERATION) or _Deceleration(
            stop.deceleration, "the quick-stop deceleration"
        )
        halt = None if drive is None else drive.number(options.HALT.index)
        halts_quickly = halt is not None and options.HALT_RAMPS.get(halt) is Ramp.QUICK
        for key, default, ramp in (
            ("halt_time", times.halt, quick if halts_quickly else slow),
            ("quick_stop_time", times.quick_stop, quick),
        ):
            allowed = getattr(stop, key) or default
            if speed is None or ramp.value is None or speed / ramp.value <= allowed or not stop.at.sound(key):
                continue
            seconds = speed / ramp.value
            yield case.warning(
                stop.at.of(key),
                f"axis {axis.name}: {key} is too short to brake from full speed",
                f"{speed:g} {axis.unit}/s with {ramp.name}, {ramp.value:g} {axis.unit}/s², takes {seconds:.3g} s; "
                f"after {allowed:g} s the next step of the stop sequence begins",
                f'{key} = "{seconds * 1.5:.2g}s" in [axes.{axis.name}.stop], or a steeper ramp',
            )


def _fixed(drive: Drive | None, index: int) -> _Deceleration | None:
    """Return the deceleration of a drive if the object is read-only and has a value; None otherwise."""
    variable = None if drive is None else drive.variable(index)
    if drive is None or variable is None or variable.writable or not (raw := drive.number(index)):
        return None
    value = abs(units_of(drive.axis).acceleration.to_units(raw))
    return _Deceleration(value, f"the read-only deceleration of its drive ({index:04X}h)")


CHECKS: tuple[Check, ...] = (
    coasting,
    not_there,
    ramp_of_quick_stop,
    weak_quick_stop,
    unused_ramp,
    load_held,
    stop_sequence_times,
)


# -- Check that each drive can detect the loss of the master --------------------------------------------------------------------


_MILLISECOND = 0.001


def _whole(seconds: float) -> int:
    """Return the time in milliseconds, rounded up to a whole number."""
    return math.ceil(seconds / _MILLISECOND - 1e-6)


def heartbeat(case: CheckContext) -> Problems:
    """Check that the heartbeat is a whole number of milliseconds, and that the scan can send it."""
    bus = case.cell.bus
    if not bus.at.sound("heartbeat", "scan_period"):
        return
    line = bus.at.of("heartbeat")
    if bus.heartbeat is None:
        yield case.warning(
            line,
            "the heartbeat is off, so no drive can use it to detect the loss of the master",
            'heartbeat = "off"',
            'heartbeat = "100ms" in [bus]',
        )
    elif abs(bus.heartbeat / _MILLISECOND - round(bus.heartbeat / _MILLISECOND)) > 1e-6:
        yield case.error(
            line,
            f"a heartbeat of {bus.heartbeat * 1000:g} ms cannot be set in the drives",
            "1016h and 1017h count whole milliseconds",
            f'heartbeat = "{_whole(max(bus.heartbeat, bus.scan_period))}ms"',
        )
    elif bus.heartbeat < bus.scan_period:
        yield case.error(
            line,
            f"a heartbeat of {bus.heartbeat * 1000:g} ms is faster than the scan that sends it",
            f"scan_period is {bus.scan_period * 1000:g} ms",
            f'heartbeat = "{max(100, _whole(bus.scan_period))}ms", or scan_period = "{bus.heartbeat * 1000:g}ms" or shorter',
        )


def watched(case: CheckContext) -> Problems:
    """Warn of drives that cannot detect the loss of the master, and note drives with an unknown reaction."""
    if case.cell.bus.heartbeat is None:
        return
    for node, eds, _ in case.nodes:
        if not any(case.cell.axes_of(node.node_id)):
            continue
        if _consumes_heartbeats(eds):
            yield from _reaction(case, node, eds)
        elif not _can_be_guarded(eds):
            yield case.warning(
                node.at.line,
                f"node {node.node_id}: nothing on this drive detects the loss of the master",
                f"{eds.source} has neither 1016h (consumer heartbeat) nor 100Ch and 100Dh (node guarding): if this program "
                "or the bus fails, the drive continues with its last command",
                "keep its speed and travel harmless, or cut its power by hardware that monitors the master",
            )


def _consumes_heartbeats(eds: Eds) -> bool:
    variable = eds.get(cia301.CONSUMER_HEARTBEAT, 1)
    return variable is not None and variable.writable


def _can_be_guarded(eds: Eds) -> bool:
    return cia301.GUARD_TIME in eds and cia301.LIFE_TIME_FACTOR in eds


def _reaction(case: CheckContext, node: NodeConfig, eds: Eds) -> Problems:
    """Note a missing 6007h; ``stopping.coasting`` reports values with which the drive continues to move."""
    for drive in case.drives:
        if drive.node is node and not drive.has(options.CONNECTION_LOSS.index):
            yield case.note(
                drive.axis.at.line,
                f"axis {drive.axis.name}: the reaction of the drive to the loss of the master is unknown",
                f"{eds.source} has 1016h (consumer heartbeat) but no 6007h (abort connection option code)",
                "try it at low speed: kill the program, and watch the axis",
            )


def watchable(case: CheckContext) -> Problems:
    """Note nodes without a heartbeat, whose loss the master notices later."""
    for node, eds, _ in case.nodes:
        if cia301.PRODUCER_HEARTBEAT not in eds:
            guards = case.cell.bus.heartbeat is not None and _can_be_guarded(eds)
            noticed = "by node guarding (100Ch, 100Dh)" if guards else "when its PDOs or answers do not come"
            yield case.note(
                node.at.line,
                f"node {node.node_id} sends no heartbeat",
                f"{eds.source} lacks 1017h; the loss of the node is detected {noticed}",
            )


WATCHDOG_CHECKS: tuple[Check, ...] = (heartbeat, watched, watchable)
