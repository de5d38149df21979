"""What a shell is offered, and what is offered for a command that does not exist."""

from __future__ import annotations

import cli_bus_kit as kit
import pytest
from click.shell_completion import ShellComplete

from axisbus.cli.main import cli


def offered(*words: str) -> list[str]:
    """Return what the shell is told for a line whose last word is being typed."""
    *before, incomplete = words
    return [
        each.value for each in ShellComplete(cli, {}, "axisbus", "_X").get_completions(before, incomplete)
    ]


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("mo",), ["monitor", "move"]),
        (("config", "b"), ["backup"]),
        (("home", kit.CELL, ""), ["x", "y", "z", "xyz"]),
        (("home", kit.CELL, "x", ""), ["y", "z", "xyz"]),
        (("reset", kit.CELL, "x"), ["x", "xyz"]),
        (("move", kit.CELL, ""), ["x=", "y=", "z="]),
        (("move", kit.CELL, "x=1", ""), ["y=", "z="]),
        (("save", "--cell", kit.CELL, ""), ["1", "2", "3", "x", "y", "z"]),
        (("nmt", "--cell", kit.CELL, "start", "a"), ["all"]),
        (("config", "backup", "--cell", kit.CELL, "x"), ["x"]),
        (("od", "read", "--cell", kit.CELL, "x:Statusw"), ["x:Statusword"]),
        (("scan", "-i", "socketc"), ["socketcan", "socketcand"]),
        (("move", "none.toml", ""), []),
    ],
)  # fmt: skip
def test_what_is_offered(words, names):
    assert offered(*words) == names


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("mov",), "there is no command 'mov'; did you mean axisbus move?"),
        (("MOVE",), "did you mean axisbus move"),
        (("backup",), "there is no command 'backup'; did you mean axisbus config backup?"),
        (("od", "raed"), "did you mean axisbus od read?"),
        (("eds", "chekc"), "did you mean axisbus eds check?"),
        (("diff",), "did you mean axisbus eds diff or axisbus config diff?"),
        (("qqq",), "there is no command 'qqq'; axisbus -h lists all"),
        (("move", kit.CELL, "x=1", "--velocty", "3"), "--velocity"),
    ],
)
def test_what_may_have_been_meant(monkeypatch, capsys, words, meant):
    code, _, err = kit.runner(monkeypatch, capsys)(*words)
    assert (code, meant in err) == (2, True), err
