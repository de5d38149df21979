"""Executes planned faults on simulated drives; the values for their conditions come from the drives themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.cia402.state import decode
from axisbus.eds.model import Eds
from axisbus.record.columns import AxisForm, digits
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.faults.plan import Plan, PlannedFault


class Player:
    """Holds the plan, and the drive of each axis with its units. Positions are those of the drive (6064h)."""

    def __init__(
        self,
        faults: Sequence[PlannedFault],
        cell: CellConfig,
        dictionaries: Mapping[int, Eds],
        devices: Mapping[int, Device],
        lock: AbstractContextManager[object],
    ) -> None:
        """``lock``: that of the devices, taken for each step."""
        self._plan = Plan(faults, devices)
        self._lock = lock
        self._axes = {
            name: (
                devices[axis.node].drives[axis.drive_axis - 1],
                AxisForm.of(axis_parameters(cell, name, dictionaries[axis.node])),
            )
            for name, axis in cell.driven.items()
        }

    def step(self, now: float) -> list[str]:
        """Execute the faults that are due ``now`` (seconds since the drives began); return the texts about them."""
        with self._lock:
            return self._plan.step(now, {name: _values(*axis) for name, axis in self._axes.items()})


def _values(drive: Drive, form: AxisForm) -> dict[str, Any]:
    return {
        "position": round(drive.position / form.position, digits(form.position)),
        "velocity": round(drive.velocity / form.velocity, digits(form.velocity)),
        "torque": drive.torque * form.torque,
        "state": decode(drive.statusword).value,
        "mode": drive.mode_display,
        "statusword": drive.statusword,
    }
