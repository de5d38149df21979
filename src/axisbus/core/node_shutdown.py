"""The final treatment of each node when the machine closes: at rest, as found, or with its own watchdog left armed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from axisbus.boot.report import Booted
from axisbus.bus.node.events import NodeEvent
from axisbus.core.command_queue import COMMANDS_PER_CYCLE, QUEUE_LIMIT
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import AxisbusError, NodeError, ScanError, StateError, Stopped, one_line
from axisbus.link import NodeShutdown, StopResult, Unsafe, alarm
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.stop.diagnosis import join_remedies


def node_shutdowns(
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
    results = {stopped.axis: stopped.ok for stopped in rescued}
    return {
        node_id: armed.get(node_id) or _shutdown_of(node, cores, results) for node_id, node in booted.items()
    }


def _shutdown_of(node: Booted, cores: Mapping[str, AxisCore], results: Mapping[str, bool]) -> NodeShutdown:
    commanded = [cores[name] for name in node.parameters if name in cores and cores[name].touched]
    if not all(results.get(core.parameters.name, core.rests) for core in commanded):
        return NodeShutdown.ARMED
    return NodeShutdown.AS_FOUND if node.found_enabled and not commanded else NodeShutdown.REST


def lost_without_axes(event: NodeEvent, starved: str) -> NodeError:
    """Return the error that stops the cell when a node without axes is lost; ``starved``: text of ``Starvation``."""
    remedy = 'check its supply and cable; with on_lost = "report" in its table the axes continue'
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


# -- The errors of commands that the end of the scan, or of the machine, has ended -------------------------------------


_OPEN_AGAIN = "remove the cause, and open the machine again"
_MISTAKE = "a mistake in axisbus, or in an observer of its scan: report it with its traceback, and open the machine again"


def refused_while_leaving(what: str, reason: str) -> StateError:
    """Return the error of a command that came, or was queued, while the machine is being closed because of ``reason``."""
    return StateError(
        f"{what}: rejected: the machine is shutting down",
        observed=f"every axis is being stopped: {reason}",
        remedy="close it, and open it again to continue",
    )


def interrupted(what: str, reason: str) -> Stopped:
    """Return the error of a command that was queued when an interrupt of its program halted all axes."""
    return Stopped(f"{what} did not begin: {reason}")


def queue_full(what: str) -> StateError:
    """Return the error of a command that does not fit into the queue."""
    return StateError(
        f"{what}: too many commands are waiting",
        observed=f"{QUEUE_LIMIT} are waiting already, and the scan accepts {COMMANDS_PER_CYCLE} in each of its cycles; "
        "stops are always accepted",
        remedy="wait for the handles of commands before you give more, and add a short sleep to a loop that gives commands",
    )


_SENT = (
    "a quick stop was sent to every drive that this program had commanded, but its effect is not known: make sure that the "
    "axes are at standstill"
)
_NOT_SENT = "the quick stop could not be sent: TREAT EVERY DRIVE THAT THIS PROGRAM HAD COMMANDED AS MOVING: use the emergency stop"


def ended(what: str, failure: BaseException | None, quick_stop_sent: bool = False) -> ScanError:
    """Return the error of a command that ended with the scan, by ``failure`` or (None) because the machine was closed.

    ``quick_stop_sent``: the bus has accepted the quick stop of every commanded drive.
    """
    if failure is None:
        return ScanError(f"{what} was ended: the machine was closed", remedy="open it again to continue")
    error = ScanError(
        f"{what} was ended: the scan of the bus has failed",
        observed=one_line(failure, alarm=False),
        remedy=join_remedies(_SENT if quick_stop_sent else _NOT_SENT, remedy_of(failure)),
    )
    error.__cause__ = failure  # its traceback is then shown as well
    return error


def remedy_of(failure: BaseException) -> str:
    """Return the remedy for the failure of the scan."""
    if isinstance(failure, AxisbusError):
        return failure.remedy or _OPEN_AGAIN
    return _MISTAKE if isinstance(failure, Exception) else _OPEN_AGAIN
