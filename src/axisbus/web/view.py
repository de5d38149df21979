"""The present values of a machine as texts for its pages, those of the axes with their age; unknown values are shown as unknown."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import WHAT_TO_CHECK, CanErrorState
from axisbus.bus.node.events import BAD, NodeEventKind
from axisbus.cia301.nmt import NmtState
from axisbus.cia402 import statusword
from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.cia402.state import PowerState
from axisbus.errors import AxisbusError, BootError, NodeStateError, StaleError, seen_of
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.machine.signal_shutdown import ShutdownRequest
from axisbus.motion.modes import FOLLOWED
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.wording import age_text, with_subject

Values = dict[str, object]
_OLD = 1.0  # seconds; an older process image does not count as present


def all_axes(machine: Machine, now: float) -> dict[str, Values]:
    """Return the values of every axis by name; does not block. ``now`` in seconds of the monotonic clock."""
    facts = machine.session.axes
    return {axis.name: one_axis(axis, facts[axis.name].parameters, now) for axis in machine}


def one_axis(axis: Axis, parameters: AxisParameters, now: float) -> Values:
    """Return the values of an axis; ``known`` says whether its states are up to date."""
    snapshot, error = axis.snapshot, axis.error
    image_age = max(0.0, now - snapshot.now)
    known = _state(axis) is not None and image_age < _OLD
    mode = None if snapshot.mode is None else ModeOfOperation(snapshot.mode)
    word = snapshot.statusword if known else None
    decimals = decimals_for(abs(parameters.units.position.to_units(1)))
    return {
        "known": known,
        "state": snapshot.state.value if known else UNKNOWN,
        "power": snapshot.power_state.value if known else UNKNOWN,
        "mode": f"mode {short(mode) if known and mode is not None else UNKNOWN}",
        "bits": "" if word is None else ", ".join(statusword.bit_words(word, mode)),
        "homed": ("homed" if snapshot.homed else "not homed") if known else UNKNOWN,
        "position": _number(axis, "position", known, decimals),
        "velocity": _number(axis, "velocity", known, decimals),
        "torque": _number(axis, "torque", known, 3),
        "target": "" if axis.target is None or not known else number(axis.target, decimals),
        "position_age": age_text(max(0.0, now - snapshot.position_stamp))
        if snapshot.position is not None
        else "",
        "image_age": age_text(max(0.0, image_age)),
        "bars": marks(parameters, snapshot, lambda name: _value(axis, name, known)),
        "error": None if error is None else explained(error),
    }


def explained(error: AxisbusError) -> dict[str, str]:
    """Return the three texts of an error, and the page of its symptom."""
    texts = {"message": error.message, "observed": seen_of(error), "remedy": error.remedy}
    return {**{name: in_page_terms(text) for name, text in texts.items()}, "page": error.page}


def _state(axis: Axis) -> object | None:
    try:
        return axis.state
    except StaleError:
        return None


def _number(axis: Axis, name: str, known: bool, decimals: int) -> str:
    value = _value(axis, name, known)
    return UNKNOWN if value is None else number(value, decimals)


def _value(axis: Axis, name: str, known: bool) -> float | None:
    """Return a value of the axis by its name, None if it is unknown."""
    try:
        return float(getattr(axis, name)) if known else None
    except StaleError:
        return None


# ----------------------------------------------------------------------------------------------------------------------
# The limits of an axis as bars: their range, the position of the present value, and whether it is near or beyond a limit.


NEAR = 0.8  # fraction of the distance from the middle to a limit
UNKNOWN = "unknown"
_NEAR, _BEYOND = "near its limit", "beyond its limit"
_NOT_HOMED, _NOT_FOLLOWING = "applies after homing", "applies while it follows position set-points"


Span = tuple[float, float]


_DECIMALS = range(3, 7)


def decimals_for(increment: float) -> int:
    """Return the number of decimals to show for values with this increment: 3 to 6, so that one increment is visible."""
    needed = math.ceil(-math.log10(increment)) if increment > 0 else 0
    return min(max(needed, _DECIMALS[0]), _DECIMALS[-1])


def number(value: float, decimals: int) -> str:
    """Return a value as text with this number of decimals; a value that rounds to 0 has no sign."""
    return f"{value:z.{decimals}f}"


class Bar(NamedTuple):
    """The description of one bar: the name of the axis's value, and its limits in ``unit``; None if none is known.

    ``slack``: a value beyond a limit by no more than this counts as at the limit. ``decimals``: of the shown value.
    """

    name: str
    title: str
    unit: str
    bounds: Span | None
    slack: float = 0.0
    decimals: int = _DECIMALS[0]


class BarValue(NamedTuple):
    """The contents of a bar: its value as text, and the positions of the value and of 0 as fractions of its length.

    A position is None if it is unknown. ``told``: a remark in words; ``kind``: the style of the remark.
    """

    text: str
    now: float | None = None
    at: float | None = None
    zero: float | None = None
    kind: str = ""
    told: str = ""


def bars_of(parameters: AxisParameters) -> list[Bar]:
    """Return the bars of an axis; if neither the cell file nor the drive gives a limit, the bar has none."""
    units, limits = parameters.units, parameters.limits
    unit, increment = units.position.unit, abs(units.position.to_units(1))
    torque = "of rated torque" if units.rated_torque is None else "N·m"
    slack, decimals = parameters.position_tolerance * increment, decimals_for(increment)
    lag = _both(_lag(parameters, increment))
    return [
        Bar("position", "Position", unit, limits.position, slack, decimals),
        Bar("velocity", "Velocity", f"{unit}/s", _both(limits.velocity), decimals=decimals),
        Bar("torque", "Torque", torque, _both(limits.torque)),
        Bar("following_error", "Following error", unit, lag, decimals=decimals),
    ]


def mark(bar: Bar, value: float | None, not_enforced: str = "") -> BarValue:
    """Return the contents of a bar for a value, None if unknown; ``not_enforced``: why its limits do not apply now, else empty."""
    if value is None or bar.bounds is None:
        return BarValue(UNKNOWN if value is None else number(value, bar.decimals))
    low, high = bar.bounds
    at, zero = (min(1.0, max(0.0, (each - low) / (high - low))) for each in (value, 0.0))
    kind, told = ("loose", not_enforced) if not_enforced else _judged(bar.bounds, bar.slack, value)
    return BarValue(number(value, bar.decimals), min(high, max(low, value)), at, zero, kind, told)


def marks(
    parameters: AxisParameters, snapshot: Snapshot, read: Callable[[str], float | None]
) -> dict[str, dict[str, object]]:
    """Return the contents of each bar of an axis, by name; ``read`` returns a value by name, None if it is unknown."""
    why = _not_enforced(parameters, snapshot)
    return {
        bar.name: mark(bar, read(bar.name), why.get(bar.name, ""))._asdict()
        for bar in bars_of(parameters)
        if bar.bounds is not None
    }


def _not_enforced(parameters: AxisParameters, snapshot: Snapshot) -> dict[str, str]:
    """Return the limits that are not enforced at present, with the reason."""
    found = {}
    if parameters.homing.required and not snapshot.homed:
        found["position"] = _NOT_HOMED
    if snapshot.power_state is not PowerState.OPERATION_ENABLED or snapshot.mode not in FOLLOWED:
        found["following_error"] = _NOT_FOLLOWING
    return found


def _judged(bounds: Span, slack: float, value: float) -> tuple[str, str]:
    middle, half = (bounds[0] + bounds[1]) / 2, (bounds[1] - bounds[0]) / 2
    off = abs(value - middle)
    if off > half + slack:
        return "beyond", _BEYOND
    return ("near", _NEAR) if off > NEAR * half else ("", "")


def _both(limit: float | None) -> Span | None:
    return None if not limit else (-limit, limit)


def _lag(parameters: AxisParameters, increment: float) -> float | None:
    """Return the largest following error in units: from the cell file, else from the drive's 6065h; rounded to its resolution."""
    from_drive = parameters.following_error
    from_drive = parameters.drive_following_error if from_drive is None else from_drive
    if from_drive is None:
        return None
    return round(from_drive * increment, math.floor(-math.log10(increment))) or from_drive * increment


