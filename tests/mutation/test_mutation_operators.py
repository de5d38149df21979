"""The replacements of each kind of small mistake, and lines that are left alone."""

from __future__ import annotations

import ast

import pytest

from mutation.mutant import Mutant
from mutation.operators import KINDS, mutants

# kind, a function's body, its possible lines
CASES = [
    ("comparison", "return a < b", {"return a <= b", "return a > b"}),
    ("comparison", "return a >= b", {"return a > b", "return a < b"}),
    ("comparison", "return (a) == (b)", {"return (a) != (b)"}),
    ("comparison", "return a is not b", {"return a is b"}),
    ("comparison", "return a not in b", {"return a in b"}),
    (
        "comparison",
        "return a < b <= c",
        {"return a <= b <= c", "return a > b <= c", "return a < b < c", "return a < b > c"},
    ),
    ("comparison", "return 'ö<' < b", {"return 'ö<' <= b", "return 'ö<' > b"}),
    ("guard", "if a.b: return c", {"if False: return c"}),
    ("guard", "if a: raise b", {"if False: raise b"}),
    ("guard", "for a in b:\n        if a: continue", {"for a in b:\n        if False: continue"}),
    ("guard", "if a: b = c", set()),
    ("half a condition", "return a and b", {"return True and b", "return a and True"}),
    ("half a condition", "return (a or b)", {"return (False or b)", "return (a or False)"}),
    ("number", "return a + 4", {"return a + 5", "return a + 3"}),
    ("number", "return a[0]", {"return a[1]"}),
    ("number", "return 0x6040", {"return 0x6041", "return 0x603F"}),
    ("number", "return 0.5", {"return 1.5"}),
    ("number", "return -1", {"return -2", "return -0"}),
    ("number", "return True", set()),
    ("sign", "return a + b", {"return a - b"}),
    ("sign", "return a - (b + c)", {"return a + (b + c)", "return a - (b - c)"}),
    ("sign", "return -a", {"return a"}),
    ("sign", "a += b", {"a -= b"}),
    ("sign", "return 'a' + b", set()),
    ("loop", "for a in b:\n        a()", {"for a in b:\n        a()\n        break"}),
    ("loop", "while a:\n        a()", {"while a:\n        a()\n        break"}),
    ("loop", "while a:\n        return b", set()),
    (
        "stamp",
        "return now - since",
        {"return 0.0 - since", "return since - since", "return now - 0.0", "return now - now"},
    ),
    ("stamp", "return image.now", {"return 0.0"}),
    ("stamp", "return since is None", set()),
    ("stamp", "return time.time()", {"return 0.0.time()"}),
    ("boolean", "return a(b=True)", {"return a(b=False)"}),
    ("boolean", "return zip(a, b, strict=True)", set()),
    ("boolean", "if a: b()", {"if (not (a)): b()"}),
    ("boolean", "return b if a else c", {"return b if (not (a)) else c"}),
    ("not", "return not a", {"return a"}),
    ("call", "a.b(c)", {"pass"}),
    ("call", "a = b(c)", set()),
    ("return", "return a", {"return None"}),
    ("return", "return", set()),
    ("min and max", "return min(a, b)", {"return max(a, b)"}),
]


def lines(body: str, kind: str, returns: str = "") -> set[str]:
    """Return the possible bodies after mistakes of one kind."""
    source = f"def f(a, b, c){returns}:\n    {body}\n"
    found = [mutant for mutant in mutants("f.py", source) if mutant.kind == kind]
    for mutant in found:
        ast.parse(mutant.apply(source))
    return {mutant.apply(source).split("\n", 1)[1].strip() for mutant in found}


@pytest.mark.parametrize(
    ("kind", "body", "expected"), CASES, ids=[f"{kind}: {body}" for kind, body, _ in CASES]
)
def test_a_kind_of_mistake_changes_one_thing(kind: str, body: str, expected: set[str]) -> None:
    assert lines(body, kind) == expected


def test_every_kind_has_an_example() -> None:
    assert {kind for kind, _, expected in CASES if expected} == set(KINDS)


def test_a_boolean_result_is_replaced_by_both_values() -> None:
    assert lines("return a(b)", "return", " -> bool") == {"return True", "return False"}
    assert lines("return True", "return", " -> bool") == {"return False"}


def test_texts_and_types_and_decorators_are_left_alone() -> None:
    source = '''\
"""A text with 1 < 2."""
from __future__ import annotations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import a


@dataclass(frozen=True)
class B:
    """The number 5."""

    c: tuple[int, ...] | None
    d: int = 3

    def e(self, f: Literal[1]) -> Literal[2]:
        """Not 7."""
        raise ValueError(f"{f + 1} is above {f > 2}")
'''
    assert {mutant.diff(source) for mutant in mutants("b.py", source)} == {
        "-    d: int = 3\n+    d: int = 4",
        "-    d: int = 3\n+    d: int = 2",
    }


def test_a_mutant_has_its_location() -> None:
    source = (
        "A = (\n    1\n)\nclass B:\n    C = 5\n    def d(self, e):\n        return not (\n            e)\n"
    )
    by_kind: dict[str, list[Mutant]] = {}
    for mutant in mutants("b.py", source):
        by_kind.setdefault(mutant.kind, []).append(mutant)
    one, five = by_kind["number"][0], by_kind["number"][2]
    assert (one.line, one.lines, one.inside, one.names) == (2, (1, 3), "", ("A",))
    assert (five.line, five.inside, five.names) == (5, "B", ("B", "C"))
    [returned] = by_kind["not"]
    assert (returned.line, returned.lines, returned.inside, returned.names) == (7, (7, 8), "B.d", ())


def test_the_change_of_a_mutant_is_shown() -> None:
    source = "def f(a):\n    return a < 3\n"
    [mutant] = [mutant for mutant in mutants("f.py", source) if mutant.new == "<="]
    assert mutant.change(source) == "< -> <="
    assert mutant.diff(source) == "-    return a < 3\n+    return a <= 3"
