"""The report of boot-up for each node and axis, as values, as text and as JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from axisbus.boot import program_text
from axisbus.boot.program_text import LETTERS
from axisbus.boot.stop_report import StopSequenceReport, WatchdogReport
from axisbus.bus.pdo.eventtimer import EventTimer
from axisbus.cell.scale_proposal import ScaleReport
from axisbus.cia301 import abort
from axisbus.cia302.types import BootOutcome, Letter
from axisbus.errors import AxisbusError, BootError, help_line
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.promises import Promise, rows
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.boot.configure import DriveMonitoringSetup


@dataclass(frozen=True, slots=True)
class AxisReport:
    """One axis after boot-up."""

    name: str
    power: str
    found_enabled: bool
    modes: tuple[str, ...]
    mode_doubts: tuple[str, ...]
    transport: str
    event_timers: tuple[EventTimer, ...]
    in_one_sync: bool
    stop_sequence: StopSequenceReport
    scale: ScaleReport
    rated_torque: ScaleReport | None = None
    promises: tuple[Promise, ...] = ()
    demand: str = ""
    by_make: str = ""  # the keys of the axis that its drive plug-in sets


@dataclass(slots=True)
class NodeReport:
    """One node during and after boot-up; ``error`` names the failed step, ``steps`` lists the completed steps."""

    node_id: int
    device: str = ""
    identity: str = ""
    changed: tuple[str, ...] = ()  # since its nameplate was saved
    nmt: str = "unknown"
    program: str = ""
    configured: str = ""
    watchdog: WatchdogReport | None = None
    axes: list[AxisReport] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    error: AxisbusError | None = None
    optional: bool = False
    outcome: BootOutcome | None = None
    io: tuple[str, ...] = ()

    @property
    def absent(self) -> bool:
        """Whether the node is optional and absent."""
        return self.optional and self.outcome is not None and self.outcome.letter is Letter.B

    @property
    def ok(self) -> bool:
        """Whether the boot-up succeeded."""
        return self.error is None

    def text(self) -> str:
        """Return the report as lines for a user."""
        return "\n".join(self._lines())

    def as_json(self) -> dict[str, Any]:
        """Return the report as plain values."""
        return {
            "node": self.node_id,
            "ok": self.ok,
            "device": self.device,
            "identity": self.identity,
            "changed": list(self.changed),
            "nmt": self.nmt,
            "program": program_text.as_json(None if self.outcome is None else self.outcome.program),
            "configured": self.configured,
            "watchdog": None if self.watchdog is None else self.watchdog.kind.value,
            "warnings": list(self.warnings),
            "steps": list(self.steps),
            "optional": self.optional,
            "boot": None if self.outcome is None else _outcome_values(self.outcome),
            "error": None if self.error is None else _error(self.error),
            "axes": [_axis(axis) for axis in self.axes],
            "io": list(self.io),
        }

    def _lines(self) -> list[str]:
        lines = [f"node {self.node_id}: {self.device or 'not identified'}"]
        if self.absent:
            lines[0] = f"node {self.node_id}: not present; it is optional"
            return lines + _outcome_lines(self.outcome)
        if self.error is not None:
            step = f" at {self.error.step}" if isinstance(self.error, BootError) else ""
            text = f"{self.error}\n{help_line(self.error)}"
            lines.append(f"  FAILED{step}: " + text.replace("\n", "\n  "))
            return lines + _outcome_lines(self.outcome)
        rows = [
            ("identity", self.identity),
            *(("changed", text) for text in self.changed),
            ("NMT state", self.nmt),
            ("program", self.program),
            ("configured", self.configured),
            ("watchdog", f"{self.watchdog.kind.value}: {self.watchdog.text}" if self.watchdog else ""),
        ]
        lines += [f"  {title:<14}{text}" for title, text in rows if text]
        lines += _outcome_lines(self.outcome)
        for axis in self.axes:
            lines += _axis_lines(axis)
        lines += [f"  {'in, out' if not number else '':<14}{line}" for number, line in enumerate(self.io)]
        lines += [f"  WARNING  {warning}" for warning in self.warnings]
        return lines


def _axis_lines(axis: AxisReport) -> list[str]:
    rated = axis.rated_torque
    lines = [
        f"  axis {axis.name}",
        f"    {'power stage':<14}{axis.power}"
        + (" - FOUND ENABLED, left unchanged" if axis.found_enabled else ""),
        f"    {'modes':<14}{', '.join(axis.modes) or 'none'}",
        *(f"    {'':<14}{doubt}" for doubt in axis.mode_doubts),
        f"    {'scale':<14}{axis.scale.configured}; {axis.scale.proposed}",
        *([f"    {'rated torque':<14}{rated.configured}; {rated.proposed}"] if rated is not None else []),
        *(f"    {limit:<16}{text}" for limit, text in rows(axis.promises)),
        f"    {'travels by':<14}{axis.transport}",
        *(f"    {'event timer':<14}{timer}" for timer in axis.event_timers),
        f"    {'one SYNC':<14}"
        + (
            "starts and stops together with others in one SYNC"
            if axis.in_one_sync
            else "NOT synchronous with other axes"
        ),
        *([f"    {'demand':<14}{axis.demand}"] if axis.demand else []),
        *([f"    {'by its make':<14}{axis.by_make}"] if axis.by_make else []),
        "    stop sequence",
    ]
    width = max(len(row[1]) for row in axis.stop_sequence.rows)
    lines += [f"      {title:<15}{what:<{width}}  {text}" for title, what, text in axis.stop_sequence.rows]
    return lines


def _axis(axis: AxisReport) -> dict[str, Any]:
    return {
        "name": axis.name,
        "power": axis.power,
        "found_enabled": axis.found_enabled,
        "modes": list(axis.modes),
        "mode_doubts": list(axis.mode_doubts),
        "travels": axis.transport,
        "event_timers": [
            {"pdo": timer.pdo, "was_ms": timer.was, "wanted_ms": timer.wanted, "now_ms": timer.now}
            for timer in axis.event_timers
        ],
        "in_one_sync": axis.in_one_sync,
        "stop_sequence": [
            {"step": step, "object": what, "does": text} for step, what, text in axis.stop_sequence.rows
        ],
        "demand": axis.demand,
        "by_make": axis.by_make,
        "scale": _compared(axis.scale),
        "rated_torque": None if axis.rated_torque is None else _compared(axis.rated_torque),
        "promises": [{**each._asdict(), "kept": each.kept.value} for each in axis.promises],
    }


def _compared(scale: ScaleReport) -> dict[str, Any]:
    return {"configured": scale.configured, "proposed": scale.proposed, "agrees": scale.agrees}


def _error(error: AxisbusError) -> dict[str, Any]:
    fields = {
        key: value
        for key, value in vars(error).items()
        if isinstance(value, (str, int, float)) or value is None
    }
    return {"kind": type(error).__name__, "page": error.page, **fields}


# -- The result of booting a node --------------------------------------------------------------------------------------


@dataclass(slots=True)
class Booted:
    """A booted node: its report, the parameters of its axes, and the monitoring setup that is undone when the node is released."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    watch: DriveMonitoringSetup | None = None
    found_enabled: bool = False


