"""The list of endpoints that a cell file names for a module, and the firmware that the list belongs to."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell.model import NodeConfig
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, parse
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware, proposed_version
from axisbus.errors import ArgumentError


def list_of(node: NodeConfig, folder: Path) -> tuple[EndpointList, Firmware] | None:
    """Return the list of a module and its firmware, by the file's name or else the node's ``firmware``; None if none is named.

    Raises:
        ArgumentError: the file cannot be read, or is no such list; its firmware is unknown, or file name and ``firmware`` differ.
    """
    if node.module is None or node.module.endpoints is None:
        return None
    path = folder / node.module.endpoints
    try:
        path = folder / Path(node.module.endpoints).expanduser()  # RuntimeError: unknown home folder
        text = path.read_bytes()
    except (OSError, RuntimeError) as error:
        raise ArgumentError(
            f"{path} cannot be read: {getattr(error, 'strerror', error)}",
            remedy="give the firmware's list of endpoints (the manufacturer's JSON file), a path relative to the cell file",
        ) from error
    return parse(text, path.name), _made_for(path.name, node.firmware)


def _made_for(name: str, firmware: str | None) -> Firmware:
    named, given = proposed_version(name), None if firmware is None else Firmware.parse(firmware)
    if named is not None and given is not None and named != given:
        raise ArgumentError(
            f"{name} is for firmware {named} by its name, and the node must have {given}",
            remedy=f"get the list of firmware {given} from the manufacturer, or correct firmware",
        )
    made_for = named or given
    if made_for is None:
        raise ArgumentError(
            f"{name} does not give its firmware version",
            remedy='name it endpoints_0.5.13.json if it is for that version, or add firmware = "0.5.13" to the node',
        )
    return made_for
