"""A plant on this computer: an endpoint of its own, and sessions that listen there or connect to it."""

from __future__ import annotations

import socket
from contextlib import suppress

import zenoh

from axisbus.fleet.network import ZenohNetwork, opened
from kit.fleet.fake_cell import FakeCell


def free_endpoint():
    """A free endpoint."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{taken.getsockname()[1]}"


class Plant:
    """Fake cells, each with a session of its own that listens at an endpoint."""

    def __init__(self, name="hall"):
        self.name = name
        self.endpoints = []
        self._ends = []

    def cell(self, name, axes=("x",), *, endpoint=None, **more):
        endpoint = endpoint or free_endpoint()
        session = opened(ZenohNetwork(listen=(endpoint,)))
        cell = FakeCell(session, self.name, name, axes, **more)
        self.endpoints.append(endpoint)
        self._ends += [session.close, cell.end]
        cell.cut = session.close
        return cell

    def end(self):
        while self._ends:
            with suppress(zenoh.ZError):  # a test has closed it
                self._ends.pop()()