# -- The course of a boot-up: letter, step, object, expected, got, abort, tries, time ---------------------------------------------

_WIDTH = 14


def _outcome_lines(outcome: BootOutcome | None) -> list[str]:
    """Return the lines that matter; a boot-up without incident has one."""
    if outcome is None:
        return []
    found = [("boot-up", _outcome_summary(outcome))]
    if not outcome.ok:
        found += [
            ("object", _outcome_object(outcome)),
            ("expected", _outcome_value(outcome.expected, outcome)),
            ("got", _outcome_value(outcome.got, outcome)),
            ("abort", "" if outcome.abort is None else abort.describe(outcome.abort)),
            ("done before", ", ".join(outcome.done)),
        ]
    found += [("skipped", text) for text in outcome.skipped]
    return [f"  {title:<{_WIDTH}}{text}" for title, text in found if text]


def _outcome_values(outcome: BootOutcome) -> dict[str, Any]:
    """Return a boot-up as plain values; numbers stay numbers."""
    return {
        "ok": outcome.ok,
        "letter": None if outcome.letter is None else outcome.letter.name,
        "sentence": outcome.sentence,
        "step": outcome.step,
        "object": _outcome_object(outcome) or None,
        "expected": _plain(outcome.expected),
        "got": _plain(outcome.got),
        "abort": outcome.abort,
        "abort_text": None if outcome.abort is None else abort.explain(outcome.abort).text,
        "tries": outcome.tries,
        "retries": outcome.retries,
        "elapsed": round(outcome.elapsed, 3),
        "found": outcome.found.text,
        "error_control": outcome.control.value,
        "done": list(outcome.done),
        "skipped": list(outcome.skipped),
    }


def _outcome_object(outcome: BootOutcome) -> str:
    """Return the object at which the boot-up ended, such as ``1018h:02``; empty if there is none."""
    return "" if outcome.address is None else f"{outcome.address[0]:04X}h:{outcome.address[1]:02X}"


def _outcome_summary(outcome: BootOutcome) -> str:
    letter = f"{outcome.letter.name}: {outcome.letter.sentence}; " if outcome.letter is not None else ""
    again = f", {counted(outcome.retries, 'request')} repeated" if outcome.retries else ""
    end = f"{outcome.elapsed:.2f} s{again}"
    return (
        f"{letter}in {end}"
        if outcome.ok
        else f"{letter}step {outcome.step}, try {outcome.tries}, after {end}"
    )


def _outcome_value(value: object, outcome: BootOutcome) -> str:
    if value is None:
        return ""
    if isinstance(value, str) and outcome.letter in LETTERS:
        return value  # a date or a state in words
    return f"0x{value:X} ({value})" if isinstance(value, int) and not isinstance(value, bool) else repr(value)


def _plain(value: object) -> object:
    return value.hex() if isinstance(value, bytes) else value
