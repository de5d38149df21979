"""``axisbus monitor``: states, positions and faults of a cell's axes, its bus and its cycle, updated periodically."""

from __future__ import annotations

import time
from pathlib import Path

import click

from axisbus.bus.link.controller import WHAT_TO_CHECK, CanErrorState
from axisbus.cia301.dropped_frames import Drop, DropNews, words
from axisbus.cia301.incident import Incident
from axisbus.cia402 import statusword
from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.cli.shared.attach_or_open import machine_of
from axisbus.cli.shared.common import OK, coloured, rounds, say, say_json, say_next, with_page
from axisbus.cli.shared.machine_status import MachineStatus
from axisbus.cli.shared.options import PATH, Seconds, beside_option
from axisbus.errors import StaleError
from axisbus.machine.axis import Axis
from axisbus.machine.io import Signal
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.wording import age_text, with_subject

_REPAINTED, _PRINTED = 0.2, 1.0  # default seconds between two updates
_SHOWN = 3  # events of each node and sort in one update


every_option = click.option(
    "--every",
    type=Seconds(0.01),
    help=f"Seconds between two updates  [default: {_PRINTED:g}; {_REPAINTED:g} in a terminal]",
)


@click.command("monitor")
@click.argument("cell", type=PATH)
@every_option
@click.option("--count", type=click.IntRange(min=1), help="Number of updates; without it, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value per update.")
@click.option("--listen", is_flag=True, help="Boot nothing and send nothing: only listen to the bus.")
@beside_option
def command(
    cell: Path, every: float | None, count: int | None, as_json: bool, listen: bool, beside: bool
) -> int:
    """Boot CELL and show its axes, or join its machine if it is already running; energises nothing.

    On a terminal the output is one table, which is updated in place. "age" is the time since the drive reported the position.

    With --listen it boots nothing and sends nothing at all, also if a master is running: it shows NMT states, heartbeats, the
    newest PDOs with names and units, EMCYs, the period of SYNC, and the frames by which it recognises a master.
    """
    if listen:
        if beside:
            raise click.UsageError(
                "--listen sends nothing, so it does not need --beside: leave one of them out"
            )
        from axisbus.cli.monitor.listen import run as listen_to

        return listen_to(cell, _PRINTED if every is None else every, count, as_json)
    with machine_of(cell, command=False, beside=beside) as machine:
        for line in [] if as_json else histories(machine):
            say(line)
        try:
            watch(machine, _PRINTED if as_json and every is None else pace(every), count, as_json)
        finally:
            if not as_json and machine.dropped_frames:
                say(words(machine.dropped_frames))
    if not as_json:
        first = next(iter(machine), None)
        say_next(
            f"axisbus boot {cell}"
            if first is None
            else f"axisbus home {cell}, or axisbus move {cell} {first.name}=..."
        )
    return OK


def pace(every: float | None) -> float:
    """Return the seconds between two updates: as requested, else the default for a fixed table or for lines."""
    if every is not None:
        return every
    return _REPAINTED if coloured() else _PRINTED


def watch(machine: Machine, every: float, count: int | None, as_json: bool) -> None:
    """Show the axes ``count`` times (None: until Ctrl-C)."""
    known, drops, status = set[str](), DropNews(), MachineStatus(machine)
    if coloured() and not as_json:
        from axisbus.cli.monitor import live

        def read_update() -> live.MonitorUpdate:
            rows, new_lines = _rows(machine, known, drops)
            return live.MonitorUpdate(rows, [*io_lines(machine), *status.lines()], new_lines)

        live.show(read_update, lambda: machine.sleep(every), count)
        return
    for _ in rounds(count, lambda: machine.sleep(every)):
        if as_json:
            _print_json(machine, status)
        else:
            _print_update(machine, known, drops, status)


def _print_json(machine: Machine, status: MachineStatus) -> None:
    bus = {
        "bus_events": [str(event) for event in machine.bus_events],
        "dropped": [plain_drop(drop) for drop in machine.dropped_frames],
        "machine": status.values(),
        "io": {name: value_of(signal) for name, signal in machine.io.items()},
    }
    say_json([{**describe(axis), **of_node(machine, axis), **bus} for axis in machine])


def _print_update(machine: Machine, known: set[str], drops: DropNews, status: MachineStatus) -> None:
    for row in map(_row, machine):
        say(
            f"{row['axis']:<8} {row['state']:<18} {row['position']:>20} "
            f"{row['velocity']:>20} {row['age']:>7}  {row['power']}, {row['mode']}  {row['bits']}"
        )
        if row["error"]:
            say("         " + row["error"].replace("\n", "\n         "))
    for line in [*io_lines(machine), *status.lines(), *_since(machine, known, drops)]:
        say(f"         {line}")


def _rows(machine: Machine, known: set[str], drops: DropNews) -> tuple[list[dict[str, str]], list[str]]:
    """Return the values of each axis as texts, and the news since the last update, including new errors."""
    rows = [_row(axis) for axis in machine]
    wrong = {
        f"{row['axis']} {row['error']}": with_subject(row["axis"], row["error"])
        for row in rows
        if row["error"]
    }
    lines = [line for key, line in wrong.items() if key not in known]
    lines += _since(machine, known, drops)
    known.update(wrong)
    return rows, lines


def _row(axis: Axis) -> dict[str, str]:
    """Return an axis's present values as texts."""
    facts = describe(axis)
    numbers = {
        "position": _number(facts["position"], axis.unit),
        "velocity": _number(facts["velocity"], axis.unit + "/s"),
        "age": age_text(facts["age"]) if isinstance(facts["age"], float) else "",
    }
    texts = {key: str(value or "") for key, value in facts.items()} | numbers
    if facts["override"] != 1.0:
        texts["bits"] = ", ".join(text for text in (f"override {facts['override']:g}", texts["bits"]) if text)
    return texts