# -- Replace the calls in an error text of the library by the buttons of the page --------------------------------------


# Longer patterns first: the shorter ones replace the rest.
_TABLE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(call), words)
    for call, words in (
        (r" \(axis\.error\)", ""),
        (r"; in a program: \S+\(\w+\)\.(?:command\(NmtCommand\.START\)|boot\(\))", ""),
        (r"\(axisbus boot CELL --node (\d+)\)", r"(Boot node \1 in the view Cell)"),
        (r"; in a program: machine\.reconnect\(\)", ""),
        (
            r"close the machine,? and open it again",
            "end the program that runs the machine, and start it again",
        ),
        (r"; axis\.snapshot has the last known values, with their time", ""),
        (r"axis\.enable\(allow_moving=True\) catches it in motion; ", ""),
        (r"confirm its position \(axis\.set_position\(\.\.\.\)\)", "confirm its position, in a program"),
        (r"axis\.disable\(coast=True\)\.wait\(\)", "Disable"),
        (r"at axis\.position", "the position of the axis"),
        (r"axis\.(?:quick_stop|stop)\(\)", "Quick stop"),
    )
)
_BUTTON = re.compile(r"axis\.(enable|disable|reset|release|home|halt)\(\)")


def in_page_terms(text: str) -> str:
    """Return a text of the library for users of the page."""
    for call, words in _TABLE:
        text = call.sub(words, text)
    return _BUTTON.sub(lambda found: found[1].capitalize(), text)


