"""What a machine runs on: the scan's cycle and ports, the booted nodes, and how to let all of it go."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial

from axisbus.boot.node import Booted
from axisbus.bus.link.controller import ControllerEvent
from axisbus.cell.model import CellConfig
from axisbus.cia301.drops import Drop
from axisbus.cia402.port import Cycle, Port
from axisbus.core.node_access import NodeAccess
from axisbus.core.parting import Parting, Stopped, partings
from axisbus.core.pickup import Late
from axisbus.core.stand_in import StandIn
from axisbus.eds import load
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters
from axisbus.wording import counted


def _nothing() -> None:
    """Nothing to wait for."""


def _no_time(_now: float) -> datetime | None:
    """TIME is not heard."""
    return None


@dataclass(slots=True)
class Runtime:
    """A cell on its bus, booted but not yet scanned.

    ``ready`` waits for what the scan needs before its first cycle (SYNC of another producer). ``bus_time`` returns what TIME of
    another producer says at a monotonic time, None where none was heard; ``bus_events`` what the CAN controller has told, ``drops``
    which frames were dropped. At the end, each called once: ``rescue`` stops the axes with these names where the scan has failed,
    ``let_go`` leaves the nodes, ``release`` closes the rest. ``late`` are optional nodes that may still come.
    """

    cycle: Cycle
    ports: dict[str, Port]
    booted: dict[int, Booted]
    nodes: dict[int, NodeAccess]
    rescue: Callable[[Collection[str]], list[Stopped]]
    let_go: Callable[[Mapping[int, Parting]], None]
    release: list[Callable[[], None]] = field(default_factory=list)
    stand_ins: dict[int, StandIn] = field(default_factory=dict)
    late: dict[int, Late] = field(default_factory=dict)
    ready: Callable[[], object] = _nothing
    bus_time: Callable[[float], datetime | None] = _no_time
    bus_events: Callable[[], Sequence[ControllerEvent]] = tuple
    drops: Callable[[], Sequence[Drop]] = tuple

    @property
    def parameters(self) -> dict[str, AxisParameters]:
        """The parameters of every axis whose node came up, by name."""
        up = [booted for booted in self.booted.values() if booted.report.ok]
        return {name: value for booted in up for name, value in booted.parameters.items()}

    def leave(self, cores: Mapping[str, AxisCore] | None = None, rescued: Iterable[Stopped] = ()) -> None:
        """Leave the nodes as is right for each, and release everything, whatever fails on the way; as ``parting.partings``."""
        works: list[Callable[[], None]] = [
            partial(self.let_go, partings(self.booted, cores or {}, rescued)),
            *self.release,
        ]
        for work in works:
            with suppress(AxisbusError, OSError):
                work()


def load_dictionaries(cell: CellConfig) -> dict[int, Eds]:
    """Read the EDS or DCF of every node; blocks for as long as that takes.

    Raises:
        EdsError: one is missing or cannot be read.
    """
    return {
        node_id: load(resolve(node.file or "", cell.folder)) for node_id, node in sorted(cell.nodes.items())
    }


def require_all(booted: Mapping[int, Booted]) -> None:
    """Raise what kept nodes from coming up that are not optional: one ``BootError``, or a group of them."""
    needed = [node.report for node in booted.values() if not node.report.optional]
    errors = [report.error for report in needed if report.error is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise ExceptionGroup(f"{len(errors)} of {counted(len(booted), 'node')} did not come up", errors)
