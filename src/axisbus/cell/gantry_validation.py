"""Find the errors inside one ``[gantries.NAME]`` table."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.cell.model import GantryConfig

Wrong = tuple[tuple[str, ...], str, str]  # the key below the table, the error, the remedy


def wrong(config: GantryConfig) -> Iterator[Wrong]:
    """Yield the contradictions between the table's own keys."""
    name = config.name
    if config.at.sound("axes") and len(config.axes) != 2:
        message = f"[gantries.{name}] must name two axes, not {len(config.axes)}"
        yield ("axes",), message, 'name both that carry the beam: axes = ["y1", "y2"]'
    homing = config.homing
    if homing is None:
        return
    if homing.at.sound("distance") and homing.distance == 0.0:
        yield (
            ("homing", "distance"),
            f"distance in [gantries.{name}.homing] must not be 0",
            "give the longest search distance, below 0 towards smaller positions",
        )
    wanted = 2 if homing.switches == "each" else 1
    if homing.at.sound("positions", "switches") and len(homing.positions) != wanted:
        yield (
            ("homing", "positions"),
            f"positions in [gantries.{name}.homing] must be {'two numbers' if wanted == 2 else 'one number'}",
            "give the position of each axis at its own switch"
            if wanted == 2
            else 'give the position of the first axis at its switch; with switches = "first" there is no other',
        )
