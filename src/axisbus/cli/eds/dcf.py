"""``axisbus eds dcf``: the configuration of one node as a DCF or concise DCF, and back."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.eds.files import file_argument, say_lines
from axisbus.cli.shared.common import OK, say, say_json, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import (
    concise_option,
    force_option,
    output_option,
    require_free,
    write_and_say,
    write_whole,
)
from axisbus.eds import assign, builtin, concise, concise_dcf_values, dcf, writer
from axisbus.eds.io import reader
from axisbus.eds.io.new_file import written
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Eds, Variable
from axisbus.errors import ArgumentError
from axisbus.wording import counted


@click.command("dcf")
@file_argument
@click.option("--node", type=click.IntRange(1, 127), help="Node ID [default: that of a DCF].")
@click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="OBJECT=VALUE",
    help="Set a value: 6081=1000, 0x6099:1=0x64, 'Profile velocity=1000'.",
)
@click.option("--baudrate", type=int, help="Bit rate in kbit/s: 10, 20, 50, 125, 250, 500, 800 or 1000.")
@click.option("--name", help="The node's name (NodeName).")
@click.option("--network-name", help="The network's name (NetworkName).")
@click.option("--net-number", type=int, help="The network's number (NetNumber).")
@output_option("Write the DCF (with --to-eds: the EDS) here.")
@concise_option("Write a concise DCF, the content of 1F22h, here.")
@force_option
@click.option("--from-concise", type=PATH, help="Apply the values of this concise DCF first.")
@click.option(
    "--values", is_flag=True, help="Print the values that differ from the defaults, and write nothing."
)
@click.option("--to-eds", is_flag=True, help="Remove node and values from a DCF; needs -o.")
@click.option("--json", "as_json", is_flag=True, help="With --values: print JSON.")
def command(
    file: str,
    node: int | None,
    sets: tuple[str, ...],
    baudrate: int | None,
    name: str | None,
    network_name: str | None,
    net_number: int | None,
    output: Path | None,
    concise_out: Path | None,
    force: bool,
    from_concise: Path | None,
    values: bool,
    to_eds: bool,
    as_json: bool,
) -> int:
    """Make a DCF for one node of FILE (an EDS or DCF): node ID, bit rate, and values that are checked against type, limits,
    access.

    All values that are not set remain as in FILE, byte for byte. With --concise, also (or only) write the list of SDO downloads
    that configure the device, in the order that the device accepts: PDOs disabled first and enabled last, 1020h at the end.

    Nothing is sent to a device.
    """
    require_free(output, concise_out, force=force)
    path = builtin.resolve(file, Path())
    reading = reader.read(reader.file_bytes(path), str(path))
    if to_eds:
        return _to_eds(reading, output)
    settings = dcf.Settings(
        _node(reading, node, values), baudrate, name, network_name, net_number,
        file_name=output.name if output is not None else None,
        last_eds=path.name if reading.eds.node_id is None and output is not None else None,
    )  # fmt: skip
    reading = _configured(reading, settings, sets, from_concise)
    if values:
        _show(reading, as_json)
        return OK
    if output is None and concise_out is None:
        raise click.UsageError("give -o FILE.dcf, --concise FILE.bin, or --values")
    _write(reading, output, concise_out)
    return OK


def _node(reading: EdsParseResult, node: int | None, values: bool) -> int:
    found = node if node is not None else reading.eds.node_id
    if found is None:
        raise ArgumentError(
            "a DCF is made for one node, and no node ID is given",
            observed="" if values else f"{reading.eds.source} has no node ID",
            remedy="give --node 5 (1 to 127)",
        )
    return found


def _configured(
    reading: EdsParseResult, settings: dcf.Settings, sets: tuple[str, ...], from_concise: Path | None
) -> EdsParseResult:
    if from_concise is not None:
        writes = concise.decode(reader.file_bytes(from_concise), str(from_concise))
        reading = dcf.make(reading, settings, concise_dcf_values.parameters(reading.eds, writes))
    return dcf.make(reading, settings, [_assigned(reading.eds, each) for each in sets])


def _assigned(eds: Eds, text: str) -> tuple[Variable, str]:
    address, equals, given = text.partition("=")
    if not equals:
        raise ArgumentError(
            f"--set {text!r} has no '='", remedy="write OBJECT=VALUE, such as --set 0x6081=1000"
        )
    return assign.entry(eds, address), given


def _write(reading: EdsParseResult, output: Path | None, concise_out: Path | None) -> None:
    concise_values = concise_dcf_values.configuration(reading) if concise_out is not None else None
    if output is not None:
        write_whole(output, writer.dumps(reading))
        count = len(dcf.differing(reading.eds))
        say(
            f"{output}: node {reading.eds.node_id}, {counted(count, 'value differs', 'values differ')} from the defaults"
        )
    if concise_out is not None and concise_values is not None:
        data = concise.encode(concise_values.writes)
        write_whole(concise_out, data)
        say(
            f"{concise_out}: {counted(len(concise_values.writes), 'write')}, {counted(len(data), 'octet')} "
            f"for 1F22h:{reading.eds.node_id:02X}"
        )
        for each in concise_values.left_out:
            say(
                f"  left out: {each.index:04X}h:{each.subindex:02X} ({each.name}), access {each.access}: not for a download"
            )
    if output is not None:
        say_next(f"axisbus eds check {output}")


def _to_eds(reading: EdsParseResult, output: Path | None) -> int:
    if output is None:
        raise click.UsageError("--to-eds needs -o FILE.eds")
    skeleton = dcf.to_eds(reading, output.name)
    next_step = f"axisbus eds check {output}"
    write_and_say(output, writer.dumps(skeleton), "written without node ID and values", next_step)
    return OK


def _show(reading: EdsParseResult, as_json: bool) -> None:
    eds = reading.eds
    found = [_plain(each) for each in dcf.differing(eds)]
    if as_json:
        say_json({"file": eds.source, "node_id": eds.node_id, "values": found})
        return
    lines = [f"{each['object']}={each['value']}" for each in found]
    width = max(map(len, lines), default=0)
    say_lines(
        f"{line:<{width}}  {each['name']} (default {each['default'] or 'not given'})"
        for line, each in zip(lines, found, strict=True)
    )
    say(f"{counted(len(found), 'value differs', 'values differ')} from the defaults for node {eds.node_id}")


def _plain(variable: Variable) -> dict[str, str]:
    sub = "" if variable.subindex == 0 else f":{variable.subindex:02X}"
    return {
        "object": f"0x{variable.index:04X}{sub}",
        "name": variable.name,
        "value": written(variable.parameter_value, variable.data_type),
        "default": written(variable.default, variable.data_type),
    }
