"""Listen before the first frame is sent: is another master on the bus already?"""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.cia301 import cob
from axisbus.cia301.master_detection import ExpectedMasters, MasterDetector, MasterEvidence, Sign, words
from axisbus.cia301.nmt import NmtState
from axisbus.errors import SecondMasterError

# What else a sign may be, and the remedy for that.
_DEVICES = {
    Sign.HEARTBEAT: "if such a heartbeat is from a device, give that device another node ID",
    Sign.SYNC: 'if a device sends that SYNC, write sync_producer = "external" in [bus]',
}
_LINE = "\n            "  # under the text of ``observed``


def require_no_other_master(channel: Channel, expected: ExpectedMasters, seconds: float) -> None:
    """Listen for ``seconds`` without sending; blocks until then.

    Raises:
        SecondMasterError: another master, or a tool that acts as one, was heard.
        AdapterError: the channel failed.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "listening to the bus")
    detector = MasterDetector(expected)
    begin = channel.clock.now()
    with channel.frames_to(detector.note):
        channel.clock.sleep(seconds)
    channel.check()
    if detector.heard:
        raise refusal(channel.name, detector.heard, begin, seconds)


def refusal(name: str, heard: Iterable[MasterEvidence], begin: float, seconds: float) -> SecondMasterError:
    """Return the error for a bus on which ``heard`` was received in the ``seconds`` after ``begin``."""
    found = list(heard)
    first = min(one.first for one in found) - begin
    last = max(one.last for one in found) - begin
    lines = [
        f"listened for {seconds:g} s; the first sign came after {first:.3f} s, the last after {last:.3f} s:",
        *words(found),
        "it is not known which program sends them, and on which computer (a frame has no sender)",
    ]
    devices = [_DEVICES[sign] for sign in dict.fromkeys(one.sign for one in found) if sign in _DEVICES]
    remedy = [
        "close the other program, and open again",
        *devices,
        "to open the bus nevertheless, for example if a device sends them: --beside, Machine.open(..., "
        "allow_other_master=True) or beside = true",
        "in [bus]; two masters command the same drives, each overrides the commands of the other, and the master that "
        "closes first stops them",
    ]
    return SecondMasterError(
        f"another master, or a tool that acts as one, is on the bus {name}; this program sent nothing",
        heard=tuple(words(found)),
        observed=_LINE.join(lines),
        remedy=_LINE.join(remedy),
    )


# -- Detect whether a machine is running on a bus, by listening only ---------------------------------------------------


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

    subscriptions: list[tuple[int, Receiver]] = [(cob.SYNC, note("SYNC is sent"))]
    for node_id in cob.NODE_IDS:
        subscriptions.append(
            (cob.HEARTBEAT + node_id, note(f"node {node_id} is operational", NmtState.OPERATIONAL))
        )
        subscriptions.append((cob.TPDO[0] + node_id, note(f"node {node_id} sends PDOs")))
    for can_id, receiver in subscriptions:
        channel.subscribe(can_id, receiver)
    try:
        end = channel.clock.now() + listen
        while not seen and (left := end - channel.clock.now()) > 0.0:
            channel.check()
            channel.clock.sleep(min(left, _SLICE))
    finally:
        for can_id, receiver in subscriptions:
            channel.unsubscribe(can_id, receiver)
    channel.check()
    return list(seen)
