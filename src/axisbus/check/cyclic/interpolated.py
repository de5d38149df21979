"""Report the axes that the master commands in ip, because their drive has no csp."""

from __future__ import annotations

from axisbus.bus.pdo.mapping import axis_objects
from axisbus.bus.pdo.plan import make_plan
from axisbus.cell import pdo_tables
from axisbus.cell.cyclic_modes import interpolates, wanted_of
from axisbus.cell.pdo_plan import policy_of
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia402.port import ValueTransport


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
        device = pdo_tables.device_pdos(drive.node, drive.eds)
        objects = axis_objects(drive.dictionary, device, axis.drive_axis)
        wanted, policy = wanted_of(axis, drive.node, drive.eds), policy_of(case.cell, drive.node)
        plan = make_plan(drive.node.node_id, device, objects, wanted, policy, axis.drive_axis)
        if plan.outputs["interpolation_target"] is not ValueTransport.SYNC_PDO:
            yield case.error(
                line,
                f"axis {axis.name}: its set-points of ip (60C1h:01) cannot be sent with SYNC",
                f"no synchronous RPDO contains them, by {drive.eds.source} and the node's [pdo] tables",
                f"map it into an RPDO, or leave ip and csp out of modes in [{axis.at.name}]",
            )


CHECKS: tuple[Check, ...] = (by_interpolation,)
