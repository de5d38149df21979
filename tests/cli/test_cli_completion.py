"""Completions for a shell, and suggestions for a command that does not exist."""

from __future__ import annotations

import pytest
from click.shell_completion import ShellComplete

from axisbus.cli.main import cli
from kit import command_line

PAIR = str(command_line.ROOT / "examples" / "gantry.toml")


def offered(*words: str) -> list[str]:
    """Return the completions for a line whose last word is being typed."""
    *before, incomplete = words
    return [
        each.value for each in ShellComplete(cli, {}, "axisbus", "_X").get_completions(before, incomplete)
    ]


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("mo",), ["monitor", "move"]),
        (("config", "b"), ["backup"]),
        (("home", command_line.CELL, ""), ["x", "y", "z", "xyz"]),
        (("home", command_line.CELL, "x", ""), ["y", "z", "xyz"]),
        (("reset", command_line.CELL, "x"), ["x", "xyz"]),
        (("move", command_line.CELL, ""), ["x=", "y=", "z="]),
        (("move", command_line.CELL, "x=1", ""), ["y=", "z="]),
        (("save", "--cell", command_line.CELL, ""), ["1", "2", "3", "x", "y", "z"]),
        (("nmt", "--cell", command_line.CELL, "start", "a"), ["all"]),
        (("config", "backup", "--cell", command_line.CELL, "x"), ["x"]),
        (("od", "read", "--cell", command_line.CELL, "x:Statusw"), ["x:Statusword"]),
        (("scan", "-i", "socketc"), ["socketcan", "socketcand"]),
        (("move", "none.toml", ""), []),
        (("home", PAIR, "y"), ["y1", "y2", "y"]),
        (("move", PAIR, "y"), ["y="]),
    ],
)  # fmt: skip
def test_completions_of_a_command_line(words, names):
    assert offered(*words) == names


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("mov",), "there is no command 'mov'; did you mean axisbus move?"),
        (("MOVE",), "did you mean axisbus move"),
        (("backup",), "there is no command 'backup'; did you mean axisbus config backup?"),
        (("od", "raed"), "did you mean axisbus od read?"),
        (("eds", "chekc"), "did you mean axisbus eds check?"),
        (("diff",), "did you mean axisbus eds diff or axisbus config diff or axisbus record diff?"),
        (("qqq",), "there is no command 'qqq'; axisbus -h lists all"),
        (("move", command_line.CELL, "x=1", "--velocty", "3"), "--velocity"),
    ],
)
def test_a_mistyped_word_gets_a_suggestion(monkeypatch, capsys, words, meant):
    code, _, err = command_line.runner(monkeypatch, capsys)(*words)
    assert (code, meant in err) == (2, True), err
