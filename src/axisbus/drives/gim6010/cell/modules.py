"""The modules among a cell's nodes, the settings of their ports, and their axes as CiA 402 drives."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from axisbus.cell import scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.model import AxisConfig, BusConfig, CellConfig, NodeConfig
from axisbus.cell.other_protocols import NodeFrame
from axisbus.cell.parameters import axis_parameters
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware, with_version
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import LENGTH, named
from axisbus.drives.gim6010.can_simple.port.feedback import CURRENT_EVERY, SELDOM
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import MAKE, description
from axisbus.drives.gim6010.cell.module import MODBUS, ModuleConfig
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, StateError
from axisbus.motion.parameters import AxisParameters

NO_REMOTE = ("socketcand",)  # interfaces whose protocol has no remote frames


def carries_remote(bus: BusConfig) -> bool:
    """Whether the adapter of a bus can send remote frames."""
    return bus.interface not in NO_REMOTE


def is_line(bus: BusConfig) -> bool:
    """Whether a bus is a serial line, on which the master polls the modules one after the other."""
    return bus.interface == MODBUS


def modules_of(cell: CellConfig) -> list[int]:
    """Return the node-IDs of a cell's modules."""
    return sorted(node.node_id for node in cell.nodes.values() if module_of(node) is not None)


def module_of(node: NodeConfig) -> ModuleConfig | None:
    """Return the settings of a node that is a module; None if it is none."""
    return node.module if isinstance(node.module, ModuleConfig) else None


def no_objects(node_id: int, what: str) -> StateError:
    """Return the error for using a module as a CANopen node."""
    return StateError(
        f"node {node_id} uses CAN Simple or Modbus, not CANopen: {what}",
        remedy="use its axis; its own parameters are read and written by axisbus gim6010 params",
    )


def no_virtual_time(cell: CellConfig) -> StateError | None:
    """Return the error for running a cell in virtual time, if its modules are on a serial line."""
    if not is_line(cell.bus):
        return None
    return StateError(
        f"{cell.file} uses a serial line, which does not run in virtual time",
        remedy="axisbus sim --modbus 1 serves a simulated module on a port, which it prints: write that into [bus]",
    )


def settings_of(cell: CellConfig, node_id: int) -> ModuleSettings:
    """Return the settings of a module's port; a module has only one axis.

    Raises:
        ArgumentError, LimitError: a value is not valid for a module; ``axisbus check`` reports it with its line.
    """
    module = module_of(cell.nodes[node_id])
    assert module is not None
    axis = next(iter(cell.axes_of(node_id)), None)
    return module.settings(
        node_id,
        None if axis is None else axis.rated_torque,
        cell.bus.scan_period,
        None if axis is None else axis.stop.quick_stop,
        remote=carries_remote(cell.bus),
        relayed=is_line(cell.bus),
        modes=None if axis is None else axis.modes,
    )


def settings_by_axis(cell: CellConfig, names: Collection[str]) -> dict[str, ModuleSettings]:
    """Return the settings of the modules whose axes are among ``names``, by axis."""
    return {
        axis.name: settings_of(cell, node_id)
        for node_id in modules_of(cell)
        for axis in cell.axes_of(node_id)
        if axis.name in names
    }


# -- The list of endpoints that a cell file names for a module, and the firmware that the list belongs to --------------


def list_of(node: NodeConfig, folder: Path) -> tuple[EndpointList, Firmware] | None:
    """Return the list of a module and its firmware, by the file's name or else the node's ``firmware``; None if none is named.

    Raises:
        ArgumentError: the file cannot be read, or is no such list; its firmware is unknown, or file name and ``firmware`` differ.
    """
    module = module_of(node)
    if module is None or module.endpoints is None:
        return None
    path = folder / module.endpoints
    try:
        path = folder / Path(module.endpoints).expanduser()  # RuntimeError: unknown home folder
        text = path.read_bytes()
    except (OSError, RuntimeError) as error:
        raise ArgumentError(
            f"{path} cannot be read: {getattr(error, 'strerror', error)}",
            remedy="give the firmware's list of endpoints (the manufacturer's JSON file), a path relative to the cell file",
        ) from error
    return with_version(text, path.name, node.firmware)


