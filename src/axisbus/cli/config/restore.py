"""``axisbus config restore``: write the configuration of a DCF to a node, and read every object back."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.cia301.datatypes import decode
from axisbus.cli.config import files as config_files
from axisbus.cli.shared.common import FAILURE, OK, WRONG, progress_phases, say, say_error, say_json, say_next
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession, node_options
from axisbus.cli.shared.options import packed
from axisbus.configuration import report_text
from axisbus.errors import BusError, SdoAbort, StateError
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.node.node import CanopenNode, NodeIdentity
    from axisbus.configuration.dcf_values import Item, Selection
    from axisbus.configuration.restore import Restore, RestoreReport, Result
    from axisbus.drives.plugin import DrivePlugin
    from axisbus.eds.model import Eds, Identity


STOPPED = 130  # the exit code of shells for Ctrl-C


@dataclass(frozen=True, slots=True)
class _RestoreOptions:
    """The user's options apart from file and node."""

    include: frozenset[config_files.Key]
    exclude: frozenset[config_files.Key]
    replacement: bool
    store: bool
    dry_run: bool
    ignore_limits: bool


def _objects(
    _: click.Context, option: click.Parameter, given: tuple[str, ...]
) -> frozenset[config_files.Key]:
    return config_files.keys(given, option.opts[0])


@click.command("restore")
@click.argument("file")
@click.argument("node", shell_complete=complete_node)
@node_options
@click.option(
    "--include",
    multiple=True,
    metavar="OBJECT",
    callback=_objects,
    help="Also write this calibration object, such as 2105:1; one option per object.",
)
@click.option(
    "--exclude", multiple=True, metavar="OBJECT", callback=_objects, help="Do not write this object."
)
@click.option(
    "--replacement",
    is_flag=True,
    help="The node replaces the node in the file: accept a different revision, serial number and node-ID.",
)
@click.option("--store", is_flag=True, help="Store by 1010h, wait for a restart, and read all again.")
@click.option(
    "--ignore-limits",
    is_flag=True,
    help="Also write values beyond the file's limits; the drive may refuse them.",
)
@click.option("--dry-run", is_flag=True, help="Only show the values that would be written.")
@packed(_RestoreOptions, "restore_options")
@click.option("--concise", is_flag=True, help="FILE is a concise DCF (1F22h); needs the EDS.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(
    file: str, node: str, options: NodeOptions, restore_options: _RestoreOptions, concise: bool, as_json: bool
) -> int:
    """Configure NODE as in FILE (a DCF): write the values that differ, in the order that a device accepts, and read every
    object again.

    It refuses a file of another device, and a node that is energised, operational, or run by another master. Controlword, modes
    and targets are not written; calibration objects are written only if --include names them. If a restore was cut off, run it
    again: it writes the values that still differ.

    Exit code 1 when an object cannot be restored, 3 when the node or the bus fails during the restore.
    """
    files = options.files()
    node_id = files.address(node).node_id
    eds = _concise_values(file, files, node_id) if concise else _values(file)
    _selection(eds, node_id, eds.identity, restore_options)  # report missing values before the bus is opened
    with ExitStack() as stack:
        device = NodeSession(stack, options, files.described_by(node_id, eds), [node_id]).node(node_id)
        return _run(stack, device, eds, restore_options, as_json)


def _values(file: str) -> Eds:
    from axisbus.configuration.dcf_values import require_values

    reading = config_files.read_file(file)
    require_values(reading)
    return reading.eds


def _concise_values(file: str, files: NodeFiles, node_id: int) -> Eds:
    """Return the EDS of the node with the values of a concise DCF."""
    from axisbus.eds import concise, dcf
    from axisbus.eds.concise_dcf_values import parameters
    from axisbus.eds.io import reader

    given = config_files.eds_file(files, node_id)
    if not given:
        raise click.UsageError(
            "a concise DCF does not contain the types of its values: give the node's EDS with --eds"
        )
    path = Path(file)
    writes = concise.decode(reader.file_bytes(path), str(path))
    reading = dcf.to_eds(config_files.read_file(given))
    return dcf.make(reading, dcf.Settings(node_id), parameters(reading.eds, writes)).eds


