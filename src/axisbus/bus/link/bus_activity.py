"""Detect whether a machine is running on a bus, by listening only."""

from __future__ import annotations

import time

from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtState

_SLICE = 0.05  # s between two checks


def bus_activity(channel: Channel, listen: float) -> list[str]:
    """Listen for up to ``listen`` s; return texts of the first signs of a running machine: SYNC, PDOs, operational nodes.

    Raises:
        AdapterError: the channel failed.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "listening to the bus")
    seen: dict[str, None] = {}

    def note(text: str, state: int | None = None) -> Receiver:
        def receive(data: bytes, _: float) -> None:
            if state is None or (data and data[0] & 0x7F == state):
                seen[text] = None

        return receive

    ears: list[tuple[int, Receiver]] = [(cob.SYNC, note("SYNC is sent"))]
    for node_id in cob.NODE_IDS:
        ears.append((cob.HEARTBEAT + node_id, note(f"node {node_id} is operational", NmtState.OPERATIONAL)))
        ears.append((cob.TPDO[0] + node_id, note(f"node {node_id} sends PDOs")))
    for can_id, receiver in ears:
        channel.subscribe(can_id, receiver)
    try:
        end = time.monotonic() + listen
        while not seen and (left := end - time.monotonic()) > 0.0:
            channel.check()
            time.sleep(min(left, _SLICE))
    finally:
        for can_id, receiver in ears:
            channel.unsubscribe(can_id, receiver)
    channel.check()
    return list(seen)
