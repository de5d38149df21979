"""The reference of the command line, generated from the commands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from textwrap import dedent

import click
from texts import code, plain, table

from axisbus.cli.main import COMMANDS, cli

_ABOUT = """# Commands

`axisbus COMMAND --help` prints the same in the terminal. The rules for all commands (selection of the bus, exit codes,
colours, completion) are in [commissioning](../../commissioning.md#rules-for-all-commands).
"""


def pages() -> Mapping[str, str]:
    """Return a page for each command, and a page that lists them."""
    context = click.Context(cli, info_name="axisbus")
    rows = [(f"[`axisbus {name}`]({name}.md)", plain(about)) for name, (_, about) in COMMANDS.items()]
    names = "\n".join(COMMANDS)
    index = f"{_ABOUT}\n{table(('command', 'effect'), rows)}\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"
    each = {f"reference/cli/{name}": "\n".join(_described(context, name, 1)) for name in COMMANDS}
    return {"reference/cli/index": index, **each}


def _described(parent: click.Context, name: str, level: int) -> Iterator[str]:
    assert isinstance(parent.command, click.Group)
    command = parent.command.get_command(parent, name)
    assert command is not None
    context = click.Context(command, info_name=name, parent=parent)
    yield f"{'#' * level} `{context.command_path}`\n"
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    yield f"```text\n{usage}\n```\n"
    yield from _help(command)
    options = [*_options(command, context)]
    if options:
        yield table(("option", "effect"), options)
    if isinstance(command, click.Group):
        for each in command.list_commands(context):
            yield from _described(context, each, level + 1)


def _help(command: click.Command) -> Iterator[str]:
    """The paragraphs of a command's help; those that begin with \\b are kept as they are, as lines to type."""
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(command.help or "")):
        kept = paragraph.lstrip().startswith("\b")
        text = dedent(paragraph.replace("\b", "")).strip()
        yield f"```text\n{text}\n```\n" if kept else plain(" ".join(text.split())) + "\n"


def _options(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and record[1] and "--help" not in parameter.opts:
            yield code(record[0]), plain(record[1])
