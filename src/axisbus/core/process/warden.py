"""The warden of a core: a small process that starts it, sees it end or hang, and then stops the drives in its place.

Theory of operation
-------------------
A program that is busy in a long call notices a dead core only when that returns; the warden does nothing else. It starts the core
before it imports anything, and imports what a rescue needs while the core boots. So all of that is there before a drive is enabled:
the core waits for it.

The core's end is seen by its process, and whether it hangs by the number of its images: one that stands still for ``patience``,
while the warden itself was on time (both asleep is a suspension), is of a core that is stuck as a whole, its own supervisor
included. It is killed, and seen to be dead, before anything is sent: two masters would be one too many.

The core in turn sees the end of the connection to its warden, and stops the axes: nobody would save them from its own death.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from axisbus.core.process.duty import Duty

if TYPE_CHECKING:  # the core is started first
    from axisbus.core.process.rescue import Rescuer

_ROUND = 0.02  # seconds
_ON_TIME = 0.1  # seconds; a round that takes longer shows that this computer did not run
_READY = b"r"


def run(duty: Duty) -> None:
    """Start the core, and watch it to its end; blocks."""
    near, far = socket.socketpair()
    arguments = (duty.line, duty.memory, duty.program, duty.drives, far.fileno(), duty.axes)
    core = subprocess.Popen(
        [sys.executable, "-P", "-m", "axisbus.core", "core", *map(str, arguments)],
        pass_fds=[far.fileno(), *duty.of_core],
        stdin=subprocess.DEVNULL,
    )
    far.close()
    os.close(duty.line)
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)  # the core's affair
    from axisbus.core.process.rescue import Rescuer

    with near:  # its end tells the core that nobody watches any more
        rescuer = Rescuer(duty)
        with suppress(OSError):  # it has ended already
            near.sendall(_READY)
        _watch(core, rescuer)


def _watch(core: subprocess.Popen[bytes], rescuer: Rescuer) -> None:
    """Wait for the end of the core, or make one; then stop its drives, if it has left any."""
    why = _end_of(core, rescuer)
    if rescuer.is_needed:
        rescuer.rescue(why)


def _end_of(core: subprocess.Popen[bytes], rescuer: Rescuer) -> str:
    number, idle, before = 0, 0.0, time.monotonic()
    while core.poll() is None:
        time.sleep(_ROUND)
        now = time.monotonic()
        idle += now - before if now - before < _ON_TIME else 0.0
        before = now
        if rescuer.number != number or not rescuer.runs:
            number, idle = rescuer.number, 0.0
        if idle > rescuer.patience:
            core.kill()
            core.wait()
            return f"it did no cycle for {idle:.2f} s, and was killed"
    return _ended(core.returncode)


def _ended(code: int) -> str:
    if code < 0:
        return f"it was ended by {signal.Signals(-code).name}"
    return f"it ended by itself, with exit code {code}"


def main(duty: str) -> None:
    """Do what the JSON of a ``Duty`` says."""
    run(Duty(**json.loads(duty)))