def io_lines(machine: Machine) -> list[str]:
    """Return the inputs and outputs in one line, none if the cell has none."""
    texts = [f"{name} {_value_text(signal)}" for name, signal in machine.io.items()]
    return [f"inputs and outputs: {', '.join(texts)}"] if texts else []


def value_of(signal: Signal) -> bool | int | float | None:
    """Return the value of an input or output, None if it is unknown."""
    try:
        return signal.value
    except StaleError:
        return None


def _value_text(signal: Signal) -> str:
    value = value_of(signal)
    if value is None:
        return "unknown"
    text = {True: "on", False: "off"}[value] if isinstance(value, bool) else f"{value:g}"
    return f"{text} {signal.unit}".strip()


def _since(machine: Machine, known: set[str], drops: DropNews) -> list[str]:
    """Return the news since the last update, including dropped frames."""
    dropped = words(drops.take(machine.dropped_frames, time.monotonic()))
    return [*new_lines(machine, known), *([dropped] if dropped else [])]


def plain_drop(drop: Drop) -> dict[str, object]:
    """Return dropped frames as plain values; identifier and data are those of the newest."""
    return {
        "what": str(drop),
        "fault": drop.fault.name.lower(),
        "node": drop.node,
        "count": drop.count,
        "cob_id": drop.can_id,
        "data": drop.data.hex(),
    }


def histories(machine: Machine) -> list[str]:
    """Return the errors in the nodes' own error history (1003h); blocks for a few transfers each."""
    lines = []
    for node_id in sorted(machine.cell.nodes):
        node = machine.node(node_id)
        if node.error_history():
            lines += [f"node {node_id}, earlier errors (1003h), the newest first:"]
            lines += [f"  {text}" for text in node.format_error_history()]
    return lines


def new_lines(machine: Machine, known: set[str]) -> list[str]:
    """Return the news since the last update: CAN controller, present state of incidents, missing TPDOs.

    ``known`` has the news of the last update. For each node and sort only the newest are shown, with the number of others.
    """
    present: set[str] = set()

    def is_new(key: str) -> bool:
        present.add(key)
        return key not in known

    bus = [event for event in machine.bus_events if is_new(f"{event.stamp} {event}")]
    lines = _newest([[str(event)] for event in bus], "events of the CAN controller")
    lines += [f"check {WHAT_TO_CHECK}"] if bus and bus[-1].condition is not CanErrorState.ACTIVE else []
    for node_id in sorted(machine.cell.nodes):
        node = machine.node(node_id)
        incidents = [incident for incident in node.incidents if is_new(_key(node_id, incident))]
        lines += _newest(
            [_incident_lines(node, incident) for incident in incidents], f"incidents of node {node_id}"
        )
        pdos = [event for event in node.pdo_events if is_new(f"{event.stamp} {event}")]
        lines += _newest([[str(event)] for event in pdos], f"events of the PDOs of node {node_id}")
    known.clear()
    known.update(present)
    return lines


def _key(node_id: int, incident: Incident) -> str:
    return f"{node_id}/{incident.number}/{len(incident.emcys)}/{len(incident.resets)}/{incident.outcome}"


def _incident_lines(node: NodeAccess, incident: Incident) -> list[str]:
    first, *rest = node.format_incident(incident)
    return [f"node {node.node_id}, {first}", *rest]


def _newest(found: list[list[str]], what: str) -> list[str]:
    """Return the newest lines, so that a node with many events does not push those of the others off the screen."""
    more = len(found) - _SHOWN
    head = [f"{more} more {what}, before these:"] if more > 0 else []
    return [*head, *(line for lines in found[-_SHOWN:] for line in lines)]


def of_node(machine: Machine, axis: Axis) -> dict[str, object]:
    """Return the incidents and PDO events of an axis's node, as plain values; a virtual axis has no node."""
    if machine.cell.axes[axis.name].virtual:
        return {"node": None, "incidents": [], "pdo_events": []}
    node = machine.node(machine.cell.axes[axis.name].node)
    return {
        "node": node.node_id,
        "incidents": [
            {
                "number": incident.number,
                "outcome": incident.outcome.value,
                "codes": [f"0x{code:04X}" for code in incident.codes],
                "lasted": incident.lasted,
                "text": node.format_incident(incident),
            }
            for incident in node.incidents
        ],
        "pdo_events": [str(event) for event in node.pdo_events],
    }


def describe(axis: Axis) -> dict[str, object]:
    """Return an axis's present values as plain values; unknown ones are None."""
    snapshot = axis.snapshot
    mode = None if snapshot.mode is None else ModeOfOperation(snapshot.mode)
    return {
        "axis": axis.name,
        "state": snapshot.state.value,
        "position": None if snapshot.position is None else axis.position,
        "velocity": None if snapshot.velocity is None else axis.velocity,
        "age": None if snapshot.position is None else snapshot.now - snapshot.position_stamp,
        "unit": axis.unit,
        "power": snapshot.power_state.value,
        "mode": "mode unknown" if mode is None else short(mode),
        "bits": ""
        if snapshot.statusword is None
        else ", ".join(statusword.bit_words(snapshot.statusword, mode)),
        "override": axis.total_override,
        "error": None if snapshot.error is None else with_page(snapshot.error),
    }


def _number(value: object, unit: str) -> str:
    return "unknown" if not isinstance(value, float) else f"{value:.3f} {unit}"
