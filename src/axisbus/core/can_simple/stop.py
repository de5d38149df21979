"""Stopping modules on a channel without the scan, as ``core.node_stop`` does it for CANopen nodes."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from functools import partial

from axisbus.bus.dialogue.request import send
from axisbus.bus.link.channel import Channel
from axisbus.cia301.frame import Frame
from axisbus.drives.gim6010.can_simple.coexistence import identifiers
from axisbus.drives.gim6010.can_simple.port.rescue import ModuleRescue
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.errors import BusError
from axisbus.link import Stopped

_POLL = 0.005  # s


def stop_modules(channel: Channel, modules: Mapping[str, ModuleSettings]) -> list[Stopped]:
    """Stop the modules of these axes, all at a time, and return how each was left; blocks until they stand, at most about 8 s."""
    heard: deque[Frame] = deque()
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
            time.sleep(_POLL)
    finally:
        for can_id, ear in ears.items():
            channel.unsubscribe(can_id, ear)
    return [Stopped(name, each.ok, each.text) for name, each in rescues.items()]


def _step(channel: Channel, heard: deque[Frame], rescues: Mapping[str, ModuleRescue]) -> None:
    while heard:
        frame = heard.popleft()
        for each in rescues.values():
            each.receive(frame, frame.time)
    for each in rescues.values():
        for order in each.step(time.monotonic()) if not each.text else ():
            with suppress(BusError):  # what is not taken now is tried again
                send(channel, order)


def _hear(heard: deque[Frame], can_id: int, data: bytes, stamp: float) -> None:
    heard.append(Frame(stamp, can_id, bytes(data)))
