"""Cells with a pair ``b`` of the axes x and y, tied by a beam; the motion of the beam is known from the motors alone."""

from __future__ import annotations

from bisect import bisect_left
from operator import attrgetter

from axisbus.machine.gantry import Gantry
from kit.cell import SCALE, Cell, Stage, cell_text
from kit.gantry.beam import Beam, tied

CYCLE = 0.01  # s
MAX_SKEW = 8.0  # deg
STIFF, SOFT = 0.5, 0.02  # ‰ of rated torque per increment
AXIS = "max_acceleration = 2000.0"
LIMITED = "max_acceleration = 2000.0\nposition_limits = [-400.0, 400.0]"
HOMING = """
[gantries.b.homing]
input = 1
edge = "rising"
velocity = 20.0
distance = -90.0
positions = [5.0, 7.0]
skew = 12.0
"""


class Pair(Cell):
    """A cell with the pair, in virtual time; ``beam`` ties its motors."""

    beam: Beam

    @property
    def gantry(self) -> Gantry:
        """The pair."""
        return self.machine.gantry("b")

    @property
    def skew(self) -> float:
        """How much farther the motor of y is than that of x now."""
        return self.record("y").sample.position - self.record("x").sample.position

    def worst_skew(self, since: float = 0.0, square: float = 0.0) -> float:
        """The most that the motors were out of ``square`` since then: both step at the same times."""
        xs = self.record("x").since(since)
        ys = self.record("y").since(since)
        times = [sample.time for sample in ys]
        found = 0.0
        for sample in xs:
            at = bisect_left(times, sample.time - 1e-9)
            if at < len(ys):
                found = max(found, abs(ys[at].position - sample.position - square))
        return found

    def fastest(self, name: str, since: float = 0.0) -> float:
        """The highest speed of a motor since then."""
        return max((abs(sample.velocity) for sample in self.record(name).since(since)), default=0.0)

    def moved_since(self, name: str, since: float) -> float:
        """How far a motor has gone since then."""
        samples = sorted(self.record(name).since(since), key=attrgetter("time"))
        return abs(samples[-1].position - samples[0].position) if samples else 0.0


def pair_of(
    stage: Stage,
    names: str = "xy",
    *,
    axis: str = AXIS,
    gantry: str = "",
    more: str = "",
    bus: str = "",
    stiff: float = STIFF,
    required: bool = False,
    **changes: str,
) -> Pair:
    """Open a cell with the pair; ``gantry``: lines of its table, ``stiff``: that of its beam.

    ``required``: its axes must be homed.
    """
    table = f'[gantries.b]\naxes = ["x", "y"]\nmax_skew = {MAX_SKEW}\n{gantry}\n'
    text = cell_text(names, axis=axis, more=table + more, bus=bus, **changes)
    cell = stage.simulated(text=text.replace("required = false", "required = true") if required else text)
    pair = Pair(cell.machine)
    pair.beam = tied(pair.device("x"), pair.device("y"), stiff, 0.01)
    return pair


def put_switches(pair: Pair, x: float, y: float) -> None:
    """Put a switch below each axis's beginning: it is high from there downwards (deg)."""
    for name, at in (("x", x), ("y", y)):
        pair.drive(name).touch_probe.put_mark(1, (at - 300.0) * SCALE, at * SCALE)
