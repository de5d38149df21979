"""``axisbus explain``: explain a symptom, and list the checks."""

from __future__ import annotations

import difflib

import click

from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.terminal import coloured
from axisbus.errors import UserError
from axisbus.symptoms import lookup
from axisbus.symptoms.symptom import Symptom


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
    """
    if name is None:
        _list()
        return OK
    _show(_wanted(name))
    return OK


def _list() -> None:
    width = max(map(len, lookup.SYMPTOMS))
    for title, symptoms in lookup.FAMILIES.items():
        say(f"{title}:")
        for each in symptoms:
            say(f"  {each.name:<{width}}  {each.title}")
    say_next("axisbus explain NAME")


def _wanted(name: str) -> Symptom:
    symptom = lookup.found(name)
    if symptom is None:
        near = difflib.get_close_matches(name, [*lookup.words()], n=3)
        meant = f"did you mean {' or '.join(near)}? " if near else ""
        raise UserError(f"there is no page {name!r}", remedy=f"{meant}axisbus explain lists all")
    return symptom


def _show(symptom: Symptom) -> None:
    from axisbus.cli.explain.page import markdown

    text = markdown(symptom)
    if not coloured():
        say(text.rstrip())
        return
    from rich.console import Console
    from rich.markdown import Markdown

    Console().print(Markdown(text))
