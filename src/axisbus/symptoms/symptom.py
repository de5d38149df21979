"""One symptom: the texts of its page, and the errors and codes that refer to it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Symptom:
    """An observation, and the checks for it.

    Attributes:
        name: the name of the page; ``axisbus explain NAME`` prints it.
        title: the observation in the words of a user.
        seen: what happened, in a few sentences.
        checks: what to check, in this order; a text in backquotes that begins with axisbus is a command to type.
        errors: names of the classes of ``axisbus.errors`` that refer to the page.
        letters: letters of CiA 302-2 at the end of a boot that refer to the page.
        aborts: SDO abort codes (CiA 301) that refer to the page.
        faults: error codes of a drive (603Fh, EMCY) that refer to the page, four digits each; x is any digit, for the codes that no
            other page names.
        read_on: pages of the documentation, optionally with the anchor of a heading.
    """

    name: str
    title: str
    seen: str
    checks: tuple[str, ...]
    errors: tuple[str, ...] = ()
    letters: str = ""
    aborts: tuple[int, ...] = ()
    faults: tuple[str, ...] = ()
    read_on: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SymptomNote:
    """The addition of a make's plug-in to the page of a symptom.

    Attributes:
        make: the name of the drive.
        checks: what to check if the drive is of this make.
        read_on: as of a ``Symptom``.
    """

    make: str
    checks: tuple[str, ...]
    read_on: tuple[str, ...] = ()
