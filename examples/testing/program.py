"""A program for a machine, written so that a test can give it a simulated one."""

from axisbus import Machine


def enable_and_home(machine: Machine) -> None:
    """Enable all axes, and home them at their present positions."""
    for axis in machine:
        axis.enable().wait(5)
        axis.home().wait(30)


def measure(machine: Machine, positions: list[float]) -> list[float]:
    """Go to each position with x, and return where y stands then."""
    seen = []
    for position in positions:
        machine["x"].move_absolute(position, velocity=180.0).wait(10)
        seen.append(machine["y"].position)
    return seen


if __name__ == "__main__":
    with Machine.open("examples/cell.toml") as real:
        enable_and_home(real)
        print(measure(real, [0.0, 45.0, 90.0]))
