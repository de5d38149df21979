"""The clean cell of this folder with chosen defects, and the findings of its check."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from axisbus.cell.problem import CellProblem
from axisbus.check.run import check
from axisbus.eds.model import Severity

HERE = Path(__file__).parent
CLEAN = (HERE / "clean.toml").read_text(encoding="utf-8")
DRIVE = (HERE / "drive.eds").read_text(encoding="ascii")


def changed(text: str, *changes: tuple[str, str]) -> str:
    """Return ``text`` with each (old, new) replaced once; an old text must be there."""
    for old, new in changes:
        assert old in text, f"{old!r} is not in the text"
        text = text.replace(old, new, 1)
    return text


def write(folder: Path, *changes: tuple[str, str], eds: Callable[[str], str] = str) -> Path:
    """Write the clean cell with changes, and its drive's EDS, into ``folder``; return the cell's path."""
    (folder / "drive.eds").write_text(eds(DRIVE), encoding="ascii")
    path = folder / "cell.toml"
    path.write_text(changed(CLEAN, *changes), encoding="utf-8")
    return path


def line_of(path: Path, marker: str) -> int:
    """Return the line (from 1) of the only line that holds ``marker``."""
    lines = [number for number, line in enumerate(path.read_text("utf-8").split("\n"), 1) if marker in line]
    assert len(lines) == 1, f"{marker!r} is in the lines {lines}"
    return lines[0]


def serious(path: Path) -> list[CellProblem]:
    """Return the errors and warnings of a cell."""
    return [problem for problem in check(path) if problem.severity is not Severity.NOTE]


def only(path: Path, severity: str, marker: str) -> CellProblem:
    """Return the only error or warning; it must have this severity and the line that holds ``marker``."""
    found = serious(path)
    assert len(found) == 1, "\n".join(map(str, found)) or "nothing was found"
    assert found[0].severity.value == severity, found[0]
    assert found[0].file == str(path)
    assert found[0].line == line_of(path, marker), found[0]
    assert found[0].remedy, "a finding without a remedy"
    return found[0]


def notes(path: Path) -> list[CellProblem]:
    """Return the notes of a cell."""
    return [problem for problem in check(path) if problem.severity is Severity.NOTE]


def note(path: Path, words: str) -> CellProblem:
    """Return the only note whose message holds ``words``."""
    found = [each for each in notes(path) if words in each.message]
    assert len(found) == 1, [each.message for each in notes(path)]
    return found[0]


# -- the EDS ---------------------------------------------------------------------------------------------------------


def without(*sections: str) -> Callable[[str], str]:
    """Return a change of an EDS text that takes objects out: their sections, sub-indices and places in the lists."""

    def change(text: str) -> str:
        for section in sections:
            assert f"[{section}]" in text
            text = re.sub(rf"\[{section}(?:sub[0-9A-F]+)?\]\n(?:[^\[].*\n)*", "", text)
            text = _unlisted(text, section)
        return text

    return change


def _unlisted(text: str, index: str) -> str:
    """Take an index out of its object list and number the list again."""
    blocks = re.split(r"(?m)^(?=\[)", text)
    for at, block in enumerate(blocks):
        if block.startswith("[") and "SupportedObjects=" in block and f"=0x{index}\n" in block:
            kept = [
                line.split("=")[1] for line in block.splitlines()[2:] if line.split("=")[1] != f"0x{index}"
            ]
            numbered = "".join(f"{number}={value}\n" for number, value in enumerate(kept, 1))
            blocks[at] = f"{block.splitlines()[0]}\nSupportedObjects={len(kept)}\n{numbered}"
    return "".join(blocks)


def entry(section: str, **values: str) -> Callable[[str], str]:
    """Return a change of an EDS text that sets keys of one section; an empty value takes the key out."""

    def change(text: str) -> str:
        start = text.index(f"[{section}]\n")
        end = text.find("\n[", start) + 1 or len(text)
        block = text[start:end]
        for key, value in values.items():
            block = re.sub(rf"(?m)^{key}=.*\n", "", block)
            block += f"{key}={value}\n" if value else ""
        return text[:start] + block + text[end:]

    return change


def both(*changes: Callable[[str], str]) -> Callable[[str], str]:
    """Return several changes as one."""

    def change(text: str) -> str:
        for each in changes:
            text = each(text)
        return text

    return change


def without_sub(index: str, subindex: int) -> Callable[[str], str]:
    """Return a change of an EDS text that takes one sub-index out."""

    def change(text: str) -> str:
        text = re.sub(rf"\[{index}sub{subindex:X}\]\n(?:[^\[].*\n)*", "", text)
        return _recount(text, index, -1)

    return change


def with_sub(index: str, subindex: int, data_type: str, access: str, default: str) -> Callable[[str], str]:
    """Return a change of an EDS text that adds one sub-index."""

    def change(text: str) -> str:
        text += (
            f"[{index}sub{subindex:X}]\nParameterName=Added {subindex}\nObjectType=0x7\nDataType={data_type}\n"
            f"AccessType={access}\nDefaultValue={default}\nPDOMapping=0\n"
        )
        return _recount(text, index, 1)

    return change


def _recount(text: str, index: str, more: int) -> str:
    return re.sub(
        rf"(\[{index}\]\n(?:[^\[].*\n)*?SubNumber=)(\d+)",
        lambda found: f"{found[1]}{int(found[2]) + more}",
        text,
    )
