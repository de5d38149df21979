"""Follow a trajectory of your own in csp: an object with ``duration`` and ``position(t)``, or a list of points."""

import math
from dataclasses import dataclass
from pathlib import Path

from axisbus import Machine


@dataclass
class Swing:
    """A trajectory out and back that begins and ends at rest; ``duration`` in seconds."""

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
    print(f"halfway: {x.position:.1f} {x.unit}, {x.state.value}")
    swing.wait()
    print(f"back: {x.position:.2f} {x.unit}")
    here = x.position
    x.follow(
        [(0.0, here), (0.6, here + 30.0), (1.0, here + 10.0), (1.5, here)]
    ).wait()  # (seconds, position); a smooth curve through these points
    print(f"back from the points: {x.position:.2f} {x.unit}")
