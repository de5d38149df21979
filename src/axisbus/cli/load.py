"""``axisbus load``: the load of a bus, planned from a cell file and measured on the bus or in a recording."""

from __future__ import annotations

import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.bus.link.controller import WHAT_TO_CHECK
from axisbus.cli.shared.buses import rate_of
from axisbus.cli.shared.common import OK, WRONG, echo, say, say_json, say_next
from axisbus.cli.shared.frames import FrameSource, FrameSourceOptions, open_frames, source_options
from axisbus.cli.shared.options import Seconds
from axisbus.errors import ArgumentError, UserError
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.cell.model import CellConfig
    from axisbus.check.bus_load import LoadShare, MeasuredLoad, TrafficStream

FULL = 0.9  # as in ``axisbus check``
_LISTEN = 5.0


@click.command("load")
@source_options
@click.option("--seconds", type=Seconds(0.1), help="Listen to the bus for this time [default with -i: 5].")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def command(options: FrameSourceOptions, seconds: float | None, as_json: bool) -> int:
    """Show the load of a bus, by node and by service: planned for a cell.toml, measured in a recording or (--seconds) on the
    bus.

    SOURCE is a cell.toml, a recording, or - for candump's output. Planned figures are a range, from no stuff bits to the highest
    possible number of them; measured figures count the actual stuff bits. It sends nothing. Exit code 1 above 90 %.
    """
    options.check()
    listens = options.live and (options.interface is not None or seconds is not None)
    report: dict[str, Any] = {}
    if options.cell_file is not None and options.recording != "-":
        report["planned"] = _planned(options.cell_file, options.bitrate)
    if listens or not options.live:
        report["measured"] = _measured(options, (seconds or _LISTEN) if listens else None)
    if as_json:
        say_json(report)
    else:
        _show(report, options)
    return (
        WRONG
        if max(part["load_worst" if key == "planned" else "load"] for key, part in report.items()) > FULL
        else OK
    )


# -- planned -----------------------------------------------------------------------------------------------------------


def _planned(path: Path, bitrate: int | None) -> dict[str, Any]:
    from axisbus.cell import reader
    from axisbus.check.bus_load import streams
    from axisbus.core.files import load_dictionaries

    cell = reader.load(path)
    rate = bitrate or _rate(cell, None, None)
    found = streams(cell, load_dictionaries(cell))
    return {
        "bitrate": rate,
        "scan_period": cell.bus.scan_period,
        "load_least": sum(each.least for each in found) / rate,
        "load_worst": sum(each.worst for each in found) / rate,
        "by_node": _sums(found, rate, "node"),
        "by_kind": _sums(found, rate, "kind"),
    }


def _sums(found: list[TrafficStream], rate: int, key: str) -> list[dict[str, Any]]:
    groups: dict[Any, list[TrafficStream]] = {}
    for each in found:
        groups.setdefault(getattr(each, key), []).append(each)
    return [
        {
            key: name,
            "frames_per_second": sum(each.rate for each in group),
            "load_least": sum(each.least for each in group) / rate,
            "load_worst": sum(each.worst for each in group) / rate,
        }
        for name, group in sorted(groups.items(), key=lambda item: str(item[0]).rjust(4))
    ]


# -- measured ----------------------------------------------------------------------------------------------------------


def _measured(options: FrameSourceOptions, seconds: float | None) -> dict[str, Any]:
    from axisbus.check.bus_load import Meter
    from axisbus.trace.decoder import Decoder

    with ExitStack() as stack:
        opened = open_frames(stack, options, seconds)
        meter = Meter(options.bitrate or _rate(opened.loaded, options.interface, options.channel))
        duration = _fill(meter, Decoder(opened.known), opened, options.channel)
    found = meter.result(None if seconds is None else duration)
    if found is None:
        raise UserError(
            "the recording is too short to have a load",
            observed=f"{counted(meter.total.frames, 'frame')}, all with the same time stamp",
            remedy="record with time stamps, for some seconds",
        )
    skipped = opened.skipped
    for line in skipped.words():
        echo(line, err=True)
    return {
        **_plain(found, meter.first or 0.0),
        "lines_skipped": skipped.count,
        "first_skipped": skipped.first,
    }


