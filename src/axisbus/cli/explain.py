"""``axisbus explain``: explain a symptom, and list the checks."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator

import click

from axisbus import errors
from axisbus.cia301 import abort, tables
from axisbus.cia302.types import Letter
from axisbus.cli.shared.common import OK, coloured, say, say_next
from axisbus.errors import UserError
from axisbus.symptoms import lookup
from axisbus.symptoms.lookup import page_of_fault
from axisbus.symptoms.symptom import Symptom, SymptomNote
from axisbus.wording import counted


def _complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:  # noqa: ARG001  # click's shape
    return [name for name in lookup.words() if name.startswith(incomplete)]


@click.command("explain")
@click.argument("name", required=False, shell_complete=_complete)
def command(name: str | None) -> int:
    """Print the page of a symptom: its meaning, and what to check, in which order. Without NAME, list the pages.

    NAME is the name of a page, as messages print it; or the class of an error, a letter of a boot-up, an SDO abort code, or an
    error code of a drive (603Fh, EMCY).

    \b
    axisbus explain node-lost
    axisbus explain FollowingError
    axisbus explain 0x06090030
    axisbus explain 8611h

    For an error code, the texts of the drive plug-ins follow (axisbus drives list).
    """
    if name is None:
        _list()
        return OK
    symptom = _named(name)
    _show(symptom, notes_of(symptom), _by_makes(name))
    return OK


def _list() -> None:
    width = max(map(len, lookup.SYMPTOMS))
    for title, symptoms in lookup.FAMILIES.items():
        say(f"{title}:")
        for each in symptoms:
            say(f"  {each.name:<{width}}  {each.title}")
    say_next("axisbus explain NAME")


def _named(name: str) -> Symptom:
    symptom = lookup.found(name)
    if symptom is None:
        similar = difflib.get_close_matches(name, [*lookup.words()], n=3)
        suggestion = f"did you mean {' or '.join(similar)}? " if similar else ""
        raise UserError(f"there is no page {name!r}", remedy=f"{suggestion}axisbus explain lists all")
    return symptom


def notes_of(symptom: Symptom) -> list[SymptomNote]:
    """Return what the drive plug-ins add to a page. Blocks while their notes are imported."""
    from axisbus.drives import registry

    return [notes[symptom.name] for notes in registry.parts("symptoms") if symptom.name in notes]


def _by_makes(name: str) -> list[str]:
    """Return what the drive plug-ins say about an error code; an empty list for anything else."""
    code = lookup.error_code(name)
    if code is None:
        return []
    from axisbus.drives import registry

    return [f"{plugin.name}: {text}" for plugin in registry.plugins() for text in plugin.explain(code, {})]


def _show(symptom: Symptom, notes: list[SymptomNote], by_makes: list[str]) -> None:
    text = markdown(symptom, notes)
    if by_makes:
        text += "\n" + "\n".join(_section("This code in drives of known makes", by_makes)) + "\n"
    if not coloured():
        say(text.rstrip())
        return
    from rich.console import Console
    from rich.markdown import Markdown

    Console().print(Markdown(text))


# -- The page of a symptom as Markdown, from the tables that the messages use ------------------------------------------


_MAX_CODES = 12  # the most codes that are listed on a page


def markdown(
    symptom: Symptom, notes: Iterable[SymptomNote] = (), *, every_code: bool = False, wide: bool = False
) -> str:
    """Return the page, with the ``notes`` of plug-ins.

    ``every_code``: list all codes; ``wide``: for a web site, which has its own links to further pages.
    """
    notes = tuple(notes)
    parts = [
        [f"# {symptom.title}", "", symptom.seen],
        ["## What to check, in this order", "", *_numbered(symptom.checks)],
        *(list(_section(f"If the drive is a {note.make}", note.checks)) for note in notes),
        list(_section("Errors that refer to this page", _errors(symptom))),
        list(_section("Boot letters (CiA 302-2)", _letters(symptom))),
        list(_section("SDO abort codes (CiA 301)", _aborts(symptom))),
        list(_section("Error codes of a drive (603Fh, EMCY)", _faults(symptom, every_code))),
        []
        if wide
        else list(
            _section(
                "Further reading in the documentation",
                (f"docs/{page}" for page in further_reading(symptom, notes)),
            )
        ),
    ]
    return "\n\n".join("\n".join(lines) for lines in parts if lines) + "\n"


def further_reading(symptom: Symptom, notes: Iterable[SymptomNote]) -> list[str]:
    """Return the pages of the documentation that a symptom and the ``notes`` of plug-ins name, each once."""
    return list(dict.fromkeys((*symptom.read_on, *(page for note in notes for page in note.read_on))))


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
        summary = (getattr(errors, name).__doc__ or "").partition("\n")[0]
        yield f"`{name}`: {summary.replace('``', '`')}"


def _letters(symptom: Symptom) -> Iterator[str]:
    for letter in symptom.letters:
        yield f"`{letter}`: {Letter[letter].sentence}"


def _aborts(symptom: Symptom) -> Iterator[str]:
    for code in symptom.aborts:
        text, hint = abort.explain(code)
        yield f"`0x{code:08X}`: {text}" + (f" ({hint})" if hint else "")


def _faults(symptom: Symptom, every_code: bool) -> Iterator[str]:
    codes = codes_of(symptom)
    if every_code or len(codes) <= _MAX_CODES:
        yield from (f"`0x{code:04X}`: {text}" for code, text in codes.items())
        return
    yield f"{', '.join(f'`{digits}`' for digits in symptom.faults)}: {counted(len(codes), 'code')} of the standards"
    yield from (f"`0x{code:04X}`: {text}" for code, text in codes.items() if code & 0xFF == 0)