# -- Modules on a serial line (``[bus] interface = "modbus"``): the options of their relay -----------------------------


def line_options(cell: CellConfig) -> Mapping[str, object]:
    """Return the adapter's options beside ``[bus.options]``: on a serial line, the list of endpoints of each module.

    Raises:
        ArgumentError: a list is unusable; ``axisbus check`` reports it with its line.
    """
    if not is_line(cell.bus):
        return {}
    lists = {node.node_id: list_of(node, cell.folder) for node in cell.nodes.values()}
    return {"modules": {node_id: found for node_id, found in lists.items() if found is not None}}


# -- The frames of a cell's modules while it runs: cyclic messages, requests with their answers, and targets -----------


_ESTIMATES, _COUNT, _CURRENT, _TARGET = (
    "Get_Encoder_Estimates",
    "Get_Encoder_Count",
    "Get_Iq",
    "Set_Input_Pos",
)
_FACTORY_PERIOD = 0.01  # s: of the estimates, axis0.config.can.encoder_rate_ms (manual v2.2, 4.1.5)


def module_frames(cell: CellConfig) -> Iterator[NodeFrame]:
    """Return the frames of all modules; raises as ``settings_of``."""
    for node_id in modules_of(cell):
        yield from _of_module(cell, node_id)


def _of_module(cell: CellConfig, node: int) -> Iterator[NodeFrame]:
    settings = settings_of(cell, node)
    period = settings.period
    yield _frame(node, "heartbeat", "Heartbeat", 1 / settings.heartbeat, LENGTH, to_node=False)
    # The master requests the estimates in every cycle from a module that does not send them automatically; the worst case counts.
    by_itself = 1 / _FACTORY_PERIOD
    asked = {_ESTIMATES: 1 / period, _COUNT: 1 / SELDOM}
    if settings.torque is not None:
        asked[_CURRENT] = 1 / max(CURRENT_EVERY, period)
    request = 0 if carries_remote(cell.bus) else LENGTH
    for name, rate in asked.items():
        yield _frame(node, "request", name, rate, request, to_node=True)
        answers = max(by_itself, rate) if name == _ESTIMATES else rate
        yield _frame(node, "answer", name, answers, LENGTH, to_node=False)
    yield _frame(node, "target", _TARGET, 1 / period, LENGTH, to_node=True)


def _frame(node: int, kind: str, name: str, rate: float, data_bytes: int, *, to_node: bool) -> NodeFrame:
    return NodeFrame(node, can_id(node, named(name).command), kind, name, rate, data_bytes, to_node)


# -- The axis of a module as a CiA 402 drive, from the description that its port provides ------------------------------


_WHOLE = 1000  # ‰ of the rated torque: the highest that a port allows


def descriptions(cell: CellConfig) -> dict[int, Eds]:
    """Return the description (EDS) that each module's port provides, by node; raises as ``settings_of``."""
    return {node_id: description(settings_of(cell, node_id)) for node_id in modules_of(cell)}


def drive_of(cell: CellConfig, axis: AxisConfig) -> Drive:
    """Return the drive of an axis whose node is a module; raises as ``settings_of``."""
    return Drive.of(axis, cell.nodes[axis.node], description(settings_of(cell, axis.node)))


def module_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of the axis ``name``, whose node is a module; raises as ``settings_of``."""
    axis = cell.axes[name]
    drive = drive_of(cell, axis)
    found = axis_parameters(cell, name, drive.eds, MAKE)
    turning = settings_of(cell, axis.node).torque
    return replace(
        found,
        # a port has objects of modes that it cannot run: only 6502h lists the modes reliably
        modes=found.modes if axis.modes is not None else found.modes & (drive.claimed or frozenset()),
        limits=scale_proposal.limited_torque(
            found.limits, axis.rated_torque, lambda _: None if turning is None else _WHOLE
        ),
        torque_slope=None if turning is None else round(turning.ramp / turning.rated * 1000),
    )