def _fill(meter: Any, decoder: Any, opened: FrameSource, chosen_channel: str | None) -> float:
    """Process all frames; return the duration in seconds.

    Raises:
        UserError: the frames come from several buses, and none was selected.
    """
    begin = time.monotonic()
    with suppress(KeyboardInterrupt):  # the frames received until then count
        for frame in opened.frames:
            if len(opened.skipped.channels) > 1 and chosen_channel is None:
                raise UserError(
                    "the recording contains several buses, and the load is that of one bus",
                    observed=", ".join(opened.skipped.channels),
                    remedy="choose one of them: --channel NAME",
                )
            one = decoder.feed(frame)  # needed to learn identifiers, although only the kind is used
            meter.add(frame, one.kind.value, one.node)
    return time.monotonic() - begin


def _rate(cell: CellConfig | None, interface: str | None, channel: str | None) -> int:
    """Return the bus's bit rate.

    Raises:
        ArgumentError: it is unknown.
    """
    rate = rate_of(cell, interface, channel)
    if rate is None:
        raise ArgumentError(
            "the bus load cannot be calculated: the bit rate is not known",
            remedy="give it with -b 1000000, or write bitrate in [bus] of the cell file",
        )
    return rate


def _plain(found: MeasuredLoad, first: float) -> dict[str, Any]:
    def share(one: LoadShare) -> dict[str, Any]:
        return {
            "frames": one.frames,
            "frames_per_second": one.frames / found.seconds,
            "load": found.load(one),
            "load_worst": found.worst(one),
        }

    nodes = sorted(found.by_node.items(), key=lambda item: (item[0] is not None, item[0] or 0))
    return {
        "bitrate": found.bitrate,
        "seconds": found.seconds,
        **share(found.total),
        "by_node": [{"node": node, **share(one)} for node, one in nodes],
        "by_kind": [{"kind": kind, **share(one)} for kind, one in sorted(found.by_kind.items())],
        "worst_100ms": {"load": found.peak.load, "at": max(0.0, found.peak.time - first)},
        "error_frames": found.error_frames,
        "errors": dict(found.errors),
    }


# -- for people --------------------------------------------------------------------------------------------------------


def _show(report: dict[str, Any], options: FrameSourceOptions) -> None:
    planned, measured = report.get("planned"), report.get("measured")
    if planned is not None:
        say(
            f"planned at {planned['bitrate'] / 1000:g} kbit/s, a cycle each {planned['scan_period'] * 1000:g} ms:"
        )
        say(
            f"  {planned['load_least']:.1%} without stuff bits, {planned['load_worst']:.1%} with the most there can be"
        )
        _table(planned, ("load_least", "load_worst"), "least    worst")
    if measured is not None:
        peak = measured["worst_100ms"]
        say(
            f"measured at {measured['bitrate'] / 1000:g} kbit/s in {measured['seconds']:.3g} s, "
            f"{counted(measured['frames'], 'frame')}:"
        )
        say(
            f"  {measured['load']:.1%} with the stuff bits there were, {measured['load_worst']:.1%} with the most there can be"
        )
        say(f"  the fullest 100 ms: {peak['load']:.1%}, at {peak['at']:.3f} s")
        say(f"  error frames: {measured['error_frames']}")
        for text, count in measured["errors"].items():
            say(f"    {count} x {text}")
        if measured["errors"]:
            say(f"    check {WHAT_TO_CHECK}")
        _table(measured, ("load", "load_worst"), "load    worst")
        if measured["lines_skipped"]:
            skipped = counted(measured["lines_skipped"], "line is not a frame", "lines are not frames")
            say(f"  {skipped}, the first is {measured['first_skipped']}")
    _next(report, options)


def _table(part: dict[str, Any], columns: tuple[str, str], titles: str) -> None:
    say(f"  {'':<14} {'frames/s':>10} {titles.split()[0]:>8} {titles.split()[1]:>8}")
    for row in part["by_node"]:
        _row("of no node" if row["node"] is None else f"node {row['node']}", row, columns)
    for row in part["by_kind"]:
        _row(row["kind"], row, columns)


def _row(name: str, row: dict[str, Any], columns: tuple[str, str]) -> None:
    first, second = (f"{row[column]:.2%}" for column in columns)
    say(f"  {name:<14} {row['frames_per_second']:>10.1f} {first:>8} {second:>8}")


def _next(report: dict[str, Any], options: FrameSourceOptions) -> None:
    if "measured" not in report:
        say_next(f"measure it while the cell runs: axisbus load {options.cell_file} --seconds 5")
    else:
        say_next(
            "to see the frames decoded: axisbus trace "
            + (options.source or f"-i {options.interface} -c {options.channel}")
        )
