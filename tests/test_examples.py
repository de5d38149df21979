"""The programs of examples/ run; one of them, the ten lines of README.md and the demo in a process, as a reader starts them."""

import os
import runpy
import subprocess
import sys
import warnings

import pytest

from axisbus.cell.problem import errors
from axisbus.check.run import check
from kit.pages import README, ROOT, blocks

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
# Whose calls between program and core are not those of the others.
IN_A_THREAD = {"follow", "node_access", "with_asyncio"}
IN_BOTH = pytest.mark.parametrize("process", ["own", "thread"])


def run(*arguments, cwd=ROOT, process="own"):
    path = os.pathsep.join([str(ROOT / "src"), *sys.path[1:]])  # absolute, wherever it is run
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
        env={
            **os.environ,
            "PYTHONWARNINGS": "error",
            "PYTHONIOENCODING": "utf-8",
            "PYTHONPATH": path,
            "AXISBUS_PROCESS": process,
        },
    )


@pytest.mark.parametrize(
    ("example", "process"),
    [
        *((path, "own") for path in EXAMPLES),
        *((path, "thread") for path in EXAMPLES if path.stem in IN_A_THREAD),
    ],
    ids=lambda value: getattr(value, "stem", value),
)
def test_each_example_runs(example, process, monkeypatch, capsys, core_in_threads):
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("AXISBUS_PROCESS", process)
    monkeypatch.setattr(sys, "argv", [str(example)])
    monkeypatch.setattr(sys, "path", [str(example.parent), *sys.path])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runpy.run_path(str(example), run_name="__main__")
    printed = capsys.readouterr()
    assert printed.out.strip()
    assert "Traceback" not in printed.err


@IN_BOTH
def test_an_example_runs_as_a_program(process):
    ran = run(str(ROOT / "examples" / "with_asyncio.py"), process=process)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip()
    assert "Traceback" not in ran.stderr


@IN_BOTH
def test_the_ten_line_program_runs_as_printed(process):
    (program,) = blocks(README, "python")
    assert len([line for line in program.splitlines() if line.strip()]) <= 10
    ran = run("-c", program + "\nprint(x.snapshot.state.value)", process=process)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""


@pytest.mark.timeout(120)
@pytest.mark.parametrize("there", [False, True], ids=["new", "of_the_user"])
def test_the_demo_runs_as_printed_and_leaves_a_cell_file_to_continue_with(tmp_path, there):
    kept = tmp_path / "demo-output" / "cell.toml"
    own = "# of the user\n"
    if there:
        kept.parent.mkdir()
        kept.write_text(own, encoding="utf-8")
    ran = run("-m", "axisbus", "demo", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.endswith(f"; then axisbus check {kept.relative_to(tmp_path)}\n")
    assert kept.read_text(encoding="utf-8") == own if there else not errors(check(kept))
