"""Stop modules on a channel without the scan, as ``core.node_stop`` does for CANopen nodes; or both at the same time."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from functools import partial

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.cell.model import CellConfig
from axisbus.cia301.frame import CanFrame
from axisbus.core.node_stop import stop_nodes
from axisbus.drives.gim6010.bus.run import send
from axisbus.drives.gim6010.can_simple.coexistence import identifiers
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue
from axisbus.drives.gim6010.cell.modules import settings_by_axis
from axisbus.errors import BusError
from axisbus.link import StopResult

_POLL = 0.005  # s


def stop_drives(
    cell: CellConfig, channel: Channel, nodes: Iterable[CanopenNode], names: Collection[str]
) -> list[StopResult]:
    """Stop the axes of these names, of ``nodes`` and of modules; blocks until standstill, at most about 8 s.

    If there is no other thread for the modules, they come first, because their stop sequence is shorter.
    """
    modules = settings_by_axis(cell, names)
    works = [partial(stop_modules, channel, modules)] if modules else []
    works.append(partial(stop_nodes, channel.clock, cell, list(nodes), names))
    return [stopped for each in in_parallel(channel.clock, lambda work: work(), works) for stopped in each]


def stop_modules(channel: Channel, modules: Mapping[str, ModuleSettings]) -> list[StopResult]:
    """Stop the modules of these axes, all at the same time, and return the result of each. Blocks until standstill, at most 8 s."""
    heard: deque[CanFrame] = deque()
    rescues = {name: ModuleRescue(settings) for name, settings in modules.items()}
    ears = {
        can_id: partial(_hear, heard, can_id)
        for settings in modules.values()
        for can_id in identifiers(settings.node)
    }
    for can_id, ear in ears.items():
        channel.subscribe(can_id, ear)
    try:
        while not all(each.text for each in rescues.values()):
            _step(channel, heard, rescues)
            channel.clock.sleep(_POLL)
    finally:
        for can_id, ear in ears.items():
            channel.unsubscribe(can_id, ear)
    return [StopResult(name, each.ok, each.text) for name, each in rescues.items()]


def _step(channel: Channel, heard: deque[CanFrame], rescues: Mapping[str, ModuleRescue]) -> None:
    while heard:
        frame = heard.popleft()
        for each in rescues.values():
            each.receive(frame, frame.time)
    for each in rescues.values():
        for order in each.step(channel.clock.now()) if not each.text else ():
            with suppress(BusError):  # a frame that is not accepted now is sent again
                send(channel, order)


def _hear(heard: deque[CanFrame], can_id: int, data: bytes, stamp: float) -> None:
    heard.append(CanFrame(stamp, can_id, bytes(data)))
