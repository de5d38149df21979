"""The rules of the house that no linter keeps: folders that can be taken in, no empty rooms, no circles, pages that are true,
and tests that stand by themselves."""

import ast
import re
from pathlib import Path

import grimp
import pytest

from kit.slow import LONG, NAMES

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "axisbus"
MOST = 25  # files in a folder
# Folders of like pieces, which nobody reads from end to end.
LIKE_PIECES = {SOURCE / "eds" / "rules": "one file for each family of rules"}
PAGES = sorted((ROOT / "docs").rglob("*.md"))


def folders():
    return sorted({path.parent for path in SOURCE.rglob("*.py")})


def pieces(folder):
    return [path for path in folder.iterdir() if path.suffix in (".py", ".tsv")]


@pytest.mark.parametrize("folder", folders(), ids=lambda folder: folder.relative_to(SOURCE).as_posix())
def test_a_folder_can_be_taken_in_and_says_what_it_is(folder):
    assert len(pieces(folder)) <= MOST or folder in LIKE_PIECES
    first = (folder / "__init__.py").read_text(encoding="utf-8").splitlines()[0]
    assert re.fullmatch(r'"""[A-Z`a-z].*[.:]("""|)', first)


def test_a_folder_that_may_be_larger_is():
    assert all(len(pieces(folder)) > MOST for folder in LIKE_PIECES)


def test_no_room_is_empty():
    assert [folder for folder in SOURCE.rglob("*/") if folder.is_dir() and _is_empty(folder)] == []


def _is_empty(folder):
    names = {path.name for path in folder.iterdir()}
    return folder.name != "__pycache__" and names <= {"__init__.py", "__pycache__"}


def test_no_module_imports_itself_by_way_of_others():
    graph = grimp.build_graph("axisbus", exclude_type_checking_imports=True)
    circles = [
        (one, other)
        for one in sorted(graph.modules)
        for other in sorted(graph.find_modules_directly_imported_by(one))
        if one < other and graph.chain_exists(importer=other, imported=one)
    ]
    assert circles == []


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *PAGES], ids=lambda page: page.relative_to(ROOT).as_posix()
)
def test_every_file_that_a_page_names_is_there(page):
    named = re.findall(r"`((?:src|tests|examples|eds|docs)/[\w./-]+)`", page.read_text(encoding="utf-8"))
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_pages_name_files():
    assert len(PAGES) >= 3
    assert any("`src/" in page.read_text(encoding="utf-8") for page in PAGES)


# -- the tests ---------------------------------------------------------------------------------------------------------

TESTS = ROOT / "tests"
FILES = sorted(TESTS.rglob("*.py"))


def imported(file):
    """The names of the modules that a file imports."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file} imports by dots"
            yield node.module


def test_no_test_imports_another_or_what_stands_beside_it():
    shared = {
        path.stem for path in FILES if path.parent != TESTS and "kit" not in path.relative_to(TESTS).parts
    }
    shared -= {"__init__"} | {
        path.stem for path in (TESTS / "mutation").iterdir()
    }  # a tool, and a package by itself
    shared |= {path.stem for path in TESTS.glob("*.py")}
    found = {(file.name, name) for file in FILES for name in imported(file) if name.split(".")[0] in shared}
    assert found == set()


def test_no_test_puts_a_folder_on_the_path():
    changing = re.compile(r"\bsys\.path(\.(insert|append|extend)|\[.*\] *=[^=])")
    assert [file.name for file in FILES if changing.search(file.read_text(encoding="utf-8"))] == []


@pytest.mark.parametrize("name", LONG)
def test_a_file_that_is_begun_first_is_there(name):
    assert len(list(TESTS.rglob(name))) == 1


@pytest.mark.parametrize("name", sorted(NAMES))
def test_what_is_called_slow_is_there(name):
    path, _, function = name.partition("::")
    assert (TESTS / path).exists()
    assert not function or f"\ndef {function}(" in (TESTS / path).read_text(encoding="utf-8")
