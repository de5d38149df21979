"""``axisbus record diff``: compare two recordings of one job."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.record.load import read
from axisbus.cli.shared.common import OK, WRONG, say, say_json
from axisbus.cli.shared.paths import PATH
from axisbus.record.compare import Compared, compare


@click.command("diff")
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
@click.option(
    "--within", type=float, help="Exit code 1 if a position differs by more than this, in its axis's unit."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(first: Path, second: Path, within: float | None, as_json: bool) -> int:
    """Align FIRST and SECOND at the first motion of an axis, and show the largest deviations of each axis."""
    compared = compare(read(first), read(second))
    _tell_json(compared) if as_json else _tell(compared)
    positions = [one for one in compared.deviations if one.column == "position"]
    return WRONG if within is not None and any(abs(one.by) > within for one in positions) else OK


def _tell(compared: Compared) -> None:
    say(
        f"{compared.seconds:.3f} s of both; the second begins to move {compared.shift:+.3f} s after the first does"
    )
    say(f"{'axis':<8}{'':<18}{'largest':>12}  {'at':>9}  {'first':>12}  {'second':>12}")
    for one in compared.deviations:
        say(
            f"{one.axis:<8}{one.column.replace('_', ' '):<18}{one.by:>+12.4f}  {one.time:>7.3f} s  "
            f"{one.first:>12.4f}  {one.second:>12.4f} {one.unit}"
        )
    if compared.only:
        say(f"in only one of them: {', '.join(compared.only)}")


def _tell_json(compared: Compared) -> None:
    deviations = [{**one._asdict(), "by": one.by} for one in compared.deviations]
    say_json({**compared._asdict(), "deviations": deviations})
