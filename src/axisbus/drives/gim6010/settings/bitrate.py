"""Bit rate of a module: a parameter that takes effect with the next restart, so that it is saved at once."""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.drives.gim6010.discovery.finder import Finder
from axisbus.drives.gim6010.discovery.results import DiscoveredModule
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import ArgumentError, StateError

PATH = "can.config.baud_rate"
RATES = (
    125_000,
    250_000,
    500_000,
    1_000_000,
)  # bit rates of CiA 301, from 125 kbit/s up to the module's 1 Mbit/s (manual v2.2, 4.1)
NAMED = frozenset({500_000, 1_000_000})
_UNNAMED = "the manual names 500000 and 1000000 bit/s alone: if the module does not take this rate, it is reached over USB only"


def wanted(rate: int) -> ParameterBatch:
    """Return the parameters that set a bit rate (bit/s).

    Raises:
        ArgumentError: the bit rate is not in ``RATES``.
    """
    if rate not in RATES:
        raise ArgumentError(f"{rate} bit/s cannot be set", remedy=f"give one of {', '.join(map(str, RATES))}")
    return ParameterBatch(((PATH, rate),), () if rate in NAMED else (_UNNAMED,))


def require_alone(finder: Finder, found: Sequence[DiscoveredModule], node: int) -> None:
    """Check that a module is alone on its bus: with another bit rate it would destroy the frames of other nodes.

    Raises:
        StateError: it is not alone.
    """
    others = [
        f"{each.protocol.value} node {' or '.join(map(str, each.addresses))}"
        for each in found
        if each.node != node
    ]
    others += [each.words for each in finder.picture.foreign()]
    if others:
        raise StateError(
            f"module {node} is not alone on its bus",
            observed=f"there are also: {', '.join(others)}",
            remedy="connect it alone: at another bit rate it would destroy the others' frames",
        )
