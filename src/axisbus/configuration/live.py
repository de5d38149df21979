"""One side of a comparison read from the device itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from axisbus.bus.sdo.access import ByObjects
from axisbus.configuration.compare import Side, typed
from axisbus.eds.model import Variable
from axisbus.errors import SdoAbort


def of_device(
    node: ByObjects, variables: Sequence[Variable], tell: Callable[[int, int], None] | None = None
) -> Side:
    """Read ``variables`` of a device; blocks for a transfer each. What it refuses is in ``unread``.

    Raises:
        SdoTimeout, AdapterError: it does not answer.
    """
    values, unread = {}, {}
    for number, variable in enumerate(variables, start=1):
        key = variable.index, variable.subindex
        try:
            values[key] = typed(variable, node.sdo.upload(*key))
        except SdoAbort as refusal:
            unread[key] = f"the device refuses it: {refusal.observed}"
        if tell is not None:
            tell(number, len(variables))
    return Side(f"node {node.node_id}", values, unread)
