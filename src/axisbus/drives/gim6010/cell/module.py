"""``[nodes.N.can_simple]`` and ``[nodes.N.modbus]``: settings that no message of a module reports, for its port."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from axisbus.cia402.modes import ModeOfOperation
from axisbus.drives.gim6010.can_simple.port.settings import (
    HEARTBEAT,
    HEARTBEAT_BY_LINE,
    ModuleSettings,
    TorqueSettings,
)
from axisbus.toml import value_readers as v
from axisbus.toml.tables import SourceLocation

CAN_SIMPLE, MODBUS = "can_simple", "modbus"
_HOLDING = "-hold"

# Each key with its reader, and the remedy if a required key is missing.
READERS: Mapping[str, tuple[v.ValueReader, str]] = {
    "velocity_limit": (
        v.positive,
        "velocity_limit = 20.0, turns/s of the rotor, sent with Set_Limits",
    ),
    "current_limit": (v.positive, "current_limit = 10.0, A, sent with Set_Limits; at most 50"),
    "velocity_ramp": (
        v.positive,
        "velocity_ramp = the module's axis0.controller.config.vel_ramp_rate, in turns/s²: its quick stop brakes with it",
    ),
    "acceleration": (
        v.positive,
        "acceleration = 80.0, turns/s² of the trapezoidal profile that follows a path",
    ),
    "filter_bandwidth": (v.positive, ""),
    "gear_ratio": (v.positive, ""),
    "torque_constant": (v.positive, ""),
    "torque_ramp": (v.positive, ""),
    "endpoints": (v.text, ""),
}
WORDS: Mapping[str, str] = {
    "velocity_limit": "Velocity limit sent to the module, in turns/s of the rotor.",
    "current_limit": "Current limit sent to the module, in A, at most 50.",
    "velocity_ramp": "The module's vel_ramp_rate, in turns/s²: a quick stop brakes with it.",
    "acceleration": "Acceleration of the trapezoidal profile with which it follows a path, in turns/s².",
    "filter_bandwidth": "The module's input_filter_bandwidth, in rad/s: then it follows a path by its filter.",
    "gear_ratio": "Turns of the rotor for one turn of the output; torques need it.",
    "torque_constant": "The module's torque_constant, in N·m/A of the rotor; torques need it.",
    "torque_ramp": "The module's torque_ramp_rate, in N·m/s of the rotor; torques need it.",
    "endpoints": "The list of endpoints of its firmware, a path: boot uses it to read which watchdogs are armed, to reset "
    "them.",
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
        rated_torque: float | None,
        period: float,
        quick_stop: str | None,
        *,
        remote: bool = True,
        relayed: bool = False,
        modes: Collection[str] | None = None,
    ) -> ModuleSettings:
        """Return the settings of the module's port.

        If ``rated_torque`` (N·m, of the axis, at the output) is None, or a key of ``TORQUE`` is missing, the port has no torques.
        ``period`` (s) is the scan period, ``quick_stop`` the word of ``[axes.NAME.stop]``. ``remote``: whether the bus carries
        remote frames. ``relayed``: the module is on a serial line, where ``modes`` of its axis select its mode.

        Raises:
            ArgumentError, LimitError: a value is not valid for a module.
        """
        by_line = line_mode(modes)
        has_torque = not relayed or by_line is ModeOfOperation.PROFILE_TORQUE
        return ModuleSettings(
            node_id,
            self.velocity_limit,
            self.current_limit,
            self.velocity_ramp,
            self.acceleration,
            period,
            heartbeat=HEARTBEAT_BY_LINE if relayed else HEARTBEAT,
            torque=self._torque(rated_torque) if has_torque else None,
            filter_bandwidth=self.filter_bandwidth,
            quick_stop_holds=quick_stop is not None and quick_stop.endswith(_HOLDING),
            remote=remote,
            relayed=relayed,
            line_mode=by_line if relayed else ModeOfOperation.PROFILE_POSITION,
        )

    def _torque(self, rated: float | None) -> TorqueSettings | None:
        if (
            rated is None
            or self.gear_ratio is None
            or self.torque_constant is None
            or self.torque_ramp is None
        ):
            return None
        return TorqueSettings(self.torque_constant, abs(rated) / self.gear_ratio, self.torque_ramp)
