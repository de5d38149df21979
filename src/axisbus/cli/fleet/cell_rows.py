"""The output for a cell of a fleet: as plain values, and as rows of texts; unknown values are shown as unknown."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from axisbus.fleet.cell import FleetCell
from axisbus.fleet.cell_state import LastAxisState
from axisbus.fleet.messages import Event, RecordingInfo
from axisbus.wording import age_text, counted, with_subject

_INCIDENTS = 3  # the most incidents shown for a cell, newest first
_CLOCKS = 0.5  # seconds; a larger clock difference, including the transmission time, is reported
UNKNOWN = "unknown"
Recordings = Sequence[RecordingInfo] | str  # or why they are unknown


def plain(cell: FleetCell, recordings: Recordings) -> dict[str, Any]:
    """Return the known state of a cell as plain values; unknown values are None."""
    info = cell.info
    return {
        "cell": cell.name,
        "alive": cell.alive,
        "since": cell.since,
        "axisbus": None if info is None else info.axisbus,
        "differs": cell.version_mismatch or None,
        "doubled": cell.duplicate_bridge,
        "simulated": None if info is None else info.simulated,
        "computer": None if info is None else info.computer,
        "clock_difference": cell.clock_difference,
        "axes": [_plain_axis(axis.name, axis.unit, cell.last_state(axis.name)) for axis in cell],
        "incidents": [_plain_event(event) for event in cell.incidents[-_INCIDENTS:]],
        "lost_events": cell.lost_events,
        "recordings": None
        if isinstance(recordings, str)
        else [{"name": one.name, "size": one.size, "written": one.written} for one in recordings],
    }


def _plain_axis(name: str, unit: str, last: LastAxisState | None) -> dict[str, Any]:
    values: dict[str, Any] = dict.fromkeys(
        ("state", "drive", "mode", "position", "velocity", "torque", "homed", "error")
    )
    if last is not None and last.fresh:
        values = {key: getattr(last.state, key) for key in values}
    return {"axis": name, "unit": unit, **values, "age": None if last is None else last.age}


def _plain_event(event: Event) -> dict[str, Any]:
    keys = ("n", "clock", "kind", "about", "severity", "text", "cause", "remedy")
    return {key: getattr(event, key) for key in keys}


# -- texts -------------------------------------------------------------------------------------------------------------


def heading(cell: FleetCell) -> list[str]:
    """Return the lines about a cell as a whole: whether it is present, and its irregularities."""
    facts = ["alive" if cell.alive else cell.offline_reason.replace("gone", "GONE", 1)]
    info = cell.info
    if info is not None:
        facts += ["simulated"] if info.simulated else []
        facts += [f"on {info.computer}"] if info.computer else []
    facts += [f"VERSION DIFFERS: {cell.version_mismatch}"] if cell.version_mismatch else []
    facts += ["TWO BRIDGES HAVE THIS NAME"] if cell.duplicate_bridge else []
    if cell.clock_difference is not None and abs(cell.clock_difference) > _CLOCKS:
        facts.append(f"its clock differs by {cell.clock_difference:+.1f} s")
    return list(map(_printable, facts))


def axis_rows(cell: FleetCell) -> list[tuple[str, ...]]:
    """Return a row of texts for each axis: name, state, position, velocity, age, remarks."""
    return [
        tuple(map(_printable, (axis.name, *_axis_texts(axis.unit, cell.last_state(axis.name)))))
        for axis in cell
    ]


def _axis_texts(unit: str, last: LastAxisState | None) -> tuple[str, ...]:
    age = "" if last is None or last.age is None else age_text(last.age)
    if last is None or not last.fresh:
        return UNKNOWN, UNKNOWN, UNKNOWN, age, ""
    state = last.state
    details = ", ".join(text for text in (state.drive, state.mode, state.error) if text)
    return (
        state.state,
        _number(state.position, unit),
        _number(state.velocity, f"{unit}/s"),
        age,
        details,
    )


def cell_lines(cell: FleetCell, recordings: Recordings) -> list[str]:
    """Return a cell as lines: itself, its axes, its newest incidents, and, while it is alive, its recordings."""
    rows = [
        f"{name:<8} {state:<18} {position:>20} {velocity:>20} {age:>7}  {details}".rstrip()
        for name, state, position, velocity, age, details in axis_rows(cell)
    ]
    below = [*rows, *incident_lines(cell), *([recordings_line(recordings)] if cell.alive else [])]
    return [f"{cell.name}: {', '.join(heading(cell))}", *(f"  {line}" for line in below)]


def incident_lines(cell: FleetCell) -> list[str]:
    """Return the newest incidents, each with its cause and remedy if they are known, and the number of lost events."""
    lines = []
    for event in cell.incidents[-_INCIDENTS:]:
        lines.append(f"{_at(event.clock)} {with_subject(event.about, event.text)}")
        lines += [
            f"         {what}: {text}"
            for what, text in (("cause", event.cause), ("remedy", event.remedy))
            if text
        ]
    if cell.lost_events:
        lines.append(f"{counted(cell.lost_events, 'event')} more were missed, and are no longer stored there")
    return list(map(_printable, lines))


def recordings_line(recordings: Recordings) -> str:
    """Return the recordings in a line, or why they are unknown."""
    if isinstance(recordings, str):
        return _printable(f"recordings unknown: {recordings}")
    if not recordings:
        return "no recordings"
    newest = max(recordings, key=lambda one: one.written)
    size = sum(one.size for one in recordings) / 1e6
    return f"{counted(len(recordings), 'recording')}, {size:.1f} MB, the newest {_printable(newest.name)}"


def _printable(text: str) -> str:
    """Return a text from the network made safe for a terminal: no character in it moves the cursor."""
    return "".join(each if each.isprintable() else " " for each in text)


def _at(clock: float) -> str:
    """Return a time of day by the clock of a cell's computer, which may have any value."""
    try:
        return time.strftime("%H:%M:%S", time.localtime(clock))
    except (OverflowError, ValueError, OSError):
        return "--:--:--"


def _number(value: float | None, unit: str) -> str:
    return UNKNOWN if value is None else f"{value:.3f} {unit}"
