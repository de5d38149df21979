"""The machine of most tests of this folder: two simulated axes in virtual time."""

from __future__ import annotations

import pytest

from axisbus.machine.machine import Machine
from kit.cell import cell_file


@pytest.fixture
def machine(tmp_path):
    file = cell_file(tmp_path, "xy")
    with Machine.simulated(file) as opened:
        yield opened