# -- The nodes, the bus, the cycle and the incidents as texts; newest first ------------------------------------------------

_SHOWN = 30  # incidents
# Events after which a node is lost, or has lost its configuration.
_ENDED_BY_BOOT = frozenset(
    {
        NodeEventKind.LOST,
        NodeEventKind.UNANSWERED,
        NodeEventKind.BOOT_UP,
        NodeEventKind.STATE,
        NodeEventKind.UNKNOWN,
    }
)


@dataclass(frozen=True, slots=True)
class PageIncident:
    """An incident: its time (seconds, monotonic; None: it persists), a summary, its cause in lines, and the remedy."""

    stamp: float | None
    what: str
    lines: tuple[str, ...] = ()
    remedy: str = ""

    def as_values(self, now: float) -> Values:
        """Return the incident as plain values."""
        ago = "now" if self.stamp is None else f"{max(0.0, now - self.stamp):.0f} s ago"
        return {"ago": ago, "what": self.what, "lines": list(self.lines), "remedy": self.remedy}


def whole_cell(machine: Machine, status_lines: list[str], now: float) -> Values:
    """Return the state of the cell without its axes; ``status_lines`` are the lines about bus, cycle and programs. May block."""
    return {
        "nodes": [_node(machine, report) for report in machine.reports],
        "beside": [*status_lines, *_controller(machine)],
        "incidents": [incident.as_values(now) for incident in incidents_of(machine)],
        "command": _command(machine),
    }


def _command(machine: Machine) -> Values:
    """Return whether this program has control of the machine, and who has it, for people; after the session's end: this program."""
    if machine.session.ended:
        return {"ours": True, "by": ""}
    holder = next((each.who for each in machine.programs if each.commands), "nobody")
    return {"ours": machine.has_control, "by": holder}


def incidents_of(machine: Machine) -> list[PageIncident]:
    """Return the incidents, newest first; the errors of axes in ErrorStop come before all others."""
    found = [*_of_nodes(machine), *_of_bus(machine), *_events(machine)]
    found.sort(key=lambda incident: incident.stamp or 0.0, reverse=True)
    return [*_of_axes(machine), *found][:_SHOWN]


