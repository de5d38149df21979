"""The golden messages as a whole: none is left over, and each says what to do."""

from __future__ import annotations

import pytest

from kit.stories import golden as story_golden

# What ends a command as its user wanted it, or names the reason and the remedy beside it.
NEEDS_NO_REMEDY = {"replaced"}


def test_no_golden_message_is_left_over(request):
    """Only a run of all stories can tell; where several processes share them, ``tests/conftest.py`` asks at the end."""
    if hasattr(request.config, "workerinput"):
        assert story_golden.FOLDER.is_dir()
        return
    if not story_golden.whole(request.session) or request.session.testsfailed:
        pytest.skip("not all stories have run")
    assert story_golden.kept() == story_golden.USED


@pytest.mark.parametrize("path", sorted(story_golden.FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_a_message_tells_what_to_do(path):
    text = path.read_text(encoding="utf-8")
    assert ("remedy:" in text) != (path.stem in NEEDS_NO_REMEDY)
