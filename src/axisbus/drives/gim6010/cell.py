"""The modules among a cell's nodes: the settings of their tables, which no message reports, and their axes as CiA 402 drives."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from axisbus.cell import scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.model import AxisConfig, BusConfig, CellConfig, NodeConfig
from axisbus.cell.other_protocols import CellPart, NodeFrame
from axisbus.cell.parameters import axis_parameters
from axisbus.cia301.tables import rows
from axisbus.cia402.modes import ModeOfOperation
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware, with_version
from axisbus.drives.gim6010.can_simple.identifier import can_id, commands_to, sent_by
from axisbus.drives.gim6010.can_simple.messages import LENGTH, named
from axisbus.drives.gim6010.can_simple.port.feedback import CURRENT_EVERY, SELDOM
from axisbus.drives.gim6010.can_simple.port.settings import (
    HEARTBEAT,
    HEARTBEAT_BY_LINE,
    ModuleSettings,
    TorqueSettings,
)
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import MAKE, description
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, StateError
from axisbus.motion.parameters import AxisParameters
from axisbus.toml import value_readers as v
from axisbus.toml.tables import CellKey, SourceLocation

CAN_SIMPLE, MODBUS = "can_simple", "modbus"
_HOLDING = "-hold"

_KEYS = rows(__package__, "cell_keys.tsv")
_KINDS = {"positive": v.positive, "text": v.text}
# Each key with its reader, and the remedy if a required key is missing.
READERS: Mapping[str, tuple[v.ValueReader, str]] = {
    row["key"]: (_KINDS[row["kind"]], row["remedy"]) for row in _KEYS
}
TORQUE = ("gear_ratio", "torque_constant", "torque_ramp")
# The modes of a module on RS485 beside homing, of which its axis has one: the mode is set in idle.
LINE_MODES: Mapping[str, ModeOfOperation] = {
    "pp": ModeOfOperation.PROFILE_POSITION,
    "pv": ModeOfOperation.PROFILE_VELOCITY,
    "tq": ModeOfOperation.PROFILE_TORQUE,
}


def line_mode(modes: Collection[str] | None) -> ModeOfOperation:
    """Return the mode of a module on RS485 by ``modes`` of its axis: the first of ``LINE_MODES`` that it names, by default pp."""
    named = [mode for word, mode in LINE_MODES.items() if word in (modes or ())]
    return named[0] if named else ModeOfOperation.PROFILE_POSITION


@dataclass(frozen=True, slots=True)
class ModuleConfig:
    """The values of ``[nodes.N.can_simple]`` or ``[nodes.N.modbus]``, on the rotor's side of the gear; None: left out."""

    velocity_limit: float = 0.0
    current_limit: float = 0.0
    velocity_ramp: float = 0.0
    acceleration: float = 0.0
    filter_bandwidth: float | None = None
    gear_ratio: float | None = None
    torque_constant: float | None = None
    torque_ramp: float | None = None
    endpoints: str | None = None
    at: SourceLocation = field(default=SourceLocation(), compare=False)
    protocol: str = CAN_SIMPLE

    def settings(
        self,
        node_id: int,
        axis: AxisConfig | None,
        period: float,
        *,
        remote: bool = True,
        relayed: bool = False,
    ) -> ModuleSettings:
        """Return the settings of the port of the module, which has this ``axis``, or none.

        If the axis has no rated torque, or a key of ``TORQUE`` is missing, the port has no torques. ``period`` (s) is the scan
        period. ``remote``: whether the bus carries remote frames. ``relayed``: the module is on a serial line, where the modes of
        its axis select its mode.

        Raises:
            ArgumentError, LimitError: a value is not valid for a module.
        """
        by_line = line_mode(None if axis is None else axis.modes)
        quick_stop = None if axis is None else axis.stop.quick_stop
        has_torque = not relayed or by_line is ModeOfOperation.PROFILE_TORQUE
        return ModuleSettings(
            node_id,
            self.velocity_limit,
            self.current_limit,
            self.velocity_ramp,
            self.acceleration,
            period,
            heartbeat=HEARTBEAT_BY_LINE if relayed else HEARTBEAT,
            torque=self._torque(axis) if has_torque else None,
            filter_bandwidth=self.filter_bandwidth,
            quick_stop_holds=quick_stop is not None and quick_stop.endswith(_HOLDING),
            remote=remote,
            relayed=relayed,
            line_mode=by_line if relayed else ModeOfOperation.PROFILE_POSITION,
        )

    def _torque(self, axis: AxisConfig | None) -> TorqueSettings | None:
        rated = None if axis is None else axis.rated_torque
        if (
            rated is None
            or self.gear_ratio is None
            or self.torque_constant is None
            or self.torque_ramp is None
        ):
            return None
        return TorqueSettings(self.torque_constant, abs(rated) / self.gear_ratio, self.torque_ramp)


NO_REMOTE = ("socketcand",)  # interfaces whose protocol has no remote frames


def carries_remote(bus: BusConfig) -> bool:
    """Whether the adapter of a bus can send remote frames."""
    return bus.interface not in NO_REMOTE


def is_line(bus: BusConfig) -> bool:
    """Whether a bus is a serial line, on which the master polls the modules one after the other."""
    return bus.interface == MODBUS


def modules_of(cell: CellConfig) -> list[int]:
    return sorted(node.node_id for node in cell.nodes.values() if module_of(node) is not None)


def module_of(node: NodeConfig) -> ModuleConfig | None:
    """Return the settings of a node that is a module; None if it is none."""
    return node.module if isinstance(node.module, ModuleConfig) else None


def no_objects(node_id: int, what: str) -> StateError:
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
    remote, relayed = carries_remote(cell.bus), is_line(cell.bus)
    return module.settings(node_id, axis, cell.bus.scan_period, remote=remote, relayed=relayed)


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


# -- The part of the plug-in that reads and describes the modules of a cell --------------------------------------------


PART = CellPart(
    keys={key: CellKey(*each) for key, each in READERS.items()},
    descriptions={row["key"]: row["words"] for row in _KEYS},
    tables={
        CAN_SIMPLE: "Properties that a module with CAN Simple does not report.",
        MODBUS: "The same for a module on RS485: as [nodes.N.can_simple], with endpoints, without filter; torques for the mode tq.",
    },
    settings=lambda protocol, fields: ModuleConfig(**fields, protocol=protocol),
    dictionaries=descriptions,
    parameters=module_parameters,
    frames=module_frames,
    sent_by=sent_by,
    commands_to=commands_to,
    adapter_options=line_options,
    no_objects=no_objects,
    no_virtual_time=no_virtual_time,
)
