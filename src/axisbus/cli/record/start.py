"""``axisbus record``: record a cell's machine, which is joined if it runs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import click

from axisbus.cli.shared.attach_or_open import machine_of
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_next
from axisbus.cli.shared.options import PATH, Seconds, beside_option
from axisbus.cli.shared.output import force_option, output_option, require_free
from axisbus.cli.shared.progress import draw
from axisbus.cli.shared.recordings import summary
from axisbus.machine.machine import Machine
from axisbus.record.mcap_writer import library
from axisbus.record.recording import Recording
from axisbus.wording import counted

_POLL_PERIOD = 0.2  # seconds


@click.command("start")
@click.argument("cell", type=PATH)
@output_option("The MCAP file to write.", required=True)
@force_option
@click.option("--for", "seconds", type=Seconds(), help="Duration in seconds; without it, until Ctrl-C.")
@click.option("--axes", metavar="AXIS,...", help="Only these axes; without it, all of them.")
@click.option(
    "--objects",
    metavar="AXIS:OBJECT,...",
    help="Also record these objects: x:6074, x:6099:01, 3:1001 (3: a node), lamp (an input or output). If a PDO "
    "carries the object, each of its frames is recorded; otherwise the object is read by SDO, in turn.",
)
@click.option(
    "--when",
    metavar="CONDITION",
    help="Record only the moment at which this becomes true: 'x.velocity > 100', '|x.following_error| > 0.5', "
    "'x.state = ErrorStop', fault, 'part = true' (an input or output), x.probe (its touch probe latches an edge).",
)
@click.option(
    "--before",
    type=Seconds(0.0),
    default=0.5,
    show_default=True,
    help="With --when: seconds to record before the moment.",
)
@click.option(
    "--after",
    type=Seconds(0.0),
    default=1.5,
    show_default=True,
    help="With --when: seconds to record after the moment.",
)
@beside_option
def command(
    cell: Path,
    output: Path,
    force: bool,
    seconds: float | None,
    axes: str | None,
    objects: str | None,
    when: str | None,
    before: float,
    after: float,
    beside: bool,
) -> int:
    """Record CELL into an MCAP file: each cycle of its axes, commands and their results, faults, lost and recovered nodes.

    Joins the machine of the cell if it is already running, otherwise boots the cell; energises nothing. The file can be read up
    to its last second, no matter how the recording ends.
    """
    library()
    require_free(output, force=force)
    if when is not None:
        if objects is not None:
            raise click.UsageError("--when records a moment of the axes: leave --objects out")
        return _capture(cell, output, _names(axes), StartTrigger(when, before, after), seconds, beside)
    recording = None
    try:
        with (
            machine_of(cell, command=False, beside=beside) as machine,
            machine.recording(output, axes=_names(axes), objects=_names(objects) or ()) as recording,
        ):
            _wait_for_end(machine, recording, seconds)
    except KeyboardInterrupt:  # the normal end
        if recording is None:
            raise
    say(summary(recording))
    say_next(f"axisbus plot {output} -o {output.with_suffix('.png')}")
    return FAILURE if recording.failed else OK


class StartTrigger(NamedTuple):
    """The trigger, and the seconds to record before and after it."""

    when: str
    before: float
    after: float


def _capture(
    cell: Path,
    output: Path,
    axes: list[str] | None,
    trigger: StartTrigger,
    seconds: float | None,
    beside: bool,
) -> int:
    """Wait for the trigger, and write the capture."""
    when, before, after = trigger
    with (
        machine_of(cell, command=False, beside=beside) as machine,
        machine.capture(output, when, before=before, after=after, axes=axes) as capture,
    ):
        until = None if seconds is None else time.monotonic() + seconds
        while not capture.done and not machine.session.ended and (until is None or time.monotonic() < until):
            capture.wait(_POLL_PERIOD)
            draw("the condition has become true" if capture.fired else f"waiting for {when}")
        draw("")
    if capture.failed or not capture.fired:
        say(f"nothing was recorded: {capture.failed or 'the condition did not become true'}")
        return FAILURE if capture.failed else WRONG
    say(f"recorded: {output}")
    say_next(f"axisbus plot {output} -o {output.with_suffix('.png')}")
    return OK


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _wait_for_end(machine: Machine, recording: Recording, seconds: float | None) -> None:
    """Wait until the time is over, the machine is closed, or writing has failed."""
    until = None if seconds is None else time.monotonic() + seconds
    try:
        while not recording.failed and not machine.session.ended:
            remaining = _POLL_PERIOD if until is None else min(_POLL_PERIOD, until - time.monotonic())
            if remaining <= 0.0:
                return
            machine.sleep(remaining)
            draw(
                f"{recording.seconds:.1f} s, {counted(recording.cycles, 'cycle')}, {recording.size / 1e6:.1f} MB"
            )
    finally:
        draw("")
    if not recording.failed:
        say("the program that opened the machine has closed it")
