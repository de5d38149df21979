"""``axisbus trace``: the frames of a bus or a recording as text."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, NamedTuple

import click

from axisbus.cli.shared import no_traffic_help
from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import OK, WRONG, echo
from axisbus.cli.shared.frames import FrameSource, FrameSourceOptions, open_frames, source_options
from axisbus.cli.shared.options import Seconds
from axisbus.cli.shared.plugin_options import adding, trace_options
from axisbus.wording import counted, printable

if TYPE_CHECKING:
    from axisbus.bus.link.bitrate_change import Opening
    from axisbus.trace.decoded import Decoded
    from axisbus.trace.filters import Wanted

_OPTIONS = trace_options()


class TraceFilter(NamedTuple):
    """The selection of frames, and their output format."""

    wanted: Wanted
    unwanted: Wanted | None
    errors_only: bool
    as_json: bool
    absolute: bool

    def shows(self, one: Decoded) -> bool:
        """Whether a frame is shown."""
        if self.errors_only and not one.trouble:
            return False
        return self.wanted(one) and (self.unwanted is None or not self.unwanted(one))


class TraceCounts(NamedTuple):
    """Frame counts: all frames, those shown, and those with trouble; protocol violations, and frames of other protocols."""

    frames: int = 0
    shown: int = 0
    trouble: int = 0
    violations: str = ""
    foreign: tuple[str, ...] = ()


@click.command("trace")
@source_options
@adding(_OPTIONS, "\n\n".join(option.about for option in _OPTIONS))
@click.option(
    "--filter", "filters", multiple=True, metavar="KEY=VALUE,...", help="Show only node=, kind= or object=."
)
@click.option(
    "--without", multiple=True, metavar="KEY=VALUE,...", help="Leave out the frames of this filter."
)
@click.option("--errors-only", is_flag=True, help="Show only errors; exit code 1 when there are any.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per line and frame.")
@click.option(
    "--absolute", is_flag=True, help="Show the times of the recording, not seconds since the first frame."
)
@click.option("--seconds", type=Seconds(), help="Listen for this time; without it, until Ctrl-C.")
@click.option("--count", type=click.IntRange(min=1), help="End when this many frames have been shown.")
def command(
    options: FrameSourceOptions,
    filters: tuple[str, ...],
    without: tuple[str, ...],
    errors_only: bool,
    as_json: bool,
    absolute: bool,
    seconds: float | None,
    count: int | None,
    **named: str,
) -> int:
    """Show the frames of SOURCE decoded: a recording (candump's log, asc, blf, csv, trc ...), - for candump's output, a
    cell.toml.

    With a cell.toml, or with -i and -c, it listens to the bus; it sends nothing. Names and units of objects come from the cell
    file, names also from --eds 5=drive.eds, otherwise from the standards; mappings that are set during the recording are
    learned from it.

    If a recording has several buses, each is decoded separately; --channel can0 shows one, by its name or number in the file.

    {plugins}

    Filters are joined by "and", the values of one by "or": --filter node=1,x --filter kind=sdo,emcy --filter object=6041.
    """
    from axisbus.trace import filters as wanted

    axes = options.axes if filters or without else ()
    unwanted = wanted.parse(without, axes) if without else None
    frame_filter = TraceFilter(wanted.parse(filters, axes), unwanted, errors_only, as_json, absolute)
    others = {
        option.protocol: option.nodes(named[option.parameter])
        for option in _OPTIONS
        if named[option.parameter]
    }
    with ExitStack() as stack:
        opened = open_frames(stack, options, seconds)
        counts = _show(opened, frame_filter, count, others)
    _report(opened, counts)
    if not counts.frames and options.interface is not None:
        _report_other_rate(
            opening_of(None, options.interface, options.channel, options.bitrate, options.option)
        )
    return WRONG if errors_only and counts.trouble else OK


def _show(
    opened: FrameSource, frame_filter: TraceFilter, limit: int | None, others: Mapping[str, Collection[int]]
) -> TraceCounts:
    from axisbus.trace.decoded import TraceErrorCounters
    from axisbus.trace.decoder import Decoder

    decoders: dict[str, Decoder] = {}  # by channel: requests and answers belong to one bus
    counts, error_counters, start = TraceCounts(), TraceErrorCounters(), None
    with suppress(KeyboardInterrupt):  # the normal end of listening
        for frame in opened.frames:
            start = frame.time if start is None and not frame_filter.absolute else start
            if frame.channel not in decoders:
                decoders[frame.channel] = Decoder(opened.known, others)
            one = decoders[frame.channel].feed(frame)
            error_counters.note(one)
            shown = frame_filter.shows(one)
            counts = TraceCounts(
                counts.frames + 1, counts.shown + shown, counts.trouble + (shown and one.trouble)
            )
            if shown:
                _print(one, frame_filter, start or 0.0, frame.channel if len(decoders) > 1 else "")
            if limit is not None and counts.shown >= limit:
                break
    foreign = (line for decoder in decoders.values() for line in decoder.foreign.lines())
    return counts._replace(violations=error_counters.words(), foreign=tuple(foreign))


def _print(one: Decoded, frame_filter: TraceFilter, start: float, channel: str) -> None:
    """Print a frame; ``channel``: empty while the recording has only one."""
    from axisbus.trace import frame_formats as json_form
    from axisbus.trace import frame_formats as text

    if frame_filter.as_json:
        values = {**json_form.plain(one), **({"channel": channel} if channel else {})}
        echo(json.dumps(values, ensure_ascii=False, allow_nan=False))
    else:
        line = f"{channel:<6} {text.line(one, start)}" if channel else text.line(one, start)
        click.secho(printable(line), fg="red" if one.trouble else None)


def _report_other_rate(opening: Opening) -> None:
    """Report on standard error the bit rate at which traffic is received, or how to find it."""
    traffic = no_traffic_help.listen(opening)
    for line in no_traffic_help.lines(traffic) if traffic is not None else no_traffic_help.advice(opening):
        echo(line, err=True)


def _report(opened: FrameSource, counts: TraceCounts) -> None:
    """Print a summary on standard error, so that standard output has only frames."""
    text = f"{counted(counts.frames, 'frame')}, {counts.shown} shown, {counts.trouble} of them with errors"
    if counts.violations:
        text += f"; {counts.violations}"
    if opened.skipped.count:
        text += (
            f"; {counted(opened.skipped.count, 'line is not a frame', 'lines are not frames')}, the first is "
            f"{opened.skipped.first}"
        )
    echo(text, err=True)
    for line in opened.skipped.words():
        echo(line, err=True)
    for line in counts.foreign:
        echo(line, err=True)
