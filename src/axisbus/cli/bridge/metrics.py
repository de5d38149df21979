"""``axisbus bridge metrics``: the figures of a machine, for Prometheus."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.check.checked import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import port_option
from axisbus.cli.shared.paths import PATH
from axisbus.errors import AxisbusError, StateError
from axisbus.machine.machine import Machine

if TYPE_CHECKING:
    from axisbus.gateway.metrics.exporter import Exporter

_PORT = 9402
_LOOK = 1.0  # seconds between two looks at the machine, or for one


@click.command("metrics")
@click.argument("cell", type=PATH)
@port_option(_PORT)
@click.option(
    "--listen",
    metavar="ADDRESS",
    default="127.0.0.1",
    show_default=True,
    help="Another address of this computer: whoever reaches it can read them, without encryption.",
)
def command(cell: Path, port: int, listen: str) -> int:
    """Serve the figures of the machine of CELL for Prometheus: lateness, bus, nodes, EMCY, axes. It commands nothing.

    It joins the machine that runs, waits for one where none does, and for the next one where it ends; meanwhile axisbus_up is 0.
    What is unknown or too old is left out. Ctrl-C ends it.
    """
    if importlib.util.find_spec("prometheus_client") is None:
        raise StateError(
            "metrics need prometheus-client, which is not installed",
            remedy="install it: pip install axisbus[metrics]",
        )
    checked(cell)
    from axisbus.gateway.metrics.exporter import Exporter
    from axisbus.gateway.metrics.server import MetricsServer

    exporter = Exporter()
    server = MetricsServer(exporter, listen, port)
    try:
        say(f"served: {server.url}")
        while True:
            _follow(cell, exporter)
            time.sleep(_LOOK)
    finally:
        server.close()
    return OK


def _follow(cell: Path, exporter: Exporter) -> None:
    """Tell of the machine of a cell until it ends; return at once where none runs, or it cannot be joined, which is said."""
    try:
        machine = Machine.join(cell)
        if machine is None:
            return
        with machine:
            say("joined the machine that runs")
            exporter.machine = machine
            while not machine.session.ended:
                exporter.look()
                machine.sleep(_LOOK)
        say("the machine has ended")
    except AxisbusError as error:
        say(f"no machine is followed: {error.message}")
    finally:
        exporter.machine = None
