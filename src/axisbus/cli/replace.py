"""``axisbus replace``: make a new drive the drive of a node, in a running machine or on the bus alone."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.bus.node.node import NodeIdentity
from axisbus.bus.sdo.access import ByObjects
from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cli.config.files import read_file
from axisbus.cli.nameplate import save_plates
from axisbus.cli.shared.attach_or_open import join, take_option
from axisbus.cli.shared.common import OK, say, say_json, say_next, say_note
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import write_whole
from axisbus.configuration import nameplate
from axisbus.configuration.dcf_backup import file_name
from axisbus.configuration.dcf_values import require_values
from axisbus.configuration.nameplate import Nameplate
from axisbus.configuration.preconditions import require_same_device
from axisbus.configuration.replacement_order import (
    FoundDrive,
    ReplacementOrder,
    ReplacementOutcome,
    ReplacementStep,
    Tell,
)
from axisbus.configuration.replacement_plan import (
    NodeToReplace,
    ReplacementPlan,
    UnfinishedReplacement,
    note_file,
    parse_note,
    plan,
)
from axisbus.drives import registry
from axisbus.eds import builtin
from axisbus.errors import AxisbusError, UserError
from axisbus.machine.machine_node import MachineNode
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.eds.model import Eds

_FILE = "The DCF with the configuration of the old drive; by default that of CELL, else a backup beside CELL."


@click.command("replace")
@click.argument("cell", type=PATH)
@click.argument("node", metavar="AXIS|NODE", shell_complete=complete_node)
@click.option("--file", type=PATH, help=_FILE)
@click.option("--no-restore", is_flag=True, help="Leave the parameters of the new drive as they are.")
@click.option("--plan", "only_plan", is_flag=True, help="Only show what was found, and the steps.")
@click.option("--yes", is_flag=True, help="Skip the confirmation prompt.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON; needs --plan or --yes.")
@take_option
def command(
    cell: Path,
    node: str,
    file: Path | None,
    no_restore: bool,
    only_plan: bool,
    yes: bool,
    as_json: bool,
    take: bool,
) -> int:
    """Replace the drive of a node of CELL by a new one of the same type. Energises nothing.

    The new drive has the node-ID of the old one, or a node-ID that CELL does not use, or (with LSS) no node-ID. The
    command shows the old and the new drive, and asks once. Then it sets the node-ID by LSS, restores the stored
    configuration (without the objects that calibrate the drive), stores it by 1010h, restarts the drive, compares every object,
    and writes the new nameplate into the record (axisbus nameplate --save).

    It joins the machine of CELL if one runs; the other axes continue, and the node is booted into the machine. Otherwise it works
    on the bus alone. If it was interrupted, run it again. Refused if product or revision differ, or if objects are missing.

    \b
    axisbus replace cell.toml x --plan
    axisbus replace cell.toml x
    """
    if file is not None and no_restore:
        raise click.UsageError("--no-restore restores no file: leave --file out")
    if as_json and not (only_plan or yes):
        raise click.UsageError("--json asks no question: add --plan or --yes")
    config = reader.load(cell)
    files = NodeFiles(config)
    node_id = files.address(node).node_id
    if node_id not in config.nodes:
        raise UserError(
            f"{cell} has no node {node_id}", observed=f"it has {', '.join(map(str, config.nodes))}"
        )
    record = _Record(cell, node_id)
    stored = None if no_restore else _values(_configuration(config, node_id, record.plate, file))
    with ExitStack() as stack:
        access = _access_to(stack, cell, config, files, node_id, take)
        planned = plan(_known(config, files, record, stored, running=access.running), access.find())
        if stored is not None:
            _require_file_of(planned.drive, stored, node_id)
        if not as_json:
            _show(planned, config)
        if only_plan:
            if as_json:
                say_json(_plain(planned, None))
            return OK
        if not yes:
            _confirm(planned)
        outcome = _execute(planned, record, access, config, quiet=as_json)
    if as_json:
        say_json(_plain(planned, outcome))
    else:
        _show_outcome(planned, outcome, config)
    return OK


# -- files -----------------------------------------------------------------------------------------------------------------


class _Record:
    """The record of the nameplates beside a cell file, and the note of an unfinished replacement of a node."""

    def __init__(self, cell: Path, node_id: int) -> None:
        self._cell = cell
        self._file = nameplate.file_of(cell)
        self._plates = nameplate.load(self._file)[1] if self._file.exists() else []
        self._note = note_file(cell, node_id)
        self._earlier: bytes | None = None  # the note of an earlier run
        self.node_id = node_id

    @property
    def plate(self) -> Nameplate | None:
        """The stored nameplate of the node."""
        return next((each for each in self._plates if each.node == self.node_id), None)

    @property
    def unfinished(self) -> UnfinishedReplacement | None:
        """The note; raises UserError if it cannot be read."""
        if not self._note.exists():
            return None
        return parse_note(self._note.read_text("utf-8", "replace"), str(self._note))

    def begin(self, note: UnfinishedReplacement) -> None:
        """Note that a replacement has begun."""
        self._earlier = self._note.read_bytes() if self._note.exists() else None
        write_whole(self._note, note.as_json().encode())

    def undo(self) -> None:
        """Restore the state before ``begin``: the note of an earlier run, or none."""
        if self._earlier is None:
            self.end()
        else:
            write_whole(self._note, self._earlier)

    def end(self) -> None:
        """Remove the note."""
        self._note.unlink(missing_ok=True)

    def renew(self, plate: Nameplate) -> None:
        """Store the nameplate of the new drive in place of that of the old one."""
        plates = [plate if each.node == plate.node else each for each in self._plates]
        save_plates(self._file, plates, self._cell.name)


def _configuration(config: CellConfig, node_id: int, was: Nameplate | None, given: Path | None) -> str:
    """Return the DCF to restore.

    Raises:
        UserError: there is none.
    """
    if given is not None:
        return str(given.absolute())
    dcf = config.nodes[node_id].dcf
    if dcf is not None:
        return str(Path(builtin.resolve(dcf, config.folder)).absolute())
    found = _backups(config.folder, node_id, was)
    if len(found) == 1:
        return str(found[0].absolute())
    other_files = (
        f"beside it are {', '.join(each.name for each in found)}" if found else "there is no backup beside it"
    )
    raise UserError(
        f"there is no stored configuration of node {node_id}"
        if not found
        else "it is not known which backup is to be restored",
        observed=f"[nodes.{node_id}] of {config.file} names no dcf, and {other_files}",
        remedy="give the backup of the old drive (axisbus config backup) with --file; --no-restore leaves the new drive as it is",
    )


def _backups(folder: Path, node_id: int, was: Nameplate | None) -> list[Path]:
    """Return the backups of a node by their usual names: that of the drive of the record, else those of other drives."""
    usual_file = folder / file_name(node_id, was.serial if was else None)
    if usual_file.is_file():
        return [usual_file]
    return sorted([*folder.glob(f"node-{node_id}.dcf"), *folder.glob(f"node-{node_id}-serial-*.dcf")])


def _values(file: str) -> Eds:
    """Read the DCF to restore; raises EdsError if it cannot be read or has no values."""
    reading = read_file(file)
    require_values(reading)
    return reading.eds


def _require_file_of(drive: FoundDrive, stored: Eds, node_id: int) -> None:
    """Check before anything is changed that the file is for this type of drive."""
    identity = NodeIdentity(vendor_id=drive.vendor, product_code=drive.product)
    require_same_device(stored, identity, node_id, replacement=True)


def _known(
    config: CellConfig, files: NodeFiles, record: _Record, stored: Eds | None, *, running: bool
) -> NodeToReplace:
    node, eds = config.nodes[record.node_id], files.eds_for(record.node_id)
    return NodeToReplace(
        record.node_id,
        config.file,
        None if eds is None else eds.identity.vendor_id,
        None if eds is None else eds.identity.product_code,
        None if eds is None else eds.identity.revision,
        node.revision,
        node.serial,
        record.plate,
        record.unfinished,
        None if stored is None else stored.source,
        running,
    )


# -- where the drive is replaced -------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _DriveAccess:
    """A running machine, or a bus without one: how to find the new drive, to configure it, and to read it."""

    running: bool
    find: Callable[[], list[FoundDrive]]
    replace: Callable[[ReplacementOrder, Tell], ReplacementOutcome]
    read: Callable[[], ByObjects]


def _access_to(
    stack: ExitStack, cell: Path, config: CellConfig, files: NodeFiles, node_id: int, take: bool
) -> _DriveAccess:
    machine = join(cell, command=True, take=take)
    if machine is not None:
        node = stack.enter_context(machine).node(node_id)
        return _DriveAccess(
            True,
            node.find_replacement,
            node.replace_drive,
            lambda: MachineNode(machine.node(node_id)),
        )
    from axisbus.configuration.replacement import DriveReplacement, find_drives

    device = NodeSession(stack, NodeOptions(None, None, None, (), cell, ()), files, [node_id]).node(node_id)
    others, makes = (*config.nodes, config.bus.master_id), config.nodes[node_id].makes
    return _DriveAccess(
        False,
        lambda: find_drives(device, others),
        lambda order, on_step: DriveReplacement(device, order, makes, on_step=on_step).run(),
        lambda: device,
    )


def _execute(
    planned: ReplacementPlan, record: _Record, access: _DriveAccess, config: CellConfig, *, quiet: bool
) -> ReplacementOutcome:
    """Do all steps; the note is there until all are done. If nothing was changed, the note is as it was before."""
    begun_steps = set[ReplacementStep]()

    def on_step(step: ReplacementStep) -> None:
        begun_steps.add(step)
        if not quiet:
            say_note(f"node {record.node_id}: {step.value}")

    record.begin(planned.note)
    try:
        outcome = access.replace(planned.order, on_step)
        if ReplacementStep.RECORD in planned.steps:
            on_step(ReplacementStep.RECORD)
            record.renew(nameplate.read_nameplate(access.read(), config))
    except (AxisbusError, KeyboardInterrupt) as error:
        # the step CONFIGURE writes nothing if it is refused (``DriveReplacement.run``)
        if isinstance(error, UserError) and begun_steps <= {ReplacementStep.CONFIGURE}:
            record.undo()
        else:
            say_note(
                f"the replacement of node {record.node_id} is unfinished: run the command again to finish it"
            )
        raise
    record.end()
    return outcome


# -- output ----------------------------------------------------------------------------------------------------------------


def _show(planned: ReplacementPlan, config: CellConfig) -> None:
    node, drive = planned.node, planned.drive
    say(f"node {node.node_id}: the new drive was found {drive.where}")
    if node.unfinished is not None and node.unfinished.serial == drive.serial:
        say("  its replacement has begun before, and is unfinished")
    rows = [("", "was", "is"), _plugin_names(planned, config), *planned.rows()]
    width = max(len(was) for _, was, _ in rows)
    for title, was, now in rows:
        say(f"  {title:<28}{was or 'unknown':<{width}}  {now or 'unknown'}")
    if node.configuration is not None:
        say(f"  configuration: {node.configuration}")
    say("steps:")
    for number, step in enumerate(planned.steps, 1):
        say(f"  {number}. {step.value}")
    if node.was is None:
        say_note(f"no nameplate of node {node.node_id} is stored, so nothing is known about the old drive")


def _plugin_names(planned: ReplacementPlan, config: CellConfig) -> tuple[str, str, str]:
    drive, was = planned.drive, planned.node.was
    now = registry.find(
        drive.vendor, drive.product, drive.revision, config.nodes[planned.node.node_id].makes
    ).name
    return nameplate.TITLES["make"], "" if was is None else was.make, now


def _confirm(planned: ReplacementPlan) -> None:
    if not sys.stdin.isatty():
        raise click.UsageError("no terminal to answer the question: give --yes to replace the drive")
    click.confirm(f"Make it the drive of node {planned.node.node_id}?", abort=True)


def _show_outcome(planned: ReplacementPlan, outcome: ReplacementOutcome, config: CellConfig) -> None:
    node_id, cell = planned.node.node_id, planned.node.cell
    if planned.node.configuration is not None:
        say(
            f"node {node_id}: {counted(outcome.values, 'value')} of the file compared, {counted(outcome.written, 'write')}"
            + (", stored" if not outcome.not_stored else f"; NOT stored: {outcome.not_stored}")
        )
        if outcome.calibration:
            say(
                f"{counted(outcome.calibration, 'object')} that calibrate the drive were left as they are: calibrate it"
            )
    say(f"node {node_id} has been replaced: serial number {planned.drive.serial}")
    axes = " ".join(axis.name for axis in config.axes_of(node_id))
    if planned.node.running:
        say_next(f"axisbus reset {cell} {axes}".rstrip())
    else:
        say_next(f"axisbus boot {cell}")
    if ReplacementStep.RECORD not in planned.steps:
        say_next(f"axisbus nameplate {cell} --save")


def _plain(planned: ReplacementPlan, outcome: ReplacementOutcome | None) -> dict[str, object]:
    return {
        "node": planned.node.node_id,
        "was": None if planned.node.was is None else asdict(planned.node.was),
        "drive": asdict(planned.drive),
        "configuration": planned.node.configuration,
        "steps": [step.name.lower() for step in planned.steps],
        "outcome": None if outcome is None else asdict(outcome),
    }
