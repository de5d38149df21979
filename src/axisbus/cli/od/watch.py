"""``axisbus od watch``: read objects periodically, and show changes."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack, suppress

import click

from axisbus.cli.od import objects as od
from axisbus.cli.shared.attached_nodes import NodeLookup, open_nodes
from axisbus.cli.shared.common import FAILURE, OK, say
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, node_options, require_bus
from axisbus.cli.shared.numbers import Seconds
from axisbus.errors import SdoError


@click.command("watch")
@click.argument("arguments", metavar="NODE:OBJECT...", nargs=-1, required=True, shell_complete=od.complete)
@node_options
@click.option(
    "--every",
    type=Seconds(0.01),
    default=0.5,
    show_default=True,
    help="Seconds between two reads.",
)
@click.option("--count", type=click.IntRange(min=1), help="How many reads; without it, until Ctrl-C.")
@click.option("--all", "everything", is_flag=True, help="Show every read, not only changes.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line.")
def command(
    arguments: tuple[str, ...],
    asked: NodeOptions,
    every: float,
    count: int | None,
    everything: bool,
    as_json: bool,
) -> int:
    """Read objects periodically and show changes; writes nothing. A node that does not answer is reported and read again.

    Exit code 3 when the last read got no answer.
    """
    require_bus(asked)
    files = NodeFiles.of(asked.cell, asked.eds)
    wanted = od.targets(files, arguments)
    with ExitStack() as stack:
        nodes = open_nodes(stack, asked, files, {each.address.node_id for each in wanted})
        look = _Look(nodes, files, wanted, everything, as_json)
        looks, due = 0, time.monotonic()
        with suppress(KeyboardInterrupt):  # the normal end of watching
            while count is None or looks < count:
                time.sleep(max(0.0, due - time.monotonic()))
                look.once()
                looks, due = looks + 1, max(due + every, time.monotonic())
    return FAILURE if look.silent else OK


class _Look:
    """The observed objects; holds state: the last value of each object, and whether the last reading failed."""

    def __init__(
        self,
        nodes: NodeLookup,
        files: NodeFiles,
        wanted: list[od.ObjectTarget],
        everything: bool,
        as_json: bool,
    ) -> None:
        self._nodes, self._files, self._wanted = nodes, files, wanted
        self._everything, self._as_json = everything, as_json
        self._start = time.monotonic()
        self._shown: dict[tuple[int, int, int], str] = {}
        self.silent = False

    def once(self) -> None:
        """Read all objects once; blocks."""
        self.silent = False
        for target in self._wanted:
            self._one(target)

    def _one(self, target: od.ObjectTarget) -> None:
        node_id, entry = target.address.node_id, target.entry
        try:
            value = od.read(self._files, self._nodes.node(node_id), entry)
            text, plain = od.line(value), od.plain(node_id, value)
        except SdoError as error:
            self.silent = True
            text, plain = (
                f"{entry}: {error.message}",
                {"node": node_id, "index": entry.index, "subindex": entry.subindex, "error": error.message},
            )
        key = (node_id, entry.index, entry.subindex)
        if self._shown.get(key) == text and not self._everything:
            return
        self._shown[key] = text
        now = time.monotonic() - self._start
        say(
            json.dumps({"time": round(now, 6), **plain})
            if self._as_json
            else f"{now:10.3f}  node {node_id}  {text}"
        )
