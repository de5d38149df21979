"""Drives that answer at once, each in a few lines: their position is the last target. Run as a process with a socket to serve.

Their TPDO 1 holds statusword, mode and position; or, ``split``, TPDO 1 to 3 hold one of them each. At every 50th SYNC one of them
sends an EMCY, a warning.
"""

from __future__ import annotations

import os
import socket
import struct
import sys

FRAME = struct.Struct("<IB3x8s")  # struct can_frame of Linux
TPDO, RPDO, SDO_TX, SDO_RX, HEARTBEAT = 0x180, 0x200, 0x580, 0x600, 0x700
TPDOS = (0x180, 0x280, 0x380)
_BEAT = 25  # SYNCs between two heartbeats of a node
EVENT = 50  # SYNCs between two EMCYs of the cell
_EMCY = bytes.fromhex("1042090000000000")  # 4210h, the temperature of the device
# The statusword of a drive for the lower bits of its controlword, and whether it is enabled then.
_SHOWN = {0x0: 0x0250, 0x6: 0x0231, 0x7: 0x0233, 0xF: 0x1637, 0x2: 0x0217}
_SIZES = {0x6040: 2, 0x6041: 2, 0x6060: 1, 0x6061: 1, 0x6071: 2, 0x6077: 2}
_UPLOADED = {1: 0x4F, 2: 0x4B, 4: 0x43}


class Drive:
    """One drive: statusword, mode and position follow its RPDO."""

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id
        self.position, self.mode, self.word = 0, 0, 0x0250

    def take(self, data: bytes) -> None:
        """RPDO 1: target position, mode, controlword."""
        self.position, self.mode, controlword = struct.unpack("<ibH", data[:7])
        self.word = _SHOWN.get(controlword & 0xF, 0x0250)

    def tpdos(self, *, split: bool) -> list[bytes]:
        """The frames that answer a SYNC."""
        values = (self.word, self.mode, self.position)
        if not split:
            return [FRAME.pack(TPDO + self.node_id, 7, struct.pack("<Hbi", *values))]
        packed = [struct.pack(f"<{code}", value) for code, value in zip("Hbi", values, strict=True)]
        return [
            FRAME.pack(base + self.node_id, len(data), data) for base, data in zip(TPDOS, packed, strict=True)
        ]

    def answer(self, request: bytes) -> bytes:
        """An SDO answer: every write is accepted, a read returns a value of the drive, else 0."""
        index = request[1] | request[2] << 8
        if request[0] >> 5 == 1:
            return b"\x60" + request[1:4] + bytes(4)
        size = _SIZES.get(index, 4)
        value = {0x6041: self.word, 0x6061: self.mode, 0x6060: self.mode, 0x6064: self.position}.get(index, 0)
        return bytes((_UPLOADED[size],)) + request[1:4] + (value & (1 << 8 * size) - 1).to_bytes(4, "little")


def serve(line: socket.socket, cyclic: socket.socket, count: int, *, split: bool = False) -> None:
    """Be ``count`` drives on ``line`` until it is closed; their TPDOs go to ``cyclic``, which may be the same."""
    drives = {number: Drive(number) for number in range(1, count + 1)}
    syncs = 0
    while True:
        try:
            frame = line.recv(16)
        except ConnectionError:
            return
        if not frame:
            return
        can_id, length, data = FRAME.unpack(frame)
        node_id, function = can_id & 0x7F, can_id & 0x780
        if can_id == 0x80:
            syncs += 1
            for drive in drives.values():
                for answer in drive.tpdos(split=split):
                    cyclic.send(answer)
            if syncs % EVENT == 0:
                line.send(FRAME.pack(0x80 + 1 + syncs // EVENT % count, 8, _EMCY))
            if syncs % _BEAT == 1:
                for number in drives:
                    line.send(FRAME.pack(HEARTBEAT + number, 1, b"\x05"))
        elif function == RPDO and node_id in drives:
            drives[node_id].take(data[:length])
        elif function == SDO_RX and node_id in drives:
            line.send(FRAME.pack(SDO_TX + node_id, 8, drives[node_id].answer(data)))


if __name__ == "__main__":
    first, second = (socket.socket(fileno=os.dup(int(number))) for number in sys.argv[1:3])
    serve(first, second, int(sys.argv[3]), split="split" in sys.argv)
