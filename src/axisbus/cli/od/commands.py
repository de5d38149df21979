"""The commands of ``axisbus od``: read, write, dump and watch."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.bus.sdo.access import ByObjects
from axisbus.bus.sdo.value import checked_bytes
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import Value
from axisbus.cli.od import objects as od
from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.attached_nodes import NodeLookup, attach_to_nodes, open_nodes
from axisbus.cli.shared.common import FAILURE, OK, progress_bar, say, say_error, say_json, say_next
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession, node_options, require_bus
from axisbus.cli.shared.options import Seconds
from axisbus.cli.shared.output import force_option, output_option, require_free, write_and_say
from axisbus.configuration import guarded_write, parse_values
from axisbus.configuration.guarded_write import Written, is_command
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import SdoError
from axisbus.trace import frame_formats
from axisbus.trace.decoded import ObjectValue
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.eds.model import Eds


# -- ``axisbus od read``: read objects and explain their values --------------------------------------------------------


@click.command("read")
@click.argument("arguments", metavar="NODE:OBJECT...", nargs=-1, required=True, shell_complete=od.complete)
@node_options
@click.option(
    "--type", "kind", metavar="TYPE", help="Read as this type (u16, i32, REAL32, VISIBLE_STRING, ...)."
)
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def read_command(arguments: tuple[str, ...], options: NodeOptions, kind: str | None, as_json: bool) -> int:
    """Read objects and show their meaning; writes nothing. A record is read whole.

    \b
    axisbus od read --cell cell.toml x:Statusword 5:6064 5:1018
    axisbus od read -i socketcan -c can0 --eds drive.eds 5 Position_actual_value 6041
    """
    files = options.files()
    data_type = od.kind_of(kind)
    wanted = od.targets(files, arguments)
    with ExitStack() as stack:
        nodes = open_nodes(stack, options, files, {each.address.node_id for each in wanted})
        found = [
            (each, od.read(files, nodes.node(each.address.node_id), each.entry, data_type)) for each in wanted
        ]
    if as_json:
        say_json([od.plain(each.address.node_id, value) for each, value in found])
        return OK
    several = len({each.address for each, _ in found}) > 1
    for each, value in found:
        say((f"node {each.address.node_id}  " if several else "") + od.line(value))
    return OK


# -- ``axisbus od write``: write one object, checked before anything is sent, and read it back -------------------------


@click.command("write", context_settings={"ignore_unknown_options": True})
@click.argument("arguments", metavar="NODE:OBJECT VALUE", nargs=-1, required=True, shell_complete=od.complete)
@node_options
@click.option("--type", "kind", metavar="TYPE", help="Write as this type, if the EDS has none.")
@click.option(
    "--may-move", is_flag=True, help="Allow objects that can energise or move a drive, or drop its load."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@take_option
def write_command(
    arguments: tuple[str, ...],
    options: NodeOptions,
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
    require_bus(options)
    if len(arguments) not in (2, 3):
        raise click.UsageError("write one object: NODE:OBJECT VALUE, such as 5:6081 1000")
    data_type = od.kind_of(kind)
    files = NodeFiles.of(options.cell, options.eds)
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
        machine = attach_to_nodes(stack, options, command=True, take=take)
        node: ByObjects
        if machine is not None:
            node = machine.node(node_id)
            node.require_not_cyclic(entry)
            written = guarded_write.write_in_machine(node, entry, value, data_type, may_move=may_move)
        else:
            node = on_bus = NodeSession(stack, options, files, [node_id]).node(node_id)
            written = guarded_write.write(on_bus, entry, value, data_type, may_move=may_move)
        now = guarded_write.energised(node) if may_move and machine is None else []
    if as_json:
        say_json(_plain(files, target, value, written, now))
    else:
        _report_write(files, target, value, written, now)
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


def _report_write(
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
        say_error(f"{what} {written.result_text(value, shown)}")
        return
    say(f"{what}: {written.result_text(value, shown)}")
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


# -- ``axisbus od dump``: read every readable object of a node ---------------------------------------------------------


@click.command("dump")
@click.argument("node", shell_complete=complete_node)
@node_options
@output_option("Write to this file instead.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def dump_command(node: str, options: NodeOptions, output: Path | None, force: bool, as_json: bool) -> int:
    """Read every object of NODE that is readable by its EDS, and show its meaning; writes nothing to the drive.

    Without an EDS the objects of CiA 301 and CiA 402 are read. DOMAINs and objects that refuse a scan (ObjFlags) are left out.
    """
    require_free(output, force=force)
    files = options.files()
    address = files.address(node.rstrip(":"))
    with ExitStack() as stack:
        device = open_nodes(stack, options, files, [address.node_id]).node(address.node_id)
        found = _all(stack, files, device)
    values = [value for value, _ in found]
    if output is not None:
        what = f"{counted(len(values), 'object')} of node {address.node_id}"
        next_step = f"read one again: axisbus od read ... {address.node_id}:6041"
        write_and_say(output, _text(address.node_id, found, as_json).encode(), what, next_step)
    elif as_json:
        say_json([_dump_plain(address.node_id, value, refusal) for value, refusal in found])
    else:
        say(_text(address.node_id, found, as_json).rstrip("\n"))
    return OK


def _all(stack: ExitStack, files: NodeFiles, device: ByObjects) -> list[tuple[ObjectValue, str]]:
    on_progress = stack.enter_context(progress_bar(f"reading node {device.node_id}"))
    eds = device.eds or _skeleton(device)
    wanted = list(od.may_read(eds))
    found = []
    for number, (index, subindex) in enumerate(wanted, start=1):
        found.append(_dump_one(files, device, index, subindex))
        if on_progress is not None:
            on_progress(number, len(wanted))
    return found


def _skeleton(device: ByObjects) -> Eds:
    from axisbus.bus.node.from_device import skeleton

    return skeleton(device.sdo)


def _dump_one(files: NodeFiles, device: ByObjects, index: int, subindex: int) -> tuple[ObjectValue, str]:
    """Return an object with its value, or with the reason why it has none."""
    from axisbus.bus.sdo.access import decoded, try_upload, why_unread

    entry = device.sdo.dictionary.entry(index, subindex)
    data = try_upload(device.sdo, index, subindex)
    if not isinstance(data, bytes):
        return ObjectValue(index, subindex, entry.name), why_unread(data)
    value = decoded(data, entry.data_type)
    return od.value_of(files, device.node_id, device.sdo.dictionary, entry, value), ""


def _text(node_id: int, found: list[tuple[ObjectValue, str]], as_json: bool) -> str:
    if as_json:
        import json

        return json.dumps([_dump_plain(node_id, *each) for each in found], indent=2) + "\n"
    return "".join(
        (f"{frame_formats.address(value)}: {refusal}" if refusal else od.line(value)) + "\n"
        for value, refusal in found
    )


def _dump_plain(node_id: int, value: ObjectValue, refusal: str) -> dict[str, object]:
    return {**od.plain(node_id, value), **({"refused": refusal} if refusal else {})}


# -- ``axisbus od watch``: read objects periodically, and show changes -------------------------------------------------


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
@click.option("--count", type=click.IntRange(min=1), help="Number of reads; without it, until Ctrl-C.")
@click.option("--all", "everything", is_flag=True, help="Show every read, not only changes.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line.")
def watch_command(
    arguments: tuple[str, ...],
    options: NodeOptions,
    every: float,
    count: int | None,
    everything: bool,
    as_json: bool,
) -> int:
    """Read objects periodically and show changes; writes nothing. A node that does not answer is reported and read again.

    Exit code 3 when the last read got no answer.
    """
    files = options.files()
    wanted = od.targets(files, arguments)
    with ExitStack() as stack:
        nodes = open_nodes(stack, options, files, {each.address.node_id for each in wanted})
        watch = _ObjectWatch(nodes, files, wanted, everything, as_json)
        readings, due = 0, time.monotonic()
        with suppress(KeyboardInterrupt):  # the normal end of watching
            while count is None or readings < count:
                time.sleep(max(0.0, due - time.monotonic()))
                watch.read_all()
                readings, due = readings + 1, max(due + every, time.monotonic())
    return FAILURE if watch.silent else OK


class _ObjectWatch:
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
        self._show_unchanged, self._as_json = everything, as_json
        self._start = time.monotonic()
        self._shown: dict[tuple[int, int, int], str] = {}
        self.silent = False

    def read_all(self) -> None:
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
        if self._shown.get(key) == text and not self._show_unchanged:
            return
        self._shown[key] = text
        now = time.monotonic() - self._start
        say(
            json.dumps({"time": round(now, 6), **plain})
            if self._as_json
            else f"{now:10.3f}  node {node_id}  {text}"
        )
