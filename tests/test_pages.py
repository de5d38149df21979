"""The contents of README.md and the pages under docs/ are run and true: every command line, program, excerpt and message.

A line that is on several pages runs once; its result is stored for all of them.
"""

import json
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from typing import NamedTuple

import click
import pytest

from axisbus.cell import reader
from axisbus.check.run import check
from axisbus.cia302.types import Letter
from axisbus.cia402 import options
from axisbus.cli.main import COMMANDS, cli
from axisbus.cli.shared.common import run
from axisbus.core.sim_faults_file import load_faults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.motion.parameters import StopTimes
from axisbus.version import __version__
from kit.pages import (
    PAGES,
    README,
    ROOT,
    blocks,
    blocks_of_all,
    cell_excerpts,
    fault_plans,
    name_of,
    rows,
    text_of,
    whole_cell,
)

ARCHITECTURE, COMMISSIONING, ERRORS, STOPPING = (
    ROOT / "docs" / name for name in ("architecture.md", "commissioning.md", "api/errors.md", "stopping.md")
)
LANGUAGES = {"sh", "bat", "python", "toml", "text", "c"}
# Commands that correctly end with 1: no slave without a node-ID, two files that differ.
FOUND_SOMETHING = {("lss", "find"), ("eds", "diff")}
MAY_FIND = {"jitter"}  # 1: a busy computer leaves cycles out
SET_UP = re.compile(r"python -m venv |.*python -m (pip install|pytest)")  # done already where this test runs
RUN_ELSEWHERE = {
    "make",
    "pip",
    "python",
}  # ``test_examples`` runs the programs; ``make dist`` installs the wheel
INIT = ("init", "-i", "sim", "-c", "examples/cell.toml", "-o", "cell.toml")
BOOT = ("boot", "examples/cell.toml")
WHEEL = f"axisbus-{__version__}-py3-none-any.whl"
PORT = "29536"  # that of axisbus sim, as printed


def page_names(*pages):
    return {"argvalues": pages, "ids": [name_of(page) for page in pages]}


def pages_with(language, *without):
    return page_names(*(page for page in PAGES if blocks(page, language) and page not in without))


# -- command lines --------------------------------------------------------------------------------------------------------------


class Ran(NamedTuple):
    code: int
    out: str
    err: str


def command_lines(page):
    """The command lines of a page as lists of words, without their comments."""
    printed = [line for block in blocks(page, "sh") for line in block.splitlines() if line.strip()]
    lines = [words for line in printed if (words := shlex.split(line, comments=True))]
    return [words for words in lines if words[0] not in RUN_ELSEWHERE]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the files of the lines, and the result of each line that has run in it."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("examples", "eds"):
        shutil.copytree(ROOT / name, folder / name)
    return folder, {}


@pytest.fixture
def axisbus(checkout, monkeypatch, capsys):
    """Run the command line in the copy of the checkout, once for all pages. In this process: to load axisbus again for each line
    takes longer than most of them."""
    folder, ran = checkout
    monkeypatch.chdir(folder)

    def call(words):
        key = tuple(words)
        if key not in ran:
            monkeypatch.setattr(sys, "argv", ["axisbus", *key])
            code = run(cli)
            ran[key] = Ran(code, *capsys.readouterr())
        return ran[key]

    return call


class Serving:
    """The first terminal of a page: keeps simulated drives, at a port that no other test has."""

    def __init__(self, folder):
        self.port = PORT
        self._folder = folder
        self._sim = None

    def __call__(self, words):
        """Begin to serve, and wait until the others can come; what was served before has ended."""
        self.end()
        command = [sys.executable, "-m", "axisbus", *words, "--port", "0"]
        self._sim = subprocess.Popen(command, cwd=self._folder, stdout=subprocess.PIPE, text=True)
        while not (line := self._sim.stdout.readline()).startswith("or take"):
            assert line, words
            if found := re.search(r"port=(\d+)", line):
                self.port = found[1]

    def end(self):
        """Ctrl-C in the first terminal."""
        if self._sim is not None:
            self._sim.send_signal(signal.SIGINT)
            self._sim.communicate(timeout=20)
            assert self._sim.returncode == 0


@pytest.fixture
def serve(checkout):
    serving = Serving(checkout[0])
    yield serving
    serving.end()


def expanded(words, folder):
    """As a shell does with the ``*`` of a path."""
    found = []
    for word in words:
        paths = sorted(folder.glob(word)) if "*" in word else []
        found += [path.relative_to(folder).as_posix() for path in paths] or [word]
    return found


def serves(page):
    """Whether it begins simulated drives in a terminal of their own."""
    return any(words[1] == "sim" for words in command_lines(page))


