"""Sets a module's zero to its present position (manual v2.2, 3.1.8; an owner's procedure).

Theory of operation
-------------------
The position is the encoder's reading minus ``index_offset``, if ``use_index_offset`` is set. An owner sets the zero by adding the
present estimate to the offset. But in many modules the estimate is invalid outside closed loop, and a wrong offset would give wrong
positions that look valid. Therefore the estimate must agree with the encoder's count, which is valid in idle; otherwise nothing is
written. The encoder is on the rotor and knows the position within one rotor turn: the number of the turn is lost with the power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings.parameter_settings import ParameterBatch
from axisbus.errors import NodeError, StateError

OFFSET, USED = "axis0.encoder.config.index_offset", "axis0.encoder.config.use_index_offset"
_ESTIMATE, _COUNT, _CPR = (f"axis0.encoder.{name}" for name in ("pos_estimate", "count_in_cpr", "config.cpr"))
NEAR = 0.01  # turns of the rotor by which estimate and count may differ: 0.45° of the output
_STILL = 0.002  # turns between two readings at standstill
STEPS = (
    "connect it by USB and open odrivetool; enable it where it is to be zero, and keep it there",
    "read odrv0.axis0.encoder.pos_estimate and odrv0.axis0.encoder.config.index_offset; disable it (requested_state = 1)",
    "odrv0.axis0.encoder.config.index_offset = the sum of both; odrv0.axis0.encoder.config.use_index_offset = True",
    "odrv0.save_configuration(), after which it restarts",
)
_TURNS = (
    "the encoder knows its place within one turn of the rotor, an eighth of a turn of the output at 8:1: after a start the "
    "position is 0 at each of these places, so home the axis or confirm its position"
)


@dataclass(frozen=True, slots=True)
class RotorZero:
    """Position data of a module: offset and estimate in turns of the rotor, the count within ``cpr``."""

    offset: float
    used: bool
    estimate: float
    count: int
    cpr: int

    @property
    def by_estimate(self) -> float:
        """Position within a turn of the rotor (0 to 1), by estimate and offset."""
        return ((self.offset if self.used else 0.0) + self.estimate) % 1.0

    @property
    def by_count(self) -> float:
        """Position within a turn of the rotor (0 to 1), by the encoder's count."""
        return self.count / self.cpr % 1.0


def look(module: ModuleParameters) -> RotorZero:
    """Read the position data of a module; blocks.

    Raises:
        StateError: it reports an invalid position. BusError: as ``ModuleParameters.read``.
    """
    offset, estimate = float(module.read(OFFSET)), float(module.read(_ESTIMATE))
    place = RotorZero(
        offset, bool(module.read(USED)), estimate, int(module.read(_COUNT)), int(module.read(_CPR))
    )
    if place.cpr <= 0 or not math.isfinite(offset + estimate) or not 0 <= place.count < place.cpr:
        raise StateError("the module reported an invalid position", observed=str(place))
    return place


def wanted(first: RotorZero, second: RotorZero) -> ParameterBatch:
    """Return the parameters that make the present position 0; ``first`` and ``second`` are read some tenths of a second apart.

    Raises:
        StateError: the rotor turns, or its estimate does not agree with its count.
    """
    if apart(first.by_count, second.by_count) > _STILL:
        raise StateError(
            "the output turns, so its zero would be at a random position",
            observed=f"count {first.count}, then {second.count}",
            remedy="hold it still",
        )
    if apart(second.by_estimate, second.by_count) > NEAR:
        raise StateError(
            "the estimate of its position does not agree with its encoder's count: in many modules it does not work in idle",
            observed=f"within a turn of the rotor {second.by_estimate:.4f} by the estimate, {second.by_count:.4f} by the count",
            remedy="set the zero over USB, with the listed steps; nothing was written",
        )
    return ParameterBatch(((OFFSET, second.by_estimate), (USED, True)), (_TURNS,))


def verify(node: int, zero: float, after: RotorZero) -> None:
    """Check the position after the restart, if the rotor was not turned meanwhile; ``zero`` is the offset that was written.

    Raises:
        NodeError: it is not at its zero.
    """
    if apart(after.by_count, zero) > NEAR:
        raise NodeError(
            "the output was turned meanwhile: its present position is not its zero",
            node=node,
            observed=f"within a turn of the rotor {after.by_count:.4f}, and the zero is at {zero:.4f}",
            remedy="turn it to its zero and give the command again, if that position was intended",
        )
    if apart(after.estimate, 0.0) > NEAR:
        raise NodeError(
            f"the module is at its zero, and its position is {after.estimate:.4f} rotor turns",
            node=node,
            observed="owners saw positions that jump back and forth by 0.1425 turns from one start to the next",
            remedy="home the axis after each start, and do not rely on the zero of the module",
        )


def apart(one: float, other: float) -> float:
    """Return the difference between two positions within a turn, in turns, at most 0.5."""
    return abs((one - other + 0.5) % 1.0 - 0.5)
