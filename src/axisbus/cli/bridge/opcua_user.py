"""``axisbus bridge opcua-user``: a line for the file of who may call methods by OPC UA."""

from __future__ import annotations

import click

from axisbus.cli.shared.common import OK, say
from axisbus.gateway.opcua.users import line_of


@click.command("opcua-user")
@click.argument("name")
def command(name: str) -> int:
    """Ask for the password of NAME, twice, and print the line for the file of --users; what is kept is a hash."""
    line_of(name, "x")  # a name that may not be is told before anybody types a password
    password = click.prompt("password", hide_input=True, confirmation_prompt=True, err=True)
    say(line_of(name, password))
    return OK
