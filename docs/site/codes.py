"""The codes of the standards, each with the page of its symptom, generated from the tables of the messages."""

from __future__ import annotations

from collections.abc import Mapping

from texts import plain, table

from axisbus.cia301 import tables
from axisbus.cia302.types import Letter
from axisbus.drives.gim6010.faults import FAULTS
from axisbus.symptoms.lookup import page_of_abort, page_of_fault, page_of_letter

_ABOUT = """# Codes

The codes that nodes and drives report, each with the page of its symptom. `axisbus explain 0x06020000` and
`axisbus explain 8611h` print that page in the terminal.
"""


def pages() -> Mapping[str, str]:
    """Return the page of the codes."""
    return {"reference/codes": "\n".join([_ABOUT, _letters(), _aborts(), _faults(), _module()])}


def _page(name: str | None) -> str:
    assert name is not None
    return f"[`{name}`](../symptoms/{name}.md)"


def _letters() -> str:
    rows = [(f"`{each.name}`", plain(each.sentence), _page(page_of_letter(each.name))) for each in Letter]
    return f"## Letters of a boot-up (CiA 302-2)\n\n{table(('letter', 'meaning', 'symptom'), rows)}"


def _aborts() -> str:
    rows = [
        (
            f"`{each['code']}`",
            plain(each["text"]),
            plain(each["hint"]),
            _page(page_of_abort(int(each["code"], 16))),
        )
        for each in tables.rows("axisbus.cia301", "abort.tsv")
    ]
    return f"## SDO abort codes (CiA 301)\n\n{table(('code', 'meaning', 'look at', 'symptom'), rows)}"


def _faults() -> str:
    rows = [
        (
            f"`{each['code']}`",
            plain(each["name"]) + (", and others of its class" if each["match"] != "exact" else ""),
            _page(page_of_fault(int(each["code"], 16))),
        )
        for each in tables.rows("axisbus.cia301", "emcy.tsv")
    ]
    return f"## Error codes of drives (603Fh, EMCY)\n\n{table(('code', 'meaning', 'symptom'), rows)}"


def _module() -> str:
    rows = [
        (
            plain(each.category),
            f"`0x{each.bits:09X}`",
            f"`{each.name}`",
            plain(each.meaning),
            plain(each.remedy),
        )
        for each in FAULTS
    ]
    about = "Each part has its own error word; [the page of the module](../gim6010-8.md#error-bits) says how to read it."
    return (
        f"## Faults of the GIM6010-8\n\n{about}\n\n{table(('part', 'bit', 'name', 'meaning', 'to do'), rows)}"
    )
