"""The dictionary of an EDS as text for other programs: CSV, with a row for each entry, and JSON."""

from __future__ import annotations

import csv
import io
import json

from axisbus.eds.model import Eds
from axisbus.eds.report import facts
from axisbus.eds.report.facts import Entry

COLUMNS = tuple(Entry.__annotations__)


def csv_text(eds: Eds, node_id: int | None) -> str:
    """Return all entries as CSV (RFC 4180, lines end with LF), the columns those of ``facts.Entry``.

    Index and sub-index are hexadecimal (``0x1018``, ``0x01``), other numbers decimal; absent values are empty. Values are those
    for ``node_id`` (1 to 127); without one, what depends on it stays a formula such as ``$NODEID+0x180``.
    """
    out = io.StringIO()
    writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for entry in facts.entries(eds, node_id):
        writer.writerow(
            {**entry, "index": f"0x{entry['index']:04X}", "subindex": f"0x{entry['subindex']:02X}"}
        )
    return out.getvalue()


def json_text(eds: Eds, node_id: int | None) -> str:
    """Return the whole file as JSON, as ``facts.whole`` has it, with a line feed at the end."""
    return json.dumps(facts.whole(eds, node_id), indent=2, ensure_ascii=False) + "\n"