@pytest.mark.timeout(240)
@pytest.mark.parametrize("page", **page_names(*filter(serves, PAGES)))
def test_each_command_line_beside_simulated_drives_runs_as_printed(page, axisbus, checkout, serve):
    run_all(page, axisbus, checkout[0], serve)


@pytest.mark.timeout(240)
@pytest.mark.parametrize("page", **pages_with("sh", *filter(serves, PAGES)))
def test_each_command_line_runs_as_printed_and_without_hardware(page, axisbus, checkout, serve):
    run_all(page, axisbus, checkout[0], serve)


def run_all(page, axisbus, folder, serve):
    """Run the command lines of a page, each of which must print something and end as expected."""
    for printed in command_lines(page):
        assert printed[0] == "axisbus", printed
        if printed[1] == "sim":
            serve(printed[1:])
            continue
        line = " ".join(expanded(printed[1:], folder)).replace(PORT, serve.port)
        words, *written = line.split(" > ")
        words = words.split()
        ran = axisbus(words)
        assert "Traceback" not in ran.err, f"{words}: {ran.err}"
        expected = {1} if tuple(words[:2]) in FOUND_SOMETHING else {0, 1} if words[0] in MAY_FIND else {0}
        assert ran.code in expected, f"{words}: {ran.out}{ran.err}"
        assert ran.out.strip(), words
        for name in written:
            (folder / name).write_text(ran.out, encoding="utf-8")
        for flag, name in pairwise(words):
            assert flag not in ("-o", "--concise") or (folder / name).stat().st_size, words


def test_every_block_of_the_pages_is_of_a_kind_that_is_checked():
    for page in PAGES:
        fences = re.findall(r"^```(\w*)$", text_of(page), re.MULTILINE)
        kinds = Counter(fences[::2])
        assert set(fences[1::2]) <= {""}, page
        assert set(kinds) <= LANGUAGES | ({""} if page == ARCHITECTURE else set()), page


