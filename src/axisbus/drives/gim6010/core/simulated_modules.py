"""The simulated modules of a cell, and the user's access to one."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import partial
from typing import Any, NoReturn

from axisbus.cell.model import CellConfig
from axisbus.core.other_protocols import SimulatedGuest
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.drives.gim6010.cell.modules import modules_of, settings_of
from axisbus.drives.gim6010.sim.firmware import FACTORY, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import StateError

_COUNTS = 16384  # in a turn of its rotor


class ModuleStandIn(SimulatedNode):
    """One simulated module: ``module`` has its shaft and its fault settings (``dials``); for any thread."""

    def __init__(self, module: Module, lock: AbstractContextManager[object]) -> None:
        self.module = module
        self.lock = lock

    def history(self) -> tuple[float, float, int]:
        """As ``SimulatedNode.history``; the stage is the state of the module's axis: 1 is idle, 8 closed loop."""
        module = self.module
        return module.position * _COUNTS, module.shaft.speed * _COUNTS, int(module.axis.state)

    def drive(self, axis: int = 1) -> NoReturn:  # noqa: ARG002
        """Refuse: the motor is in ``module``."""
        raise StateError(
            f"node {self.module.node_id} is simulated as a module with CAN Simple, and has no CiA 402 drive",
            remedy="use .module: .module.shaft is its motor, .module.dials are its fault settings",
        )

    def fault(self, code: int, maker_bits: int = 0, axis: int = 1) -> None:  # noqa: ARG002
        """Put the module into fault with these bits of its motor's error word (``maker_bits``, else ``code``)."""
        with self.lock:
            self.module.dials.motor_error = maker_bits or code


def simulated_modules(cell: CellConfig) -> dict[int, SimulatedGuest]:
    """Make the modules of a cell, with their settings in the cell file; raises as ``settings_of``."""
    made = {node_id: _module(cell, node_id) for node_id in modules_of(cell)}
    return {node_id: SimulatedGuest(each, partial(ModuleStandIn, each)) for node_id, each in made.items()}


def _module(cell: CellConfig, node_id: int) -> Module:
    settings, firmware = settings_of(cell, node_id), cell.nodes[node_id].firmware
    own: dict[str, Any] = {"vel_ramp_rate": settings.velocity_ramp}
    if settings.torque is not None:
        own |= {
            "torque_ramp_rate": settings.torque.ramp,
            "axis0.motor.config.torque_constant": settings.torque.constant,
        }
    if settings.filter_bandwidth is not None:
        own["input_filter_bandwidth"] = settings.filter_bandwidth
    version = FACTORY if firmware is None else Firmware.read(firmware.removeprefix("v"))
    return Module(node_id, firmware=version, serial=node_id, **own)
