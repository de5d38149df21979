"""Starting is quick and light: nothing heavy is imported before it is needed."""

import json
import subprocess
import sys
import time

import pytest

import axisbus

HEAVY = ("numpy", "matplotlib", "pyarrow", "rich", "asyncua", "can", "canopen")


def loaded(statement):
    program = f"import sys, json; {statement}; print(json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


@pytest.mark.parametrize(
    "statement", ["import axisbus", "import axisbus.eds", "import axisbus.machine.check"]
)
def test_import_loads_nothing_heavy(statement):
    assert loaded(statement) == []


def test_every_public_name_is_there():
    for name in axisbus.__all__:
        assert getattr(axisbus, name).__name__ == name
    assert set(axisbus.__all__) <= set(dir(axisbus))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        axisbus.nothing  # noqa: B018


def seconds(*arguments):
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return time.perf_counter() - start


def test_help_starts_within_150_ms_of_a_bare_interpreter():
    """The best of several pairs: a busy machine slows both."""
    extra = min(seconds("-m", "axisbus", "--help") - seconds("-c", "pass") for _ in range(7))
    assert extra < 0.150
