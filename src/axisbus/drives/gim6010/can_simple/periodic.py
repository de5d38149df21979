"""The messages that a module sends periodically, their periods, and their bus load (manual v2.2, 4.1.5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.cia301.frame import worst_bits
from axisbus.drives.gim6010.can_simple.messages import LENGTH


@dataclass(frozen=True, slots=True)
class Periodic:
    """One such message: the parameter with its period in ms (0: not sent), the factory setting, and its command if it has one."""

    name: str
    parameter: str
    factory_ms: int
    command: int | None


_CONFIG = "axis0.config.can"
PERIODIC = (
    Periodic("Heartbeat", f"{_CONFIG}.heartbeat_rate_ms", 100, 0x01),
    Periodic("Get_Encoder_Estimates", f"{_CONFIG}.encoder_rate_ms", 10, 0x09),
    Periodic("Get_Motor_Error", f"{_CONFIG}.motor_error_rate_ms", 0, 0x03),
    Periodic("Get_Encoder_Error", f"{_CONFIG}.encoder_error_rate_ms", 0, 0x03),
    Periodic("Get_Controller_Error", f"{_CONFIG}.controller_error_rate_ms", 0, 0x03),
    Periodic("Get_Sensorless_Error", f"{_CONFIG}.sensorless_error_rate_ms", 0, None),
    Periodic("Get_Encoder_Count", f"{_CONFIG}.encoder_count_rate_ms", 0, 0x0A),
    Periodic("Get_Iq", f"{_CONFIG}.iq_rate_ms", 0, 0x14),
    Periodic("Get_Sensorless_Estimates", f"{_CONFIG}.sensorless_rate_ms", 0, None),
    Periodic("Get_Bus_Voltage_Current", f"{_CONFIG}.bus_vi_rate_ms", 0, 0x17),
)
FACTORY = {each.name: each.factory_ms for each in PERIODIC}


def load(periods_ms: Mapping[str, int], bitrate: int) -> float:
    """Return the load (0 to 1) of a bus with ``bitrate`` bit/s by one module with these periods in ms.

    Frames count with the maximum number of stuff bits; a period of 0 adds no load.
    """
    per_second = sum(1000 / period for period in periods_ms.values() if period > 0)
    return per_second * worst_bits(LENGTH) / bitrate