# -- the run -----------------------------------------------------------------------------------------------------------


def _selection(
    eds: Eds, node_id: int, identity: Identity | NodeIdentity, restore_options: _RestoreOptions
) -> tuple[Selection, DrivePlugin]:
    """Select the values of the file for a device: the one that the file names, or the present one; also return its plug-in.

    Raises:
        ArgumentError: an object is not in the file, or has no value that can be written.
    """
    from axisbus.configuration.dcf_values import select
    from axisbus.drives import registry

    make = registry.of_identity(identity)
    return select(eds, node_id, make, restore_options.include, restore_options.exclude), make


def _run(
    stack: ExitStack, device: CanopenNode, eds: Eds, restore_options: _RestoreOptions, as_json: bool
) -> int:
    from axisbus.configuration import preconditions
    from axisbus.configuration.dcf_values import require_within_limits
    from axisbus.configuration.restore import Restore

    identity = device.identity()
    preconditions.require_same_device(eds, identity, device.node_id, replacement=restore_options.replacement)
    selection, make = _selection(eds, device.node_id, identity, restore_options)
    bars = stack.enter_context(ExitStack())
    restore = Restore(device.sdo, selection, bars.enter_context(progress_phases(quiet=as_json)))
    differing = restore.read_present()
    if not restore_options.ignore_limits:
        require_within_limits(differing, eds, device.node_id)
    if restore_options.dry_run:
        return _dry(device.node_id, differing, selection, as_json)
    found: dict[str, Any] = {
        "node": device.node_id,
        "file": eds.source,
        "cannot_store": _ready(device, restore_options),
    }
    try:
        report = _execute(device, restore, make, restore_options, found)
    except (BusError, KeyboardInterrupt) as error:
        bars.close()
        return _cut_off(device.node_id, restore, error, found, as_json)
    found["in_ram_only"] = report.writes > 0 and "stored" not in found
    report_result(report, found, as_json)
    if "store_refused" in found:
        say_error(found["store_refused"])
        return FAILURE
    return OK if report.ok else WRONG


def _ready(device: CanopenNode, restore_options: _RestoreOptions) -> str:
    """Check that the node may be written to; return why it cannot store, empty if it can.

    Raises:
        StateError: it must not be written to, or cannot store although that is requested.
    """
    from axisbus.configuration import preconditions, store_parameters

    preconditions.require_at_rest(device)
    why_not = store_parameters.can_store(device)
    if restore_options.store and why_not:
        raise StateError(
            f"node {device.node_id} cannot store: {why_not}; nothing was written", remedy="leave --store out"
        )
    return why_not


def _execute(
    device: CanopenNode,
    restore: Restore,
    make: DrivePlugin,
    restore_options: _RestoreOptions,
    found: dict[str, Any],
) -> RestoreReport:
    """Write, store if requested, and read back; ``found`` gets the result of storing."""
    from axisbus.configuration import store_parameters

    report = restore.run()
    if not (restore_options.store and report.ok):
        return report
    try:
        stored = store_parameters.store(device, make)
    except SdoAbort as refusal:
        found["store_refused"] = str(refusal)
        return report
    found["stored"] = {"restarted": stored.restarted, "seconds": stored.seconds}
    restore.read_present()
    return restore.report()


def _dry(node_id: int, differing: list[Item], selection: Selection, as_json: bool) -> int:
    if as_json:
        say_json(
            {
                "node": node_id,
                "would_write": [report_text.identified(each.variable) for each in differing],
                "skipped": [
                    {**report_text.identified(each.variable), "reason": each.text}
                    for each in selection.skipped
                ],
            }
        )
    else:
        for each in differing:
            say(
                f"would write {report_text.address(each.variable)} = {report_text.data_shown(each.variable, each.data)}"
            )
        say(f"node {node_id}: {report_text.would(differing, selection)}")
    return WRONG if differing else OK


