"""Compare a node at boot with its nameplate in the as-built record of the machine."""

from __future__ import annotations

from axisbus.bus.node.node import read_identity
from axisbus.bus.sdo.access import SdoUploads
from axisbus.cell.model import CellConfig
from axisbus.configuration import nameplate
from axisbus.errors import SdoError, UserError


def changed(objects: SdoUploads, cell: CellConfig, node_id: int) -> list[str]:
    """Return what has changed in a node since the nameplates were saved, as texts; empty if none were saved.

    Blocks for reading the file, and if there is one, for some transfers. None of the changes is an error: if the cell file gives
    revision or serial number, boot-up checks these itself.
    """
    file = nameplate.file_of(cell.file)
    if not file.is_file():
        return []
    try:
        when, plates = nameplate.load(file)
        plate = next((each for each in plates if each.node == node_id), None)
        found = [] if plate is None else nameplate.changes_of_device(plate, read_identity(objects))
    except UserError as error:
        return [f"it is not compared with its nameplate: {error.message}"]
    except SdoError:  # the steps of the boot-up report that
        return []
    return [f"{each.text} (nameplate saved {when})" for each in found]
