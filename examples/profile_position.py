"""Profile position: move to a position, by a distance, and to a new position before the move has ended."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    x.move_absolute(90.0, velocity=180.0).wait()
    print(f"absolute: {x.position:.2f} {x.unit}")
    x.move_relative(-30.0).wait()  # from the present position
    print(f"relative: {x.position:.2f} {x.unit}")
    first = x.move_absolute(-90.0)
    cell.sleep(0.3)
    x.move_absolute(10.0).wait()  # replaces the first move at once
    print(f"new target during the move: {x.position:.2f} {x.unit}; first move: {first.status.value}")
