"""Following a trajectory of your own in csp: an object with ``duration`` and ``position(t)``; or points."""

import math
from dataclasses import dataclass
from pathlib import Path

from axisbus import Machine


@dataclass
class Swing:
    """A swing out and back, at rest at both ends."""

    start: float
    amplitude: float
    duration: float

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds."""
        return self.start + self.amplitude * math.sin(math.pi * t / self.duration) ** 2


with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    swing = x.follow(Swing(x.position, 40.0, 1.5))
    cell.sleep(0.75)
    print(f"in the middle: {x.position:.1f} {x.unit}, {x.state.value}")
    swing.wait()
    print(f"back: {x.position:.2f} {x.unit}")
    here = x.position
    x.follow(
        [(0.0, here), (0.6, here + 30.0), (1.0, here + 10.0), (1.5, here)]
    ).wait()  # a smooth curve through them
    print(f"along points, and back: {x.position:.2f} {x.unit}")
