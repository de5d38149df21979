"""The golden messages as a whole: none is left over, and each says what to do."""

from __future__ import annotations

import pytest

from kit.stories import golden as story_golden

# What ends a command as its user wanted it, or names the reason and the remedy beside it.
NEEDS_NO_REMEDY = {"replaced"}


def test_no_golden_message_is_left_over():
    assert story_golden.unused() == set()


@pytest.mark.parametrize("path", sorted(story_golden.FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_a_message_tells_what_to_do(path):
    text = path.read_text(encoding="utf-8")
    assert ("remedy:" in text) != (path.stem in NEEDS_NO_REMEDY)