def _cut_off(
    node_id: int, restore: Restore, error: BaseException, found: dict[str, Any], as_json: bool
) -> int:
    """Report the progress of an aborted restore: another run continues from there."""
    report = restore.report()
    report_result(
        report,
        {**found, "cut_off": str(error) or "stopped by Ctrl-C", "in_ram_only": report.writes > 0},
        as_json,
    )
    say_error(str(error) or "stopped by Ctrl-C")
    say_error(
        f"the restore of node {node_id} was cut off after {counted(report.writes, 'write')}; run it again: it writes the "
        "values that still differ"
    )
    return FAILURE if isinstance(error, BusError) else STOPPED


# -- The report of ``axisbus config restore``, for people and as JSON --------------------------------------------------


def report_result(report: RestoreReport, found: dict[str, Any], as_json: bool) -> None:
    """Print a report; ``found`` has the node, the file, and if it was stored (``stored``, ``in_ram_only``, ``cannot_store``)."""
    if as_json:
        say_json(_plain(report, found))
    else:
        _show(report, found)


def _show(report: RestoreReport, found: dict[str, Any]) -> None:
    from axisbus.configuration.restore import ValueEnd

    for each in report.of(ValueEnd.RESTORED):
        say(f"restored  {_change(each)}")
    for each in report.of(ValueEnd.UNVERIFIED, ValueEnd.DIFFERS):
        why = f" ({each.reason})" if each.reason else ""
        say(f"{each.outcome.value}: {report_text.address(each.item.variable)}{why}")
    for each in report.of(ValueEnd.FAILED):
        say(f"FAILED    {_change(each)}: {each.reason}")
    for line in report_text.skipped(report.skipped):
        say(f"skipped   {line}")
    say(f"node {found['node']}: {report_text.restored(report)}")
    _show_memory(found, report)


def _show_memory(found: dict[str, Any], report: RestoreReport) -> None:
    stored = found.get("stored")
    if stored is not None:
        restart = "it restarted, and " if stored["restarted"] else ""
        say(f"stored by 1010h in {stored['seconds']:.1f} s; {restart}all values were read again")
    elif found["in_ram_only"] and found.get("cannot_store"):
        say(f"the written values are in RAM: {found['cannot_store']}")
    elif found["in_ram_only"]:
        say("the written values are in RAM only, and are lost at the next power-off")
        say_next(f"store it: axisbus config restore {found['file']} {found['node']} ... --store")
    if not report.ok and stored is None and "cut_off" not in found:
        say_next(
            "correct the failed objects in the file, or leave them out with --exclude, and run the command again"
        )


def _change(each: Result) -> str:
    variable = each.item.variable
    target_text = report_text.data_shown(variable, each.item.data)
    before = report_text.data_shown(variable, each.before)
    now = "" if each.after == each.item.data else f", it is {report_text.data_shown(variable, each.after)}"
    return f"{report_text.address(variable)}: {before} -> {target_text}{now}"


def _plain(report: RestoreReport, found: dict[str, Any]) -> dict[str, Any]:
    def value(each: Result, data: bytes | None) -> object:
        return None if data is None else report_text.plain(decode(data, each.item.variable.data_type))

    return {
        **found,
        "ok": report.ok and "cut_off" not in found,
        "writes": report.writes,
        "objects": [
            {
                **report_text.identified(each.item.variable),
                "outcome": each.outcome.name.lower(),
                "wanted": value(each, each.item.data),
                "before": value(each, each.before),
                "after": value(each, each.after),
                "reason": each.reason,
            }
            for each in report.results
        ],
        "skipped": [
            {**report_text.identified(each.variable), "reason": each.text} for each in report.skipped
        ],
    }
