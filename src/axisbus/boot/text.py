"""The course of a boot-up, as lines for a user and as plain values: letter, step, object, expected, got, abort, tries, time."""

from __future__ import annotations

from typing import Any

from axisbus.boot.program_text import LETTERS
from axisbus.cia301 import abort
from axisbus.cia302.types import BootOutcome
from axisbus.wording import counted

_WIDTH = 14


def rows(outcome: BootOutcome | None) -> list[str]:
    """Return the lines that matter; a boot-up without incident has one."""
    if outcome is None:
        return []
    found = [("boot-up", _summary(outcome))]
    if not outcome.ok:
        found += [
            ("object", object_text(outcome)),
            ("expected", _value(outcome.expected, outcome)),
            ("got", _value(outcome.got, outcome)),
            ("abort", "" if outcome.abort is None else abort.describe(outcome.abort)),
            ("done before", ", ".join(outcome.done)),
        ]
    found += [("skipped", text) for text in outcome.skipped]
    return [f"  {title:<{_WIDTH}}{text}" for title, text in found if text]


def as_json(outcome: BootOutcome) -> dict[str, Any]:
    """Return a boot-up as plain values; numbers stay numbers."""
    return {
        "ok": outcome.ok,
        "letter": None if outcome.letter is None else outcome.letter.name,
        "sentence": outcome.sentence,
        "step": outcome.step,
        "object": object_text(outcome) or None,
        "expected": _plain(outcome.expected),
        "got": _plain(outcome.got),
        "abort": outcome.abort,
        "abort_text": None if outcome.abort is None else abort.explain(outcome.abort).text,
        "tries": outcome.tries,
        "retries": outcome.retries,
        "elapsed": round(outcome.elapsed, 3),
        "found": outcome.found.text,
        "error_control": outcome.control.value,
        "done": list(outcome.done),
        "skipped": list(outcome.skipped),
    }


def object_text(outcome: BootOutcome) -> str:
    """Return the object at which the boot-up ended, such as ``1018h:02``; empty if there is none."""
    return "" if outcome.address is None else f"{outcome.address[0]:04X}h:{outcome.address[1]:02X}"


def _summary(outcome: BootOutcome) -> str:
    letter = f"{outcome.letter.name}: {outcome.letter.sentence}; " if outcome.letter is not None else ""
    again = f", {counted(outcome.retries, 'request')} repeated" if outcome.retries else ""
    end = f"{outcome.elapsed:.2f} s{again}"
    return (
        f"{letter}in {end}"
        if outcome.ok
        else f"{letter}step {outcome.step}, try {outcome.tries}, after {end}"
    )


def _value(value: object, outcome: BootOutcome) -> str:
    if value is None:
        return ""
    if isinstance(value, str) and outcome.letter in LETTERS:
        return value  # a date or a state in words
    return f"0x{value:X} ({value})" if isinstance(value, int) and not isinstance(value, bool) else repr(value)


def _plain(value: object) -> object:
    return value.hex() if isinstance(value, bytes) else value
