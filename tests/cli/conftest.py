"""The motion of the machine of a program, which commands are run beside."""

from __future__ import annotations

import pytest

from kit.scenarios.core_process import enabled, under_way


@pytest.fixture
def moving(opened):
    """The machine of a program, and its move of x: it turns already, and continues for longer than any of these tests."""
    x = enabled(opened["x"])
    yield opened, under_way(x)
    x.halt().wait(10)
