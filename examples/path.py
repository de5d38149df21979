"""Move axes on a path: lines with rounded corners, and circles."""

from pathlib import Path

from axisbus import Machine, wait

SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    for blend in (0.0, 3.0):  # 0: stop at each corner; 3: round the corner within 3 degrees of it
        xy.move_path(SQUARE, velocity=120.0, blend=blend).wait()
        print(f"path done, blend {blend:g}:", [round(axis.position, 1) for axis in xy])
    xy.move_circular((0.0, 0.0), centre=(30.0, 0.0), velocity=120.0).wait()
    print("full circle:", [round(axis.position, 1) for axis in xy])
    xy.move_circular((60.0, 0.0), via=(30.0, 30.0), velocity=120.0).wait()
    print("half circle:", [round(axis.position, 1) for axis in xy])
