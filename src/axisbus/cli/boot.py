"""``axisbus boot``: boot the nodes of a cell and report each."""

from __future__ import annotations

import itertools
import threading
from pathlib import Path

import click

from axisbus.boot.report import NodeReport
from axisbus.cell import reader
from axisbus.cell.other_protocols import canopen_nodes
from axisbus.cli.shared.attach_or_open import running, take_option
from axisbus.cli.shared.common import (
    FAILURE,
    OK,
    ProgressLine,
    progress_line,
    say,
    say_error,
    say_json,
    say_next,
    say_note,
)
from axisbus.cli.shared.options import PATH, beside_option
from axisbus.core.process.launch import expected
from axisbus.errors import BootError, StateError
from axisbus.link import alarm
from axisbus.machine.node_access import NodeAccess
from axisbus.machine.opening import boot
from axisbus.wording import counted

_LABEL = "booting"
_STEPS = 10  # of a boot-up (cia302.bootup)
_RECONNECT_HELP = "Open the CAN adapter of the running machine again, after it was unplugged or its link was down; then boot nodes."
_NODE_HELP = "Boot this node of the running machine, whose other axes continue; may be repeated."


class _BootProgress:
    """Output while nodes boot; called in their threads; holds the nodes whose program download runs."""

    def __init__(self, line: ProgressLine | None, *, quiet: bool) -> None:
        self._line = line
        self._quiet = quiet
        self._lock = threading.Lock()
        self._nodes: set[int] = set()

    def note_booted(self, done: int, total: int) -> None:
        """Note the number of booted nodes."""
        if self._line is not None:
            with self._lock:
                self._line.label(_LABEL)
                self._line.update(done, total)

    def program(self, node: int, done: int, total: int | None) -> None:
        """Note the progress of a node's program download in bytes."""
        with self._lock:
            if node not in self._nodes and not self._quiet:
                size = "of a size that is not known" if total is None else counted(total, "byte")
                say_note(f"node {node}: its program is being replaced, {size}; do not switch it off")
            self._nodes.add(node)
            if self._line is not None:
                self._line.label(f"{_LABEL}, node {node}: program {done * 100 // max(1, total or 0)} %")

    def interrupted(self, cell: Path) -> None:
        """Report the consequences of an interruption during a program download."""
        if self._nodes:
            nodes = ", ".join(map(str, sorted(self._nodes)))
            say_note(
                f"interrupted while programs were being replaced (node {nodes}): a node cannot be used after an interrupted "
                f"download until a download has succeeded; next: axisbus boot {cell}"
            )


@click.command("boot")
@click.argument("cell", type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print the reports as JSON.")
@beside_option
@click.option("--node", "wanted", type=int, multiple=True, metavar="ID", help=_NODE_HELP)
@click.option("--reconnect", is_flag=True, help=_RECONNECT_HELP)
@take_option
def command(
    cell: Path, as_json: bool, beside: bool, wanted: tuple[int, ...], reconnect: bool, take: bool
) -> int:
    """Boot and configure the nodes of CELL, report on each, and release them; energises nothing.

    With --node, boot nodes of the running machine that were lost, have restarted or were replaced, while the other axes continue.
    Their axes then wait for a reset. With --reconnect, the machine first opens its CAN adapter again, and stops each axis that had
    been commanded; then all its CANopen nodes are booted, or those of --node.

    If [nodes.N.program] says download = true and a node has a program other than the expected one, the expected program is
    downloaded first, which may take minutes.

    For each node, the report shows its identity, the result of its boot-up (with the letter of CiA 302-2, A to O, if the
    standard defines one), the stop sequence of each axis, and how the node detects the loss of the master. Exit code 3 when a node
    that is not optional did not come up.
    """
    if wanted or reconnect:
        return _boot_in_machine(cell, wanted, reconnect=reconnect, take=take, as_json=as_json)
    with progress_line(_LABEL, quiet=as_json) as line:
        boot_progress = _BootProgress(line, quiet=as_json)
        try:
            reports = boot(cell, boot_progress.note_booted, boot_progress.program, beside=beside)
        except KeyboardInterrupt:
            boot_progress.interrupted(cell)
            raise
    failed = [report for report in reports if not report.ok and not report.optional]
    up = sum(report.ok for report in reports)
    if as_json:
        say_json([report.as_json() for report in reports])
        return FAILURE if failed else OK
    for report in reports:
        say(report.text())
    config = reader.load(cell)
    say(f"{up} of {counted(len(reports), 'node')} came up")
    for name, axis in config.axes.items():
        if axis.encoder is not None:
            say(f"axis {name} is an encoder: its position is that of [io.{axis.encoder}]")
        elif axis.virtual:
            say(f"axis {name} is virtual: only the core moves it, without a node")
    say_note(f"the core of a program that opens this cell will run {expected(config.bus)}")
    if failed:
        say_next(
            "fix the cause shown after FAILED, and boot again; to list the nodes: axisbus scan " + str(cell)
        )
        return FAILURE
    homing = f", or axisbus home {cell}" if any(report.axes for report in reports) else ""
    say_next(f"axisbus monitor {cell}{homing}")
    return OK


def _boot_in_machine(
    cell: Path, nodes: tuple[int, ...], *, reconnect: bool, take: bool, as_json: bool
) -> int:
    """Boot nodes of the running machine one after the other, and report each; a node that does not boot does not end it.

    ``reconnect``: open its adapter again before; without ``nodes``, all are booted.
    """
    why, remedy = "boots nodes of a running machine", f"to boot all nodes: axisbus boot {cell}"
    verb = "boot --reconnect" if reconnect else "boot --node"
    reports, unconfirmed = list[NodeReport](), False
    with running(cell, verb, why, remedy, command=True, take=take) as machine:
        if reconnect:
            stopped = machine.reconnect()
            unconfirmed = not all(each.ok for each in stopped)
            nodes = nodes or tuple(canopen_nodes(machine.cell))
            if not as_json:
                say("the CAN adapter was opened again; every axis is in ErrorStop")
                for each in stopped:
                    say(f"{each.axis}: {each.text}")
            if unconfirmed:
                say_error(alarm(stopped))
        for node in [machine.node(node_id) for node_id in dict.fromkeys(nodes)]:
            try:
                report = _boot_node(node, quiet=as_json)
            except (BootError, StateError) as error:
                report = NodeReport(node.node_id, error=error)
            reports.append(report)
            if not as_json:
                say(report.text())
    failed = [report for report in reports if not report.ok]
    if as_json:
        say_json([report.as_json() for report in reports])
    elif failed:
        say_next(
            f"fix the cause shown after FAILED, and boot the node again: axisbus boot {cell} --node {failed[0].node_id}"
        )
    elif any(report.axes for report in reports):
        say_next(f"axisbus reset {cell} {' '.join(axis.name for report in reports for axis in report.axes)}")
    return FAILURE if failed or unconfirmed else OK


def _boot_node(node: NodeAccess, *, quiet: bool) -> NodeReport:
    """Boot a node of the running machine; on a terminal a line shows the step that runs."""
    with progress_line(_LABEL, quiet=quiet) as line:
        done = itertools.count()

        def show_step(step: str) -> None:
            if line is not None:
                line.label(f"{_LABEL} node {node.node_id}: {step}")
                line.update(next(done), _STEPS)

        return node.boot(show_step)
