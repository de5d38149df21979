"""``axisbus sim``: simulate the drives of a cell for other terminals and programs, over a loopback port."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import click

from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import other_nodes
from axisbus.check.run import checked
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.options import PATH, Seconds, packed, port_option
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.cli.shared.plugin_options import SimOption, adding, sim_options
from axisbus.core.sim_faults_file import load_faults
from axisbus.core.sim_server import ServedDrives
from axisbus.eds.builtin import PREFIX
from axisbus.errors import UserError
from axisbus.sim.node.network import ForeignNode
from axisbus.sim.socketcand_server import LOOPBACK, Server
from axisbus.wording import counted

_LONG = 3600.0  # s
_PORT = 29536  # the default port of socketcand
_OPTIONS = sim_options()


def _names(options: Sequence[SimOption]) -> str:
    return " or ".join(option.name for option in options)


def _about(options: Sequence[SimOption]) -> str:
    """Return the text about the options of plug-ins, for the help."""
    texts = [f"With {_names(options)}, CELL may be left out.", *(option.about for option in options)]
    return " ".join(filter(None, texts)) if options else ""


class _SimSettings(NamedTuple):
    """The user's options apart from cell, plug-ins and --force."""

    port: int
    output: Path | None
    faults: Path | None
    control: Path | None
    seconds: float | None


@click.command("sim")
@click.argument("cell", type=PATH, required=False)
@adding(_OPTIONS, _about(_OPTIONS))
@port_option(_PORT)
@output_option("Write CELL with the [bus] to use into this file.")
@force_option
@click.option("--faults", type=PATH, help="A TOML file of faults and their times.")
@click.option(
    "--control",
    type=PATH,
    help="Create a socket at this path, through which tests control the drives (axisbus.SimulationControl).",
)
@click.option("--for", "seconds", type=Seconds(), help="Duration in seconds; without it, until Ctrl-C.")
@packed(_SimSettings, "settings")
def command(
    cell: Path | None,
    settings: _SimSettings,
    force: bool,
    **plugin_values: tuple[Any, ...],
) -> int:
    """Simulate the drives of CELL for other terminals and programs, on a port of this computer that other computers cannot
    reach.

    {plugins}

    It uses the protocol of socketcand, so that python-can's interface of that name, and other tools that support it, can
    connect. No hardware is needed or touched, whatever [bus] says in CELL. Ctrl-C ends the simulation, and its drives
    disappear.
    """
    config = None if cell is None else checked(cell)
    given = {
        option: plugin_values[option.parameter] for option in _OPTIONS if plugin_values[option.parameter]
    }
    _require_nodes(config, given, settings)
    foreign_nodes = {option: option.foreign_nodes(values) for option, values in given.items()}
    if config is not None:
        _require_same_folder(config, settings.output)
        _require_free_node_ids(config, foreign_nodes)
    require_free(settings.output, force=force)
    with ExitStack() as stack:
        for option, values in given.items():
            stack.enter_context(option.serve(values))
        if config is None and not any(foreign_nodes.values()):
            _wait(settings.seconds)
            return OK
        texts = [option.text(values) for option, values in given.items() if foreign_nodes[option]]
        return _serve(
            config,
            [foreign_node for modules in foreign_nodes.values() for foreign_node in modules],
            texts,
            settings,
        )


def _serve(
    config: CellConfig | None,
    foreign_nodes: Sequence[ForeignNode],
    texts: Sequence[str],
    settings: _SimSettings,
) -> int:
    output = settings.output
    planned = () if settings.faults is None or config is None else load_faults(settings.faults, config)
    served = ServedDrives(config, planned, foreign_nodes)
    with served.serve(settings.port, settings.control) as server:
        _print_help(config, texts, server, settings.control)
        if output is not None and config is not None:
            write_whole(output, with_bus(config.source, _bus(server)).encode())
            say(f"or take {output}, which is {config.file} with this bus: axisbus boot {output}")
        with suppress(KeyboardInterrupt):  # the usual end
            for line in served.play(settings.seconds):
                say(line)
    return OK


def _wait(seconds: float | None) -> None:
    with suppress(KeyboardInterrupt):  # the usual end
        if seconds is not None:
            time.sleep(seconds)
        while seconds is None:
            time.sleep(_LONG)


def _require_nodes(config: CellConfig | None, given: Mapping[SimOption, Any], settings: _SimSettings) -> None:
    """Check that there are simulated nodes if there is no cell file, and no options that need one."""
    if config is not None:
        return
    if not given:
        raise click.UsageError(f"give a cell file, or modules with {_names(_OPTIONS)}")
    for option, value in (
        ("-o", settings.output),
        ("--faults", settings.faults),
        ("--control", settings.control),
    ):
        if value is not None:
            raise click.UsageError(f"{option} needs a cell file: also give the cell file")


def _require_free_node_ids(
    config: CellConfig, foreign_nodes: Mapping[SimOption, Sequence[ForeignNode]]
) -> None:
    """Refuse a second module with the node ID of a module of the cell, which is served anyway: both would answer."""
    cell_nodes = other_nodes(config)
    for option, modules in foreign_nodes.items():
        for node_id in (foreign_node.node_id for foreign_node in modules):
            if node_id in cell_nodes:
                raise UserError(
                    f"node {node_id} is a module of {config.file}, and is served with it",
                    remedy=f"leave {option.name} {node_id} out",
                )


def _require_same_folder(config: CellConfig, output: Path | None) -> None:
    """Refuse to write the cell file to another folder: it would not find the files that it names."""
    files = [node.file for node in config.nodes.values() if node.file and not node.file.startswith(PREFIX)]
    relative = [file for file in files if not Path(file).expanduser().is_absolute()]
    if output is not None and relative and output.absolute().parent != config.folder.absolute():
        raise UserError(
            f"{output} would not find {relative[0]}, which {config.file} names relative to its own folder",
            remedy=f"write it into the same folder: -o {config.folder / output.name}",
        )


def _print_help(
    config: CellConfig | None, texts: Sequence[str], server: Server, control: Path | None
) -> None:
    for text in texts:
        say(f"{text}; on port {server.port}")
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
    written: list[str] = []
    table, found = "", False
    for line in source.splitlines():
        header = _HEADER.match(line)
        if header is not None:
            table = header[1].replace(" ", "")
        if table == "bus" and header is not None:
            written += [line, *lines]
            found = True
        elif table != "bus.options" and not (table == "bus" and _REPLACED.match(line)):
            written.append(line)
    if not found:
        raise UserError(
            "the cell file has no line [bus], so its bus cannot be replaced",
            remedy="write it as a table: [bus]",
        )
    return "\n".join(written) + "\n"
