"""Check that each drive can notice a dead master."""

from __future__ import annotations

import math

from axisbus.cell.model import NodeConfig
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as cia301
from axisbus.cia402 import options
from axisbus.eds.model import Eds

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
            "the heartbeat is off: no drive can detect a dead master by it",
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
    """Warn of drives that cannot notice a dead master, and note drives with an unknown reaction."""
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
                f"node {node.node_id}: nothing on this drive detects a dead master",
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
                f"axis {drive.axis.name}: the reaction of the drive to a dead master is unknown",
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


CHECKS: tuple[Check, ...] = (heartbeat, watched, watchable)