def _node(machine: Machine, report: NodeReport) -> Values:
    outcome = report.outcome
    letter = "" if outcome is None or outcome.letter is None else outcome.letter.name
    return {
        "node": report.node_id,
        "device": report.device or "not identified",
        "identity": report.identity,
        "nmt": _nmt(machine, report),
        "letter": letter,
        "boot": "" if outcome is None else outcome.sentence,
        "wrong": _wrong(machine, report),
        "needs_boot": _needs_boot(machine, report),
        "axes": [axis.name for axis in report.axes],
        "warnings": list(report.warnings),
    }


def _nmt(machine: Machine, report: NodeReport) -> str:
    return UNKNOWN if machine.session.silent is not None else machine.node(report.node_id).nmt.text


def _wrong(machine: Machine, report: NodeReport) -> dict[str, str] | None:
    """Return the present fault of a node: of its boot-up, of one of its axes, or of the node itself; None if it has none."""
    if report.absent:
        return _plainly("it is missing; it is optional")
    if report.error is not None:
        return explained(report.error)
    if (silent := machine.session.silent) is not None:
        return _plainly(f"not known: {silent}")
    wrong = [machine[axis.name].error for axis in report.axes]
    errors = {error.message: error for error in wrong if error is not None}
    if errors:
        first, *others = errors.values()
        return (
            {**explained(first), "message": "\n".join(map(in_page_terms, errors))}
            if others
            else explained(first)
        )
    node = machine.node(report.node_id)
    if node.events and node.events[-1].kind in BAD:
        return _plainly(str(node.events[-1]))
    return None if node.nmt is NmtState.OPERATIONAL else _plainly(f"its NMT state is {node.nmt.text}")


def _needs_boot(machine: Machine, report: NodeReport) -> bool:
    """Return whether a node is lost, has restarted, or did not boot; its axes cannot be used before it is booted."""
    node = machine.node(report.node_id)
    if not node.parts.has_objects or machine.session.silent is not None:
        return False
    if report.error is not None or node.nmt is not NmtState.OPERATIONAL:
        return True
    errors = (machine[axis.name].error for axis in report.axes)
    lost = bool(node.events) and node.events[-1].kind in _ENDED_BY_BOOT
    return lost or any(isinstance(error, (NodeStateError, BootError)) for error in errors)


def _plainly(message: str) -> dict[str, str]:
    return {"message": message, "observed": "", "remedy": ""}


def _controller(machine: Machine) -> list[str]:
    """Return the newest state of the CAN controller, if it has reported one, and the dropped frames."""
    events = machine.bus_events[-1:]
    return [*map(str, events), *(str(drop) for drop in machine.dropped_frames)]


def _of_axes(machine: Machine) -> list[PageIncident]:
    return [_of_error(axis.name, axis.error) for axis in machine if axis.error is not None]


def _of_error(name: str, error: AxisbusError) -> PageIncident:
    what = with_subject(name, error.message)
    return PageIncident(None, what, tuple(seen_of(error).splitlines()), in_page_terms(error.remedy))


def _of_nodes(machine: Machine) -> list[PageIncident]:
    return [found for report in machine.reports for found in _incidents(machine.node(report.node_id))]


def _incidents(node: NodeAccess) -> list[PageIncident]:
    found = []
    for incident in node.incidents:
        first, *rest = node.format_incident(incident)
        found.append(
            PageIncident(incident.began, f"node {node.node_id}, {first.rpartition(',')[0]}", tuple(rest))
        )
    return found


def _of_bus(machine: Machine) -> list[PageIncident]:
    return [
        PageIncident(event.stamp, str(event), (), f"check {WHAT_TO_CHECK}")
        for event in machine.bus_events
        if event.condition is not CanErrorState.ACTIVE
    ]


def _events(machine: Machine) -> list[PageIncident]:
    return [
        PageIncident(event.stamp, str(event))
        for event in machine.events
        if isinstance(event, ShutdownRequest) or event.kind in BAD
    ]
