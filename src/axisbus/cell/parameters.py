"""Convert a cell file's axis and its EDS to the parameters that motion needs of the axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Set
from dataclasses import dataclass, replace

from axisbus.cell import scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.cyclic_modes import feed_forward, interpolates, led_modes
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.quantities import units_of
from axisbus.cia402 import objects, options
from axisbus.cia402.modes import FACTS, ModeOfOperation, needed
from axisbus.cia402.options import Ramp
from axisbus.drives.plugin import DrivePlugin
from axisbus.drives.registry import make_of
from axisbus.eds.model import Eds
from axisbus.motion.modes import RESTING_MODES
from axisbus.motion.parameters import (
    AxisLimits,
    AxisParameters,
    Defaults,
    DemandUse,
    DriveTimeouts,
    Handshake,
    HoldsLoad,
    HomingParameters,
    StopTimes,
    Units,
    standstill_time,
)
from axisbus.motion.stop_deceleration import Braking

# Without standstill_velocity, an axis is at standstill below this part of its default velocity.
STANDSTILL_PART = 0.01


_BY_SHORT_NAME = {facts.short: mode for mode, facts in FACTS.items()}
_HOLDS = {None: HoldsLoad.NO, "brake": HoldsLoad.BRAKE, "torque": HoldsLoad.TORQUE}


def axis_parameters(cell: CellConfig, name: str, eds: Eds, make: DrivePlugin | None = None) -> AxisParameters:
    """Return the parameters of the axis ``name``.

    ``eds`` is that of the axis's node; ``make`` None: the one that matches the EDS's identity. Does not block, and raises nothing
    for a cell that ``reader.load`` returned.
    """
    node = cell.nodes[cell.axes[name].node]
    drive = Drive.of(cell.axes[name], node, eds)
    axis = drive.axis
    values = {(index, sub): drive.number(index, sub) for index, sub in scale_proposal.OBJECTS}
    units = known_units(axis, values)
    make = make or make_of(eds, node.makes)
    return AxisParameters(
        name=name,
        units=units,
        limits=scale_proposal.limited_torque(
            AxisLimits(axis.position_limits, axis.max_velocity, axis.max_acceleration, axis.max_torque),
            axis.rated_torque,
            drive.number,
        ),
        defaults=defaults(axis),
        homing=_homing(axis),
        stop_times=stop_times(axis),
        timing=_timing(axis, units),
        holds_load=_HOLDS[axis.holds_load],
        handshake=Handshake(axis.handshake or Handshake.ACKNOWLEDGE),
        homing_reached=axis.homing_reached is not False,
        objects=drive.objects,
        read_only=drive.read_only,
        modes=led_modes(drive, modes(drive)),
        quick_stop_holds=drive.number(objects.QUICK_STOP_OPTION) in options.HOLDING_QUICK_STOPS,
        braking=braking_of(units, drive.number),
        fixed_ramps=fixed_ramps(drive, drive.number),
        position_window=_increments(axis.position_window, units),
        standstill_window=_increments(axis.standstill_window, units),
        following_error=None
        if axis.following_error == math.inf
        else _increments(axis.following_error, units),
        demand=DemandUse(axis.demand or DemandUse.AUTO),
        compares_demand=axis.following_error != math.inf,
        standstill_speed=standstill_speed(axis, units),
        fault_objects=make.fault_objects,
        explain_fault=make.explain,
        node=axis.node,
        eds=eds.source,
        scan_period=cell.bus.scan_period,
        feed_forward=feed_forward(axis, drive.number(objects.POLARITY)),
        interpolated=interpolates(drive),
        limits_in_drive=axis.limits_in_drive
        and axis.position_limits is not None
        and objects.SOFTWARE_POSITION_LIMIT in drive.objects,
    )


def known_units(axis: AxisConfig, values: scale_proposal.Values) -> Units:
    """Return the units of an axis; for an axis in increments, the ratios are known if the drive's own units are increments, too."""
    units = units_of(axis)
    if units.ratio_known or not scale_proposal.counts_increments(axis, values):
        return units
    return replace(units, ratio_known=True)


def modes(drive: Drive, claimed: Collection[ModeOfOperation] | None = None) -> frozenset[ModeOfOperation]:
    """Return the modes that an axis uses: those of the cell file, else those that 6502h lists, else those with all their objects.

    ``claimed``: the modes of the drive's own 6502h (None: of its EDS's). A 6502h that lists no mode is ignored. If the 6502h of a
    make is known to be wrong, the modes with all their objects are added. If a drive has no 6061h, no change of its mode can be
    confirmed, so only the mode in which it is enabled is used.
    """
    found = _named_modes(drive, claimed)
    if len(found) < 2 or not drive.missing((objects.MODES_OF_OPERATION_DISPLAY,)):
        return found
    return frozenset([next((mode for mode in RESTING_MODES if mode in found), min(found))])


def _named_modes(drive: Drive, claimed: Collection[ModeOfOperation] | None) -> frozenset[ModeOfOperation]:
    if drive.axis.modes is not None:
        return frozenset(_BY_SHORT_NAME[short] for short in drive.axis.modes)
    said = frozenset(claimed or drive.claimed or ())
    if said and make_of(drive.eds, drive.node.makes).behaviour.lists_modes:
        return said
    return drive.runnable | said


@dataclass(frozen=True, slots=True)
class ShownModes:
    """The modes that objects and 6502h agree on (the objects alone, if 6502h has no value), and their differences in sentences."""

    modes: tuple[ModeOfOperation, ...]
    doubts: tuple[str, ...]


