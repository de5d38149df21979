"""PDOs of one axis that are lost, or late, in both directions; and another master on the same bus."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtCommand
from axisbus.sim.virtual_can import FrameFaults
from axisbus.testing import Simulation
from kit.cell import Cell

# s by which frames come later, how often they do so more, and at most. By small steps: a jump of about a cycle looks like a lost
# frame, and counts as one for up to 1.6 s if the drive does not answer SDO meanwhile (docs/stopping.md).
_LATER, _EACH, _LATEST = 0.0003, 0.002, 0.3


class Wire:
    """The PDOs of one axis on the wire. Its fields are fault settings.

    ``inputs_lost``, ``outputs_lost``: the share of frames that never arrive. ``late``: cycles by which both come later.
    """

    def __init__(self, cell: Cell, name: str, period: float) -> None:
        plan = cell.port(name).plan.active
        self._inputs = {pdo.target.cob_id: FrameFaults() for pdo in plan if not pdo.receive}
        self._outputs = {pdo.target.cob_id: FrameFaults() for pdo in plan if pdo.receive}
        self._by_id = cell.wire.faults.by_id
        self._period = period

    def turn(self, dial: str, value: float) -> None:
        """Change a fault setting."""
        whose = {
            "inputs_lost": self._inputs,
            "outputs_lost": self._outputs,
            "late": self._inputs | self._outputs,
        }
        for faults in whose[dial].values():
            if dial == "late":
                faults.delay = value * self._period
            else:
                faults.loss = value
        self._by_id.update(self._inputs | self._outputs)


# -- another master: its effects on a drive -------------------------------------------------------------------------------


def _words(cell: Cell, name: str, *words: int) -> None:
    drive = cell.drive(name)
    for word in words:
        drive.controlword = word
        drive.evaluate_controlword()


def _set_point(cell: Cell, name: str, value: float) -> None:
    drive = cell.drive(name)
    drive.target_position = drive.position + round(200.0 * value * cell.scale_of(name))
    _words(cell, name, 0x0F, 0x3F)


def _velocity(cell: Cell, name: str, value: float) -> None:
    drive = cell.drive(name)
    drive.mode, drive.target_velocity = 3, round(60.0 * value * cell.scale_of(name))


def _enable(cell: Cell, name: str) -> None:
    """Send controlwords until the drive has power, between two cycles of ours: its transitions take 2 ms each."""

    def send(*words: int) -> None:
        cell.wire.catch_up(cell.clock.now())
        _words(cell, name, *words)

    simulation = Simulation(cell.machine)
    simulation.after(0.001, lambda: send(0x06, 0x07, 0x0F))
    simulation.after(0.004, lambda: send(0x0F))
    simulation.after(0.007, lambda: send(0x0F))


def _program(cell: Cell, name: str) -> None:
    """Send RPDOs of its own for 0.1 s, 200 per second: the drive's present mode and target, and the word of an enabled drive."""
    drive, adapter, simulation = cell.drive(name), cell.wire.connect(), Simulation(cell.machine)
    values = {
        "controlword": 0x0F,
        "mode": drive.mode_display,
        "target_position": drive.target_position,
        "target_velocity": drive.target_velocity,
    }
    for pdo in cell.port(name).plan.active:
        if not pdo.receive or "controlword" not in pdo.values:
            continue
        data = b"".join(
            (values.get(value or "", 0) & ((1 << mapped.bits) - 1)).to_bytes(mapped.bits // 8, "little")
            for value, mapped in zip(pdo.values, pdo.target.mapping, strict=True)
        )
        for number in range(20):
            simulation.after(0.005 * number, partial(adapter.send, pdo.target.cob_id, data))
    simulation.after(0.11, adapter.shutdown)


def boot_up_frame(cell: Cell, name: str) -> None:
    """Let another device send the boot-up frame of the node of an axis."""
    adapter = cell.wire.connect()
    adapter.send(cob.HEARTBEAT + cell.device(name).node_id, b"\0")
    Simulation(cell.machine).after(0.01, adapter.shutdown)


def let_link_slow_down(cell: Cell) -> None:
    """Let frames come later and later, without a gap, up to 0.3 s; until the delay is taken away."""
    simulation, faults = Simulation(cell.machine), cell.wire.faults
    faults.delay = _LATER

    def later() -> None:
        if 0.0 < faults.delay < _LATEST:
            faults.delay += _LATER
            simulation.after(_EACH, later)

    simulation.after(_EACH, later)


OTHER_MASTER: Mapping[str, Callable[[Cell, str, float], object]] = {
    "other_shuts_down": lambda cell, name, _: _words(cell, name, 0x06),
    "other_quick_stops": lambda cell, name, _: _words(cell, name, 0x0B),
    "other_enables": lambda cell, name, _: _enable(cell, name),
    "other_sets_point": _set_point,
    "other_takes_velocity": _velocity,
    "other_program": lambda cell, name, _: _program(cell, name),
    "other_stops_node": lambda cell, name, _: cell.device(name).nmt_command(NmtCommand.STOP),
    "reboots": lambda cell, name, _: cell.device(name).nmt_command(NmtCommand.RESET_NODE),
}
