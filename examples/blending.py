"""Blend lines into each other without a stop, and add points to a path while the axes move."""

from pathlib import Path

from axisbus import Machine, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    lines = [
        xy.move_linear((60.0, 0.0), velocity=60.0),
        xy.move_linear((60.0, 40.0), velocity=120.0, buffer="blending_next", blend=3.0),
        xy.move_linear((0.0, 40.0), velocity=60.0, buffer="blending_low", blend=3.0),
        xy.move_linear((0.0, 0.0), velocity=120.0, buffer="blending_high", blend=3.0),
    ]
    for line in lines:
        line.wait()  # done when the axes have passed its end
        print(f"{line.name}:", [round(axis.position, 1) for axis in xy])
    handles = [xy.move_path([(30.0, 0.0), (30.0, 30.0)], velocity=90.0, blend=3.0, more=True)]
    for point in [(60.0, 30.0), (60.0, 0.0), (0.0, 0.0)]:
        handles.append(xy.extend_path([point]))
        cell.sleep(0.3)
    wait(handles)
    print("after the last point:", [round(axis.position, 1) for axis in xy])
