"""``axisbus sim``: simulate the drives of a cell for other terminals and programs, over a loopback port."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import other_nodes
from axisbus.check.run import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, Seconds, port_option
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.core.sim_faults_file import load_faults
from axisbus.core.sim_server import Served
from axisbus.drives.gim6010.sim.constants import MOST_NODE_ID
from axisbus.drives.gim6010.sim.firmware import EXTENDED, FACTORY, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.eds.builtin import PREFIX
from axisbus.eds.io.reader import load
from axisbus.errors import UserError
from axisbus.sim.socketcand_server import LOOPBACK, Server
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.drives.gim6010.sim.modbus.station import Station


_LONG = 3600.0  # s
_PORT = 29536  # the default port of socketcand


# -- Modules without CANopen for ``axisbus sim``: ``--can-simple ID[:FIRMWARE]`` ---------------------------------------


_EDS = f"{PREFIX}gim6010-8"  # the EDS of such a module after switching it to CANopen
Wanted = tuple[int, Firmware]


class CanSimple(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A node ID from 0 to 63, and a firmware version: 0, 5:0.5.11."""

    name = "id[:firmware]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        """Convert text to both."""
        node_id, _, firmware = str(value).partition(":")
        try:
            found = int(node_id), Firmware.read(firmware or str(FACTORY))
        except ValueError:
            found = -1, FACTORY
        if not 0 <= found[0] <= MOST_NODE_ID:
            self.fail(
                f"{value!r} is not a module: give a node ID from 0 to 63, or one with its firmware: 5:0.5.11",
                param,
                ctx,
            )
        return found


def modules(wanted: Sequence[Wanted]) -> list[Module]:
    """Create the modules; blocks to read their EDS for CANopen."""
    eds = load(_EDS) if wanted else None
    return [
        Module(node_id, firmware=firmware, eds=eds, serial=number)
        for number, (node_id, firmware) in enumerate(wanted, 1)
    ]


def told(wanted: Sequence[Wanted]) -> str:
    """Return the text about the served modules."""
    each = (
        f"node {node_id} with firmware {firmware}"
        + (", in its 29-bit protocol" if firmware >= EXTENDED else "")
        for node_id, firmware in wanted
    )
    return f"{counted(len(wanted), 'simulated module')} GIM6010-8: {'; '.join(each)}"


# -- Modules on RS485 for ``axisbus sim``: ``--modbus ID[:FIRMWARE]``, all on one pseudo-terminal ----------------------


class Modbus(CanSimple):
    """A node ID from 1 to 63, and a firmware version: 1, 5:0.5.14."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        """Convert text to both."""
        found = super().convert(value, param, ctx)
        if not found[0]:
            self.fail("0 is the broadcast address of Modbus: give a node ID from 1 to 63", param, ctx)
        return found


@contextmanager
def on_terminal(wanted: Sequence[Wanted]) -> Iterator[None]:
    """Serve the modules on a pseudo-terminal during the block, and print its path; without modules, do nothing.

    Raises:
        UsageError: two modules have one node ID.
        AdapterError: this system has no pseudo-terminals.
    """
    if not wanted:
        yield
        return
    twice = [node_id for node_id, number in Counter(node_id for node_id, _ in wanted).items() if number > 1]
    if twice:
        raise click.UsageError(f"--modbus: two modules have node ID {twice[0]}")
    from axisbus.drives.gim6010.sim.modbus.terminal import served

    with served(*_stations(wanted)) as terminal:
        each = ", ".join(f"node {node_id} with firmware {firmware}" for node_id, firmware in wanted)
        say(f"{counted(len(wanted), 'simulated module')} GIM6010-8 on RS485: {each}; in another terminal:")
        say(f"  axisbus gim6010 modbus state --port {terminal.path} --node {wanted[0][0]}")
        yield


def _stations(wanted: Sequence[Wanted]) -> list[Station]:
    from axisbus.drives.gim6010.sim.modbus.station import Station

    return [Station(node_id, firmware=firmware) for node_id, firmware in wanted]


# -- serve -------------------------------------------------------------------------------------------------------------


@click.command("sim")
@click.argument("cell", type=PATH, required=False)
@click.option(
    "--can-simple",
    "wanted",
    type=CanSimple(),
    multiple=True,
    help="In addition, a GIM6010-8 that speaks CAN Simple, with this node ID (0 to 63) and firmware; repeat it for more.",
)
@click.option(
    "--modbus",
    "on_line",
    type=Modbus(),
    multiple=True,
    help="In addition, a GIM6010-8 that speaks Modbus RTU on a pseudo-terminal, with this node ID (1 to 63) and firmware; repeat "
    "it for more.",
)
@port_option(_PORT)
@output_option("Write CELL with the [bus] to use into this file.")
@force_option
@click.option("--faults", type=PATH, help="A TOML file of faults and their times.")
@click.option(
    "--control",
    type=PATH,
    help="Make a socket at this path, for tests to control the drives (axisbus.SimulationControl).",
)
@click.option("--for", "seconds", type=Seconds(), help="Duration in seconds; without it, until Ctrl-C.")
def command(
    cell: Path | None,
    wanted: tuple[Wanted, ...],
    on_line: tuple[Wanted, ...],
    port: int,
    output: Path | None,
    force: bool,
    faults: Path | None,
    control: Path | None,
    seconds: float | None,
) -> int:
    """Simulate the drives of CELL for other terminals and programs, on a port of this computer that other computers cannot
    reach.

    With --can-simple or --modbus, CELL may be left out. From firmware 0.6.8 on, such a module only sends heartbeats in its
    29-bit protocol.

    It uses the protocol of socketcand, so that python-can's interface of that name, and other tools that support it, can
    connect. No hardware is needed or touched, whatever [bus] says in CELL. Ctrl-C ends the simulation, and its drives
    disappear.
    """
    config = None if cell is None else checked(cell)
    _require_enough(config, (*wanted, *on_line), {"-o": output, "--faults": faults, "--control": control})
    if config is not None:
        _require_beside(config, output)
        _require_others(config, wanted)
    require_free(output, force=force)
    with on_terminal(on_line):
        if config is None and not wanted:
            _wait(seconds)
            return OK
        return _serve(config, wanted, port, output, faults, control, seconds)


def _serve(
    config: CellConfig | None,
    wanted: tuple[Wanted, ...],
    port: int,
    output: Path | None,
    faults: Path | None,
    control: Path | None,
    seconds: float | None,
) -> int:
    planned = () if faults is None or config is None else load_faults(faults, config)
    served = Served(config, planned, modules(wanted))
    with served.serve(port, control) as server:
        _tell(config, wanted, server, control)
        if output is not None and config is not None:
            write_whole(output, with_bus(config.source, _bus(server)).encode())
            say(f"or take {output}, which is {config.file} with this bus: axisbus boot {output}")
        with suppress(KeyboardInterrupt):  # the usual end
            for line in served.play(seconds):
                say(line)
    return OK


def _wait(seconds: float | None) -> None:
    with suppress(KeyboardInterrupt):  # the usual end
        if seconds is not None:
            time.sleep(seconds)
        while seconds is None:
            time.sleep(_LONG)


def _require_enough(
    config: CellConfig | None, wanted: tuple[Wanted, ...], options: dict[str, Path | None]
) -> None:
    """Check that there are modules if there is no cell file, and no options that need one."""
    if config is not None:
        return
    if not wanted:
        raise click.UsageError("give a cell file, or modules with --can-simple or --modbus")
    for option, value in options.items():
        if value is not None:
            raise click.UsageError(f"{option} needs a cell file: give one, too")


def _require_others(config: CellConfig, wanted: tuple[Wanted, ...]) -> None:
    """Refuse a second module with the node ID of a module of the cell, which is served anyway: both would answer."""
    for node_id, _ in wanted:
        if node_id in other_nodes(config):
            raise UserError(
                f"node {node_id} is a module of {config.file}, and is served with it",
                remedy=f"leave --can-simple {node_id} out",
            )


def _require_beside(config: CellConfig, output: Path | None) -> None:
    """Refuse to write the cell file to another folder: it would not find the files that it names."""
    files = [node.file for node in config.nodes.values() if node.file and not node.file.startswith(PREFIX)]
    relative = [file for file in files if not Path(file).expanduser().is_absolute()]
    if output is not None and relative and output.absolute().parent != config.folder.absolute():
        raise UserError(
            f"{output} would not find {relative[0]}, which {config.file} names relative to its own folder",
            remedy=f"write it into the same folder: -o {config.folder / output.name}",
        )


def _tell(
    config: CellConfig | None, wanted: tuple[Wanted, ...], server: Server, control: Path | None
) -> None:
    if wanted:
        say(f"{told(wanted)}; on port {server.port}")
    options = f"-i socketcand -c {server.channel} -O host={LOOPBACK} -O port={server.port}"
    if config is None:
        say("in another terminal:")
        say(f"  axisbus trace {options}")
        return
    say(
        f"{counted(len(config.nodes), 'simulated node')} of {config.file} on port {server.port}; in another terminal:"
    )
    say(f"  axisbus scan {options}")
    say("in a cell file:")
    for line in ("[bus]", *_bus(server)):
        say(f"  {line}")
    if control is not None:
        say(
            f'in a test: with axisbus.SimulationControl("{control}") as plant: plant.simulated_node({min(config.nodes)}) ...'
        )


def _bus(server: Server) -> list[str]:
    return [
        'interface = "socketcand"',
        f'channel = "{server.channel}"',
        f'options = {{ host = "{LOOPBACK}", port = {server.port} }}',
    ]


# -- Make a cell file with another ``[bus]``: the server of its simulated drives ---------------------------------------


_HEADER = re.compile(r"\s*\[+\s*([^\[\]]+?)\s*\]+")
_REPLACED = re.compile(r"\s*(interface|channel|options)\b")


def with_bus(source: str, lines: list[str]) -> str:
    """Return the text of a cell file with ``lines`` in its ``[bus]``, in place of its interface, channel and options.

    Raises:
        UserError: the file has no line ``[bus]``.
    """
    kept: list[str] = []
    table, found = "", False
    for line in source.splitlines():
        header = _HEADER.match(line)
        if header is not None:
            table = header[1].replace(" ", "")
        if table == "bus" and header is not None:
            kept += [line, *lines]
            found = True
        elif table != "bus.options" and not (table == "bus" and _REPLACED.match(line)):
            kept.append(line)
    if not found:
        raise UserError(
            "the cell file has no line [bus], so its bus cannot be replaced",
            remedy="write it as a table: [bus]",
        )
    return "\n".join(kept) + "\n"
