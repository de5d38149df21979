"""A watch over the threads of a running scan: none opens a file or imports a module, for a disk may take seconds to answer."""

from __future__ import annotations

import sys
import threading

_WATCHED = ("axisbus scan", "axisbus supervisor", "axisbus receive")
_EVENTS = ("open", "import", "subprocess.Popen", "os.listdir", "os.scandir")
_seen: list[str] = []


def _look(event: str, arguments: tuple[object, ...]) -> None:
    if event not in _EVENTS:
        return
    name = threading.current_thread().name
    if name.startswith(_WATCHED):
        _seen.append(f"{name}: {event} {arguments[0]}")


def begin() -> None:
    """Watch this process until it ends."""
    sys.addaudithook(_look)


def taken() -> list[str]:
    """Return, and forget, the observations."""
    found = _seen.copy()
    del _seen[: len(found)]
    return found
