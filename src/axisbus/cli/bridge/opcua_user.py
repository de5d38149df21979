"""``axisbus bridge opcua-user``: print a line for the file of users that may call methods by OPC UA."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import OK, say
from axisbus.gateway.opcua.users import line_of

if TYPE_CHECKING:
    pass


@click.command("opcua-user")
@click.argument("name")
def opcua_user_command(name: str) -> int:
    """Ask for the password of NAME, twice, and print the line for the file of --users; the line contains a hash of the
    password.

    If standard input is not a terminal, its first line is the password.
    """
    line_of(name, "x")  # report an invalid name before the user types a password
    say(line_of(name, _password()))
    return OK


def _password() -> str:
    if sys.stdin is None or not sys.stdin.isatty():
        return "" if sys.stdin is None else sys.stdin.readline().rstrip("\r\n")
    return str(click.prompt("password", hide_input=True, confirmation_prompt=True, err=True))
