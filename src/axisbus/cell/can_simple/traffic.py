"""The frames of a cell's modules while it runs: cyclic messages, requests with their answers, and targets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.cell.can_simple.modules import carries_remote, modules_of, settings_of
from axisbus.cell.model import CellConfig
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import LENGTH, named
from axisbus.drives.gim6010.can_simple.periodic import FACTORY
from axisbus.drives.gim6010.can_simple.port.feedback import CURRENT_EVERY, SELDOM

_ESTIMATES, _COUNT, _CURRENT, _TARGET = (
    "Get_Encoder_Estimates",
    "Get_Encoder_Count",
    "Get_Iq",
    "Set_Input_Pos",
)


class ModuleFrame(NamedTuple):
    """Frames of one kind: ``rate`` per second at worst, in closed loop; ``to_module``: whether the master sends them."""

    node: int
    can_id: int
    kind: str
    name: str
    rate: float
    data_bytes: int
    to_module: bool


def module_frames(cell: CellConfig) -> Iterator[ModuleFrame]:
    """Return the frames of all modules; raises as ``settings_of``."""
    for node_id in modules_of(cell):
        yield from _of_module(cell, node_id)


def _of_module(cell: CellConfig, node: int) -> Iterator[ModuleFrame]:
    settings = settings_of(cell, node)
    period = settings.period
    yield _frame(node, "heartbeat", "Heartbeat", 1 / settings.heartbeat, LENGTH, to_module=False)
    # The master requests the estimates in every cycle from a module that does not send them automatically; the worst case counts.
    by_itself = 1000 / FACTORY[_ESTIMATES]
    asked = {_ESTIMATES: 1 / period, _COUNT: 1 / SELDOM}
    if settings.torque is not None:
        asked[_CURRENT] = 1 / max(CURRENT_EVERY, period)
    request = 0 if carries_remote(cell.bus) else LENGTH
    for name, rate in asked.items():
        yield _frame(node, "request", name, rate, request, to_module=True)
        answers = max(by_itself, rate) if name == _ESTIMATES else rate
        yield _frame(node, "answer", name, answers, LENGTH, to_module=False)
    yield _frame(node, "target", _TARGET, 1 / period, LENGTH, to_module=True)


def _frame(node: int, kind: str, name: str, rate: float, data_bytes: int, *, to_module: bool) -> ModuleFrame:
    return ModuleFrame(node, can_id(node, named(name).command), kind, name, rate, data_bytes, to_module)
