"""``axisbus jitter``: measure how regular a cell's cycle is, caused by computer, bus and drives."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import click

from axisbus.cell.model import CellConfig
from axisbus.check.cycle_schedule import CycleSlot, timetable
from axisbus.cli.shared.attach_or_open import frames_of, machine_of
from axisbus.cli.shared.buses import rate_of
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_next
from axisbus.cli.shared.options import PATH, Seconds, beside_option
from axisbus.cli.shared.output import force_option, picture_option, require_free, write_file
from axisbus.core.files import load_dictionaries
from axisbus.errors import UserError
from axisbus.machine.machine import Machine
from axisbus.record.plot import load_pyplot, require_picture
from axisbus.trace.cycle_timing import MEASURED, CycleTiming, CyclicIdentifiers, histogram, spread
from axisbus.wording import counted

_ANY_RATE = 1_000_000  # only identifiers are needed, not times
_BINS, _BAR = 16, 48
_US = 1e6


@click.command("jitter")
@click.argument("cell", type=PATH)
@click.option(
    "--for", "seconds", type=Seconds(0.1), default=10.0, show_default=True, help="Duration in seconds."
)
@picture_option
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
@beside_option
def command(cell: Path, seconds: float, output: Path | None, force: bool, as_json: bool, beside: bool) -> int:
    """Measure the jitter of CELL's cycle; joins the running machine, or boots the cell if none is running; energises nothing.

    It measures, as this computer sees the frames, the period of SYNC, the time from SYNC to the last TPDO and to the last RPDO,
    and the interval between the nodes' answers. On SocketCAN the times of reception are the kernel's. Exit code 1 if cycles are
    missing.
    """
    if output is not None:
        require_picture(output)
    require_free(output, force=force)
    with machine_of(cell, command=False, beside=beside) as machine:
        pace = measure(machine, seconds)
        jitter_text = str(machine.cycle_jitter)
    if not pace.cycles:
        raise UserError(
            "no SYNC was seen",
            remedy="jitter needs a cell with sync = true, and a bus (no simulation in virtual time)",
        )
    if as_json:
        say_json(_plain(pace))
    else:
        _show(pace, jitter_text)
    if output is not None:
        write_file(output, lambda file: draw(pace, file, cell.name))
        say(f"written: {output}")
    if not as_json:
        say_next(f"time needed on the wire alone: axisbus plan {cell}")
    return WRONG if pace.missing else OK


def measure(machine: Machine, seconds: float) -> CycleTiming:
    """Measure the frames of a machine for this time; blocks."""
    pace = CycleTiming(_cyclic_identifiers(machine.cell), machine.cell.bus.scan_period)
    with ExitStack() as stack:
        for frame in frames_of(stack, machine, seconds, sorted(pace.seen)):
            pace.add((frame,))
    pace.finish()
    return pace


def _cyclic_identifiers(cell: CellConfig) -> CyclicIdentifiers:
    slots = timetable(cell, load_dictionaries(cell), rate_of(cell) or _ANY_RATE).slots
    sent_each_cycle = [slot for slot in slots if slot.share >= 1]
    return CyclicIdentifiers(
        cell.bus.sync_cob_id,
        _ids(sent_each_cycle, "TPDO"),
        _ids(sent_each_cycle, "RPDO"),
        _first(sent_each_cycle),
    )


def _ids(slots: Sequence[CycleSlot], kind: str) -> frozenset[int]:
    return frozenset(slot.can_id for slot in slots if slot.kind == kind)


def _first(slots: Sequence[CycleSlot]) -> frozenset[int]:
    """Return the first TPDO of each node."""
    found: dict[int | None, int] = {}
    for slot in slots:
        if slot.kind == "TPDO":
            found.setdefault(slot.node, slot.can_id)
    return frozenset(found.values())


def _show(pace: CycleTiming, jitter_text: str) -> None:
    say(f"{counted(pace.cycles, 'cycle')} of {pace.period * 1000:g} ms, {pace.missing} missing")
    say(f"since it was opened: {jitter_text}")
    for name, title in MEASURED.items():
        values = getattr(pace, name)
        found = spread(values)
        if found is None:
            say(f"{title}: none was seen")
            continue
        say(
            f"{title}: {found.least * _US:.0f} to {found.worst * _US:.0f} µs, "
            f"half of them up to {found.p50 * _US:.0f}, 99 % up to {found.p99 * _US:.0f}"
        )
        _draw(values)


def _draw(values: Sequence[float]) -> None:
    bins = histogram(values, _BINS)
    most = max(count for *_, count in bins)
    for begin, end, count in bins:
        bar = "#" * max(round(count / most * _BAR), 1 if count else 0)
        say(f"{begin * _US:>9.0f} to {end * _US:>7.0f} {count:>7} {bar}".rstrip())


def _plain(pace: CycleTiming) -> dict[str, object]:
    figures = {name: spread(getattr(pace, name)) for name in MEASURED}
    return {
        "period": pace.period,
        "cycles": pace.cycles,
        "missing": pace.missing,
        **{name: None if found is None else found._asdict() for name, found in figures.items()},
    }


# -- The regularity of a cycle as a plot (needs the ``plot`` extra): one histogram for each measured value -------------


_PLOT_BINS = 60


_COLOUR, _MARK = "#1f6fb4", "#c8553d"


def draw(pace: CycleTiming, path: Path, name: str) -> None:
    """Plot the measurements as a PNG or SVG; raises UserError if matplotlib is not installed. Blocks meanwhile."""
    pyplot = load_pyplot()
    figure, panels = pyplot.subplots(2, 2, figsize=(11, 6), layout="constrained")
    for panel, (what, title) in zip(panels.flat, MEASURED.items(), strict=True):
        values = [value * _US for value in getattr(pace, what)]
        panel.set_xlabel(f"{title}, µs")
        panel.set_ylabel("cycles")
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
        found = spread(values)
        if found is None:
            panel.text(0.5, 0.5, "none was seen", ha="center", transform=panel.transAxes)
            continue
        panel.hist(values, bins=_PLOT_BINS, color=_COLOUR, log=True)
        panel.axvline(
            found.p99, color=_MARK, linewidth=1.2, linestyle="--", label=f"99 % up to {found.p99:.0f} µs"
        )
        panel.legend(frameon=False, loc="upper right")
    figure.suptitle(
        f"{name}: {counted(pace.cycles, 'cycle')} of {pace.period * 1000:g} ms, {pace.missing} missing"
    )
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
