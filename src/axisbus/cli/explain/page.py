"""The page of a symptom as Markdown, from the tables that the messages use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from axisbus import errors
from axisbus.cia301 import abort, tables
from axisbus.cia302.types import Letter
from axisbus.symptoms.lookup import page_of_fault
from axisbus.symptoms.symptom import Symptom
from axisbus.wording import counted

_FEW = 12  # the most codes that are listed on a page


def markdown(symptom: Symptom, *, every_code: bool = False, wide: bool = False) -> str:
    """Return the page; ``every_code``: list all codes; ``wide``: for a web site, which has its own links to further pages."""
    parts = [
        [f"# {symptom.title}", "", symptom.seen],
        ["## What to check, in this order", "", *_numbered(symptom.checks)],
        list(_section("Errors that refer to this page", _errors(symptom))),
        list(_section("Boot letters (CiA 302-2)", _letters(symptom))),
        list(_section("SDO abort codes (CiA 301)", _aborts(symptom))),
        list(_section("Error codes of a drive (603Fh, EMCY)", _faults(symptom, every_code))),
        []
        if wide
        else list(
            _section("Further reading in the documentation", (f"docs/{page}" for page in symptom.read_on))
        ),
    ]
    return "\n\n".join("\n".join(lines) for lines in parts if lines) + "\n"


def codes_of(symptom: Symptom) -> dict[int, str]:
    """Return the error codes of the standards' table that refer to a page, with their texts."""
    rows = tables.rows("axisbus.cia301", "emcy.tsv")
    return {
        int(row["code"], 16): row["name"]
        for row in rows
        if page_of_fault(int(row["code"], 16)) == symptom.name
    }


def _numbered(lines: Iterable[str]) -> Iterator[str]:
    for number, line in enumerate(lines, 1):
        yield f"{number}. {line}"


def _section(title: str, lines: Iterable[str]) -> Iterator[str]:
    found = [f"- {line}" for line in lines]
    if found:
        yield from (f"## {title}", "", *found)


def _errors(symptom: Symptom) -> Iterator[str]:
    for name in symptom.errors:
        about = (getattr(errors, name).__doc__ or "").partition("\n")[0]
        yield f"`{name}`: {about.replace('``', '`')}"


def _letters(symptom: Symptom) -> Iterator[str]:
    for letter in symptom.letters:
        yield f"`{letter}`: {Letter[letter].sentence}"


def _aborts(symptom: Symptom) -> Iterator[str]:
    for code in symptom.aborts:
        text, hint = abort.explain(code)
        yield f"`0x{code:08X}`: {text}" + (f" ({hint})" if hint else "")


def _faults(symptom: Symptom, every_code: bool) -> Iterator[str]:
    codes = codes_of(symptom)
    if every_code or len(codes) <= _FEW:
        yield from (f"`0x{code:04X}`: {text}" for code, text in codes.items())
        return
    yield f"{', '.join(f'`{digits}`' for digits in symptom.faults)}: {counted(len(codes), 'code')} of the standards"
    yield from (f"`0x{code:04X}`: {text}" for code, text in codes.items() if code & 0xFF == 0)
