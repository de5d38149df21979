"""``axisbus plot``: plot a recording."""

from __future__ import annotations

import math
from pathlib import Path

import click

from axisbus.cli.record.load import read
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.output import output_option, require_writable
from axisbus.cli.shared.paths import PATH
from axisbus.record.plot import plot


@click.command("plot")
@click.argument("recording", type=PATH)
@output_option("The picture to write, .png or .svg; without it, in the folder of the recording.")
@click.option(
    "--from", "begin", type=float, default=-math.inf, help="Begin at this time of the recording, in seconds."
)
@click.option(
    "--to", "end", type=float, default=math.inf, help="End at this time of the recording, in seconds."
)
@click.option("--title", default="", help="A title, instead of the file's name and the time.")
def command(recording: Path, output: Path | None, begin: float, end: float, title: str) -> int:
    """Draw RECORDING: position and command, velocity, torque, following error and state of each axis; and the events, as text.

    RECORDING is an MCAP file, or a CSV file that axisbus record export or axisbus demo has written (which contains no events).
    """
    if not begin < end:
        raise click.UsageError("--from must be less than --to")
    picture = output or recording.parent / f"{recording.stem}.png"  # a folder has no file name to change
    require_writable(picture)
    recorded = read(recording)
    when = "" if recorded.began is None else f"{recorded.began:%Y-%m-%d %H:%M:%S} UTC"
    drives = " ".join([recorded.facts["drives"], "drives"]) if "drives" in recorded.facts else ""
    heading = title or ", ".join(filter(None, (recording.name, when, drives)))
    say(f"written: {plot(recorded, picture, heading, begin=begin, end=end)}")
    return OK
