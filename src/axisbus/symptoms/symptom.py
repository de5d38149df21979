"""One symptom, as its page tells it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Symptom:
    """What is seen, and what to check.

    Attributes:
        name: that of its page; ``axisbus explain NAME`` prints it.
        title: in the words of who sees it.
        seen: what it is, in some sentences.
        checks: what to check, in this order; what stands in backquotes and begins with axisbus is to be typed.
        errors: names of the classes of ``axisbus.errors`` that lead here.
        letters: those of CiA 302-2 with which a boot-up ends that leads here.
        aborts: SDO abort codes (CiA 301) that lead here.
        faults: error codes of a drive (603Fh, EMCY) that lead here, four digits each; x stands for any that no other page names.
        read_on: pages of the documentation, with a heading's anchor where one is meant.
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
