"""Texts shared by messages about Modbus."""

from __future__ import annotations


def turns(value: float | None) -> str:
    """Return a position or a distance in turns of the rotor as text; None: unknown."""
    return "an unknown place" if value is None else f"{float(value):.4f} turns"
