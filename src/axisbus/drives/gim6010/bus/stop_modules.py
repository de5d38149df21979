"""Stop modules on a channel without the scan, whichever program enabled them, as ``core.node_stop`` does for CANopen nodes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack

from axisbus.bus.link.channel import Channel
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.bus.run import frames_of, send
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.port.stop_without_scan import ModuleRescue
from axisbus.errors import BusError
from axisbus.link import StopResult

_POLL = 0.005  # s
_LONGEST = 30.0  # s to brake on a very slow ramp, if no program waits for the stop


def stop_modules(
    channel: Channel,
    modules: Mapping[str, ModuleSettings],
    *,
    alone: bool = False,
    impatience: Callable[[], int] = lambda: 0,
) -> list[StopResult]:
    """Stop the modules of these axes, all at the same time, and return the result of each; blocks until standstill.

    That is at most 12 s. ``alone``: the modules belong to no cell: their encoder counts are not available in idle, and a very slow
    ramp is waited for, for 30 s. Each time that ``impatience()`` grows, the next step of the stop sequence begins.
    """
    heard: deque[CanFrame] = deque()
    rescues = {
        name: ModuleRescue(each, counts=False, longest=_LONGEST) if alone else ModuleRescue(each)
        for name, each in modules.items()
    }
    patience = impatience()
    with ExitStack() as stack:
        for settings in modules.values():
            stack.enter_context(frames_of(channel, settings.node, heard))
        while not all(each.text for each in rescues.values()):
            if impatience() > patience:
                patience += 1
                for each in rescues.values():
                    each.escalate(channel.clock.now())
            _step(channel, heard, rescues)
            channel.clock.sleep(_POLL)
    return [StopResult(name, each.ok, each.text) for name, each in rescues.items()]


def _step(channel: Channel, heard: deque[CanFrame], rescues: Mapping[str, ModuleRescue]) -> None:
    while heard:
        frame = heard.popleft()
        for each in rescues.values():
            each.receive(frame, frame.time)
    for each in rescues.values():
        for order in each.step(channel.clock.now()) if not each.text else ():
            _send(channel, order)


def _send(channel: Channel, order: Outgoing) -> None:
    """Send a frame, also on a channel that no longer receives; a frame that is not accepted now is sent again."""
    try:
        send(channel, order)
    except BusError:
        if not order.remote:
            channel.send_urgent([(order.can_id, order.data)])
