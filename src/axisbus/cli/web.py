"""``axisbus web``: serve the page in the browser for a machine that it opens or joins."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.check.run import checked
from axisbus.cli.shared.attach_or_open import machine_of, take_option
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.machine_status import MachineStatus
from axisbus.cli.shared.options import PATH, beside_option, port_option
from axisbus.machine.machine import Machine
from axisbus.machine.web_process import require_nicegui
from axisbus.system.terminal import enter_was_pressed
from axisbus.web import address as served
from axisbus.web.access.tokens import Role

if TYPE_CHECKING:
    from axisbus.web.server import PageServer

_POLL_PERIOD = 0.2  # seconds between two checks of the server and the terminal
_FINAL_TIME = 5.0  # seconds for which pages can still show how the machine ended
_PORT = 8402


@click.command("web")
@click.argument("cell", type=PATH)
@port_option(_PORT)
@click.option(
    "--listen",
    metavar="ADDRESS",
    default="127.0.0.1",
    help="An address other than loopback; needs --certificate and --key.",
)
@click.option("--certificate", type=PATH, help="The server's certificate (PEM), for https.")
@click.option("--key", type=PATH, help="The certificate's private key (PEM).")
@click.option(
    "--insecure",
    is_flag=True,
    help="Serve another address without https: every computer on the network can read the traffic.",
)
@click.option(
    "--look", is_flag=True, help="Serve observer pages: they may halt, stop and read, but not command."
)
@take_option
@beside_option
def command(
    cell: Path,
    port: int,
    listen: str,
    certificate: Path | None,
    key: Path | None,
    insecure: bool,
    look: bool,
    take: bool,
    beside: bool,
) -> int:
    """Serve a web page for CELL: it shows the machine and commands its axes. Energises nothing without a command of the user.

    It opens the machine, or joins the machine that is already running. It prints a link that admits one browser, once. After
    Ctrl-C, a machine that this command has opened is stopped and disabled. A machine that it has joined keeps running, and the
    axes that the page moves halt.
    """
    require_nicegui()
    tls = certificate_files(certificate, key)
    if not (tls or insecure or served.is_loopback(served.resolved(listen))):
        raise click.UsageError(
            f"{listen} can be reached by others: give --certificate and --key, or --insecure if the network is trusted"
        )
    checked(cell)
    listening, address = served.opened(listen, port, tls=tls is not None)
    with ExitStack() as stack:
        stack.callback(listening.close)
        # takes a second: import it only when it is needed
        from axisbus.web.server import PageServer, logging_aside

        machine = machine_of(cell, command=not look, take=take, beside=beside)
        with machine:
            stack.enter_context(logging_aside())
            server = PageServer(
                machine, address, listening, tls, MachineStatus(machine).lines, observes_only=look
            )
            stack.callback(server.end)  # after the machine has been left, so that nothing waits for a browser
            server.begin()
            _serve(server, machine, Role.OBSERVER if look else Role.OPERATOR)
    return OK


def certificate_files(certificate: Path | None, key: Path | None) -> tuple[Path, Path] | None:
    """Return the files of a server's certificate and its key, which are checked; None if neither is given.

    Raises:
        UsageError: only one is given.
        StateError: they cannot be used.
    """
    if (certificate is None) is not (key is None):
        raise click.UsageError(
            "a certificate and its key go together: give --certificate and --key, or neither"
        )
    if certificate is None or key is None:
        return None
    served.require_certificate(certificate, key)
    return certificate, key


def _serve(server: PageServer, machine: Machine, role: Role) -> None:
    """Serve until Ctrl-C, or until a joined machine has ended; Enter in the terminal prints another link.

    Raises:
        StateError: the server has ended unexpectedly.
    """
    while True:
        say(f"open this, once: {server.link(role)}")
        while not enter_was_pressed():
            machine.sleep(_POLL_PERIOD)
            server.require_alive()
            if machine.is_attached and machine.session.ended:
                say("the machine that it has joined has ended")
                time.sleep(_FINAL_TIME)
                return
