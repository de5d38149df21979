"""Another bit rate for a module: a parameter that holds from its next start on, so that it is saved at once."""

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
)  # of CiA 301, from 125 kbit/s up to the module's 1 Mbit/s (manual v2.2, 4.1)
NAMED = frozenset({500_000, 1_000_000})
_UNNAMED = "the manual names 500000 and 1000000 bit/s alone: if the module does not take this rate, it is reached over USB only"


def wanted(rate: int) -> ParameterBatch:
    """Return what sets a bit rate (bit/s).

    Raises:
        ArgumentError: it is none that is set here.
    """
    if rate not in RATES:
        raise ArgumentError(
            f"{rate} bit/s is not set here", remedy=f"give one of {', '.join(map(str, RATES))}"
        )
    return ParameterBatch(((PATH, rate),), () if rate in NAMED else (_UNNAMED,))


def require_alone(finder: Finder, found: Sequence[DiscoveredModule], node: int) -> None:
    """Check that nobody is on the bus but one module: it comes back at a rate at which it would destroy what others say.

    Raises:
        StateError: somebody is.
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
