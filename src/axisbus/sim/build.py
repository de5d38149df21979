"""Makes simulated nodes from any EDS: the modes that a drive really has, and a motor that fits its resolution and units."""

from __future__ import annotations

from dataclasses import replace

from axisbus.eds.model import Eds, Number
from axisbus.sim.control_bits import CSP, CST, CSV, HM, IP, PP, PV, TQ
from axisbus.sim.device import Device, count_axes
from axisbus.sim.fault_injection import NodeFaults
from axisbus.sim.modes.catalogue import IMPLEMENTED
from axisbus.sim.motor import MotorParams
from axisbus.sim.settings import AXIS_SPAN

# Objects that a mode needs (CiA 402-2 table of objects by mode); a cyclic mode is assumed only with an interpolation time.
_REQUIRED: dict[int, tuple[int, ...]] = {
    PP: (0x607A, 0x6081, 0x6083),
    PV: (0x60FF, 0x6083),
    TQ: (0x6071,),
    HM: (0x6098,),
    IP: (0x60C1,),
    CSP: (0x607A, 0x60C2),
    CSV: (0x60FF, 0x60C2),
    CST: (0x6071, 0x60C2),
}
# Vendors whose 6502h does not agree with the modes of their drives: the objects decide.
_WRONG_6502 = frozenset({0x000C_0B00})

_TURN = 16384  # increments, if the file does not define them
_TURNS_PER_S2 = 125.0  # at rated torque
_BRISK_TURNS = 20.0  # turns/s
_SHORTEST_LAG = 1e-5  # s
_NO_WINDOW = 0xFFFF_FFFF
_PLAUSIBLE_TURN = range(16, 1 << 26)
# 60A9h (SI unit velocity): numerator and denominator of revolutions per minute, bits 8 to 23.
_REVOLUTIONS_PER_MINUTE = 0xB447


def device_from_eds(
    eds: Eds,
    node_id: int = 1,
    params: MotorParams | None = None,
    *,
    dials: NodeFaults | None = None,
    seed: int = 0,
    serial: int | None = None,
) -> Device:
    """Make a whole node, with as many axes as its EDS has controlwords; ``params`` replaces every derived motor.

    For ``node_id`` 255 and ``serial``: see ``Device``.
    """
    axes = count_axes(eds)
    return Device(
        eds,
        node_id,
        axes=axes,
        params=[params or motor_from_eds(eds, axis) for axis in range(axes)],
        modes=modes_of(eds, 0),
        dials=dials,
        seed=seed,
        serial=serial,
    )


def modes_of(eds: Eds, axis: int = 0) -> frozenset[int]:
    """Return the modes of the drive: those in 6502h, or those that its objects permit if 6502h is 0 or known to be wrong."""
    offset = axis * AXIS_SPAN
    claimed = _default(eds, 0x6502 + offset) or 0
    by_word = frozenset(mode for mode in IMPLEMENTED if claimed >> mode - 1 & 1)
    if by_word and eds.identity.vendor_id not in _WRONG_6502:
        return by_word
    return frozenset(
        mode for mode, objects in _REQUIRED.items() if all(index + offset in eds for index in objects)
    )


def motor_from_eds(eds: Eds, axis: int = 0) -> MotorParams:
    """Return a motor with the resolution of 608Fh and the velocity unit of 60A9h (increments/s if it is not defined)."""
    offset = axis * AXIS_SPAN
    turn = _increments_per_turn(eds, offset)
    unit = _velocity_unit(_default(eds, 0x60A9 + offset) or 0, turn)
    return replace(
        MotorParams(),
        increments_per_turn=turn,
        lag=_lag(_default(eds, 0x6065 + offset), turn),
        rated_acceleration=_TURNS_PER_S2 * turn,
        velocity_unit=unit,
        acceleration_unit=unit,
    )


def _increments_per_turn(eds: Eds, offset: int) -> int:
    increments = _default(eds, 0x608F + offset, 1) or 0
    turns = _default(eds, 0x608F + offset, 2) or 1
    turn = increments // turns if turns > 0 else 0
    return turn if turn in _PLAUSIBLE_TURN else _TURN


def _lag(window: int | None, turn: int) -> float:
    """Return a tracking lag with which the following error is at most half the drive's window at 20 turns/s."""
    usual = MotorParams().lag
    if not window or window >= _NO_WINDOW:
        return usual
    return min(usual, max(_SHORTEST_LAG, 0.5 * window / (_BRISK_TURNS * turn)))


def _velocity_unit(si_unit: int, turn: int) -> float:
    """Return velocity units per increment/s; the top byte of ``si_unit`` is a power of ten."""
    if si_unit >> 8 & 0xFFFF != _REVOLUTIONS_PER_MINUTE:
        return 1.0
    power = (si_unit >> 24 & 0xFF) - (0x100 if si_unit >> 31 & 1 else 0)
    return float(60.0 / turn * 10.0**-power)


def _default(eds: Eds, index: int, subindex: int = 0) -> int | None:
    variable = eds.get(index, subindex)
    if variable is None or not isinstance(variable.default, Number):
        return None
    return variable.default.value
