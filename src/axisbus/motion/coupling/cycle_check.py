"""Slaves that are masters, too: in a chain, and never in a ring."""

from __future__ import annotations

from axisbus.errors import StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.slave_axis import Coupled


def require_no_ring(master: AxisCore, slave: AxisCore, name: str) -> None:
    """Raise StateError where ``master`` is led by ``slave``, by itself or by others; ``name`` says what was asked for."""
    chain = [slave.parameters.name]
    leads: AxisCore | None = master
    while leads is not None:
        chain.append(leads.parameters.name)
        if leads is slave:
            raise StateError(
                f"{name}: an axis cannot be led by itself",
                observed=" is led by ".join(chain),
                remedy=f"let go of one of them first: {master.parameters.name}.halt()",
            )
        activity = leads.activity
        leads = activity.master if isinstance(activity, Coupled) else None
