"""Stop modules on a channel without the scan, as ``core.node_stop`` does for CANopen nodes."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import partial

from axisbus.bus.link.channel import Channel
from axisbus.cell.model import CellConfig
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.bus.run import send
from axisbus.drives.gim6010.can_simple.coexistence import identifiers
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue
from axisbus.drives.gim6010.cell.modules import settings_by_axis
from axisbus.errors import BusError
from axisbus.link import StopResult

_POLL = 0.005  # s


def stop_axes(cell: CellConfig, channel: Channel, names: Collection[str]) -> list[StopResult]:
    """Stop the axes of these names that belong to modules. Blocks as ``stop_modules``."""
    return stop_modules(channel, settings_by_axis(cell, names))


def holding(cell: CellConfig) -> frozenset[str]:
    """Return the axes of modules whose stop holds their position."""
    settings = settings_by_axis(cell, cell.driven)
    return frozenset(name for name, each in settings.items() if each.quick_stop_holds)


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
