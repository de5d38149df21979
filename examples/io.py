"""I/O module: an axis waits for a part, and a lamp is on while it moves. Closing the machine sets the outputs to safe."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("io.toml")) as cell:
    x, part, lamp = cell["x"], cell.io["part"], cell.io["lamp"]
    wired = cell.simulated_node(5).device.io  # the inputs of the simulated module
    x.enable().wait()
    wired.set_bit(0x6000, 1, 0, True)  # a part arrives
    part.wait(True, timeout=2.0)
    cell.io.set({"lamp": True, "valve": 5.0}).wait()
    x.move_relative(90.0).wait()
    lamp.set(False).wait()
    for name in ("valve", "pressure"):
        print(f"{name} {cell.io[name].value:.2f} {cell.io[name].unit}")
    print("part", part.value, "- lamp", lamp.value)
