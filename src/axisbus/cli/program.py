"""The commands ``axisbus program show``, ``write`` and ``verify``."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from axisbus.boot import program_facts
from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.attached_nodes import attach_to_nodes, open_nodes
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_error, say_json, say_next, say_note
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeOptions, NodeSession, node_options
from axisbus.cli.shared.options import PATH, NumberType, Seconds, packed, together
from axisbus.configuration import guarded_write
from axisbus.configuration.program_image import ProgramImage, read_image
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.boot.objects import Progress
    from axisbus.boot.program_facts import NodePrograms, ProgramVerification, ProgramWritten
    from axisbus.machine.node_access import NodeAccess


class _Form(NamedTuple):
    """How the bytes are taken from FILE, as for ``read_image``."""

    raw: bool
    fill: int | None
    start: int | None


_file_options = together(
    click.option("--raw", is_flag=True, help="Send the bytes of FILE as they are, whatever its format."),
    click.option(
        "--fill", type=NumberType(8), metavar="BYTE", help="Byte for the gaps in FILE, such as 0xFF."
    ),
    click.option(
        "--start",
        type=NumberType(32),
        metavar="ADDRESS",
        help="Address of the first byte, if it is not the lowest one in FILE.",
    ),
    packed(_Form, "form"),
)


# -- ``axisbus program show`` --------------------------------------------------------------------------------------------


@click.command("show")
@click.argument("node", shell_complete=complete_node)
@node_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def show_command(node: str, options: NodeOptions, as_json: bool) -> int:
    """Show what NODE (its ID, or an axis of --cell) reports about its program: versions, state, flash status.

    Reads only, also while the machine runs. Exit code 1 when the node reports no program, or its program does not run.

    \b
    axisbus program show x --cell cell.toml
    axisbus program show 5 -i socketcan -c can0
    """
    files = options.files()
    node_id = files.address(node).node_id
    with ExitStack() as stack:
        found = program_facts.read_programs(
            node_id, open_nodes(stack, options, files, [node_id]).node(node_id).sdo
        )
    if as_json:
        say_json(_plain(found))
    else:
        _show(found)
    return OK if found.programs and found.programs[0].runs else WRONG


def _show(found: NodePrograms) -> None:
    say(f"node {found.node_id}{f': {found.name}' if found.name else ''}")
    for title, text in _facts(found):
        say(f"  {title:<30}{text}")
    if not found.programs:
        say("  it reports no program: it has neither 1F51h nor 1F56h of CiA 302-3")
    elif not found.programs[0].runs:
        say_next(
            f"axisbus program write FILE {found.node_id} ..., which begins again after an interrupted write"
        )


def _facts(found: NodePrograms) -> list[tuple[str, str]]:
    facts = [("software version (100Ah)", found.software_version)] if found.software_version else []
    facts += [] if found.version is None else [("application software (1F52h)", str(found.version))]
    for each in found.programs:
        facts.append((f"program {each.number} (1F51h)", each.control_text))
        if each.identification is not None:
            facts.append(("  identification (1F56h)", f"{each.identification:08X}h"))
        if each.flash is not None:
            facts.append(("  flash status (1F57h)", str(each.flash)))
    return [*facts, ("can be written over CANopen", "yes" if found.can_write else "no")]


def _plain(found: NodePrograms) -> dict[str, Any]:
    moment = None if found.version is None else found.version.moment
    return {
        "node": found.node_id,
        "name": found.name,
        "software_version": found.software_version,
        "date_time": None if moment is None else moment.isoformat(),
        "programs": [
            {
                "number": each.number,
                "control": each.control,
                "runs": each.runs,
                "identification": each.identification,
                "flash": None if each.flash is None else each.flash.value,
            }
            for each in found.programs
        ],
        "can_write": found.can_write,
    }


# -- ``axisbus program verify`` ------------------------------------------------------------------------------------------


@click.command("verify")
@click.argument("file", type=PATH)
@click.argument("node", shell_complete=complete_node)
@node_options
@_file_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def verify_command(file: Path, node: str, options: NodeOptions, form: _Form, as_json: bool) -> int:
    """Compare the program of NODE with FILE: byte by byte if the node returns its program (1F50h), otherwise by its
    identification (1F56h), if that is a usual checksum of the bytes.

    Reads only, also while the machine runs. Exit code 1 when the program is another one, or when this cannot be decided.
    """
    files = options.files()
    image = read_image(file, **form._asdict())
    node_id = files.address(node).node_id
    with ExitStack() as stack:
        objects = open_nodes(stack, options, files, [node_id]).node(node_id).sdo
        result = program_facts.verify_program(
            objects, program_facts.read_programs(node_id, objects), image.data
        )
    if as_json:
        say_json({"node": node_id, "file": str(file), **asdict(result)})
    else:
        say(f"{file}: {image}")
        _show_verification(node_id, result)
    return OK if result.same else WRONG


def _show_verification(node_id: int, result: ProgramVerification) -> None:
    result_text = {
        True: "has the program of the file",
        False: "does NOT have the program of the file",
        None: "cannot be verified",
    }
    say(f"node {node_id} {result_text[result.same]}: {result.reason}")


# -- ``axisbus program write`` -------------------------------------------------------------------------------------------


@click.command("write")
@click.argument("file", type=PATH)
@click.argument("node", shell_complete=complete_node)
@node_options
@_file_options
@click.option(
    "--identification",
    type=NumberType(32),
    metavar="NUMBER",
    help="The value that 1F56h:01 must have afterwards, according to the manufacturer's documents.",
)
@click.option(
    "--deadline",
    type=Seconds(1.0),
    help="Time for each part of the write; default 60 s, more for large files.",
)
@take_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def write_command(
    file: Path,
    node: str,
    options: NodeOptions,
    form: _Form,
    identification: int | None,
    deadline: float | None,
    take: bool,
    as_json: bool,
) -> int:
    """Replace the program of NODE by that of FILE: Intel HEX, S-record, or with --raw the bytes as they are.

    The node must keep its supply until the end. If the write is interrupted, or the supply fails, run the command again: the node
    then answers from its boot loader, and the write begins again with stop and clear.

    Energises nothing, and is refused while a drive of the node is energised. If the machine of --cell runs, its core writes the
    program of a node whose axes are disabled, while the other axes continue; boot the node afterwards. The core continues even
    if this command ends.

    FILE must be for exactly this device: axisbus can only refuse a damaged file. Exit code 3 when the write has failed.

    \b
    axisbus program write firmware.hex x --cell cell.toml --fill 0xFF
    axisbus program write firmware.bin 5 -i socketcan -c can0 --raw
    """
    files = options.files()
    image = read_image(file, **form._asdict())
    node_id = files.address(node).node_id
    order = program_facts.ProgramOrder(image.data, identification, deadline)
    with ExitStack() as stack:
        running = attach_to_nodes(stack, options, command=True, take=take)
        bar = stack.enter_context(progress_bar(f"node {node_id}: program", quiet=as_json))
        progress = _Announced(node_id, bar, quiet=as_json)
        if running is not None:
            written = _write_in_machine(running.node(node_id).access, order, progress)
        else:
            device = NodeSession(stack, options, files, [node_id]).node(node_id)
            guarded_write.require_no_other_master(device, heartbeats=False)
            written = _write(device, order, progress)
    _report(image, file, written, as_json)
    if not as_json and running is not None:
        say_next(f"boot the node: axisbus boot {options.cell} --node {node_id}")
    return OK


class _Announced:
    """Progress of a write; says once what begins."""

    def __init__(self, node_id: int, bar: Progress | None, *, quiet: bool) -> None:
        self._node_id = node_id
        self._bar = bar
        self.started = quiet

    def __call__(self, done: int, total: int | None) -> None:
        """Show the confirmed bytes."""
        if not self.started:
            self.started = True
            say_note(f"node {self._node_id}: its program is being replaced; do not switch it off")
        if self._bar is not None:
            self._bar(done, total)


def _write_in_machine(
    node: NodeAccess, order: program_facts.ProgramOrder, progress: Progress
) -> ProgramWritten:
    try:
        return node.write_program(
            order.data, identification=order.identification, deadline=order.deadline, progress=progress
        )
    except KeyboardInterrupt:
        say_error(
            f"the core of the machine goes on writing the program of node {node.node_id}; do not switch it off (to see the result: "
            f"axisbus program show {node.node_id} ...)"
        )
        raise


def _write(device: Any, order: program_facts.ProgramOrder, progress: Progress) -> ProgramWritten:
    from axisbus.boot.program_write import write_program

    try:
        return write_program(device, order, progress)
    except KeyboardInterrupt:
        say_error(
            f"interrupted: node {device.node_id} cannot be used until a write has succeeded; run this command again, which begins "
            "with stop and clear"
        )
        raise


def _report(image: ProgramImage, file: Path, written: ProgramWritten, as_json: bool) -> None:
    before, after = written.before, written.after
    if as_json:
        plain = {"file": str(file), "bytes": written.size, "retries": written.retries}
        say_json({**plain, "before": _plain(before), "after": _plain(after)})
        return
    say(f"{file}: {image}")
    retries = f", {counted(written.retries, 'request')} repeated" if written.retries else ""
    say(f"node {after.node_id}: program replaced, {counted(written.size, 'byte')}{retries}")
    old_facts = dict(_facts(before))
    for title, text in _facts(after):
        old = old_facts.get(title, "not reported")
        say(f"  {title:<30}{text if text == old else f'{old} -> {text}'}")
