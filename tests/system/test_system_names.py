"""Which modules use names that Windows or macOS lacks: those of each need, and no other; and how texts are read and written."""

from __future__ import annotations

import ast
import fnmatch

import pytest

from kit.other_system import MISSING, MODULES
from kit.pages import ROOT
from kit.system_needs import ALLOWED

SOURCE = ROOT / "src" / "axisbus"
# Python has its own ``socketpair`` on Windows; ``MSG_DONTWAIT`` and the like are looked for in ``socket``.
PATTERNS: dict[str, set[str]] = {}
for names in MISSING.values():
    for module, text in names.items():
        PATTERNS.setdefault(module.removeprefix("_"), set()).update(set(text.split()) - {"socketpair"})
ABSENT = {name for text in MODULES.values() for name in text.split()} | {"msvcrt", "winreg", "_winapi"}


def used(tree: ast.AST) -> set[str]:
    """The modules and names in a module that some system lacks; also those that it only looks for (getattr, hasattr)."""
    modules: dict[str, str] = {}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names if each.name in ABSENT}
            modules |= {each.asname or each.name: each.name for each in node.names if each.name in PATTERNS}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module} & ABSENT
            found |= {f"{node.module}.{each.name}" for each in node.names if lacks(node.module, each.name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            home, name = modules.get(node.value.id), node.attr
        elif isinstance(node, ast.Call) and len(node.args) > 1 and isinstance(node.args[0], ast.Name):
            home, name = modules.get(node.args[0].id), getattr(node.args[1], "value", None)
        else:
            continue
        if isinstance(name, str) and lacks(home, name):
            found.add(f"{home}.{name}")
    return found


def lacks(home: str | None, name: str) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in PATTERNS.get(str(home), ()))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("import os\nos.fork()", {"os.fork"}),
        ("import os as o\nif hasattr(o, 'geteuid'): pass", {"os.geteuid"}),
        ("def f():\n    import termios", {"termios"}),
        ("from signal import SIGHUP", {"signal.SIGHUP"}),
        ("from fcntl import flock", {"fcntl"}),
        ("import msvcrt", {"msvcrt"}),
        ("import socket\nsocket.socket(socket.AF_UNIX)", {"socket.AF_UNIX"}),
        ("import os, signal\nos.getpid()\nsignal.SIGINT\nself.fork()", set()),
    ],
)
def test_names_that_a_system_lacks(text, names):
    assert used(ast.parse(text)) == names


def test_only_the_modules_of_a_need_use_names_that_a_system_lacks():
    found = {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts): names
        for path in SOURCE.rglob("*.py")
        if (names := used(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert {name: names for name, names in found.items() if name not in ALLOWED} == {}
    assert ALLOWED - found.keys() == set()  # a module that needs them no more is not on the list


# -- files ---------------------------------------------------------------------------------------------------------------


def unclear(tree: ast.AST) -> list[int]:
    """The lines that read or write a text without its encoding, or write it without its line ends."""
    return [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Call) and is_unclear(node)]


def is_unclear(call: ast.Call) -> bool:
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    given = {each.arg: each.value for each in call.keywords}
    if name in ("read_text", "write_text"):
        positions = {"read_text": 0, "write_text": 1}
        lacking = len(call.args) <= positions[name] and "encoding" not in given
        return lacking or (name == "write_text" and "newline" not in given)
    if name not in ("open", "fdopen", "TemporaryFile", "NamedTemporaryFile"):
        return False
    if isinstance(call.func, ast.Attribute) and getattr(call.func.value, "id", "") in ("os", "webbrowser"):
        return False
    modes = [
        each.value
        for each in (*call.args[:2], given.get("mode"))
        if isinstance(each, ast.Constant)
        and isinstance(each.value, str)
        and set(each.value) <= set("rwaxbt+")
    ]
    if not modes:
        return isinstance(call.func, ast.Name) and name == "open" and "encoding" not in given
    if "b" in modes[0]:
        return False
    return "encoding" not in given or (bool(set("wax+") & set(modes[0])) and "newline" not in given)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("path.read_text()", True),
        ("path.read_text('utf-8')", False),
        ("path.read_text(encoding='utf-8')", False),
        ("path.write_text('a', encoding='utf-8')", True),
        ("path.write_text('a', encoding='utf-8', newline='')", False),
        ("open(name, 'w', encoding='utf-8')", True),
        ("open(name, 'w', newline='')", True),
        ("path.open('r')", True),
        ("open(name)", True),
        ("Machine.open(cell)", False),
        ("path.open('rb')", False),
        ("path.open('a', encoding='utf-8', newline='\\n')", False),
    ],
)
def test_a_text_file_without_encoding_or_line_ends_is_noticed(text, expected):
    assert bool(unclear(ast.parse(text))) == expected


def test_each_text_file_has_its_encoding_and_line_ends():
    found = {
        path.relative_to(SOURCE).as_posix(): lines
        for path in SOURCE.rglob("*.py")
        if (lines := unclear(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert found == {}
