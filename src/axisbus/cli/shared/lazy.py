"""A group of subcommands that are imported only when they run, so that ``--help`` is fast."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Mapping
from typing import Any

import click

Table = Mapping[
    str, tuple[str, str]
]  # name -> (module with ``command``, or ``module:name``; one line for --help)

HELP_OPTIONS = ("-h", "--help")


class LazyGroup(click.Group):
    """A group with a table of its subcommands; imports only the requested one. Its help is shown by ``-h`` too."""

    def __init__(self, *args: Any, table: Table, **kwargs: Any) -> None:
        super().__init__(*args, context_settings={"help_option_names": list(HELP_OPTIONS)}, **kwargs)
        self._table = table

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's signature
        """Return the names in the order of the table."""
        return list(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return one subcommand."""
        if cmd_name not in self._table:
            return None
        module, _, name = self._table[cmd_name][0].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name or "command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the subcommand; suggest similar ones for an unknown name."""
        name = args[0]
        if name not in self._table and not name.startswith("-"):
            similar_names = self._similar(ctx, name)
            hint = (
                f"; did you mean {' or '.join(similar_names)}?"
                if similar_names
                else f"; {ctx.command_path} -h lists all"
            )
            ctx.fail(f"there is no command {name!r}{hint}")
        return super().resolve_command(ctx, args)

    def _similar(self, ctx: click.Context, name: str) -> list[str]:
        """Return the commands with this name one level below, else those with a similar name."""
        inner = [
            f"{ctx.command_path} {group} {name}"
            for group in self._table
            if isinstance(found := self.get_command(ctx, group), LazyGroup)
            and name in found.list_commands(ctx)
        ]
        matches = difflib.get_close_matches(name.lower(), self._table, n=3, cutoff=0.6)
        return inner or [f"{ctx.command_path} {each}" for each in matches]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self._table.items()])
