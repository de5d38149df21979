"""What README.md and the examples show is run: every program, every cell snippet, every command that it names."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import click
import pytest

from axisbus.cell import reader as config
from axisbus.cli.main import COMMANDS, cli

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


BUSES = [text for text in blocks("toml") if text.startswith("[bus]")]


@pytest.mark.parametrize("snippet", BUSES, ids=lambda text: re.search(r'interface = "(\w+)"', text)[1])
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


# -- command lines --------------------------------------------------------------------------------------------------------------

# What ends with 1 where it is as it should be: nobody without a node-ID, two files that differ.
FOUND_SOMETHING = {("lss", "find"), ("eds", "diff")}
SET_UP = re.compile(r"python -m venv |.*python -m (pip install|pytest)")  # done already where this test runs


def lines(block):
    """The command lines of a block, without their comments."""
    return [shlex.split(line, comments=True) for line in block.splitlines() if line.strip()]


def copy_of_the_checkout(folder):
    for name in ("examples", "eds"):
        shutil.copytree(ROOT / name, folder / name)
    return folder


def axisbus(words, folder):
    return subprocess.run(
        [sys.executable, "-m", "axisbus", *words],
        cwd=folder,
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
            "PYTHONPATH": os.pathsep.join(
                [str(ROOT / "src"), *sys.path[1:]]
            ),  # which may be relative to here
        },
    )


def expanded(words, folder):
    """As a shell does with the ``*`` of a path."""
    found = []
    for word in words:
        paths = sorted(folder.glob(word)) if "*" in word else []
        found += [path.relative_to(folder).as_posix() for path in paths] or [word]
    return found


COMMAND_BLOCKS = [block for block in blocks("sh") if "axisbus " in block and "eval" not in block]


@pytest.mark.timeout(240)
@pytest.mark.parametrize("block", COMMAND_BLOCKS, ids=lambda block: " ".join(block.split()[:3]))
def test_each_command_line_runs_as_printed_and_without_hardware(block, tmp_path):
    folder = copy_of_the_checkout(tmp_path)
    for printed in lines(block):
        assert printed[0] == "axisbus", printed
        words = expanded(printed, folder)
        ran = axisbus(words[1:], folder)
        assert "Traceback" not in ran.stderr, f"{words}: {ran.stderr}"
        expected = 1 if tuple(words[1:3]) in FOUND_SOMETHING else 0
        assert ran.returncode == expected, f"{words}: {ran.stdout}{ran.stderr}"
        assert ran.stdout.strip(), words
        for flag, name in pairwise(words):
            assert flag != "-o" or (folder / name).stat().st_size, words


def test_every_block_of_commands_is_run():
    run_here = [line for block in COMMAND_BLOCKS for line in block.splitlines()]
    others = [line for block in blocks("sh") for line in block.splitlines() if line not in run_here]
    assert [line.split()[0] for line in others] == ["make", "make"]
    assert len(run_here) > 20
    windows = [line for line in "".join(blocks("bat")).splitlines() if not SET_UP.match(line)]
    assert windows == [r".venv\Scripts\axisbus demo"]


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
def test_the_targets_of_make_exist():
    named = set(
        re.findall(r"make ([a-z][a-z-]+)", " ".join(re.findall(r"`([^`\n]+)`", README) + blocks("sh")))
    )
    assert {"demo", "test", "check", "bench"} <= named
    for target in named:
        ran = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr


@pytest.mark.timeout(120)
def test_the_demo_runs_as_printed(tmp_path):
    ran = axisbus(["demo"], tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "demo-output").is_dir()


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
def test_the_line_for_the_shell_s_start_file_runs(tmp_path):
    (line,) = re.findall(r"`(eval [^`]+)`", README)
    (tmp_path / "axisbus").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m axisbus "$@"\n')
    (tmp_path / "axisbus").chmod(0o755)
    ran = subprocess.run(
        ["bash", "-e", "-c", f"{line}; complete -p axisbus"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
    )
    assert ran.returncode == 0, ran.stderr
    assert "axisbus" in ran.stdout


def named_in_the_text():
    """The commands that the text names, as lists of words; what a shell does with their output is left out."""
    found = re.findall(r"`axisbus ([a-z][^`\n]*)`", README)
    return [shlex.split(text.partition(">")[0].replace("...", "")) for text in found]


@pytest.mark.parametrize("words", named_in_the_text(), ids=" ".join)
def test_each_command_and_option_that_the_text_names_exists(words):
    command, context = cli, click.Context(cli, info_name="axisbus")
    while words and isinstance(command, click.Group) and words[0] in command.list_commands(context):
        command = command.get_command(context, words.pop(0))
        context = click.Context(command, parent=context, info_name=command.name)
    known = {option for parameter in command.params for option in parameter.opts}
    for word in words:
        if word.startswith("-"):
            assert word in known, f"{context.command_path} has no {word}"
        elif "/" in word:
            assert (ROOT / word).exists(), word
        elif isinstance(command, click.Group):
            assert word == "|" or word in command.list_commands(context), f"{context.command_path} {word}"


def test_the_excerpt_of_what_init_makes_is_what_it_makes(tmp_path):
    (excerpt,) = [text for text in blocks("toml") if not text.startswith("[bus]")]
    folder = copy_of_the_checkout(tmp_path)
    ran = axisbus(["init", "-i", "sim", "-c", "examples/cell.toml", "-o", "cell.toml"], folder)
    assert ran.returncode == 0, ran.stderr
    assert excerpt in (folder / "cell.toml").read_text(encoding="utf-8")
    assert axisbus(["boot", "cell.toml"], folder).returncode == 0


def test_the_files_named_exist():
    for path in re.findall(r"`((?:src|examples|eds)/[\w./-]+)`", README):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_each_example_runs(example):
    ran = run(str(example))
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip()
    assert "Traceback" not in ran.stderr
