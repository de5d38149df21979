"""The zero of a module's position, set to where it stands (manual v2.2, 3.1.8; what an owner did).

Theory of operation
-------------------
Position is what the encoder says less ``index_offset``, where ``use_index_offset`` is set. An owner sets the zero by adding the
present estimate to the offset. But in many modules the estimate is dead until closed loop, and a wrong offset would be a position
that is believed; so it has to agree with the encoder's own count, which is alive in idle. Where it does not, nothing is written.
The encoder is on the rotor and knows its place within one turn of that: which of the turns it is in, it forgets with its power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import NodeError, StateError

OFFSET, USED = "axis0.encoder.config.index_offset", "axis0.encoder.config.use_index_offset"
_ESTIMATE, _COUNT, _CPR = (f"axis0.encoder.{name}" for name in ("pos_estimate", "count_in_cpr", "config.cpr"))
NEAR = 0.01  # turns of the rotor by which estimate and count may differ: 0.45° of the output
_STILL = 0.002  # turns between two looks
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
    """Where a module says that it is: the offset that holds and the estimate in turns of the rotor, the count within ``cpr``."""

    offset: float
    used: bool
    estimate: float
    count: int
    cpr: int

    @property
    def by_estimate(self) -> float:
        """The place within a turn of the rotor (0 to 1), by estimate and offset."""
        return ((self.offset if self.used else 0.0) + self.estimate) % 1.0

    @property
    def by_count(self) -> float:
        """The same by the encoder's own count."""
        return self.count / self.cpr % 1.0


def look(module: ModuleParameters) -> RotorZero:
    """Read where a module is; blocks.

    Raises:
        StateError: it tells a place that is none. BusError: as ``ModuleParameters.read``.
    """
    offset, estimate = float(module.read(OFFSET)), float(module.read(_ESTIMATE))
    place = RotorZero(
        offset, bool(module.read(USED)), estimate, int(module.read(_COUNT)), int(module.read(_CPR))
    )
    if place.cpr <= 0 or not math.isfinite(offset + estimate) or not 0 <= place.count < place.cpr:
        raise StateError("the module tells a place that is none", observed=str(place))
    return place


def wanted(first: RotorZero, second: RotorZero) -> ParameterBatch:
    """Return what makes the present place 0, by two looks at it, some tenths of a second apart.

    Raises:
        StateError: it turns meanwhile, or its estimate does not agree with its count.
    """
    if apart(first.by_count, second.by_count) > _STILL:
        raise StateError(
            "the output turns: its zero would be wherever it happened to be",
            observed=f"count {first.count}, then {second.count}",
            remedy="hold it still",
        )
    if apart(second.by_estimate, second.by_count) > NEAR:
        raise StateError(
            "the estimate of its position does not agree with its encoder's count: it is dead in idle in many modules",
            observed=f"within a turn of the rotor {second.by_estimate:.4f} by the estimate, {second.by_count:.4f} by the count",
            remedy="set the zero over USB, by the steps that are told; nothing was written",
        )
    return ParameterBatch(((OFFSET, second.by_estimate), (USED, True)), (_TURNS,))


def verify(node: int, zero: float, after: RotorZero) -> None:
    """Check where a module is after the restart, which has not been turned meanwhile; ``zero`` is the offset that was written.

    Raises:
        NodeError: it is not at its zero.
    """
    if apart(after.by_count, zero) > NEAR:
        raise NodeError(
            "the output was turned meanwhile: where it stands now is not its zero",
            node=node,
            observed=f"within a turn of the rotor {after.by_count:.4f}, and the zero is at {zero:.4f}",
            remedy="turn it to its zero and give the command again, if that place was meant",
        )
    if apart(after.estimate, 0.0) > NEAR:
        raise NodeError(
            f"the module stands at its zero, and its position is {after.estimate:.4f} rotor turns",
            node=node,
            observed="owners saw positions that jump to and fro by 0.1425 turns from one start to the next",
            remedy="home the axis after each start, and count on no zero of the module's",
        )


def apart(one: float, other: float) -> float:
    """Return by how many turns two places within a turn differ, 0.5 at most."""
    return abs((one - other + 0.5) % 1.0 - 0.5)
