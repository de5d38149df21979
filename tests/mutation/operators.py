"""The kinds of small mistakes, each as a function from a place to its replacements."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from itertools import pairwise

from mutation.mutant import Mutant
from mutation.mutation_points import Place, Text, places

Change = tuple[int, int, str]  # from, to, the replacement

_COMPARISONS = {
    "<": ("<=", ">"),
    "<=": ("<", ">"),
    ">": (">=", "<"),
    ">=": (">", "<"),
    "==": ("!=",),
    "!=": ("==",),
    "is": ("is not",),
    "is not": ("is",),
    "in": ("not in",),
    "not in": ("in",),
}
_SIGNS = {"+": "-", "-": "+", "+=": "-=", "-=": "+="}
_JUMPS = (ast.Return, ast.Raise, ast.Continue, ast.Break)
_STAMP = re.compile(r"(?:.*_)?(?:now|time|since|stamp|began|started|at|until|deadline|newest)|.+_by")
_TEXTS = (ast.JoinedStr, ast.List, ast.ListComp, ast.Tuple)


def _compare(place: Place, text: Text) -> Iterator[Change]:
    if not isinstance(place.node, ast.Compare):
        return
    parts = [place.node.left, *place.node.comparators]
    for left, right in pairwise(parts):
        words = text.between(text.end(left), text.start(right))
        first, last = words[0][0], words[-1][0] + len(words[-1][1])
        for other in _COMPARISONS[" ".join(word for _, word in words)]:
            yield first, last, other


def _guard(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if isinstance(node, ast.If) and isinstance(node.body[-1], _JUMPS) and not _names_a_value(node.test):
        yield text.start(node.test), text.end(node.test), "False"


def _half(place: Place, text: Text) -> Iterator[Change]:
    if isinstance(place.node, ast.BoolOp):
        neutral = "True" if isinstance(place.node.op, ast.And) else "False"
        for value in place.node.values:
            if not _names_a_value(value):
                yield text.start(value), text.end(value), neutral


def _number(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if not isinstance(node, ast.Constant) or type(node.value) not in (int, float):
        return
    as_hex = text.of(node).lower().startswith("0x")
    others = (
        [node.value + 1]
        if isinstance(node.value, float) or node.value == 0
        else [node.value + 1, node.value - 1]
    )
    for other in others:
        new = f"0x{other:X}" if as_hex else repr(round(other, 9))
        yield text.start(node), text.end(node), new


def _sign(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        if not any(isinstance(side, _TEXTS) or _is_text(side) for side in (node.left, node.right)):
            [(at, word)] = text.between(text.end(node.left), text.start(node.right))
            yield at, at + 1, _SIGNS[word]
    elif isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add | ast.Sub):
        if not isinstance(node.value, _TEXTS) and not _is_text(node.value):
            [(at, word)] = text.between(text.end(node.target), text.start(node.value))
            yield at, at + 2, _SIGNS[word]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield text.start(node), text.start(node) + 1, ""


def _once(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if not isinstance(node, ast.For | ast.AsyncFor | ast.While) or isinstance(node.body[-1], _JUMPS):
        return
    end = text.end(node.body[-1])
    yield end, end, f"\n{' ' * node.body[0].col_offset}break"


def _stamp(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if place.function is None or not _is_stamp(node):
        return
    not_times = _not_times(place.function)
    if id(node) in not_times:
        return
    stamps = [other for other in ast.walk(place.function) if _is_stamp(other) and id(other) not in not_times]
    stamps += [
        name
        for name in ast.walk(place.function.args)
        if isinstance(name, ast.arg) and _STAMP.fullmatch(name.arg)
    ]
    names = {name.arg if isinstance(name, ast.arg) else text.of(name) for name in stamps}
    for other in ["0.0", *sorted(names - {text.of(node)})[:2]]:
        yield text.start(node), text.end(node), other


def _boolean(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield text.start(node), text.end(node), str(not node.value)
    elif isinstance(node, ast.If | ast.IfExp) and not (isinstance(node.test, ast.UnaryOp | ast.Compare)):
        yield text.start(node.test), text.end(node.test), f"(not ({text.of(node.test)}))"


def _not(place: Place, text: Text) -> Iterator[Change]:
    if isinstance(place.node, ast.UnaryOp) and isinstance(place.node.op, ast.Not):
        yield text.start(place.node), text.start(place.node) + len("not "), ""


def _call(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call | ast.Await):
        yield text.start(node), text.end(node), "pass"


def _return(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if not isinstance(node, ast.Return) or node.value is None or place.function is None:
        return
    returns = place.function.returns
    said = ast.unparse(returns) if returns is not None else ""
    others = ("True", "False") if said == "bool" else ("None",)
    for other in others:
        if text.of(node.value) != other:
            yield text.start(node.value), text.end(node.value), other


def _min_max(place: Place, text: Text) -> Iterator[Change]:
    node = place.node
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        yield text.start(node.func), text.end(node.func), "max" if node.func.id == "min" else "min"


KINDS: dict[str, Callable[[Place, Text], Iterator[Change]]] = {
    "comparison": _compare,
    "guard": _guard,
    "half a condition": _half,
    "number": _number,
    "sign": _sign,
    "loop": _once,
    "stamp": _stamp,
    "boolean": _boolean,
    "not": _not,
    "call": _call,
    "return": _return,
    "min and max": _min_max,
}


def mutants(file: str, source: str) -> list[Mutant]:
    """Return every mutant of a module; ``file`` is only noted in them."""
    text, found = Text(source), {}
    for place in places(ast.parse(source)):
        for kind, operator in KINDS.items():
            for start, end, new in operator(place, text):
                line = text.data.count(b"\n", 0, start) + 1
                mutant = Mutant(file, start, end, new, kind, line, place.lines, place.inside, place.names)
                found.setdefault((start, end, new), mutant)  # `return True` is a value and a boolean
    return sorted(found.values())


def _is_stamp(node: ast.AST) -> bool:
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return bool(name) and isinstance(node.ctx, ast.Load) and _STAMP.fullmatch(name) is not None


def _not_times(function: ast.AST) -> set[int]:
    """Called names, and names that are only compared with None."""
    found = {id(call.func) for call in ast.walk(function) if isinstance(call, ast.Call)}
    for node in ast.walk(function):
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            found.add(id(node.left))
    return found


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)


def _names_a_value(node: ast.AST) -> bool:
    return any(isinstance(part, ast.NamedExpr) for part in ast.walk(node))
