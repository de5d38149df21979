"""Profile velocity and jogging: the axis turns until the next command."""

from pathlib import Path

from axisbus import Machine

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    z = cell["z"]
    z.enable().wait()
    z.move_velocity(120.0).wait()  # done when the velocity is reached; the axis keeps turning
    print(f"velocity: {z.velocity:.1f} {z.unit}/s, {z.state.value}")
    z.move_velocity(-60.0, acceleration=400.0).wait()
    print(f"reversed: {z.velocity:.1f} {z.unit}/s")
    z.halt().wait()
    print(f"halted: {z.velocity:.1f} {z.unit}/s, {z.state.value}")
    for _ in range(5):  # a jog ends after 200 ms unless it is renewed, e.g. while a button is held
        z.jog(30.0)
        cell.sleep(0.1)
    cell.sleep(0.6)
    print(f"jog not renewed: {z.state.value}")
