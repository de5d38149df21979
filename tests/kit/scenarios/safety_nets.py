"""The safety nets that a scenario relies on, and how to cut them: a scenario that still passes then proves nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from unittest.mock import patch

from axisbus.boot.configure import DriveMonitoringSetup
from axisbus.boot.stop_report import NO_WATCHDOG
from axisbus.bus.cycle import CanCycle
from axisbus.core.node_stop import NodeStop
from axisbus.core.scan_thread import Supervisor
from axisbus.motion.stop.shutdown_stop import AxisShutdown
from axisbus.motion.stop.stop_sequence import StopSequence


def _reports_standstill(stop_sequence: StopSequence, *_: object) -> bool:
    stop_sequence.confirmed = True
    return True


def _nothing(*_: object) -> None:
    pass


_RESCUE = (
    (NodeStop, "_write_controlword", _nothing),
    (NodeStop, "_send_controlword", _nothing),
    (NodeStop, "_stop_node", _nothing),
)
# Net: its replacement (owner, attribute, replacement).
NETS: dict[str, tuple[tuple[type, str, object], ...]] = {
    "the stop sequence": (
        (StopSequence, "step", _reports_standstill),
        (AxisShutdown, "_seen_at_rest", True),
    ),
    "the quick stop of a dead scan": (
        (CanCycle, "quick_stop_all", _nothing),
        (CanCycle, "keep_stopping", lambda _: nullcontext()),
        *_RESCUE,
    ),
    "the supervisor": ((Supervisor, "_take_over", _nothing),),
    "the drive's watchdog": (
        (DriveMonitoringSetup, "arm", lambda *_: NO_WATCHDOG),
        (DriveMonitoringSetup, "arm_deadlines", lambda *_: NO_WATCHDOG),
    ),
    "the stop beside": _RESCUE,
}


_cut: list[str] = []


def patience(seconds: float) -> float:
    """Return how long to wait for a stop in real time: all of it, or 2 s where the nets are cut and none will come."""
    return min(seconds, 2.0) if _cut else seconds


@contextmanager
def cut(names: tuple[str, ...]) -> Iterator[None]:
    """Work without these nets."""
    with ExitStack() as stack:
        stack.callback(_cut.clear)
        _cut.extend(names)
        for name in names:
            for owner, attribute, replacement in NETS[name]:
                stack.enter_context(patch.object(owner, attribute, replacement))
        yield
