"""Starting is quick and light: nothing heavy is imported before it is needed."""

import json
import os
import subprocess
import sys

import pytest

import axisbus

HEAVY = ("numpy", "matplotlib", "pyarrow", "rich", "asyncua", "can", "canopen")


def loaded(statement):
    program = f"import sys, json; {statement}; print(json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


@pytest.mark.parametrize("statement", ["import axisbus", "import axisbus.eds", "import axisbus.check.run"])
def test_import_loads_nothing_heavy(statement):
    assert loaded(statement) == []


def test_every_public_name_is_there():
    for name in axisbus.__all__:
        assert getattr(axisbus, name).__name__ == name
    assert set(axisbus.__all__) <= set(dir(axisbus))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        axisbus.nothing  # noqa: B018


def seconds(*arguments):
    """Processor time of a run: its duration on an idle processor."""
    before = os.times()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


@pytest.mark.skipif(sys.platform == "win32", reason="Windows counts no processor time of children")
def test_help_starts_within_150_ms_of_a_bare_interpreter():
    bare, ours = (
        min(seconds(*arguments) for _ in range(5))
        for arguments in (("-c", "pass"), ("-m", "axisbus", "--help"))
    )
    assert 0.0 < ours - bare < 0.150
