"""Golden messages: the full text of an error, compared exactly with a reviewed file. AXISBUS_UPDATE_GOLDEN=1 writes them again."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from axisbus.cpu_starvation import REMEDY
from axisbus.errors import AxisbusError, added_notes

FOLDER = Path(__file__).parents[2] / "scenarios" / "golden"
UPDATE = "AXISBUS_UPDATE_GOLDEN"

# Differences from run to run: the private channel's name, and in real time measured seconds and increments.
_CHANNEL = re.compile(r"axisbus-(sim|scenarios)-\d+-\d+"), r"axisbus-\1-#"
_MEASURED = re.compile(r"\d+\.\d+|\d+(?= s\b)"), "#"
_FRAME = re.compile(r"frame [0-9A-F]{3}h"), "frame #"  # whichever was due when the adapter failed
# That the computer was too busy for us, which it may be in any run.
_STARVED = re.compile(r"this program did not run for # s of the last # s; "), ""
_STARVED_REMEDY = re.compile(re.escape(REMEDY) + r"\n +"), ""
_VOLATILE = (_CHANNEL, _MEASURED, _FRAME, _STARVED, _STARVED_REMEDY)


USED: set[str] = set()  # the names that scenarios have compared with in this run


class Golden:
    """Compares errors with their files; ``folder`` is that of the scenario's cell, which messages name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, name: str, *errors: BaseException, volatile: bool = False) -> None:
        """Compare; ``volatile``: measured numbers, and which frame it was, are left out."""
        text = "\n".join(map(full_text, errors)) + "\n"
        text = text.replace(str(self._folder), "<folder>")
        for pattern, instead in _VOLATILE if volatile else (_CHANNEL,):
            text = pattern.sub(instead, text)
        path = FOLDER / f"{name}.txt"
        USED.add(name)
        if os.environ.get(UPDATE) == "1":
            path.write_text(text, encoding="utf-8")
        assert path.exists(), f"no golden message {name}: review this one, then run with {UPDATE}=1\n{text}"
        assert text == path.read_text(encoding="utf-8")


def full_text(error: BaseException) -> str:
    """Return the full text of an error: its text and notes; of a group, that of each."""
    if isinstance(error, BaseExceptionGroup):
        return "\n".join([error.message, *map(full_text, error.exceptions)])
    return str(error) if isinstance(error, AxisbusError) else "\n".join([str(error), *added_notes(error)])


def kept() -> set[str]:
    """The names of the golden files that there are."""
    return {path.stem for path in FOLDER.glob("*.txt")}


def whole(session: pytest.Session) -> bool:
    """Whether all scenarios are in this run."""
    here = {item.path for item in session.items if item.path.parent == FOLDER.parent}
    chosen = session.config.getoption("keyword") or any("::" in name for name in session.config.args)
    return here == set(FOLDER.parent.glob("test_*.py")) and not chosen and not part(session)


# The choices of ``make test``, ``make test-sweeps`` and ``make test-real``, which together are all tests.
PARTS = ("not real_time and not sweep", "sweep", "real_time")


def part(session: pytest.Session) -> str:
    """The choice of a run of one of the parts; empty if it has another choice or none."""
    choice = str(session.config.getoption("markexpr"))
    folders = all((session.config.invocation_params.dir / name).is_dir() for name in session.config.args)
    return choice if choice in PARTS and folders and not session.config.getoption("keyword") else ""
