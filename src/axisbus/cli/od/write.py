"""``axisbus od write``: write one object, checked before anything is sent, and read it back."""

from __future__ import annotations

from contextlib import ExitStack

import click

from axisbus.bus.sdo.access import ByObjects
from axisbus.bus.sdo.value import checked_bytes
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import Value
from axisbus.cli.od import objects as od
from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.attached_nodes import joined
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_json, say_next
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession, node_options, require_bus
from axisbus.configuration import guarded_write, parse_values
from axisbus.configuration.guarded_write import Written, is_command
from axisbus.eds.dictionary import Dictionary
from axisbus.trace import frame_formats
from axisbus.wording import counted


@click.command("write", context_settings={"ignore_unknown_options": True})
@click.argument("arguments", metavar="NODE:OBJECT VALUE", nargs=-1, required=True, shell_complete=od.complete)
@node_options
@click.option("--type", "kind", metavar="TYPE", help="Write as this type, if the EDS has none.")
@click.option(
    "--may-move", is_flag=True, help="Allow objects that can energise or move a drive, or drop its load."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@take_option
def command(
    arguments: tuple[str, ...],
    asked: NodeOptions,
    kind: str | None,
    may_move: bool,
    as_json: bool,
    take: bool,
) -> int:
    """Write VALUE to one object. Type, limits and access are checked before anything is sent; then it is read back.

    VALUE is 100, 0x64, 1.5, a value with the axis's unit ("90 deg"), text, hexadecimal digits for bytes, or @file.

    Objects by which a drive is energised or moved (controlword, mode, targets, outputs, calibration), and every write to a node
    with an energised drive, are refused without --may-move. Exit code 3 when the node then has another value.

    \b
    axisbus od write --cell cell.toml x:Profile_velocity "90 deg/s"
    axisbus od write -i socketcan -c can0 5:6083 20000 --type u32
    """
    _require_no_option(arguments)
    require_bus(asked)
    if len(arguments) not in (2, 3):
        raise click.UsageError("write one object: NODE:OBJECT VALUE, such as 5:6081 1000")
    data_type = od.kind_of(kind)
    files = NodeFiles.of(asked.cell, asked.eds)
    target = _one(od.targets(files, arguments[:-1]))
    node_id, entry = target.address.node_id, target.entry
    eds = files.eds_for(node_id)
    guarded_write.require_writable(eds, node_id, entry, data_type)
    quantity = files.quantities.of(node_id, entry.index, entry.subindex)
    value = parse_values.value(arguments[-1], entry, data_type or entry.data_type, quantity)
    checked_bytes(entry, value, data_type)  # check before the bus is opened
    if not may_move:
        guarded_write.require_harmless(eds, node_id, entry)
    with ExitStack() as stack:
        machine = joined(stack, asked, command=True, take=take)
        node: ByObjects
        if machine is not None:
            node = machine.node(node_id)
            node.require_not_cyclic(entry)
            written = guarded_write.write_in_machine(node, entry, value, data_type, may_move=may_move)
        else:
            node = on_bus = NodeSession(stack, asked, files, [node_id]).node(node_id)
            written = guarded_write.write(on_bus, entry, value, data_type, may_move=may_move)
        now = guarded_write.energised(node) if may_move and machine is None else []
    if as_json:
        say_json(_plain(files, target, value, written, now))
    else:
        _say(files, target, value, written, now)
    return OK if written.agrees(value) else FAILURE


def _require_no_option(arguments: tuple[str, ...]) -> None:
    """Refuse unknown options: click lets them pass here, because negative numbers are valid values."""
    for each in arguments:
        if each.startswith("-") and not each[1:2].isdigit() and each[1:2] != ".":
            raise click.UsageError(f"no such option: {each}")


def _one(targets: list[od.ObjectTarget]) -> od.ObjectTarget:
    if len(targets) != 1:
        names = ", ".join(
            f"{each.entry.index:04X}:{each.entry.subindex:X} {each.entry.name}" for each in targets[:8]
        )
        raise click.UsageError(
            f"{targets[0].words} has {counted(len(targets), 'entry', 'entries')}, name one of them: {names}"
        )
    return targets[0]


def _say(
    files: NodeFiles, target: od.ObjectTarget, value: Value, written: Written, energised: list[str]
) -> None:
    node_id, entry = target.address.node_id, target.entry
    dictionary = Dictionary(files.eds_for(node_id), node_id)

    def shown(one: Value | None) -> str:
        return (
            "unknown"
            if one is None
            else frame_formats.shown(od.value_of(files, node_id, dictionary, entry, one))
        )

    what = f"node {node_id}: {entry}"
    if not written.agrees(value):
        say_error(f"{what} {written.words(value, shown)}")
        return
    say(f"{what}: {written.words(value, shown)}")
    for each in energised:
        say(f"node {node_id} is ENERGISED ({each}); no program monitors it now")
    if energised:
        cell = files.cell.file if files.cell is not None else "CELL"
        say_next(f"stop it: axisbus stop {cell}")
    elif dictionary.has(c301.STORE_PARAMETERS, 1) and not is_command(entry.index):
        say_next(f"it is in RAM only; to store it: axisbus save {node_id} ...")


def _plain(
    files: NodeFiles, target: od.ObjectTarget, value: Value, written: Written, energised: list[str]
) -> dict[str, object]:
    node_id = target.address.node_id
    dictionary = Dictionary(files.eds_for(node_id), node_id)

    def hexed(one: Value | None) -> object:
        return one.hex() if isinstance(one, bytes) else one

    return {
        **od.plain(node_id, od.value_of(files, node_id, dictionary, target.entry, value)),
        "before": hexed(written.before),
        "after": hexed(written.after),
        "agrees": written.agrees(value),
        "energised": energised,
    }
