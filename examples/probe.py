"""Measure a part with a touch probe. The drive latches its position at both edges, so the axis need not move slowly."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("probe.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    x.home().wait()

    # Only in simulation: a part under the probe, from 20 mm to 55.5 mm (in increments of the motor).
    cell.simulated_node(1).drive().touch_probe.put_mark(1, 20_000, 55_500)

    with x.probe(1, "both") as probe:
        probe.wait_armed(1)  # the drive latches no edge before this
        move = x.move_absolute(80.0)
        probe.wait(5)
        move.wait()

    begins, ends = (edge.position for edge in probe.captures)
    print(
        f"the part extends from {begins:.3f} to {ends:.3f} {x.unit}; its length is {ends - begins:.3f} {x.unit}"
    )
