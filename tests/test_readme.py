"""What README.md and the examples show is run: every program, every cell snippet, every command that it names."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from axisbus.cli.main import COMMANDS
from axisbus.machine import config

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def run(*arguments):
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, "PYTHONWARNINGS": "error"},
    )


def test_the_ten_line_program_runs_as_printed():
    (program,) = blocks("python")
    assert len([line for line in program.splitlines() if line.strip()]) <= 10
    ran = run("-c", program + "\nprint(x.snapshot.state.value)")
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""


@pytest.mark.parametrize(
    "snippet", blocks("toml"), ids=lambda text: re.search(r'interface = "(\w+)"', text)[1]
)
def test_each_bus_table_is_understood(snippet):
    rest = '\n[nodes.1]\neds = "builtin:gim6010-8"\n[axes.x]\nnode = 1\nunit = "increments"\n'
    cell, problems = config.loads(snippet + rest)
    assert [problem for problem in problems if problem.severity.value == "error"] == []
    assert cell.bus.interface in snippet


def test_the_commands_named_exist():
    code = " ".join(
        re.findall(r"`[^`\n]+`", README) + [block for kind in ("sh", "bat") for block in blocks(kind)]
    )
    named = set(re.findall(r"axisbus ([a-z]+)", code))
    assert named <= set(COMMANDS)
    assert {"check", "boot", "scan", "move", "home", "demo"} <= named


def test_the_files_named_exist():
    for path in re.findall(r"`((?:src|examples|eds)/[\w./-]+)`", README):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_each_example_runs(example):
    ran = run(str(example))
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip()
    assert "Traceback" not in ran.stderr
