"""Chains of couplings: a slave may be the master of other slaves, but not of its own master."""

from __future__ import annotations

from axisbus.errors import StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.slave_axis import Coupled


def require_no_ring(master: AxisCore, slave: AxisCore, name: str) -> None:
    """Raise StateError if ``master`` follows ``slave``, directly or through others; ``name``: the command, for the message."""
    chain = [slave.parameters.name]
    leads: AxisCore | None = master
    while leads is not None:
        chain.append(leads.parameters.name)
        if leads is slave:
            raise StateError(
                f"{name}: an axis cannot be its own master, directly or over other axes",
                observed=" is led by ".join(chain),
                remedy=f"release one of the couplings first: {master.parameters.name}.halt()",
            )
        activity = leads.activity
        leads = activity.master if isinstance(activity, Coupled) else None
