"""The notes on a GIM6010-8 for the pages of symptoms, by the name of the page."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.symptoms.symptom import SymptomNote

_ERRORS = "`axisbus gim6010 errors -i socketcan -c can0 --node NODE`"
_ERROR_BITS = ("gim6010-8.md#error-bits",)


def _note(*checks: str, read_on: tuple[str, ...] = _ERROR_BITS) -> SymptomNote:
    return SymptomNote("GIM6010-8", checks, read_on)


NOTES: Mapping[str, SymptomNote] = {
    "no-answer": _note(
        "It uses CAN Simple when it leaves the factory: `axisbus gim6010 find -i socketcan -c can0`.",
        read_on=("gim6010-8.md#finding-modules",),
    ),
    "does-not-enable": _note(f"It is not calibrated: {_ERRORS} reports it."),
    "drive-fault": _note(f"It reports more in its own error bits: {_ERRORS}."),
    "supply-voltage": _note("The limits of the voltage are parameters: 200Ah:09 and 200Ah:0A."),
    "over-current": _note(f"Its own error bits name the cause: {_ERRORS}."),
    "too-hot": _note(f"Its own error bits name the sensor: {_ERRORS}."),
    "encoder-fault": _note("Calibrate it only without load and only deliberately."),
    "moves-the-wrong-way": _note("Calibrate it: encoder and motor phases do not match."),
}
