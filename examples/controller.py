"""A control loop of your own: in each cycle it gets the measured values of the axis, and returns the next velocity."""

import math
from pathlib import Path

from axisbus import AxisFeedback, Machine

LATE = 25  # further cycles for which the last answer stays valid if this program answers late: 0.1 s here


class Swing:
    """A position controller with a swinging target: feed-forward of the target velocity, plus gain times position error."""

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
            print(f"x is at {x.position:.1f} deg, position error {swing.off:.1f} deg")
    print("answers:", controller.lateness)