def test_every_line_of_commands_is_run():
    others = [
        line for _, block in blocks_of_all("sh") for line in block.splitlines() if line.startswith("make ")
    ]
    assert [line.split()[1] for line in others] == ["demo", "test"]
    lines = [line.split() for _, block in blocks_of_all("sh") for line in block.splitlines()]
    assert [words[:3] for words in lines if words and words[0] == "pip"] == [["pip", "install", WHEEL]]
    programs = [words[1] for words in lines if words and words[0] == "python"]
    assert programs == ["examples/velocity.py"]
    assert all((ROOT / name).is_file() for name in programs)
    assert len({tuple(words) for page in PAGES for words in command_lines(page)}) > 30
    windows = [
        line for _, block in blocks_of_all("bat") for line in block.splitlines() if not SET_UP.match(line)
    ]
    assert windows == [r".venv\Scripts\axisbus demo"]  # which test_examples runs


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
def test_the_targets_of_make_exist():
    code = [span for page in PAGES for span in re.findall(r"`([^`\n]+)`", text_of(page))]
    named = {
        target
        for text in [*code, *blocks(README, "sh")]
        for target in re.findall(r"make ([a-z][a-z-]+)", text)
    }
    assert {"demo", "test", "check", "bench"} <= named
    ran = subprocess.run(["make", "-n", *named], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
def test_the_line_for_the_shell_s_start_file_runs(tmp_path, monkeypatch):
    (line,) = re.findall(r"`(eval [^`]+)`", text_of(COMMISSIONING))
    (tmp_path / "axisbus").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m axisbus "$@"\n')
    (tmp_path / "axisbus").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    ran = subprocess.run(
        ["bash", "-e", "-c", f"{line}; complete -p axisbus"], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "axisbus" in ran.stdout


# -- commands in the text -------------------------------------------------------------------------------------------------------


def test_the_commands_named_exist():
    spans = [span for page in PAGES for span in re.findall(r"`[^`\n]+`", text_of(page))]
    code = " ".join([*spans, *(block for kind in ("sh", "bat") for _, block in blocks_of_all(kind))])
    named = set(re.findall(r"axisbus ([a-z]+[0-9]*)", code))
    assert named == set(COMMANDS)  # and every command is on a page


def named_in_the_text():
    """The commands in the text, as lists of words; the redirections of a shell are left out."""
    found = [text for page in PAGES for text in re.findall(r"`axisbus ([a-z][^`\n]*)`", text_of(page))]
    return [shlex.split(text.partition(">")[0].replace("...", "")) for text in dict.fromkeys(found)]


def test_each_command_and_option_that_the_text_names_exists():
    named = named_in_the_text()
    assert len(named) > 12
    for words in named:
        command, context = cli, click.Context(cli, info_name="axisbus", **cli.context_settings)
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


def test_the_command_that_installs_an_extra_is_quoted_for_every_shell():
    sources = [path for folder in ("src", "examples") for path in (ROOT / folder).rglob("*.py")]
    for path in (*PAGES, *sources):
        assert re.findall(r"pip install (?:-e )?[^\s\"\\]*\[.*", text_of(path)) == [], path


# -- programs and cell files ----------------------------------------------------------------------------------------------------


@pytest.mark.timeout(120)  # one of them draws: to load matplotlib takes its time on a busy machine
@pytest.mark.parametrize("page", **pages_with("python", README))  # that of README.md: test_examples
def test_each_program_runs_as_printed(page, checkout, monkeypatch, capsys):
    monkeypatch.chdir(checkout[0])
    for number, program in enumerate(blocks(page, "python"), 1):
        exec(compile(program, f"{page.name}, program {number}", "exec"), {"__name__": "__main__"})
    seen = capsys.readouterr()
    assert seen.out.strip()
    assert seen.err == ""


def excerpts(made_by_init):
    """The excerpts of printed cell files."""
    return [block for block in cell_excerpts() if ("CONFIRM" in block) is made_by_init]


def test_each_fault_plan_of_the_pages_is_valid_for_their_cell(tmp_path):
    plans = fault_plans()
    assert plans
    for plan in plans:
        path = tmp_path / "faults.toml"
        path.write_text(plan, encoding="utf-8")
        assert len(load_faults(path, reader.load(ROOT / "examples" / "cell.toml"))) == plan.count("[")


@pytest.mark.parametrize("excerpt", excerpts(False), ids=lambda text: " ".join(text.split()[:4]))
def test_each_excerpt_of_a_cell_file_is_valid(excerpt, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(whole_cell(excerpt), encoding="utf-8")
    (tmp_path / "endpoints_0.5.13.json").write_text(json.dumps(Module().json()), encoding="utf-8")
    assert [str(problem) for problem in check(path) if problem.severity.value == "error"] == []


def test_there_is_a_bus_table_for_each_adapter():
    buses = {
        found[1] for text in excerpts(False) if (found := re.search(r'^interface = "(\w+)"', text, re.M))
    }
    assert {"socketcan", "pcan", "kvaser", "slcan"} <= buses


def test_the_excerpt_of_the_output_of_init_is_current(axisbus, checkout):
    (excerpt,) = excerpts(True)
    assert axisbus(INIT).code == 0
    assert excerpt in (checkout[0] / "cell.toml").read_text(encoding="utf-8")
    assert axisbus(("boot", "cell.toml")).code == 0


# -- messages and meanings --------------------------------------------------------------------------------------------------------


def test_the_excerpts_of_the_output_of_boot_are_current(axisbus):
    excerpts, printed = blocks(STOPPING, "text"), axisbus(BOOT).out
    assert len(excerpts) == 2  # the stop sequence, and which limit is kept in which mode
    assert [excerpt for excerpt in excerpts if excerpt not in printed] == []


@pytest.mark.timeout(240)
def test_the_messages_that_are_explained_are_printed(axisbus):
    outputs = "\n".join(axisbus(expanded(words[1:], ROOT)).out for words in command_lines(COMMISSIONING))
    explained = [
        cells[0].strip("`").partition("...")[0]
        for header in ("it says", "the report says")
        for cells in rows(COMMISSIONING, header)
        if cells[0].startswith("`")
    ]
    assert len(explained) > 10
    assert [message for message in explained if message not in outputs] == []


def test_the_letters_of_a_boot_up_are_all_explained():
    letters = [letter for cells in rows(COMMISSIONING, "letter") for letter in cells[0].split(", ")]
    assert sorted(letters) == [letter.name for letter in Letter]


def test_the_words_of_stopping_have_the_values_that_are_reported():
    told = {cells[0].strip("`"): cells[1:] for cells in rows(STOPPING, "key")}
    assert set(told) == {option.key for option in options.ALL}
    for option in options.ALL:
        address, words = told[option.key]
        sub = f":{option.subindex:02X}" if option.subindex else ""
        assert address == f"{option.index:04X}h{sub}"
        assert {word: int(value) for word, value in re.findall(r"`([\w-]+)` (\d)", words)} == option.words


def test_each_stop_option_word_has_its_explanation():
    explained = {word for cells in rows(STOPPING, "word") for word in re.findall(r"`([\w.-]+)`", cells[0])}
    words = {word for option in options.ALL for word in option.words if not word.endswith("-hold")}
    assert explained == words | {"...-hold"}


def test_the_deadlines_of_the_stop_sequence_are_those_that_hold():
    told = [re.findall(r"([\d.]+) s", cells[2])[0] for cells in rows(STOPPING, "step")]
    times = StopTimes()
    assert [float(each) for each in told[:3]] == [times.halt, times.quick_stop, times.disable]
