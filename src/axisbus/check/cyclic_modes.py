"""Check that the feed-forward of a cell file can be calculated and sent."""

from __future__ import annotations

from axisbus.bus.pdo.mapping import axis_objects
from axisbus.bus.pdo.plan import PdoPlan, make_plan
from axisbus.cell import pdo_tables, scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.cyclic_modes import feed_forward, interpolates, wanted_of
from axisbus.cell.pdo_plan import policy_of
from axisbus.cell.quantities import units_of
from axisbus.check.context import Check, CheckContext, Problems, own_title
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import OFFSET_OBJECTS, ValueTransport
from axisbus.motion.parameters import AxisLimits, FeedForward

_M = ModeOfOperation
_NEEDS = {
    "velocity_offset": (_M.CYCLIC_SYNC_POSITION,),
    "torque_offset": (_M.CYCLIC_SYNC_POSITION, _M.CYCLIC_SYNC_VELOCITY),
}


def _with_feed_forward(case: CheckContext) -> list[tuple[Drive, FeedForward]]:
    pairs = [(drive, feed_forward(drive.axis, None)) for drive in case.drives]
    return [(drive, requested) for drive, requested in pairs if requested is not None]


def _line(drive: Drive, name: str) -> int:
    """Return the line that asks for an offset."""
    at = drive.axis.feed_forward.at
    keys = ("velocity",) if name == "velocity_offset" else ("inertia", "torque_offset")
    return next((at.of(key) for key in keys if at.gives(key)), at.line)


def no_effect(case: CheckContext) -> Problems:
    """Warn of a feed-forward table without an effect."""
    for axis in case.cell.driven.values():
        at = axis.feed_forward.at
        if axis.at.gives("feed_forward") and at.sound(*at.keys) and feed_forward(axis, None) is None:
            yield case.warning(
                at.line,
                f"axis {axis.name}: [{at.name}] sets no feed-forward",
                "there is neither velocity = true nor inertia nor torque_offset in it",
                "add one of them, or delete the table",
            )


def outputs_mapped(case: CheckContext) -> Problems:
    """Check that the drive has each offset, and that a synchronous PDO carries it."""
    for drive, requested in _with_feed_forward(case):
        sources = planned(case, drive).outputs if case.cell.bus.sync else {}
        for name in requested.outputs:
            index, line = OFFSET_OBJECTS[name], _line(drive, name)
            message = f"axis {drive.axis.name}: its feed-forward cannot be sent by {own_title(drive, index)}"
            delete = f"delete the keys that need it in [{drive.axis.feed_forward.at.name}]"
            if not drive.has(index):
                yield case.error(line, message, f"{drive.eds.source} lacks it", delete)
            elif not case.cell.bus.sync:
                where = f"sync = false at line {case.cell.bus.at.of('sync')}"
                yield case.error(
                    line, message, f"it needs a SYNC, and {where}", f"sync = true in [bus], or {delete}"
                )
            elif sources[name] is not ValueTransport.SYNC_PDO:
                why = (
                    "no RPDO contains it"
                    if sources[name] is ValueTransport.SDO
                    else "its RPDO is event-driven"
                )
                yield case.error(
                    line,
                    message,
                    f"{why}, by {drive.eds.source} and the node's [pdo] tables",
                    f"map it into an RPDO, or {delete}",
                )


def planned(case: CheckContext, drive: Drive) -> PdoPlan:
    """Return the PDO plan that boot would make for an axis, by the EDS and the cell file."""
    node = drive.node
    device = pdo_tables.device_pdos(node, drive.eds)
    objects = axis_objects(drive.dictionary, device, drive.axis.drive_axis)
    return make_plan(
        node.node_id,
        device,
        objects,
        wanted_of(drive.axis, node, drive.eds),
        policy_of(case.cell, node),
        drive.axis.drive_axis,
    )


