"""A loop of the program's own leads an axis: it is given what was measured in each cycle, and answers with a velocity."""

import math
from pathlib import Path

from axisbus import AxisFeedback, Machine

LATE = 25  # cycles for which the last answer holds where this program is kept from answering: a tenth of a second here


class Swing:
    """A place that swings, and a loop that follows it: how fast the place goes, and a share of how far the axis is off."""

    def __init__(self) -> None:
        self.begin: float | None = None
        self.off = 0.0

    def __call__(self, seen: AxisFeedback) -> float:
        self.begin = seen.time if self.begin is None else self.begin
        t = seen.time - self.begin
        self.off = 15.0 * (1.0 - math.cos(2.0 * t)) - seen.position
        return 30.0 * math.sin(2.0 * t) + 8.0 * self.off  # deg/s


with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    swing = Swing()
    with x.controller(swing, max_missed_cycles=LATE) as controller:
        for _ in range(4):
            cell.sleep(0.5)
            print(f"x is at {x.position:.1f} deg, {swing.off:.1f} deg off")
    print("answered", controller.lateness)
