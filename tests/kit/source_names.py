"""The names that the source defines, read from its text without importing it, and the names that texts mention.

Theory of operation
-------------------
A text mentions a name between backticks. The name is looked up if its first part is a class of axisbus, a module or package of
axisbus (on a page: a package directly below ``axisbus``), or a variable of ``VARIABLES``. Any other name is not ours. A dotted name
is accepted if a table of the source has it (the parameters of a drive look like that), or if the code of the file itself uses it.
"""

import ast
import importlib
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from kit.pages import ROOT

SOURCE = ROOT / "src" / "axisbus"
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
# The variables that pages and docstrings use for the user's objects.
VARIABLES = {
    "cell": ("Machine",),
    "machine": ("Machine",),
    "axis": ("Axis",),
    "x": ("Axis",),
    "y": ("Axis",),
    "z": ("Axis",),
    "group": ("Group",),
    "handle": ("Handle", "ProbeHandle"),
}
FILE_ENDINGS = (
    "py",
    "tsv",
    "js",
    "md",
    "toml",
    "eds",
    "dcf",
    "conf",
    "csv",
    "json",
    "html",
    "css",
    "svg",
    "mcap",
)


@dataclass(frozen=True)
class ClassNames:
    """The names of the bases of a class, and of its members: methods, fields, and attributes that its methods assign."""

    bases: tuple[str, ...]
    members: frozenset[str]


@dataclass(frozen=True)
class ModuleNames:
    """The names that a module defines or imports, and the classes among them."""

    names: frozenset[str]
    classes: dict[str, ClassNames]


@cache
def source_files() -> tuple[Path, ...]:
    return tuple(sorted(SOURCE.rglob("*.py")))


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def module_name(path: Path) -> str:
    """Return the dotted name of a file of the source, without ``axisbus``; the empty string for axisbus itself."""
    parts = path.relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, ModuleNames]:
    return {module_name(path): _module(tree_of(path)) for path in source_files()}


def _module(tree: ast.Module) -> ModuleNames:
    names = _bound(tree.body)
    if "__getattr__" in names:  # it imports the names of its tables when they are asked for
        names |= {
            node.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        }
    return ModuleNames(
        frozenset(names), {node.name: _class(node) for node in tree.body if isinstance(node, ast.ClassDef)}
    )


def _class(node: ast.ClassDef) -> ClassNames:
    assigned = {
        one.attr
        for one in ast.walk(node)
        if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store)
    }
    bases = tuple(ast.unparse(base).split("[")[0].rpartition(".")[2] for base in node.bases)
    return ClassNames(bases, frozenset(_bound(node.body) | assigned))


def _bound(body: Iterable[ast.stmt]) -> set[str]:
    names: set[str] = set()
    for node in body:
        if isinstance(node, (ast.ClassDef, *FUNCTIONS)):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {(alias.asname or alias.name).split(".")[0] for alias in node.names}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {
                part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)
            }
        elif isinstance(node, ast.TypeAlias if sys.version_info >= (3, 12) else ()):
            names.add(node.name.id)
        elif isinstance(node, (ast.If, ast.Try)):
            inner = [*node.body, *node.orelse]
            names |= _bound(inner)
    return names


@cache
def classes() -> dict[str, list[ClassNames]]:
    found: dict[str, list[ClassNames]] = {}
    for module in modules().values():
        for name, one in module.classes.items():
            found.setdefault(name, []).append(one)
    return found


def class_has(name: str, member: str) -> bool:
    """Say whether a class of this name, or a base of it, has this member; a class that is not ours may have any."""
    if name not in classes():
        return name not in ("Enum", "Exception", "object", "Protocol", "NamedTuple", "Generic")
    return any(
        member in one.members or any(class_has(base, member) for base in one.bases) for one in classes()[name]
    )


def resolves(dotted: str) -> bool:
    """Say whether a dotted name, without ``axisbus``, is a module or names something that a module defines."""
    parts = dotted.split(".") if dotted else []
    for count in range(len(parts), -1, -1):
        if module := modules().get(".".join(parts[:count])):
            rest = parts[count:]
            return not rest or (rest[0] in module.names and (len(rest) == 1 or class_has(rest[0], rest[1])))
    return False


# -- mentioned names ------------------------------------------------------------------------------------------------------------

_IN_CODE = re.compile(r"(?<!`)``([^`\n]+)``(?!`)")
_ON_PAGE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
_DOTTED = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)(?:\(.*)?")
_PATH = re.compile(r"(?<![\w./{}*<-])(?:src|tests|docs|examples)/[\w./-]*\w(?![\w*])")


def mentioned(text: str, *, page: bool) -> Iterator[str]:
    """Yield the dotted names that a page, or a module's docstrings and comments, have between backticks."""
    for quoted in (_ON_PAGE if page else _IN_CODE).findall(_without_blocks(text) if page else text):
        if match := _DOTTED.fullmatch(quoted.strip()):
            yield match[1]


def _without_blocks(page: str) -> str:
    return re.sub(r"^```.*?^```", "", page, flags=re.S | re.M)


def exists(dotted: str, path: Path | None = None) -> bool:
    """Say whether a dotted name is there; ``path``: the Python file that mentions it, None for a page.

    True for names that are not ours: files, names of other libraries, parameters of drives, fields of messages.
    """
    first, _, rest = dotted.partition(".")
    member = rest.split(".")[0]
    if dotted.rpartition(".")[2] in FILE_ENDINGS:
        return True
    if first == "axisbus":
        return resolves(rest)
    if first in classes():
        return class_has(first, member)
    candidates = [
        f"{parent}{dotted}" for parent in (_parents_of(first) if path else {""} & _parents_of(first))
    ]
    holders = VARIABLES.get(first, ())
    return (
        not (candidates or holders)
        or any(map(resolves, candidates))
        or any(class_has(holder, member) for holder in holders)
        or _of_standard_library(first, member)
        or any(f".{dotted}." in f".{word}." for word in _words_of_tables())
        or (path is not None and dotted in _expressions(path))
    )


def _parents_of(stem: str) -> set[str]:
    """Return the packages, each with a dot at its end, that have a module or package of this name."""
    return _parents().get(stem, set())


@cache
def _parents() -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for name in modules():
        parent, dot, stem = name.rpartition(".")
        found.setdefault(stem, set()).add(parent + dot)
    return found


@cache
def _expressions(path: Path) -> frozenset[str]:
    """The dotted expressions in the code of a file: ``x.velocity`` of a parameter ``x``."""
    return frozenset(ast.unparse(node) for node in ast.walk(tree_of(path)) if isinstance(node, ast.Attribute))


def _of_standard_library(first: str, member: str) -> bool:
    return first in sys.stdlib_module_names and hasattr(importlib.import_module(first), member)


@cache
def _words_of_tables() -> frozenset[str]:
    """The dotted words of the tables in the source: a drive's own parameters have such names, ``encoder.pos_estimate``."""
    return frozenset(
        word
        for table in SOURCE.rglob("*.tsv")
        for word in re.findall(r"\w+(?:\.\w+)+", table.read_text(encoding="utf-8"))
    )


def paths_in(text: str) -> list[str]:
    """Return the paths of the checkout that a text mentions."""
    return _PATH.findall(text)
