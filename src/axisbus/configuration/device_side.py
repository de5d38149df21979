"""A device as one side of a comparison, read object by object."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from axisbus.bus.sdo.access import ByObjects, try_upload, why_unread
from axisbus.configuration.compare import Comparison, ConfigurationSide, compare, entries, of_file, typed
from axisbus.eds.model import Eds, Variable


def against(
    node: ByObjects, eds: Eds, tell: Callable[[int, int], None] | None = None, *, everything: bool = False
) -> Comparison:
    """Compare a DCF or EDS with the present values of a device; blocks for a transfer for each entry with a value in the file.

    ``everything``: as in ``compare.entries``.

    Raises:
        SdoTimeout, AdapterError: the device does not answer.
    """
    file = of_file(eds, node.node_id)
    there = [
        each for each in entries(eds, everything=everything) if (each.index, each.subindex) in file.values
    ]
    return compare(there, file, of_device(node, there, tell))


def of_device(
    node: ByObjects, variables: Sequence[Variable], tell: Callable[[int, int], None] | None = None
) -> ConfigurationSide:
    """Read ``variables`` of a device; blocks for a transfer each. Entries that cannot be read are in ``unread``.

    Raises:
        SdoTimeout, AdapterError: the device does not answer.
    """
    values, unread = {}, {}
    for number, variable in enumerate(variables, start=1):
        key = variable.index, variable.subindex
        found = try_upload(node.sdo, *key)
        if isinstance(found, bytes):
            values[key] = typed(variable, found)
        else:
            unread[key] = why_unread(found)
        if tell is not None:
            tell(number, len(variables))
    return ConfigurationSide(f"node {node.node_id}", values, unread)
