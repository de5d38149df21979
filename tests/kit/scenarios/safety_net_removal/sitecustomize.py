"""Removes safety nets in every process that a program starts: Python imports this automatically, if its folder is on the path.

``AXISBUS_CUT`` names them (joined by ``;``), each of ``NETS``.
"""

from __future__ import annotations

import math
import os
import signal

_LONGEST = 300  # seconds: a core that nothing ends must not outlive a test that was killed itself


def _live_no_longer() -> None:
    signal.alarm(_LONGEST)


def _nothing(*_: object) -> None:
    pass


def _cut(name: str) -> None:
    from axisbus.core.process import rescue, server, signal_forwarding
    from axisbus.ipc import own_socket, stream

    if name == "the core's eye on its program":
        server.CoreServer._leave = _nothing  # type: ignore[method-assign]
    elif name == "the core's eye on the process of its program":
        server.CoreServer.watch = _nothing  # type: ignore[method-assign]
    elif name == "the eyes on the program's descriptors":
        stream.MessageStream.watch_for_loss = _nothing  # type: ignore[method-assign]
        own_socket.FarEnd.lost = False  # type: ignore[method-assign,assignment]
    elif name == "the core's check of its watchdog process":
        server.CoreServer._monitor_watchdog = _nothing  # type: ignore[method-assign]
    elif name == "the core's ear for its program":
        signal_forwarding.SignalForwarder.poll = _nothing  # type: ignore[method-assign,assignment]
    elif name == "the rescue":
        rescue.CrashStop.rescue = _nothing  # type: ignore[method-assign]
    elif name == "the watchdog process's patience":
        rescue.CrashStop.patience = lambda *_: math.inf  # type: ignore[method-assign,assignment]
    else:
        raise SystemExit(f"no such net: {name}")


_live_no_longer()
os.register_at_fork(after_in_child=_live_no_longer)
for _name in filter(None, os.environ.get("AXISBUS_CUT", "").split(";")):
    _cut(_name)
