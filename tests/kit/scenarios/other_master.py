"""Other masters on a virtual channel: the frames that they send repeatedly, and a frame listener for all frames."""

from __future__ import annotations

import time
from typing import NamedTuple

import can

from kit.sending_device import Talker

TICK = 0.01  # seconds between two rounds


class RepeatedFrame(NamedTuple):
    """One frame and how often it comes: every so many rounds."""

    can_id: int
    data: str = ""  # hex digits
    remote: bool = False
    every: int = 1
    extended: bool = False


# One sign each, which a master of this kind cannot avoid.
SIGNS: dict[str, tuple[RepeatedFrame, ...]] = {
    "a heartbeat of 127": (RepeatedFrame(0x77F, "05", every=5),),
    "SYNC": (RepeatedFrame(0x80),),
    "SDO requests": (RepeatedFrame(0x601, "40 41 60 00 00 00 00 00", every=3),),
    "SDO requests to a node of no cell": (RepeatedFrame(0x605, "40 00 10 00 00 00 00 00", every=3),),
    "an NMT command": (RepeatedFrame(0x000, "01 05", every=5),),
    "RPDOs": (RepeatedFrame(0x201, "0F 00", every=2),),
    "node guarding": (RepeatedFrame(0x701, remote=True, every=5),),
    "LSS": (RepeatedFrame(0x7E5, "04 01 00 00 00 00 00 00", every=5),),
}
# Whole masters, as their default settings make them.
MASTERS: dict[str, tuple[RepeatedFrame, ...]] = {
    "lely": (
        RepeatedFrame(0x000, "01 00", every=10),
        RepeatedFrame(0x701, "05", every=5),
        RepeatedFrame(0x80),
    ),
    "ros2_canopen": (
        RepeatedFrame(0x80),
        RepeatedFrame(0x201, "0F 00 00 00 00 00"),
        RepeatedFrame(0x602, "40 64 60 00 00 00 00 00"),
    ),
    "a script on canopen": (RepeatedFrame(0x601, "2B 40 60 00 06 00 00 00", every=4),),
    "CODESYS": (
        RepeatedFrame(0x77F, "05", every=10),
        RepeatedFrame(0x80),
        RepeatedFrame(0x702, remote=True, every=10),
    ),
}
# Commands to the cell's drives in operation: the commanded drives, and the name in the event.
COMMANDS: dict[str, tuple[tuple[RepeatedFrame, ...], str, str]] = {
    "200 RPDOs per second": ((RepeatedFrame(0x201, "0F 00"),), "x", "RPDOs to node 1 (201h)"),
    "an RPDO that does not fit": ((RepeatedFrame(0x301, "0F", every=5),), "x", "RPDOs to node 1 (301h)"),
    "a controlword by SDO": (
        (RepeatedFrame(0x601, "2B 40 60 00 0F 00 00 00", every=9),),
        "x",
        "SDO requests that write to node 1 (601h)",
    ),
    "a target by SDO": (
        (RepeatedFrame(0x602, "23 7A 60 00 00 10 00 00", every=9),),
        "y",
        "SDO requests that write to node 2 (602h)",
    ),
    "a heartbeat time by SDO": (
        (RepeatedFrame(0x602, "2B 17 10 00 00 00 00 00", every=9),),
        "y",
        "SDO requests that write to node 2 (602h)",
    ),
    "SYNC": ((RepeatedFrame(0x80, every=7),), "xy", "SYNC (080h)"),
    "NMT start of all": ((RepeatedFrame(0x000, "01 00", every=9),), "xy", "NMT commands to all nodes (000h)"),
    "NMT start of one": ((RepeatedFrame(0x000, "01 02", every=9),), "y", "NMT commands to node 2 (000h)"),
}
# Frames of a master that command none of the cell's drives.
ASIDE: dict[str, tuple[tuple[RepeatedFrame, ...], str]] = {
    "reading by SDO": (
        (RepeatedFrame(0x601, "40 41 60 00 00 00 00 00", every=3),),
        "SDO requests to node 1 (601h)",
    ),
    "an object of the maker's": (
        (RepeatedFrame(0x601, "2B 00 20 00 0F 00 00 00", every=9),),
        "SDO requests to node 1 (601h)",
    ),
    "a heartbeat of 127": ((RepeatedFrame(0x77F, "05", every=5),), "heartbeats of node 127 (77Fh)"),
    "NMT of a node of no cell": ((RepeatedFrame(0x000, "01 32", every=9),), "NMT commands (000h)"),
    "LSS": ((RepeatedFrame(0x7E5, "5E 00 00 00 00 00 00 00", every=9),), "LSS requests (7E5h)"),
    "an SDO to a node of no cell": (
        (RepeatedFrame(0x632, "2B 40 60 00 0F 00 00 00", every=9),),
        "SDO requests to node 50 (632h)",
    ),
}
# Frames of devices and tools that only listen.
HARMLESS: dict[str, tuple[RepeatedFrame, ...]] = {
    "heartbeats of another slave": (RepeatedFrame(0x732, "05", every=5),),
    "its boot-up messages": (RepeatedFrame(0x732, "00", every=5),),
    "boot-up messages of 127": (RepeatedFrame(0x77F, "00", every=5),),
    "EMCY": (
        RepeatedFrame(0x081, "00 00 00 00 00 00 00 00", every=5),
        RepeatedFrame(0xB2, "10 81 11 00 00 00 00 00", every=5),
    ),
    "TPDOs": (
        RepeatedFrame(0x1B2, "37 06"),
        RepeatedFrame(0x2B2, "00"),
        RepeatedFrame(0x3B2, "00"),
        RepeatedFrame(0x4B2, "00"),
    ),
    "PDOs between other slaves": (RepeatedFrame(0x232, "37 06"),),
    "TIME": (RepeatedFrame(0x100, "00 00 00 00 98 3A", every=5),),
    "an SDO response": (RepeatedFrame(0x5B2, "80 00 10 00 00 00 02 06", every=5),),
    "LSS answers": (RepeatedFrame(0x7E4, "50 00 00 00 00 00 00 00", every=5),),
    "frames of 29 bits": (RepeatedFrame(0x80, extended=True), RepeatedFrame(0x1000077F, "05", extended=True)),
    "a remote frame for a TPDO": (RepeatedFrame(0x1B2, remote=True, every=5),),
}


