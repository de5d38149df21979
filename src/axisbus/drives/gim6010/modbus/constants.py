"""Words that messages about Modbus share."""

from __future__ import annotations


def turns(value: float | None) -> str:
    """Return a place or a distance in turns of the rotor for a person; None is one that is not known."""
    return "an unknown place" if value is None else f"{float(value):.4f} turns"
