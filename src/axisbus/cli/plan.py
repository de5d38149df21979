"""``axisbus plan``: the transmission times of the frames of a cycle, and the shortest cycle that the bus permits."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.check.cycle_schedule import SDO_TRANSFER, CycleSlot, Timetable, shortest, timetable
from axisbus.check.scan_period_advice import PeriodReduction, changes
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.buses import rate_of
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_next
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import force_option, picture_option, require_free, write_file
from axisbus.core.files import load_dictionaries
from axisbus.errors import ArgumentError
from axisbus.record.plot import load_pyplot, require_picture

_US = 1e6


@click.command("plan")
@click.argument("cell", type=PATH)
@click.option(
    "-b", "--bitrate", type=click.IntRange(min=1), help="Bit rate in bit/s, instead of the cell's own."
)
@picture_option
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the timetable as JSON.")
def command(cell: Path, bitrate: int | None, output: Path | None, force: bool, as_json: bool) -> int:
    """Show the timetable of CELL's cycle: the latest time of each frame on the wire, with the highest possible number of stuff
    bits.

    It also shows the time left in the cycle for SDO and heartbeats, the shortest scan_period that the wire allows, and changes
    that would shorten it. It opens no bus. axisbus jitter measures the additional delays of the drives and of the computer.
    Exit code 1 if the cycle does not fit.
    """
    if output is not None:
        require_picture(output)
    require_free(output, force=force)
    loaded = reader.load(cell)
    files = load_dictionaries(loaded)
    rate = bitrate or _known_rate(loaded)
    table, shortest_period = timetable(loaded, files, rate), shortest(loaded, files, rate)
    shorter = changes(loaded, files, rate)
    if as_json:
        say_json(_plain(table, shortest_period, shorter))
    else:
        _show(loaded, table)
        _show_periods(table, shortest_period, shorter)
    if output is not None:
        write_file(output, lambda file: draw(table, loaded, file))
        say(f"written: {output}")
    if not as_json:
        say_next(f"to measure computer and drives: axisbus jitter {cell}")
    return OK if table.fits else WRONG


def _known_rate(cell: CellConfig) -> int:
    rate = rate_of(cell)
    if rate is None:
        raise ArgumentError(
            "the timetable cannot be calculated: the bit rate is not known",
            remedy="give it with -b 1000000, or write bitrate in [bus] of the cell file",
        )
    return rate


def _show(cell: CellConfig, table: Timetable) -> None:
    say(
        f"at {table.bitrate / 1000:g} kbit/s, a cycle each {table.period * 1000:g} ms; µs after its beginning, at the latest:"
    )
    say(f"{0:>8} {table.waits * _US:>8.0f}  a frame that is already on the wire, for which SYNC waits")
    for slot in table.slots:
        say(_row(cell, slot))


def _row(cell: CellConfig, slot: CycleSlot) -> str:
    share_text = "" if slot.share == 1 else f"in {slot.share:.3g} of the cycles"
    if slot.share > 1:
        share_text = f"{slot.share:.3g} times in a cycle"
    what = ", ".join(filter(None, (", ".join(slot.carries), share_text)))
    return (
        f"{slot.begin * _US:>8.0f} {slot.end * _US:>8.0f}  {slot.can_id:03X}h  "
        f"{named.of_node(cell, slot.node):<8} {slot.name:<10} {what}"
    ).rstrip()


def _show_periods(table: Timetable, shortest_period: float | None, shorter: list[PeriodReduction]) -> None:
    say(
        f"the frames of every cycle are complete after {table.every * _US:.0f} µs, "
        f"in the fullest cycle after {table.fullest * _US:.0f}"
    )
    transfers = int(table.left * table.bitrate / SDO_TRANSFER)
    if table.fits:
        say(
            f"on average {table.load:.0%} of the wire are used; {table.left * _US:.0f} µs of a cycle are left: "
            f"{transfers} SDO transfers"
        )
    else:
        say(f"IT DOES NOT FIT: {table.load:.0%} of the wire are needed, with no time left for SDO")
    say(
        "no period up to 1 s is possible"
        if shortest_period is None
        else f'the shortest scan_period that the wire allows: "{shortest_period * 1000:g}ms"'
    )
    for change in shorter:
        say(f'  "{change.period * 1000:g}ms" with {change.what}')


def _plain(
    table: Timetable, shortest_period: float | None, shorter: list[PeriodReduction]
) -> dict[str, object]:
    return {
        "bitrate": table.bitrate,
        "period": table.period,
        "waits": table.waits,
        "slots": [{**asdict(slot), "bits": slot.bits} for slot in table.slots],
        "every": table.every,
        "fullest": table.fullest,
        "load": table.load,
        "left": table.left,
        "fits": table.fits,
        "shortest": shortest_period,
        "changes": [change._asdict() for change in shorter],
    }


# -- The timetable of a cycle as a plot (needs the ``plot`` extra): a row for each node, a bar for each of its frames ----


_COLOURS = {
    "SYNC": "#555555",
    "TIME": "#555555",
    "TPDO": "#1f6fb4",
    "RPDO": "#c8553d",
    "request": "#8a6d1d",
    "heartbeat": "#3a7d44",
}
_LABELS = {
    "SYNC": "SYNC",
    "TIME": "TIME",
    "TPDO": "TPDO (from the drive)",
    "RPDO": "RPDO (to the drive)",
    "request": "request for a TPDO",
    "heartbeat": "heartbeat",
}
_WIDTH, _ROW, _MARGIN = 11.0, 0.34, 1.9  # inches
_MS = 1000.0
_OCCASIONAL_OPACITY = 0.45  # opacity of a frame that is not sent in every cycle
_NARROW = 0.035  # fraction of the width; a narrower bar has no room for its number


def draw(table: Timetable, cell: CellConfig, path: Path) -> None:
    """Plot ``table`` as a PNG or SVG; raises UserError if matplotlib is not installed. Blocks meanwhile."""
    pyplot = load_pyplot()
    rows = [
        "bus",
        *(f"{node_id}  {named.of_node(cell, node_id)}" for node_id in cell.nodes),
        f"{cell.bus.master_id}  master",
    ]
    nodes: list[int | None] = [None, *cell.nodes, cell.bus.master_id]
    at = {node_id: row for row, node_id in enumerate(nodes)}
    figure, panel = pyplot.subplots(figsize=(_WIDTH, _MARGIN + _ROW * len(rows)), layout="constrained")
    end = max(table.period, table.fullest) * _MS
    panel.barh(0, table.waits * _MS, color="#bbbbbb", height=0.7, label="a frame that is already on the wire")
    for slot in table.slots:
        _bar(panel, slot, at[slot.node], end)
    panel.axvline(table.period * _MS, color="#222222", linewidth=1.2, linestyle="--")
    panel.set_yticks(range(len(rows)), rows)
    panel.invert_yaxis()
    panel.set_xlim(0, end * 1.02)
    panel.set_xlabel("ms after the beginning of the cycle, at the latest; the dashed line is its end")
    panel.set_title(
        f"{Path(cell.file).name}: {table.period * _MS:g} ms at {table.bitrate / 1000:g} kbit/s, "
        f"{table.load:.0%} of the wire on average"
    )
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    handles, labels = panel.get_legend_handles_labels()
    shown = dict(zip(labels, handles, strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _bar(panel: object, slot: CycleSlot, row: int, width: float) -> None:
    begin, length = slot.begin * _MS, (slot.end - slot.begin) * _MS
    occasional = slot.share < 1
    label = _LABELS[slot.kind] + (", not in every cycle" if occasional and slot.kind != "heartbeat" else "")
    panel.barh(  # type: ignore[attr-defined]
        row, length, left=begin, height=0.7, color=_COLOURS[slot.kind], alpha=_OCCASIONAL_OPACITY if occasional else 1.0,
        edgecolor="white", linewidth=0.8, label=label,
    )  # fmt: skip
    number = slot.name[-1] if slot.kind in ("TPDO", "RPDO") else ""
    if number and length > _NARROW * width * 0.4:
        panel.text(begin + length / 2, row, number, ha="center", va="center", color="white", fontsize=7)  # type: ignore[attr-defined]
