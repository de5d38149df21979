"""Each rule finds the smallest breach of it, on the right line and column, and leaves the nearest other thing alone."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from rule_base import BASE, edited, place
from rule_cases import CASES, Case, Edit

from axisbus.eds import Finding, check, reader
from axisbus.eds.rules import engine
from axisbus.eds.rules.table import rules

WITHOUT_A_CASE = {"S000", "S099"}  # of unreadable files and of too many findings: below


def text_of(edits: Iterable[Edit]) -> tuple[str, bytes]:
    """Return the edited base, as text and as bytes."""
    text, data = BASE, b""
    for edit in edits:
        if isinstance(edit, str):
            text = edited(edit, text=text)
        else:
            made = edit(text)
            if isinstance(made, bytes):
                data = made
            else:
                text = made
    return text, data or text.encode("latin-1")


def found(edits: Iterable[Edit]) -> list[Finding]:
    text, data = text_of(edits)
    name = "test.dcf" if "FileName=test.dcf" in text else "test.eds"
    return list(check(reader.read(data, name)))


def test_the_base_is_clean() -> None:
    assert found(()) == []


def test_every_rule_has_a_case_and_code() -> None:
    assert {case.rule for case in CASES} | WITHOUT_A_CASE == set(rules())
    assert engine.LOOKS.keys() <= rules().keys()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.rule)
def test_a_breach_is_found_at_its_place(case: Case) -> None:
    text, _ = text_of(case.bad)
    hits = [each for each in found(case.bad) if each.rule == case.rule]
    assert hits, [f"{each.line} {each.rule} {each.message}" for each in found(case.bad)]
    assert [(each.line, each.column) for each in hits] == [place(text, case.at)]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.rule)
def test_what_is_near_a_breach_is_left_alone(case: Case) -> None:
    assert [each for each in found(case.near) if each.rule == case.rule] == []
