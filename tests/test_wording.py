"""Numbers with their nouns: one function makes them, and no message contains a literal plural behind a number."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.wording import counted

SOURCE = Path(__file__).parents[1] / "src" / "axisbus"
NOUNS = re.compile(
    r"^ (?:LSS |SDO |EDS |CAN |NMT |more |other |older )?"
    r"(axes|answers|attempts|bits|blocks|boot-ups|brackets|bytes|characters|commands|cycles|differences|drives|entries|errors|files|findings|frames|increments|lines|fixes|mends|messages|modes|nodes|notes|objects|"
    r"octets|others|positions|requests|searches|sections|segments|seconds|slaves|sub-indices|times|tries|turns|units|values|"
    r"warnings)\b(?!/)"
)
# Texts before such a noun that are no count: constants above one, and measures that need not be whole.
NO_COUNT = re.compile(
    r"^[A-Z_]+$|^(?:slot|first|bits|room|ratio|length|rate|speed|ramp|self\.factor|abs\(|float\(|node_id)"
)


@pytest.mark.parametrize(
    ("number", "nouns", "text"),
    [
        (0, ("request",), "0 requests"),
        (1, ("request",), "1 request"),
        (2, ("SDO request",), "2 SDO requests"),
        (1, ("entry", "entries"), "1 entry"),
        (3, ("value differs", "values differ"), "3 values differ"),
    ],
)
def test_a_number_with_its_noun(number: int, nouns: tuple[str, ...], text: str) -> None:
    assert counted(number, *nouns) == text


def plurals(text: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the words of each value in an f-string that a plural noun follows."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.JoinedStr):
            continue
        for value, behind in zip(node.values, node.values[1:], strict=False):
            if not isinstance(value, ast.FormattedValue) or not isinstance(behind, ast.Constant):
                continue
            found = NOUNS.match(str(behind.value))
            if found and not NO_COUNT.match(ast.unparse(value.value)):
                yield value.lineno, f"{ast.unparse(value.value)} {found[1]}"


def test_the_search_for_plurals_finds_them() -> None:
    assert list(plurals("f'{len(x)} requests and {y.tries} SDO requests, {counted(1, node)} left'")) == [
        (1, "len(x) requests"),
        (1, "y.tries requests"),
    ]


def test_no_message_has_a_literal_plural_behind_a_number() -> None:
    found = [
        f"{path.relative_to(SOURCE)}:{line}: {words}"
        for path in sorted(SOURCE.rglob("*.py"))
        for line, words in plurals(path.read_text("utf-8"))
    ]
    assert not found, "use wording.counted:\n" + "\n".join(found)
