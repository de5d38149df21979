"""Check which modes of operation each axis can run, and which objects are missing for the modes that the cell asks for."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.bus.pdo.plan import PlannedPdo
from axisbus.cell.axis_description import Drive
from axisbus.cell.cyclic_modes import interpolates
from axisbus.cell.parameters import mode_list, modes
from axisbus.check.context import Check, CheckContext, Problems, title, titles
from axisbus.check.cyclic_modes import planned
from axisbus.cia301 import objects as o
from axisbus.cia402 import objects
from axisbus.cia402.modes import FACTS, ModeOfOperation, needed

_M = ModeOfOperation
USED = (
    _M.PROFILE_POSITION,
    _M.PROFILE_VELOCITY,
    _M.PROFILE_TORQUE,
    _M.HOMING,
    _M.CYCLIC_SYNC_POSITION,
    _M.CYCLIC_SYNC_VELOCITY,
    _M.CYCLIC_SYNC_TORQUE,
)
# The commands that the user loses without a mode.
COMMANDS = {
    _M.PROFILE_POSITION: "move_absolute, move_relative and move_additive",
    _M.PROFILE_VELOCITY: "move_velocity and jog",
    _M.PROFILE_TORQUE: "torque_control",
    _M.HOMING: "home",
    _M.CYCLIC_SYNC_POSITION: "follow and a group's move_linear",
    _M.CYCLIC_SYNC_VELOCITY: "cyclic_velocity",
    _M.CYCLIC_SYNC_TORQUE: "cyclic_torque",
}
_TARGETS = {
    _M.CYCLIC_SYNC_POSITION: "target_position",
    _M.CYCLIC_SYNC_VELOCITY: "target_velocity",
    _M.CYCLIC_SYNC_TORQUE: "target_torque",
}
_BY_SHORT_NAME = {facts.short: mode for mode, facts in FACTS.items()}


def summary(case: CheckContext) -> Problems:
    """Note the modes of each axis by its objects and 6502h, and the differences between the two."""
    for drive in case.drives:
        shown = mode_list(drive)
        not_cyclic = {mode: why for mode, why in event_driven(case, drive).items() if mode in shown.modes}
        runs = [FACTS[mode].short for mode in USED if mode in shown.modes and mode not in not_cyclic]
        unclaimed = [
            f"not {FACTS[mode].short} ({titles(missing)} missing)"
            for mode in USED
            if (missing := drive.missing(needed(mode))) and mode not in (drive.claimed or ())
        ]
        yield case.note(
            drive.axis.at.line,
            f"axis {drive.axis.name} can run {', '.join(runs) or 'no mode'}",
            "; ".join(
                (
                    *shown.doubts,
                    *unclaimed,
                    *(f"not {FACTS[mode].short} ({why})" for mode, why in not_cyclic.items()),
                )
            )
            or "by the objects of its EDS and 6502h; boot asks the drive",
        )


def required_modes(case: CheckContext) -> Problems:
    """Check that the modes that the cell asks for have the objects that the master needs."""
    for drive in case.drives:
        for mode, line, reason in _required_modes(drive):
            method = drive.axis.homing.method if mode is _M.HOMING else None
            missing = drive.missing(needed(mode, method))
            if missing:
                report = case.warning if _moves_otherwise(drive, mode) else case.error
                yield report(
                    line,
                    f"axis {drive.axis.name}: {FACTS[mode].short} ({mode.text}) is needed by {reason}, but cannot be run",
                    f"{drive.eds.source} lacks {titles(missing)}",
                    f"delete the line that needs it; {COMMANDS.get(mode, mode.text)} will not be available",
                )


def without_commands(case: CheckContext) -> Problems:
    """Warn of modes that no command uses."""
    for axis in case.cell.axes.values():
        for short in axis.modes or ():
            mode = _BY_SHORT_NAME[short]
            if mode not in USED and mode is not _M.INTERPOLATED_POSITION:
                yield case.warning(
                    axis.at.of("modes"),
                    f"axis {axis.name}: no command uses {short} ({mode.text})",
                    f"commands use {', '.join(FACTS[each].short for each in USED)}",
                    f'delete "{short}" from modes',
                )


def _moves_otherwise(drive: Drive, mode: ModeOfOperation) -> bool:
    """Whether the default velocities are still used without the mode, for the trajectories of csp."""
    named = drive.axis.modes is not None
    return mode is _M.PROFILE_POSITION and not named and _M.CYCLIC_SYNC_POSITION in drive.runnable


def _required_modes(drive: Drive) -> Iterator[tuple[ModeOfOperation, int, str]]:
    axis = drive.axis
    for short in axis.modes or ():
        yield _BY_SHORT_NAME[short], axis.at.of("modes"), f"modes in [{axis.at.name}]"
    if axis.homing.method is not None and "hm" not in (axis.modes or ()):
        yield _M.HOMING, axis.homing.at.of("method"), f"method in [{axis.homing.at.name}]"
    if axis.defaults.velocity is not None and axis.modes is None and not _has_only_velocity(drive):
        yield _M.PROFILE_POSITION, axis.defaults.at.of("velocity"), f"velocity in [{axis.defaults.at.name}]"


def _has_only_velocity(drive: Drive) -> bool:
    """Whether the drive can run pv: then its default velocity may be meant for move_velocity."""
    return _M.PROFILE_VELOCITY in drive.runnable


def homing_left_out(case: CheckContext) -> Problems:
    """Warn of a homing method if modes does not list hm."""
    for drive in case.drives:
        axis = drive.axis
        if axis.homing.method is not None and axis.modes is not None and "hm" not in axis.modes:
            yield case.warning(
                axis.at.of("modes"),
                f"axis {axis.name} has a homing method, but modes leaves hm out",
                f"method {axis.homing.method} at line {axis.homing.at.of('method')}",
                'add "hm" to modes, or delete the method',
            )


def groups(case: CheckContext) -> Problems:
    """Warn of groups whose ``move_linear`` will be refused: it needs csp on each axis, and SYNC."""
    drives = case.drive_of
    for group in case.cell.groups.values():
        line = group.at.of("axes")
        for name in group.axes:
            drive = drives.get(name)
            if drive is None:
                continue
            why = no_csp(drive) or event_driven(case, drive).get(_M.CYCLIC_SYNC_POSITION)
            if why:
                yield case.warning(
                    line,
                    f"group {group.name}: move_linear will be refused, because axis {name} cannot run csp",
                    why,
                    "move_direct and the other commands of the group work without it",
                )
        if group.axes and not case.cell.bus.sync:
            yield case.warning(
                line,
                f"group {group.name}: move_linear will be refused, because the bus has no SYNC",
                f"sync = false at line {case.cell.bus.at.of('sync')}; csp takes its targets at SYNC",
                "sync = true in [bus], or only use move_direct",
            )


def event_driven(case: CheckContext, drive: Drive) -> dict[ModeOfOperation, str]:
    """Return the cyclic modes whose values will not be in synchronous PDOs, with the reasons; none if the bus has no SYNC.

    A drive whose EDS has a transmission type read-only keeps its type: boot cannot make such a PDO synchronous.
    """
    types_are_fixed = any(
        o.is_pdo_communication(index) and not _has_writable_type(drive, index) for index in drive.eds.objects
    )
    if not case.cell.bus.sync or interpolates(drive) or not types_are_fixed:
        return {}
    found = {}
    pdos = [pdo for pdo in planned(case, drive).pdos if _needs_events(drive, pdo)]
    for mode, target in _TARGETS.items():
        types = ", ".join(
            f"{_communication(pdo):04X}h:02 of {pdo.name} is {pdo.before.transmission_type}"
            for pdo in pdos
            if {"statusword", "position", target}.intersection(pdo.values)
        )
        if types:
            found[mode] = f"csp, csv and cst need synchronous PDOs; {types}, and read-only in the EDS"
    return found


def _needs_events(drive: Drive, pdo: PlannedPdo) -> bool:
    return not pdo.before.synchronous and not _has_writable_type(drive, _communication(pdo))


def _has_writable_type(drive: Drive, index: int) -> bool:
    entry = drive.eds.get(index, o.PDO_TRANSMISSION_TYPE)
    return entry is None or entry.writable


def _communication(pdo: PlannedPdo) -> int:
    first = o.RPDO_COMMUNICATION if pdo.receive else o.TPDO_COMMUNICATION
    return first + pdo.before.number - 1


def no_csp(drive: Drive) -> str:
    """Return why the master cannot command a drive in csp (or in ip instead); "" if no reason is known."""
    if interpolates(drive):
        return ""  # the master commands it in ip
    if drive.axis.modes is not None and "csp" not in drive.axis.modes:
        return f"modes at line {drive.axis.at.of('modes')} leaves it out"
    missing = drive.missing(FACTS[_M.CYCLIC_SYNC_POSITION].required)
    if missing:
        return f"{drive.eds.source} lacks {titles(missing)}"
    if _M.CYCLIC_SYNC_POSITION not in modes(drive):
        return f"6502h in {drive.eds.source} does not list csp; if the drive has it, name it in modes = [...]"
    return ""


def cyclic_without_sync(case: CheckContext) -> Problems:
    """Check that cyclic modes are not asked for on a bus without SYNC."""
    if case.cell.bus.sync:
        return
    for axis in case.cell.axes.values():
        cyclic = [short for short in axis.modes or () if FACTS[_BY_SHORT_NAME[short]].cyclic]
        if cyclic:
            yield case.error(
                axis.at.of("modes"),
                f"axis {axis.name}: {', '.join(cyclic)} take their targets at SYNC, and the bus has none",
                f"sync = false at line {case.cell.bus.at.of('sync')}",
                "sync = true in [bus], or leave these modes out",
            )


def mode_switch(case: CheckContext) -> Problems:
    """Check that a drive with several modes can be switched between them (6060h, 6061h)."""
    for drive in case.drives:
        missing = drive.missing((objects.MODES_OF_OPERATION, objects.MODES_OF_OPERATION_DISPLAY))
        if missing and len(drive.runnable) > 1:
            used = ", ".join(FACTS[mode].short for mode in sorted(modes(drive)))
            yield case.warning(
                drive.axis.at.line,
                f"axis {drive.axis.name}: its mode of operation cannot be switched and confirmed",
                f"{drive.eds.source} lacks {titles(missing)}; the modes that are used: {used}",
                "name the drive's own EDS; without these objects only one mode can be used, and modes = [...] in "
                f"[{drive.axis.at.name}] names which",
            )


def unclaimed(case: CheckContext) -> Problems:
    """Note requested modes that 6502h does not list: 6502h is wrong in many drives, so these modes are not refused."""
    for drive in case.drives:
        claimed = drive.claimed
        if claimed is None:
            continue
        for mode, line, reason in _required_modes(drive):
            by_ip = mode is _M.CYCLIC_SYNC_POSITION and interpolates(drive)
            if mode not in claimed and mode in drive.runnable and not by_ip:
                names = ", ".join(FACTS[each].short for each in sorted(claimed)) or "none"
                yield case.note(
                    line,
                    f"axis {drive.axis.name}: {FACTS[mode].short}, needed by {reason}, is not listed by the drive",
                    f"{title(objects.SUPPORTED_DRIVE_MODES)} in {drive.eds.source} claims {names}; "
                    "its objects are there, so it is tried",
                )


CHECKS: tuple[Check, ...] = (
    summary,
    required_modes,
    without_commands,
    homing_left_out,
    groups,
    cyclic_without_sync,
    mode_switch,
    unclaimed,
)
