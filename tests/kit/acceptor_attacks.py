"""Attacks of faulty or malicious programs of this user on the acceptor of a core; each attack returns the ends that it holds open.

``python -m kit.acceptor_attacks NAME CELL SECONDS`` repeats one for so long.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from axisbus.core.process import listener
from axisbus.ipc import messages as m
from axisbus.version import __version__

_LENGTH = struct.Struct("<I")
_HELD = 0.2  # seconds that an attack's ends are held open, if it is repeated


def enter(file: Path) -> socket.socket:
    """Go in as a guest does, and send no message yet."""
    admitted = listener.connect(str(file))
    assert admitted is not None
    line, image = admitted
    os.close(image)
    return line


def framed(data: bytes) -> bytes:
    return _LENGTH.pack(len(data)) + data


def attach(file: Path, version: str = __version__) -> bytes:
    return framed(m.CODEC.pack(m.Attach(version, listener.text_of(str(file)))))


def never_reads(file: Path) -> list[socket.socket]:
    line = enter(file)
    line.sendall(attach(file))
    questions = b"".join(
        framed(m.CODEC.pack(m.CoreQuery(number, "node_events"))) for number in range(1, 3000)
    )
    line.settimeout(0.5)
    with suppress(TimeoutError):
        line.sendall(questions + framed(m.CODEC.pack(m.Observe(True))))
    return [line]


def says(*parts: bytes | Callable[[Path], bytes]) -> Callable[[Path], list[socket.socket]]:
    def attack(file: Path) -> list[socket.socket]:
        line = enter(file)
        with suppress(OSError):  # it has been sent away already
            for part in parts:
                line.sendall(part(file) if callable(part) else part)
        return [line]

    return attack


def crowd(said: bytes, count: int) -> Callable[[Path], list[socket.socket]]:
    """Many connections at a time, each with the beginning of a request; surplus ones are closed."""

    def attack(file: Path) -> list[socket.socket]:
        name, lines = listener.machines_of(str(file))[0].name, []
        for _ in range(count):
            line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            line.settimeout(0.2)
            try:
                line.connect(name)
                line.sendall(said)
            except OSError:
                line.close()
                continue
            lines.append(line)
        return lines

    return attack


ATTACKS = {
    "nothing": says(),
    "junk": says(os.urandom(4096)),
    "half a message": says(lambda file: attach(file)[:-3]),
    "a huge length": says(_LENGTH.pack(0xFFFFFFFF), b"x" * 65536),
    "another version": says(lambda file: attach(file, "0.0.0")),
    "a message that is no first one": says(framed(m.CODEC.pack(m.Leave("")))),
    "deep lists": says(attach, framed(b"\x91" * 100_000 + b"\xc0")),
    "messages of the program's alone": says(
        attach,
        *(
            framed(m.CODEC.pack(one))
            for one in (m.OpenCell("", ""), m.CellOpened({}, {}, "", 0), m.RequestStop("me"))
        ),
        framed(m.CODEC.pack(m.CoreReply(1))),
    ),
    "a mad number": says(attach, framed(m.CODEC.pack(m.AddGroup("xy", ("nobody",)))), framed(b"\x01")),
    "one who never reads": never_reads,
    "a crowd": crowd(b"", 300),
    "a crowd that joins": crowd(b"a", 300),
    "a crowd that stops nothing": crowd(b"s\xff", 300),
    "a request that is none": crowd(b"s\x02\x00{}", 20),
    "a word that is none": crowd(b"x", 20),
}


def main(name: str, file: str, seconds: str) -> None:
    """Repeat an attack, and print how many connections it has made."""
    until, made = time.monotonic() + float(seconds), 0
    while time.monotonic() < until:
        with suppress(OSError, AssertionError):  # refused, or the acceptor did not answer in time
            lines = ATTACKS[name](Path(file))
            made += len(lines)
            time.sleep(_HELD if len(lines) == 1 else 0)
            for line in lines:
                line.close()
    print(made)


if __name__ == "__main__":
    main(*sys.argv[1:])
