"""The pages of the symptoms, as ``axisbus explain`` prints them, with links."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from axisbus.cli.explain import further_reading, markdown, notes_of
from axisbus.cli.main import COMMANDS
from axisbus.symptoms.lookup import FAMILIES
from axisbus.symptoms.symptom import Symptom

_ABOUT = """# Symptoms

Each page describes a symptom, its possible causes, and what to check first. Commands and tracebacks name the page of an error below
its message; a program finds it in `error.page`. `axisbus explain NAME` prints the page in the terminal, without a network. CELL is
your cell file, AXIS and NODE are an axis and a node-ID, FILE is an EDS.
"""


Title = Callable[[str, str], str]  # of a page of docs/, or of the heading that an anchor means


def pages(*, title_of: Title) -> Mapping[str, str]:
    """Return a page for each symptom, and a page that lists them."""
    each = {
        f"symptoms/{symptom.name}": _page(symptom, title_of)
        for family in FAMILIES.values()
        for symptom in family
    }
    return {**each, "symptoms/index": _index()}


def _index() -> str:
    lists = [
        f"## {title}\n\n"
        + "\n".join(f"- [{each.title}]({each.name}.md): `{each.name}`" for each in family)
        + "\n"
        for title, family in FAMILIES.items()
    ]
    names = "\n".join(each.name for family in FAMILIES.values() for each in family)
    toctree = f"```{{toctree}}\n:hidden:\n\n{names}\n```\n"
    return "\n".join([_ABOUT, *lists, toctree])


def _page(symptom: Symptom, title_of: Title) -> str:
    notes = notes_of(symptom)
    text = linked(markdown(symptom, notes, every_code=True, wide=True))
    read_on = "\n".join(f"- {_link(page, title_of)}" for page in further_reading(symptom, notes))
    return f"{text}\n## Read on\n\n{read_on}\n\nIn a terminal: `axisbus explain {symptom.name}`\n"


def _link(page: str, title_of: Title) -> str:
    name, _, anchor = page.partition("#")
    where = f": {title_of(name, anchor)}" if anchor else ""
    return f"[{title_of(name, '')}{where}](../{page})"


def linked(text: str) -> str:
    """Return a page with links from commands and errors to their descriptions."""
    text = re.sub(r"`axisbus explain ([a-z][a-z-]+)`", _other, text)
    text = re.sub(r"`axisbus ([a-z0-9]+)( [^`]*)?`", _command, text)
    return re.sub(r"^- `([A-Z]\w+)`:", r"- [`\1`](#axisbus.errors.\1):", text, flags=re.MULTILINE)


def _other(found: re.Match[str]) -> str:
    return f"[`axisbus explain {found[1]}`]({found[1]}.md)"


def _command(found: re.Match[str]) -> str:
    if found[1] not in COMMANDS or found[1] == "explain":
        return found[0]
    return f"[{found[0]}](../reference/cli/{found[1]}.md)"
