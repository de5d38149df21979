"""The golden messages as a whole: none is left over, and each says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest
import story_golden

HERE = Path(__file__).parent
# What ends a command as its user wanted it, or names the reason and the remedy beside it.
NEEDS_NO_REMEDY = {"replaced"}


def test_no_golden_message_is_left_over(request):
    """Only a run of all stories can tell."""
    here = {item.path for item in request.session.items if item.path.parent == HERE}
    chosen = request.config.getoption("keyword") or any("::" in name for name in request.config.args)
    if here != set(HERE.glob("test_*.py")) or chosen or request.session.testsfailed:
        pytest.skip("not all stories have run")
    assert {path.stem for path in story_golden.FOLDER.glob("*.txt")} == story_golden.USED


@pytest.mark.parametrize("path", sorted(story_golden.FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_a_message_tells_what_to_do(path):
    text = path.read_text(encoding="utf-8")
    assert ("remedy:" in text) != (path.stem in NEEDS_NO_REMEDY)
