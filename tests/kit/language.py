"""Counts of phrases that make a text hard to read, in documentation, docstrings and messages.

A text can be hard to read without any of these phrases: the counts show that the language gets worse, they do not prove it good.
"""

import ast
import re
from collections.abc import Iterator

from kit.pages import PAGES, ROOT
from kit.source_names import FUNCTIONS, source_files, tree_of

# Each phrase, and its replacement.
PHRASES = {
    r"\bwhat (?:is|are|was|were|has|have|had|it|they|a|an|the|each|can|may|must|will|does|do|comes?|came|goes|moves?|stops?)\b"
    r"(?![^.\n]*\?)": "the noun: 'the reported value', not 'what is told'",
    r"\b(?:tells?|telling|told)\b(?! apart)": "reports, returns, says",
    r"(?-i:\b(?:[Ll]eads?|[Ll]ed|[Ll]eading)\b)"
    r"(?! (?:to|zero|edge|byte|digit|character|slash|screw|time|compensation|of \d))": "controls, commands",
    r"(?:[;:,] |\b(?:only|but) )where\b(?! [a-z] )": "if, when",
    r"(?<!test )\b(?:stands?|stood)\b(?![- ]?(?:still|by|in|alone|for|off))": "is; is at standstill",
    r"\b(?:nobody|somebody|everybody|anybody|whoever)\b": "name the actor: the client, the master",
    r"(?<!one )(?<!those )(?<!people )(?<!users )\bwho (?:is|has|are|opens|comes|asks)\b": "name the actor: the client, the master",
    r"\b(?:goes?|going|gone|went) on\b": "continues",
    r"(?<!this )(?<!same )(?<!either )(?<!only )(?<![-\w])ways?\b(?! (?:to|of))": "path, method, direction",
    r"\banew\b": "again",
    r"\bby (?:itself|themselves)\b": "automatically, alone",
    r"(?<!one )(?<!some )(?<!all )(?<!both )(?<!each )(?<!most )(?<!none )"
    r"(?<!any )(?<!two )\bof (?:which|whom|whose)\b": "a sentence of its own",
    r"(?-i:\bis none\b)": "say what is missing",
}
_SEARCHED = [re.compile(phrase, re.IGNORECASE) for phrase in PHRASES]
_WORD = re.compile(r"[A-Za-z][A-Za-z'-]*")
# A string with fewer words is a name, a key or a format, not a message.
MESSAGE_WORDS = 5


def found_in(text: str) -> list[str]:
    """Return the places in a text where one of the phrases is."""
    return [match[0] for phrase in _SEARCHED for match in phrase.finditer(text)]


def rate(texts: list[str]) -> float:
    """Return the phrases per 1,000 words."""
    words = sum(len(_WORD.findall(text)) for text in texts)
    return 1000 * sum(len(found_in(text)) for text in texts) / max(words, 1)


def without_code(text: str) -> str:
    """Return the prose of a page or docstring: code, in blocks or between backticks, becomes ``x``."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    return re.sub(r"`+[^`]*`+", "x", re.sub(r"^#+ .*$", "", text, flags=re.M))


def documentation() -> dict[str, list[str]]:
    return {
        path.relative_to(ROOT).as_posix(): [without_code(path.read_text(encoding="utf-8"))]
        for path in {*PAGES, *ROOT.glob("*.md")}
    }


def docstrings() -> dict[str, list[str]]:
    files = [*source_files(), *sorted((ROOT / "examples").rglob("*.py"))]
    return {
        path.relative_to(ROOT).as_posix(): [without_code(text) for _, text in _docstrings(tree_of(path))]
        for path in files
    }


def _docstrings(tree: ast.Module) -> Iterator[tuple[ast.Constant, str]]:
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, *FUNCTIONS)) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                yield first.value, first.value.value


def messages() -> dict[str, list[str]]:
    """Return the strings of each module that are sentences, and those of tables and of the page's scripts."""
    of_modules = {
        path.relative_to(ROOT).as_posix(): list(_messages(tree_of(path))) for path in source_files()
    }
    others = [path for ending in ("tsv", "js", "toml") for path in (ROOT / "src").rglob(f"*.{ending}")]
    return of_modules | {
        path.relative_to(ROOT).as_posix(): list(_sentences(path.read_text(encoding="utf-8")))
        for path in others
    }


def _messages(tree: ast.Module) -> Iterator[str]:
    documenting = {id(node) for node, _ in _docstrings(tree)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str) or id(node) in documenting:
            continue
        if len(node.value.split()) >= MESSAGE_WORDS:
            yield node.value


def _sentences(text: str) -> Iterator[str]:
    return (part for part in re.split(r"[\t\n\"'`{}<>]", text) if len(part.split()) >= MESSAGE_WORDS)