def used(case: CheckContext) -> Problems:
    """Warn of an offset that no mode of the axis adds."""
    for drive, requested in _with_feed_forward(case):
        named = drive.axis.modes
        for name in requested.outputs:
            modes = _NEEDS[name]
            shorts = {_M.CYCLIC_SYNC_POSITION: "csp", _M.CYCLIC_SYNC_VELOCITY: "csv"}
            if not any(mode in drive.runnable and (named is None or shorts[mode] in named) for mode in modes):
                needed = " or ".join(shorts[mode] for mode in modes)
                yield case.warning(
                    _line(drive, name),
                    f"axis {drive.axis.name}: {own_title(drive, OFFSET_OBJECTS[name])} will have no effect",
                    f"a drive adds it in {needed}, which the axis does not have",
                    "delete it, or give the axis the mode",
                )


def computed(case: CheckContext) -> Problems:
    """Check that velocities and torques can be converted to the drive's units, and stay below the highest torque."""
    for drive, requested in _with_feed_forward(case):
        axis, at = drive.axis, drive.axis.feed_forward.at
        if requested.velocity and not units_of(axis).ratio_known and axis.at.sound("unit", "velocity_scale"):
            yield case.error(
                at.of("velocity"),
                f"axis {axis.name}: the unit of velocity of its drive is not given",
                "the velocity of a set-point is in position units; 60B1h is in the drive's velocity increments",
                f"write velocity_scale in [{axis.at.name}]",
            )
        if not requested.by_torque or not axis.at.sound("rated_torque"):
            continue
        if axis.rated_torque is None:
            yield case.error(
                _line(drive, "torque_offset"),
                f"axis {axis.name}: torques in N·m need rated_torque, which is missing",
                "60B2h is in parts of the rated torque (6076h)",
                f"add rated_torque in N·m to [{axis.at.name}]",
            )
        else:
            yield from _too_high(case, drive, requested)


def _too_high(case: CheckContext, drive: Drive, requested: FeedForward) -> Problems:
    axis, at = drive.axis, drive.axis.feed_forward.at
    limits = scale_proposal.limited_torque(
        AxisLimits(torque=axis.max_torque), axis.rated_torque, drive.number
    )
    if limits.torque is None:
        return
    limit_text = f"{limits.torque_key} is {limits.torque:g} N·m"
    constant = abs(requested.torque or 0.0)
    if constant > limits.torque:
        yield case.error(
            at.of("torque_offset"),
            f"axis {axis.name}: torque_offset is above the torque limit of the axis",
            limit_text,
            "correct it",
        )
    highest = constant + (requested.inertia or 0.0) * (axis.max_acceleration or 0.0)
    if constant <= limits.torque < highest:
        yield case.warning(
            at.of("inertia"),
            f"axis {axis.name}: its feed-forward reaches {highest:g} N·m at max_acceleration, and is limited to less",
            limit_text,
            "check whether inertia is in N·m per unit/s², or lower max_acceleration",
        )


CHECKS: tuple[Check, ...] = (no_effect, outputs_mapped, used, computed)


# -- Report the axes that the master commands in ip, because their drive has no csp ------------------------------------


def by_interpolation(case: CheckContext) -> Problems:
    """Note each axis commanded in ip; an error if no synchronous PDO carries its set-points."""
    for drive in case.drives:
        axis = drive.axis
        if not case.cell.bus.sync or not interpolates(drive):
            continue
        line = axis.at.of("modes")
        yield case.note(
            line,
            f"axis {axis.name}: its drive has ip and no csp, so trajectories, lines and couplings use ip",
            "set-points go to 60C1h:01, and bit 4 of the controlword enables the interpolation"
            if axis.modes is None or "ip" not in axis.modes
            else "modes names ip",
            'if the drive has csp, name it: modes = ["pp", "csp", ...]',
        )
        if planned(case, drive).outputs["interpolation_target"] is not ValueTransport.SYNC_PDO:
            yield case.error(
                line,
                f"axis {axis.name}: its set-points of ip (60C1h:01) cannot be sent with SYNC",
                f"no synchronous RPDO contains them, by {drive.eds.source} and the node's [pdo] tables",
                f"map it into an RPDO, or leave ip and csp out of modes in [{axis.at.name}]",
            )


INTERPOLATED_CHECKS: tuple[Check, ...] = (by_interpolation,)
