"""The final treatment of each node when the machine closes: at rest, as found, or with its own watchdog left armed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from axisbus.boot.report import Booted
from axisbus.bus.node.events import NodeEvent
from axisbus.core.end_errors import remedy_of
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import NodeError, ScanError, one_line
from axisbus.link import NodeShutdown, StopResult, Unsafe, alarm
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.stop.diagnosis import join_remedies


def partings(
    booted: Mapping[int, Booted],
    cores: Mapping[str, AxisCore],
    rescued: Iterable[StopResult],
    unsafe: Iterable[Unsafe] = (),
) -> dict[int, NodeShutdown]:
    """Return the final treatment of each node.

    ``cores`` are the axes by name (none if the machine was only booted). ``rescued``: the results of a stop without the scan, which
    replace the last states of the cores. ``unsafe``: outputs that only their module itself can still make safe.
    """
    armed = {each.node: NodeShutdown.ARMED for each in unsafe}
    seen = {stopped.axis: stopped.ok for stopped in rescued}
    return {node_id: armed.get(node_id) or _parting(node, cores, seen) for node_id, node in booted.items()}


def _parting(node: Booted, cores: Mapping[str, AxisCore], seen: Mapping[str, bool]) -> NodeShutdown:
    ours = [cores[name] for name in node.parameters if name in cores and cores[name].touched]
    if not all(seen.get(core.parameters.name, core.rests) for core in ours):
        return NodeShutdown.ARMED
    return NodeShutdown.AS_FOUND if node.found_enabled and not ours else NodeShutdown.REST


def lost_without_axes(event: NodeEvent, starved: str) -> NodeError:
    """Return the error that stops the cell when a node without axes is lost; ``starved``: text of ``Starvation``."""
    remedy = 'check its supply and cable; with on_lost = "tell" in its table the axes continue'
    if not starved:
        return NodeError(
            f"node {event.node} {event.kind.value}", node=event.node, observed=str(event), remedy=remedy
        )
    return NodeError(
        f"{starved}, and node {event.node} {event.kind.value}",
        node=event.node,
        observed=str(event),
        remedy=join_remedies(REMEDY, f"if the node is lost: {remedy}"),
    )


def scan_failure(failure: BaseException, rescued: Collection[StopResult]) -> ScanError:
    """Return the error of closing after the scan had failed."""
    texts = [
        one_line(failure),
        *(f"then, without it: {each.axis}: {each.text}" for each in rescued),
    ]
    return ScanError(
        "the scan of the bus had failed",
        observed="\n            ".join(texts),
        remedy=join_remedies(alarm(rescued), remedy_of(failure)),
    )
