"""Golden messages: the full text of an error, compared exactly with a reviewed file. AXISBUS_UPDATE_GOLDEN=1 writes them anew."""

from __future__ import annotations

import os
import re
from pathlib import Path

from axisbus.cia402.starvation import REMEDY
from axisbus.errors import added_notes

FOLDER = Path(__file__).parents[2] / "stories" / "golden"
UPDATE = "AXISBUS_UPDATE_GOLDEN"

# What differs from run to run: the private channel's name, and in real time measured seconds and increments under way.
_CHANNEL = re.compile(r"axisbus-(sim|stories)-\d+-\d+"), r"axisbus-\1-#"
_MEASURED = re.compile(r"\d+\.\d+|\d+(?= s\b)"), "#"
_FRAME = re.compile(r"frame [0-9A-F]{3}h"), "frame #"  # whichever was due when the adapter failed
# That the computer was too busy for us, which it may be in any run.
_STARVED = re.compile(r"this program did not run for # s of the last # s; "), ""
_STARVED_REMEDY = re.compile(re.escape(REMEDY) + r"\n +"), ""
_VOLATILE = (_CHANNEL, _MEASURED, _FRAME, _STARVED, _STARVED_REMEDY)


class Golden:
    """Compares errors with their files; ``folder`` is where the story's cell stands, which messages name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, name: str, *errors: BaseException, volatile: bool = False) -> None:
        """Compare; ``volatile``: measured numbers, and which frame it was, are left out."""
        text = "\n".join(map(full_text, errors)) + "\n"
        text = text.replace(str(self._folder), "<folder>")
        for pattern, instead in _VOLATILE if volatile else (_CHANNEL,):
            text = pattern.sub(instead, text)
        path = FOLDER / f"{name}.txt"
        if os.environ.get(UPDATE) == "1":
            path.write_text(text, encoding="utf-8")
        assert path.exists(), f"no golden message {name}: review this one, then run with {UPDATE}=1\n{text}"
        assert text == path.read_text(encoding="utf-8")


def full_text(error: BaseException) -> str:
    """Return what a user reads of an error: its text and notes; of a group, that of each."""
    if isinstance(error, BaseExceptionGroup):
        return "\n".join([error.message, *map(full_text, error.exceptions)])
    return "\n".join([str(error), *added_notes(error)])


def kept() -> set[str]:
    """The names of the golden files that there are."""
    return {path.stem for path in FOLDER.glob("*.txt")}


_CALLED = re.compile(r'golden\(\s*f?"([^"]+)"')


def unused() -> set[str]:
    """The names of golden files that no story asks for: by the whole name, or by its beginning and a part that its file quotes."""
    sources = [path.read_text("utf-8") for path in FOLDER.parent.glob("test_*.py")]
    return {name for name in kept() if not any(_asks_for(source, name) for source in sources)}


def _asks_for(source: str, name: str) -> bool:
    for called in _CALLED.findall(source):
        start, brace, _ = called.partition("{")
        part = name.removeprefix(start)
        spellings = (part, part.replace("_", " "), part.replace("_", "-"))
        if called == name or (
            brace and name.startswith(start) and any(f'"{each}"' in source for each in spellings)
        ):
            return True
    return False
