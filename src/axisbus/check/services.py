"""Check that the SYNC and TIME settings of ``[bus]`` are valid and fit the nodes' settings."""

from __future__ import annotations

from axisbus.cell import sync_window
from axisbus.cell.model import BusConfig
from axisbus.check.cobids import reserved_for
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.eds.model import Eds


def listeners(case: CheckContext) -> Problems:
    """Check that each node receives the bus's SYNC, and sends none of its own (1005h)."""
    for node, eds, _ in case.nodes:
        value = case.node_number(node, o.COB_ID_SYNC)
        if value is None or not case.cell.bus.sync:
            continue
        what = _sync_trouble(value, case.cell.bus)
        variable = eds.get(o.COB_ID_SYNC)
        if what and variable is not None and variable.writable:
            yield case.note(
                node.at.line,
                f"node {node.node_id} {what}",
                _value_text(value, eds),
                f"boot sets 1005h to {case.cell.bus.sync_cob_id:X}h",
            )
        elif what:
            yield case.error(
                node.at.line,
                f"node {node.node_id} {what}",
                _value_text(value, eds) + ", and cannot be written",
                "set it with the drive's own tool, or sync = false in [bus]",
            )


def _sync_trouble(value: int, bus: BusConfig) -> str:
    if value & cob.SYNC_PRODUCER and not bus.hears_sync:
        return "produces SYNC, and so does the master"
    if value & cob.ID_MASK_11 != bus.sync_cob_id:
        sync_text = "comes on" if bus.hears_sync else "the master sends"
        return (
            f"waits for SYNC on the COB-ID {value & cob.ID_MASK_11:03X}h; {sync_text} {bus.sync_cob_id:03X}h"
        )
    return ""


def producers(case: CheckContext) -> Problems:
    """Check an external SYNC: only one node produces it, at the scan period."""
    if not case.cell.bus.hears_sync:
        return
    values = [(node, case.node_number(node, o.COB_ID_SYNC) or 0) for node, _, _ in case.nodes]
    found = [node for node, value in values if value & cob.SYNC_PRODUCER]
    expected = round(case.cell.bus.scan_period * 1e6)
    for node in found:
        period = case.node_number(node, o.CYCLE_PERIOD)
        if period is not None and period != expected:
            yield case.warning(
                node.at.line,
                f"node {node.node_id} sends SYNC every {period} µs, but scan_period is {expected} µs",
                "1006h of the producer is the period of the scan",
                f'"1006" = {expected} in [nodes.{node.node_id}.objects]',
            )
    for node in found[1:]:
        yield case.error(
            node.at.line,
            f"nodes {found[0].node_id} and {node.node_id} both produce SYNC",
            "1005h has bit 30 set in both",
            f'"1005" = 0x{case.cell.bus.sync_cob_id:X} in the table of objects of one of them',
        )


def identifiers(case: CheckContext) -> Problems:
    """Check that SYNC and TIME do not use identifiers of other services (CiA 301 7.3.5)."""
    bus = case.cell.bus
    cob_ids = (
        ("sync_cob_id", bus.sync_cob_id, cob.SYNC, bus.sync),
        ("time_cob_id", bus.time_cob_id, cob.TIME, bus.time is not None),
    )
    for key, cob_id, own, used in cob_ids:
        why = reserved_for(cob_id) if used and cob_id != own else ""
        if why:
            yield case.error(
                bus.at.of(key),
                f"{key} cannot be {cob_id:03X}h",
                why,
                f"leave {key} out: by default {own:03X}h",
            )


def without_effect(case: CheckContext) -> Problems:
    """Warn of SYNC keys in ``[bus]`` that have no effect."""
    bus = case.cell.bus
    if not bus.sync:
        for key in ("sync_producer", "sync_cob_id", "sync_counter", "sync_timeout"):
            if bus.at.gives(key):
                why = "the bus has no SYNC (sync = false)"
                yield case.warning(bus.at.of(key), f"{key} has no effect", why, f"delete {key}")
    elif bus.sync_timeout is not None and not bus.hears_sync:
        yield case.warning(
            bus.at.of("sync_timeout"),
            "sync_timeout has no effect",
            "the master itself sends SYNC",
            'delete it, or write sync_producer = "external"',
        )


def counter(case: CheckContext) -> Problems:
    """Warn of nodes that may not accept a SYNC with a counter (1019h)."""
    bus = case.cell.bus
    for node, eds, _ in case.nodes if bus.sync and bus.sync_counter else ():
        if eds.get(o.SYNC_COUNTER_OVERFLOW) is None and eds.get(o.COB_ID_SYNC) is not None:
            yield case.warning(
                bus.at.of("sync_counter"),
                f"node {node.node_id} possibly does not accept a SYNC with a counter",
                f"{eds.source} has no 1019h; some drives then report 8240h (unexpected SYNC data length)",
                "leave sync_counter out, unless the drive's manual allows it",
            )


def window(case: CheckContext) -> Problems:
    """Warn of nodes whose synchronous window (1007h) closes before the master's RPDOs arrive."""
    bus = case.cell.bus
    for node, eds, _ in case.nodes:
        length = case.node_number(node, o.SYNC_WINDOW)
        if sync_window.misses(length, bus) and any(case.cell.axes_of(node.node_id)):
            yield case.warning(
                node.at.line,
                f"node {node.node_id} may discard the master's synchronous RPDOs",
                f"{sync_window.closes(length, bus)} ({eds.source})",
                sync_window.remedy(node.node_id),
            )


def period(case: CheckContext) -> Problems:
    """Warn of nodes that receive SYNC and have another cycle period (1006h) than the scan."""
    bus = case.cell.bus
    for node, eds, _ in case.nodes:
        value = case.node_number(node, o.CYCLE_PERIOD)
        if sync_window.has_other_period(value, bus):
            yield case.warning(
                node.at.line,
                f"node {node.node_id} expects SYNC with another period",
                f"{sync_window.other_period(value, bus)} ({eds.source})",
                sync_window.period_remedy(node.node_id, bus),
            )


def _value_text(value: int, eds: Eds) -> str:
    return f"1005h is {value:X}h in {eds.source}"


CHECKS: tuple[Check, ...] = (listeners, producers, identifiers, without_effect, counter, window, period)
