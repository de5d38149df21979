"""The journal of a core: a bounded file for each cell; without it if it cannot be written."""

import logging
import sys
from pathlib import Path

import pytest

from axisbus.core.process.persistence.journal import faults_of, journal, path_of
from axisbus.eds.builtin import resolve
from axisbus.errors import EdsError, StateError

LOG = logging.getLogger("axisbus")


@pytest.fixture
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    yield tmp_path
    LOG.setLevel(logging.NOTSET)


def test_each_cell_has_its_own_log_file(state):
    one, other = path_of("/a/cell.toml"), path_of("/b/cell.toml")
    assert one != other
    assert one.parent == other.parent == state / "axisbus"
    assert one.name.startswith("cell-")


def test_without_xdg_state_home_the_log_file_is_in_the_home_folder(monkeypatch, tmp_path):
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert path_of("/a/cell.toml").parent == tmp_path / ".local" / "state" / "axisbus"


@pytest.fixture
def homeless(monkeypatch):
    """A user without HOME, and without an entry in the list of users."""
    for name in ("XDG_STATE_HOME", "HOME", "USERPROFILE", "HOMEPATH"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform != "win32":
        monkeypatch.setattr("pwd.getpwuid", lambda _: {}["nobody"])


def test_a_core_of_a_user_without_a_home_runs_without_a_journal(homeless, caplog):
    with journal("/a/cell.toml"):
        LOG.warning("one line")
    assert "there is no journal of this core: " in caplog.text
    assert "one line" in caplog.text


def test_reading_the_faults_of_a_user_without_a_home_names_the_variable_to_set(homeless):
    with pytest.raises(StateError) as caught:
        faults_of("/a/cell.toml")
    assert "XDG_STATE_HOME" in caught.value.remedy


def test_a_path_in_an_unknown_home_is_reported(homeless, tmp_path):
    with pytest.raises(EdsError, match="the home directory with which it begins is not known"):
        resolve("~/drive.eds", tmp_path)


def test_log_lines_of_several_runs_are_appended_to_the_journal(state):
    for text in ("first", "second"):
        with journal("/a/cell.toml"):
            LOG.info("the %s", text)
        LOG.info("not this")
    lines = path_of("/a/cell.toml").read_text(encoding="utf-8").splitlines()
    assert [line.split(" INFO ")[1] for line in lines] == ["the first", "the second"]


def test_the_log_files_have_a_bounded_size(state):
    with journal("/a/cell.toml"):
        for number in range(3000):
            LOG.info("%d %s", number, "x" * 1000)
    files = list(path_of("/a/cell.toml").parent.iterdir())
    assert len(files) == 2
    assert all(file.stat().st_size <= 500_000 for file in files)
    assert " INFO 2999 x" in path_of("/a/cell.toml").read_text(encoding="utf-8")


def test_a_folder_that_cannot_be_created_is_reported_and_the_core_runs_without_a_journal(state, caplog):
    (state / "axisbus").write_text("a file", encoding="utf-8")
    with journal("/a/cell.toml"):
        LOG.warning("one line")
    assert "there is no journal of this core: " in caplog.text
    assert "one line" in caplog.text


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full")
def test_a_full_disk_costs_the_lines_and_nothing_else(monkeypatch, capfd):
    """Each write fails, and closing the file as well."""
    monkeypatch.setattr("axisbus.core.process.persistence.journal.path_of", lambda _: Path("/dev/full"))
    with journal("/a/cell.toml"):
        LOG.warning("one line")
    assert capfd.readouterr().err == ""
