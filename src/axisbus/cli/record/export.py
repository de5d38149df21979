"""``axisbus record export``: a recording as CSV or Parquet."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from axisbus.cli.record.load import read
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.output import force_option, output_option, require_free
from axisbus.cli.shared.paths import PATH
from axisbus.errors import UserError
from axisbus.record.export import write_csv, write_parquet
from axisbus.record.recording_data import Recorded

_KINDS: dict[str, Callable[[Recorded, Path], None]] = {".csv": write_csv, ".parquet": write_parquet}


@click.command("export")
@click.argument("recording", type=PATH)
@output_option("The file to write; its ending, .csv or .parquet, selects the format.", required=True)
@force_option
def command(recording: Path, output: Path, force: bool) -> int:
    """Write RECORDING as a table with a row for each cycle: CSV (units in the header) or Parquet (units in the metadata)."""
    write = _KINDS.get(output.suffix.lower())
    if write is None:
        raise UserError(
            f"{output} does not end with a known format", remedy=f"end its name in {' or '.join(_KINDS)}"
        )
    require_free(output, force=force)
    recorded = read(recording)
    output.parent.mkdir(parents=True, exist_ok=True)
    write(recorded, output)
    say(f"written: {output}")
    return OK
