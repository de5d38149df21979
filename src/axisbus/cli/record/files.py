"""The commands that use recordings: ``axisbus plot``, ``axisbus record diff``, ``export`` and ``faults``."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path

import click

from axisbus.cli.shared.common import OK, WRONG, echo, progress_bar, say, say_json, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import force_option, output_option, require_free, require_writable, write_file
from axisbus.errors import UserError
from axisbus.record.compare import Compared, compare
from axisbus.record.export import write_csv, write_parquet
from axisbus.record.load import load
from axisbus.record.plot import plot, require_picture
from axisbus.record.recording_data import Recorded

# -- Read a recording for a command, with a progress line and a remark if it is incomplete -----------------------------


def read(path: Path) -> Recorded:
    """Return the recording; report if it is incomplete. Raises as ``mcap_reader.load``."""
    with progress_bar(f"reading {path}") as on_progress:
        recorded = load(
            path, None if on_progress is None else lambda part: on_progress(round(part * 1000), 1000)
        )
    if recorded.lacks:
        echo(f"{path}: {recorded.lacks}", err=True)
    return recorded


# -- ``axisbus plot``: plot a recording --------------------------------------------------------------------------------


@click.command("plot")
@click.argument("recording", type=PATH)
@output_option("Image file to write, .png or .svg; by default in the folder of the recording.")
@click.option(
    "--from", "begin", type=float, default=-math.inf, help="Begin at this time of the recording, in seconds."
)
@click.option(
    "--to", "end", type=float, default=math.inf, help="End at this time of the recording, in seconds."
)
@click.option("--title", default="", help="A title, instead of the file's name and the time.")
def plot_command(recording: Path, output: Path | None, begin: float, end: float, title: str) -> int:
    """Draw RECORDING: position and command, velocity, torque, following error and state of each axis; and the events, as text.

    RECORDING is an MCAP file, or a CSV file that axisbus record export or axisbus demo has written (which contains no events).
    """
    if not begin < end:
        raise click.UsageError("--from must be less than --to")
    picture = output or recording.parent / f"{recording.stem}.png"  # a folder has no file name to change
    require_picture(picture)
    require_writable(picture)
    recorded = read(recording)
    when = "" if recorded.began is None else f"{recorded.began:%Y-%m-%d %H:%M:%S} UTC"
    drives = " ".join([recorded.facts["drives"], "drives"]) if "drives" in recorded.facts else ""
    heading = title or ", ".join(filter(None, (recording.name, when, drives)))
    write_file(picture, lambda file: plot(recorded, file, heading, begin=begin, end=end))
    say(f"written: {picture}")
    return OK


# -- ``axisbus record diff``: compare two recordings of one job --------------------------------------------------------


@click.command("diff")
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
@click.option(
    "--within", type=float, help="Exit code 1 if a position differs by more than this, in its axis's unit."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def diff_command(first: Path, second: Path, within: float | None, as_json: bool) -> int:
    """Align FIRST and SECOND at the first motion of an axis, and show the largest deviations of each axis."""
    compared = compare(read(first), read(second))
    _print_json(compared) if as_json else _print_differences(compared)
    positions = [one for one in compared.deviations if one.column == "position"]
    return WRONG if within is not None and any(abs(one.by) > within for one in positions) else OK


def _print_differences(compared: Compared) -> None:
    say(
        f"{compared.seconds:.3f} s of both; the second begins to move {compared.shift:+.3f} s after the first does"
    )
    say(f"{'axis':<8}{'':<18}{'largest':>12}  {'at':>9}  {'first':>12}  {'second':>12}")
    for one in compared.deviations:
        say(
            f"{one.axis:<8}{one.column.replace('_', ' '):<18}{one.by:>+12.4f}  {one.time:>7.3f} s  "
            f"{one.first:>12.4f}  {one.second:>12.4f} {one.unit}"
        )
    if compared.only:
        say(f"in only one of them: {', '.join(compared.only)}")


def _print_json(compared: Compared) -> None:
    deviations = [{**one._asdict(), "by": one.by} for one in compared.deviations]
    say_json({**compared._asdict(), "deviations": deviations})


# -- ``axisbus record export``: a recording as CSV or Parquet ----------------------------------------------------------


_KINDS: dict[str, Callable[[Recorded, Path], None]] = {".csv": write_csv, ".parquet": write_parquet}


@click.command("export")
@click.argument("recording", type=PATH)
@output_option("The file to write; its ending, .csv or .parquet, selects the format.", required=True)
@force_option
def export_command(recording: Path, output: Path, force: bool) -> int:
    """Write RECORDING as a table with a row for each cycle: CSV (units in the header) or Parquet (units in the metadata)."""
    write = _KINDS.get(output.suffix.lower())
    if write is None:
        raise UserError(
            f"{output} does not end with a known format", remedy=f"end its name in {' or '.join(_KINDS)}"
        )
    require_free(output, force=force)
    recorded = read(recording)
    write_file(output, partial(write, recorded))
    say(f"written: {output}")
    return OK


# -- ``axisbus record faults``: list the recordings of a cell's last faults ------------------------------------------------

_FIRST_SORTS = ("emcy", "nmt", "command")  # the most informative sort first


_FAULT_WIDTH = 140


@click.command("faults")
@click.argument("cell", type=PATH)
def faults_command(cell: Path) -> int:
    """List the stored faults of CELL, the oldest first: the newest 20, each with 1.5 s before and 1 s after it.

    The core stores them automatically if it runs in its own process; axisbus plot draws one.
    """
    from axisbus.cell import reader
    from axisbus.core.process.launch import path_of
    from axisbus.core.process.persistence.journal import faults_of

    found = faults_of(path_of(reader.load(cell)))
    for path in found:
        say(f"{path}\n    {_line(path)}")
    if not found:
        say(f"no fault of {cell} has been stored")
        return OK
    say_next(f"axisbus plot {found[-1]} -o fault.png")
    return OK


def _line(path: Path) -> str:
    try:
        return _what(load(path))
    except UserError as error:
        return error.message


def _what(recorded: Recorded) -> str:
    faulty = [name for name, track in recorded.tracks.items() if "ErrorStop" in track.columns["state"]]
    description = [
        f"{event.where}: {event.text}"
        for sort in _FIRST_SORTS
        for event in recorded.events
        if event.sort == sort and (sort != "command" or event.text.startswith("ended"))
    ]
    text = f"{', '.join(faulty)} in ErrorStop; {description[0] if description else 'without an emergency message'}"
    return textwrap.shorten(text, _FAULT_WIDTH, placeholder=" …")
