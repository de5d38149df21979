"""Fixtures of the tests of a core, in threads of this process or in a process of its own."""

from __future__ import annotations

import pytest

from kit.scenarios.core_process import enabled


@pytest.fixture
def machine(opened):
    """The machine of the program that opened it (the fixture ``opened`` of the module), with its axes enabled and at standstill."""
    for axis in opened:
        enabled(axis)
    yield opened
    for axis in opened:
        axis.halt().wait(10)
