"""Starting is quick and light: nothing heavy is imported before it is needed."""

import json
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


def test_help_loads_few_modules():
    """The time of a start is that of its imports: some 0.1 s with these."""
    names = loaded_by("--help")
    ours = [name for name in names if name.startswith("axisbus")]
    assert 0 < len(ours) <= 25
    assert len(names) <= 250
    assert not {*HEAVY, "msgspec"} & set(names)


def loaded_by(*arguments):
    program = (
        "import json, runpy, sys\n"
        f"sys.argv = ['axisbus', *{arguments!r}]\n"
        "try: runpy.run_module('axisbus', run_name='__main__')\n"
        "except SystemExit: pass\n"
        "print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return json.loads(ran.stderr.splitlines()[-1])
