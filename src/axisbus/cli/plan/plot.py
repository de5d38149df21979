"""The timetable of a cycle as a plot (needs the ``plot`` extra): a row for each node, a bar for each of its frames."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell.model import CellConfig
from axisbus.check.cycle_schedule import CycleSlot, Timetable
from axisbus.cli.shared import axes as named
from axisbus.record.plot import load_pyplot

_COLOURS = {
    "SYNC": "#555555",
    "TIME": "#555555",
    "TPDO": "#1f6fb4",
    "RPDO": "#c8553d",
    "request": "#8a6d1d",
    "heartbeat": "#3a7d44",
}
_WORDS = {
    "SYNC": "SYNC",
    "TIME": "TIME",
    "TPDO": "TPDO (from the drive)",
    "RPDO": "RPDO (to the drive)",
    "request": "request for a TPDO",
    "heartbeat": "heartbeat",
}
_WIDTH, _ROW, _AROUND = 11.0, 0.34, 1.9  # inches
_MS = 1000.0
_SELDOM = 0.45  # opacity of a frame that is not sent in every cycle
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
    figure, panel = pyplot.subplots(figsize=(_WIDTH, _AROUND + _ROW * len(rows)), layout="constrained")
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
    seldom = slot.share < 1
    label = _WORDS[slot.kind] + (", not in every cycle" if seldom and slot.kind != "heartbeat" else "")
    panel.barh(  # type: ignore[attr-defined]
        row, length, left=begin, height=0.7, color=_COLOURS[slot.kind], alpha=_SELDOM if seldom else 1.0,
        edgecolor="white", linewidth=0.8, label=label,
    )  # fmt: skip
    number = slot.name[-1] if slot.kind in ("TPDO", "RPDO") else ""
    if number and length > _NARROW * width * 0.4:
        panel.text(begin + length / 2, row, number, ha="center", va="center", color="white", fontsize=7)  # type: ignore[attr-defined]
