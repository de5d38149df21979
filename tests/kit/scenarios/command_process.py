"""``axisbus`` in a process of its own, whose drives are in another.

``python -m kit.scenarios.command_process SOCKET CHANNEL DIE_IN ARGUMENTS...``:
DIE_IN is a function of ``os`` (such as ``fsync``): the process kills itself with SIGKILL in the middle of it; ``-`` for none.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections.abc import Callable
from typing import Any

from axisbus.cli.main import cli
from axisbus.cli.shared.common import run
from kit.scenarios.socket_bridge import Bridge


def _die(before: bool, done: Callable[..., Any]) -> Callable[..., Any]:
    def dying(*arguments: Any, **more: Any) -> Any:
        if not before:
            done(*arguments, **more)
        os.kill(os.getpid(), signal.SIGKILL)

    return dying


def main() -> int:
    """Run the command line on this end of the cable."""
    descriptor, channel, die_in, *arguments = sys.argv[1:]
    when, _, name = die_in.partition(" ")
    if name:
        setattr(os, name, _die(when == "before", getattr(os, name)))
    Bridge(channel, socket.socket(fileno=int(descriptor)))
    sys.argv = ["axisbus", *arguments]
    return run(cli)


if __name__ == "__main__":
    sys.exit(main())
