"""The nodes, the bus, the cycle and the incidents as texts; newest first."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import WHAT_TO_CHECK, CanErrorState
from axisbus.bus.node.events import BAD
from axisbus.cia301.nmt import NmtState
from axisbus.errors import AxisbusError, seen_of
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.machine.signal_shutdown import ShutdownRequest
from axisbus.web.view.axes import UNKNOWN, Values, explained, in_page_terms
from axisbus.wording import with_subject

_SHOWN = 30  # incidents


@dataclass(frozen=True, slots=True)
class PageIncident:
    """An incident: its time (seconds, monotonic; None: it persists), a summary, its cause in lines, and the remedy."""

    stamp: float | None
    what: str
    lines: tuple[str, ...] = ()
    remedy: str = ""

    def told(self, now: float) -> Values:
        """Return the incident as plain values."""
        ago = "now" if self.stamp is None else f"{max(0.0, now - self.stamp):.0f} s ago"
        return {"ago": ago, "what": self.what, "lines": list(self.lines), "remedy": self.remedy}


def whole_cell(machine: Machine, beside: list[str], now: float) -> Values:
    """Return the state of the cell without its axes; ``beside`` are the lines about bus, cycle and programs. May block."""
    return {
        "nodes": [_node(machine, report) for report in machine.reports],
        "beside": [*beside, *_controller(machine)],
        "incidents": [happening.told(now) for happening in happenings(machine)],
        "command": _command(machine),
    }


def _command(machine: Machine) -> Values:
    """Return whether this program has control of the machine, and who has it, for people; after the session's end: this program."""
    if machine.session.ended:
        return {"ours": True, "by": ""}
    holder = next((each.who for each in machine.programs if each.commands), "nobody")
    return {"ours": machine.has_control, "by": holder}


def happenings(machine: Machine) -> list[PageIncident]:
    """Return the incidents, newest first; the errors of axes in ErrorStop come before all others."""
    found = [*_of_nodes(machine), *_of_bus(machine), *_events(machine)]
    found.sort(key=lambda happening: happening.stamp or 0.0, reverse=True)
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