class OtherMaster(Talker):
    """Sends frames repeatedly on a channel while its block lasts; ``counted`` is how many frames went out."""

    def __init__(self, channel: str, says: tuple[RepeatedFrame, ...], tick: float = TICK) -> None:
        super().__init__(channel)
        self.counted = 0
        self._says = says
        self._tick = tick

    def _talk(self) -> None:
        begin, rounds = time.monotonic(), 0
        while not self._over.wait(max(0.0, begin + rounds * self._tick - time.monotonic())):
            for one in self._says:
                if rounds % one.every == 0:
                    self._bus.send(_message(one))
                    self.counted += 1
            rounds += 1


def _message(one: RepeatedFrame) -> can.Message:
    return can.Message(
        arbitration_id=one.can_id,
        data=None if one.remote else bytes.fromhex(one.data),
        is_remote_frame=one.remote,
        is_extended_id=one.extended,
    )


class Ear:
    """Receives every frame on a channel while its block lasts; ``ids`` are the used COB-IDs."""

    def __init__(self, channel: str) -> None:
        self._bus = can.Bus(interface="virtual", channel=channel)
        self.heard: list[can.Message] = []

    def __enter__(self) -> Ear:
        return self

    def __exit__(self, *_: object) -> None:
        self.take()
        self._bus.shutdown()

    def take(self) -> None:
        """Take the received frames."""
        while (message := self._bus.recv(0)) is not None:
            self.heard.append(message)

    @property
    def ids(self) -> set[int]:
        """The COB-IDs of the taken frames."""
        return {message.arbitration_id for message in self.heard}
