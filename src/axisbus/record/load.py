"""Read a recording of any supported file type."""

from __future__ import annotations

from pathlib import Path

from axisbus.errors import UserError
from axisbus.record import export, fault_file, mcap_reader
from axisbus.record.recording_data import Recorded


def load(path: Path | str, progress: mcap_reader.Progress | None = None) -> Recorded:
    """Read an MCAP file of axisbus (see ``mcap_reader.load``), a CSV file of axisbus, or a fault stored by a core.

    Raises:
        UserError: the file cannot be read, or is of another type.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            begin = file.read(max(len(fault_file.MAGIC), len(export.CSV_HEAD)))
        if begin.startswith(export.CSV_HEAD):
            return export.read_csv(path)
        return (
            fault_file.read(path) if begin.startswith(fault_file.MAGIC) else mcap_reader.load(path, progress)
        )
    except OSError as error:
        raise UserError(
            f"{path} cannot be read", observed=str(error.strerror), remedy=mcap_reader.WRITTEN_BY
        ) from error
