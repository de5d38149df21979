"""``axisbus bridge metrics``: the metrics of a machine, for Prometheus."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.check.run import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, listen_option, port_option
from axisbus.gateway.machine_follower import MachineFollower, Poll
from axisbus.machine.machine import Machine
from axisbus.optional_dependencies import require

if TYPE_CHECKING:
    from axisbus.gateway.metrics_exporter import Exporter

_PORT = 9402
_POLL_PERIOD = 1.0  # seconds between two updates of the counters


@click.command("metrics")
@click.argument("cell", type=PATH)
@port_option(_PORT)
@listen_option(
    "Another address of this computer: every computer that reaches it can read the figures, without encryption."
)
def command(cell: Path, port: int, listen: str) -> int:
    """Serve the metrics of the machine of CELL for Prometheus: lateness, bus, nodes, EMCY, axes. It commands nothing.

    It joins the running machine. If no machine is running, or when the machine ends, it waits for the next one; meanwhile
    axisbus_up is 0. Unknown and outdated values are left out. Ctrl-C ends it.
    """
    require("prometheus_client", "metrics need prometheus-client", "metrics")
    checked(cell)
    from axisbus.gateway.metrics_exporter import Exporter
    from axisbus.gateway.metrics_server import MetricsServer

    exporter = Exporter()
    server = MetricsServer(exporter, listen, port)
    try:
        say(f"served: {server.url}")
        MachineFollower(cell, say).run(lambda machine: _served(machine, exporter), _POLL_PERIOD)
    finally:
        server.close()
    return OK


@contextmanager
def _served(machine: Machine, exporter: Exporter) -> Iterator[Poll]:
    """Export the metrics of a machine."""
    exporter.machine = machine
    try:
        yield exporter.poll
    finally:
        exporter.machine = None
