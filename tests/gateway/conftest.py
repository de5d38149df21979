"""The machine of most tests of this folder: two simulated axes in virtual time."""

from __future__ import annotations

import pytest

from axisbus.machine.machine import Machine
from kit.cell import cell_text


@pytest.fixture
def machine(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(cell_text("xy"), "utf-8")
    with Machine.simulated(file) as opened:
        yield opened
