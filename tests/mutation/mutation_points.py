"""The places of a module at which a change is made: each node with its surroundings, and its position in the text."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate

Function = ast.FunctionDef | ast.AsyncFunctionDef


class Text:
    """A module's text by byte offsets, as the syntax tree counts."""

    def __init__(self, text: str) -> None:
        self.data = text.encode()
        self._starts = [0, *accumulate(len(line) for line in self.data.splitlines(keepends=True))]
        lines = text.splitlines(keepends=True)
        self._tokens = [
            (self._starts[row - 1] + len(lines[row - 1][:column].encode()), token.string)
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type in (tokenize.OP, tokenize.NAME)
            for row, column in [token.start]
        ]

    def start(self, node: ast.AST) -> int:
        """Return where the node begins."""
        return self._starts[node.lineno - 1] + node.col_offset

    def end(self, node: ast.AST) -> int:
        """Return where the node has ended."""
        return self._starts[node.end_lineno - 1] + node.end_col_offset

    def of(self, node: ast.AST) -> str:
        """Return the node's own text."""
        return self.data[self.start(node) : self.end(node)].decode()

    def between(self, first: int, last: int) -> list[tuple[int, str]]:
        """Return the operators and words from ``first`` up to ``last``, without brackets."""
        return [(at, word) for at, word in self._tokens if first <= at < last and word not in "()"]


@dataclass(frozen=True)
class Place:
    """A node, the statement that it belongs to, and the function or class around that."""

    node: ast.AST
    lines: tuple[int, int]
    names: tuple[str, ...] = ()
    inside: str = ""
    function: Function | None = None


def places(tree: ast.Module) -> Iterator[Place]:
    """Yield every node with an effect: no types, no texts, no decorators."""
    for statement in tree.body:
        yield from _statement(statement, Place(statement, (0, 0)))


def _statement(node: ast.stmt, around: Place) -> Iterator[Place]:
    if _has_no_effect(node):
        return
    body = [
        child
        for child in ast.iter_child_nodes(node)
        if isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case)
    ]
    last = (
        body[0].pattern.lineno
        if body and isinstance(body[0], ast.match_case)
        else body[0].lineno
        if body
        else 0
    )
    lines = (node.lineno, max(node.lineno, last - 1) if body else node.end_lineno or node.lineno)
    here = replace(around, node=node, lines=lines)
    if around.function is None:
        here = replace(here, names=around.names + names_of(node))
    if isinstance(node, Function):
        lines = (node.body[0].lineno, node.end_lineno or node.lineno)
        yield from _expressions(node.args, replace(here, lines=lines))
        inner = replace(here, function=node, names=(), inside=_within(around.inside, node.name))
    elif isinstance(node, ast.ClassDef):
        inner = replace(here, inside=_within(around.inside, node.name), names=(node.name,))
    else:
        yield here
        for child in ast.iter_child_nodes(node):
            if child not in body:
                yield from _expressions(child, here)
        inner = here
    for child in body:
        yield from _block(child, inner)


def _block(node: ast.stmt | ast.ExceptHandler | ast.match_case, around: Place) -> Iterator[Place]:
    if isinstance(node, ast.stmt):
        yield from _statement(node, around)
        return
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt):
            yield from _statement(child, around)


def _expressions(node: ast.AST, around: Place) -> Iterator[Place]:
    if isinstance(
        node, ast.JoinedStr | ast.arg
    ):  # positions inside an f-string are unknown before Python 3.12
        return
    yield replace(around, node=node)
    for name, child in ast.iter_fields(node):
        for part in child if isinstance(child, list) else [child]:
            if isinstance(part, ast.AST) and name != "annotation" and not _only_checks(part):
                yield from _expressions(part, around)


def _only_checks(node: ast.AST) -> bool:
    """Whether it is ``zip``'s ``strict``, by which the program looks after itself: nothing that works shows it."""
    return isinstance(node, ast.keyword) and node.arg == "strict"


def _has_no_effect(node: ast.stmt) -> bool:
    if isinstance(node, ast.Import | ast.ImportFrom | ast.Pass | ast.Global | ast.Nonlocal):
        return True
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True  # a docstring
    if isinstance(node, ast.AnnAssign) and node.value is None:
        return True
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def names_of(node: ast.stmt) -> tuple[str, ...]:
    """Return the names that a statement gives."""
    if isinstance(node, Function | ast.ClassDef):
        return (node.name,)
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    return tuple(name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name))


def _within(around: str, name: str) -> str:
    return f"{around}.{name}" if around else name
