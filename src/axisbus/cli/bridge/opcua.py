"""``axisbus bridge opcua``: an OPC UA server for a machine."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cell.model import CellConfig
from axisbus.check.run import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, listen_option, port_option
from axisbus.cli.web import certificate_files
from axisbus.errors import StateError
from axisbus.gateway.machine_events import MachineEventSource
from axisbus.gateway.machine_follower import MachineFollower, Poll
from axisbus.gateway.opcua import users as known
from axisbus.gateway.opcua.event_mapping import opcua_events
from axisbus.gateway.opcua.server_options import Given, ServerOptions, decide
from axisbus.machine.machine import Machine
from axisbus.optional_dependencies import require
from axisbus.web import address as served

if TYPE_CHECKING:
    from axisbus.gateway.opcua.server import OpcUaServer


_PORT = 4840


_POLL_PERIOD = 0.5  # seconds between two checks for events


@click.command("opcua")
@click.argument("cell", type=PATH)
@port_option(_PORT)
@listen_option("Another address of this computer; needs --certificate and --key, or --insecure.")
@click.option("--certificate", type=PATH, help="The server's certificate (PEM): all channels are encrypted.")
@click.option("--key", type=PATH, help="The certificate's private key (PEM).")
@click.option("--trust", type=PATH, help="A folder with the certificates of the clients that may connect.")
@click.option("--users", type=PATH, help="A file of names and passwords (axisbus bridge opcua-user).")
@click.option(
    "--insecure", is_flag=True, help="Let every client that reaches the address read, without encryption."
)
@click.option(
    "--allow-reset", is_flag=True, help="Let users reset faults; without it, they may only halt and stop."
)
@click.option(
    "--rate",
    type=click.IntRange(1, 50),
    default=10,
    show_default=True,
    help="How many times per second values are sampled.",
)
def command(
    cell: Path,
    port: int,
    listen: str,
    certificate: Path | None,
    key: Path | None,
    trust: Path | None,
    users: Path | None,
    insecure: bool,
    allow_reset: bool,
    rate: int,
) -> int:
    """Serve the machine of CELL by OPC UA: its axes, read-only, and its faults as events; users may halt and stop.

    It joins the running machine. If no machine is running, or when the machine ends, it waits for the next one; meanwhile all
    values have a bad status. Without --users no client can call a method. Ctrl-C ends it.
    """
    require("asyncua", "OPC UA needs asyncua", "opcua")
    encrypted = certificate_files(certificate, key) is not None
    loopback = served.is_loopback(served.resolved(listen))
    access = decide(Given(loopback, encrypted, trust is not None, users is not None, insecure))
    config = checked(cell)
    allowed = None if users is None else known.read(users)
    server_options = ServerOptions(access, certificate, key, trust, allowed, allow_reset, float(rate))
    listening, _ = served.opened(listen, port, tls=encrypted)
    with closing(listening):
        server = make_server(config, cell.stem, listening, server_options)
        with closing(server):
            say(f"served: {server.url}")
            _serve(cell, server)
    return OK


def make_server(
    cell: CellConfig, name: str, listening: socket.socket, server_options: ServerOptions
) -> OpcUaServer:
    """Return the server on a bound socket; blocks for seconds while its library is loaded.

    Raises:
        StateError, ConfigError: as ``OpcUaServer``.
    """
    from axisbus.gateway.opcua.server import OpcUaServer

    return OpcUaServer(cell, name, listening, server_options)


def _serve(cell: Path, server: OpcUaServer) -> None:
    """Follow one machine after the other.

    Raises:
        StateError: the server has ended unexpectedly.
    """
    event_source = MachineEventSource()
    MachineFollower(cell, say).run(
        lambda machine: _served(machine, server, event_source), _POLL_PERIOD, lambda: server.alive
    )
    raise StateError("the OPC UA server has ended unexpectedly", remedy="start it again")


@contextmanager
def _served(machine: Machine, server: OpcUaServer, event_source: MachineEventSource) -> Iterator[Poll]:
    """Serve a machine and its events."""
    server.follow(machine)
    try:
        yield lambda: server.report(opcua_events(event_source.poll(machine, server.now())), _devices(machine))
    finally:
        server.follow(None)


def _devices(machine: Machine) -> tuple[str, ...]:
    return tuple(
        f"{report.node_id}: {report.device or 'not identified'}{f' ({report.identity})' if report.identity else ''}"
        for report in machine.reports
    )
