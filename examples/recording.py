"""Record every cycle of a move, as CSV and as a picture (the picture needs matplotlib: pip install "axisbus[plot]")."""

from pathlib import Path

from axisbus import Machine, Recorder, plot

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()
    with Recorder(cell) as recorder:
        x.move_absolute(60.0, velocity=120.0).wait()
        x.move_absolute(0.0).wait()

print(f"{len(recorder)} cycles: {recorder.write_csv('demo-output/recording.csv')}")
print(plot(recorder, "demo-output/recording.png", "x out and back"))
