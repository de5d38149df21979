"""The processes that a program starts (``core.process.launch``), and one that its first one does: ``warden``, ``core``, ``drives``.

The arguments are numbers of descriptors that are inherited, process IDs and paths; those of a warden are one ``Duty`` as JSON.
"""

from __future__ import annotations

import logging
import mmap
import os
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path


def core(near: str, memory: str, program: str, drives: str, warden: str, axes: str) -> None:
    """Serve the program with this process ID until one of both is gone."""
    from axisbus.core.process.server import Server, StreamHandler
    from axisbus.wire.messages import CODEC
    from axisbus.wire.stream import Stream

    stream = Stream(_end(near), CODEC.pack, "axisbus answers")
    logging.getLogger("axisbus").addHandler(StreamHandler(stream))
    line = None if int(drives) < 0 else _end(drives)
    server = Server(stream, mmap.mmap(int(memory), 0), int(axes), _end(warden), line)
    with suppress(
        OSError, AttributeError
    ):  # it is gone already, which the connection tells; or the platform has none
        server.watch(os.pidfd_open(int(program)))
    server.run()


def drives(line: str, control: str, cell: str) -> None:
    """Simulate the drives of a cell until its core and its program are gone."""
    from axisbus.core.process.drives import serve

    serve(_end(line), _end(control), Path(cell))


def _end(number: str) -> socket.socket:
    return socket.socket(fileno=int(number))


def warden(duty: str) -> None:
    """Start a core, and stop its drives if it dies."""
    from axisbus.core.process.warden import main

    main(duty)


_MAINS: dict[str, Callable[..., None]] = {"core": core, "drives": drives, "warden": warden}

if __name__ == "__main__":
    _MAINS[sys.argv[1]](*sys.argv[2:])
