"""The golden messages as a whole: none is left over, and each has a remedy."""

from __future__ import annotations

import pytest

from kit.scenarios import golden as scenario_golden

# Messages of commands that ended as the user wanted, or whose reason and remedy are given elsewhere.
NEEDS_NO_REMEDY = {"replaced"}


def test_no_golden_message_is_left_over(request):
    """Only a run of all scenarios can decide; if several processes share them, ``tests/conftest.py`` asks at the end."""
    if hasattr(request.config, "workerinput"):
        assert scenario_golden.FOLDER.is_dir()
        return
    if not scenario_golden.whole(request.session) or request.session.testsfailed:
        pytest.skip("not all scenarios have run")
    assert scenario_golden.kept() == scenario_golden.USED


@pytest.mark.parametrize("path", sorted(scenario_golden.FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_every_golden_message_has_a_remedy_if_it_needs_one(path):
    text = path.read_text(encoding="utf-8")
    assert ("remedy:" in text) != (path.stem in NEEDS_NO_REMEDY)
