"""Where the tests that need a bus run: python-can's virtual bus, or the SocketCAN link that AXISBUS_SOCKETCAN names."""

from __future__ import annotations

import os

LINK = os.environ.get("AXISBUS_SOCKETCAN", "")


def line(name: str) -> tuple[str, str]:
    """Return interface and channel for a test that wants a bus of its own called ``name``; on a real link all share that one."""
    return ("socketcan", LINK) if LINK else ("virtual", name)


def options(name: str) -> dict[str, str]:
    """Return the same as python-can's keyword arguments."""
    interface, channel = line(name)
    return {"interface": interface, "channel": channel}
