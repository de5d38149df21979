"""The history of simulated drives (``history`` in ``[bus.options]``): it replaces no file but another history."""

from __future__ import annotations

import sys

import pytest

from axisbus.cell.reader import load
from axisbus.core.process.persistence.plant_log import COLUMNS, PlantLog, history_path
from axisbus.errors import ConfigError
from axisbus.machine.machine import Machine
from kit.cell import cell_text


@pytest.fixture
def cell(tmp_path):
    """A cell file in a folder of its own, that names a file beside that folder."""
    file = tmp_path / "cell" / "cell.toml"
    file.parent.mkdir()
    text = cell_text("x", bus='process = "own"' if sys.platform == "linux" else "")
    file.write_text(text + '\n[bus.options]\nhistory = "../plant.csv"\n', "utf-8")
    return file


def test_a_file_of_the_user_is_not_replaced_and_nothing_is_opened(cell, tmp_path):
    precious = tmp_path / "plant.csv"
    precious.write_text("export PATH=...\n", "utf-8")
    with pytest.raises(ConfigError) as caught:
        history_path(load(cell))
    assert str(cell) in str(caught.value)
    assert "plant.csv" in caught.value.message
    assert "move that one away" in caught.value.remedy
    if sys.platform == "linux":
        with pytest.raises(ConfigError, match="history"):
            Machine.open(cell)
    assert precious.read_text("utf-8") == "export PATH=...\n"


def test_a_history_is_replaced_by_the_next_one_and_created_if_there_is_none(cell, tmp_path):
    path = history_path(load(cell))
    assert path.resolve() == tmp_path / "plant.csv"
    for _ in range(2):
        with PlantLog(history_path(load(cell)), {}):
            pass
        assert path.read_text("utf-8") == ",".join(COLUMNS) + "\n"
    path.write_bytes(b"")
    assert history_path(load(cell)) == path


def test_a_folder_of_that_name_is_reported(cell, tmp_path):
    (tmp_path / "plant.csv").mkdir()
    with pytest.raises(ConfigError, match=r"plant\.csv"):
        history_path(load(cell))