def mode_list(drive: Drive, claimed: Set[ModeOfOperation] | None = None) -> ShownModes:
    """Return an axis's modes by its objects and 6502h; ``claimed``: the modes of the drive's own 6502h (None: of its EDS's)."""
    if claimed is None:
        claimed = drive.claimed
    runnable = drive.runnable
    if claimed is None:
        return ShownModes(tuple(sorted(runnable)), ("6502h has no value: by the objects alone",))
    doubts = [_lacks(drive, mode) for mode in sorted(claimed - runnable)]
    unlisted = [FACTS[mode].short for mode in sorted(runnable - claimed)]
    if unlisted:
        it = "it" if len(unlisted) == 1 else "them"
        unused = "" if modes(drive, claimed) >= runnable else ": not used unless modes = [...] names it"
        doubts.append(f"objects of {', '.join(unlisted)} are present, but 6502h does not list {it}{unused}")
    used = modes(drive, claimed)
    if len(used) < len(_named_modes(drive, claimed)):
        doubts.append(
            f"6061h is missing, so no change of the mode can be confirmed: only {FACTS[min(used)].short} is used"
        )
    return ShownModes(tuple(sorted(runnable & claimed)), tuple(doubts))


def _lacks(drive: Drive, mode: ModeOfOperation) -> str:
    missing = drive.missing(needed(mode))
    names = ", ".join(f"{index:04X}h" for index in missing)
    return f"6502h lists {FACTS[mode].short}, but {names} {'is' if len(missing) == 1 else 'are'} missing"


def standstill_speed(axis: AxisConfig, units: Units) -> float | None:
    """Return the standstill limit of the speed in position increments per second; None if it is unknown."""
    if axis.standstill_velocity is not None:
        return axis.standstill_velocity * abs(units.position.factor)
    if axis.defaults.velocity is None or not units.ratio_known:
        return None
    return axis.defaults.velocity * STANDSTILL_PART * abs(units.position.factor)


def homing_required(axis: AxisConfig) -> bool:
    """Whether absolute moves need homing: as written, else if position limits are set; never on a virtual axis."""
    if axis.virtual:
        return False
    return axis.position_limits is not None if axis.homing.required is None else axis.homing.required


def defaults(axis: AxisConfig) -> Defaults:
    """Return the values for commands that leave them out."""
    given = axis.defaults
    return Defaults(given.velocity, given.acceleration, given.deceleration, given.torque_slope, given.jerk)


def _homing(axis: AxisConfig) -> HomingParameters:
    given = axis.homing
    return HomingParameters(
        given.method,
        given.speed_switch,
        given.speed_zero,
        given.acceleration,
        given.timeout,
        homing_required(axis),
    )


def stop_times(axis: AxisConfig) -> StopTimes:
    """Return the deadlines of the stop sequence: those of the cell file, else the defaults."""
    stop = axis.stop
    given = {"halt": stop.halt_time, "quick_stop": stop.quick_stop_time, "disable": stop.disable_time}
    return replace(StopTimes(), **{name: value for name, value in given.items() if value is not None})


def highest_speed(axis: AxisConfig, units: Units) -> float:
    """Return the highest speed of an axis in position increments per second, 0 if it is unknown."""
    return (axis.max_velocity or axis.defaults.velocity or 0.0) * abs(units.position.factor)


def _timing(axis: AxisConfig, units: Units) -> DriveTimeouts:
    given = {
        "standstill_time": standstill_time(highest_speed(axis, units)),
        "transition": axis.transition_time,
        "mode": axis.mode_time,
        "acknowledge": axis.acknowledge_time,
    }
    return replace(DriveTimeouts(), **{name: value for name, value in given.items() if value is not None})


def _increments(way: float | None, units: Units) -> int | None:
    """Return a distance of cell.toml in position increments, at least 1."""
    return None if way is None else max(1, round(way * abs(units.position.factor)))


# -- The decelerations of an axis, from its option codes, quick-stop deceleration, own limits, and read-only ramps -----


Read = Callable[[int], int | None]


def braking_of(units: Units, read: Read) -> Braking:
    """Return the ramps of halt and quick stop; ``read`` returns the value of an object of the axis, None if it is unknown."""
    most_up, most_down = read(objects.MAX_ACCELERATION), read(objects.MAX_DECELERATION)
    return Braking(
        _ramp(options.HALT_RAMPS, read(objects.HALT_OPTION)),
        _ramp(options.QUICK_STOP_RAMPS, read(objects.QUICK_STOP_OPTION)),
        _stop_deceleration_increments(units, read(objects.QUICK_STOP_DECELERATION)),
        _stop_deceleration_increments(units, most_up),
        _stop_deceleration_increments(units, most_down or most_up),
    )


def fixed_ramps(drive: Drive, read: Read) -> tuple[tuple[int, int | None], ...]:
    """Return the profile ramps (6083h, 6084h) that are read-only in the EDS, each with the drive's value."""
    found = []
    for index in (objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION):
        variable = drive.variable(index)
        if variable is not None and not variable.writable:
            found.append((index, read(index)))
    return tuple(found)


def _ramp(table: dict[int, Ramp], value: int | None) -> Ramp:
    return Ramp.UNKNOWN if value is None else table.get(value, Ramp.UNKNOWN)


def _stop_deceleration_increments(units: Units, raw: int | None) -> float | None:
    """Return an acceleration of the drive in position increments per s²; None if it is 0 or unknown."""
    if not raw or not units.ratio_known:
        return None
    return abs(units.acceleration.to_units(raw) * units.position.factor)
