"""An OPC UA server on loopback, and requests of its tests."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest
from asyncua.common.utils import ServiceError
from asyncua.ua.uaerrors import UaStatusCodeError

from axisbus.cell import reader
from axisbus.gateway.opcua.server import OpcUaServer
from axisbus.web import address as page_address
from kit.opcua.client import ClientIdentity, Visit, visit

X, Y = "/Axes/x", "/Axes/y"


POSITION = f"{X}/PositionActualValue"


ANNA = ClientIdentity("anna", "right")


def until(seen, within=10.0):
    end = time.monotonic() + within
    while not (found := seen()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found


def refused(status):
    """A call that the server refuses with this status."""
    return pytest.raises((UaStatusCodeError, ServiceError), match=status)


@contextmanager
def served(file, keeping):
    listening, _ = page_address.opened("127.0.0.1", 0, tls=False)
    server = OpcUaServer(reader.load(file), "cell", listening, keeping)
    try:
        yield server
    finally:
        server.close()


def good(url):
    return until(lambda: visit(url, lambda seen: seen.value(POSITION))[1] == "Good")


async def halt(seen: Visit):
    return await seen.call(X, "Halt")


def address(server):
    return "127.0.0.1", int(server.url.rpartition(":")[2].partition("/")[0])


@contextmanager
def crowd_of(server, *addresses):
    """Connections that say nothing, from these addresses of this computer."""
    with ExitStack() as stack:
        yield [
            stack.enter_context(socket.create_connection(address(server), 3.0, (each, 0)))
            for each in addresses
        ]


def entered_again(server):
    with suppress(Exception):
        return visit(server.url, lambda seen: seen.value("/Running"))[1] == "Good"
    return False


def connections(server):
    return server._updater._server.bserver.clients


async def running(seen: Visit):
    return await seen.value("/Running")
