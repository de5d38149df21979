"""The command line's text of an error: commands and options, instead of the calls of the library."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator

import pytest

from axisbus.cli.shared.common import in_commands
from axisbus.errors import AdapterError, AxisbusError, StateError
from axisbus.motion.stop.diagnosis import REOPEN, start_and_reset
from axisbus.web.view import in_page_terms
from kit import command_line

SOURCE = command_line.ROOT / "src" / "axisbus"
CALLS = re.compile(
    r"\b(?:axis|machine|cell|Machine|handle)\.(?!toml)\w+(?:\(|\b)|\bthe call\b|(?:open|close) the machine"
)
# Layers whose texts a command never shows, or shows as a program's own.
ELSEWHERE = {"cli/shared/common.py", "core/simulated_nodes.py", "eds/report/codegen.py", "testing.py"}


def texts() -> Iterator[tuple[str, str]]:
    """The words for users (remedy, observed) in the source that speak of calls, with their place."""
    for path in sorted(SOURCE.rglob("*.py")):
        name = str(path.relative_to(SOURCE))
        if name in ELSEWHERE:
            continue
        tree = ast.parse(path.read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.keyword) and node.arg in ("remedy", "observed"):
                whole = rendered(node.value)
                if CALLS.search(whole):
                    yield f"{name}:{node.value.lineno}", whole


def rendered(node: ast.AST) -> str:
    """A text as it would come out, with a word for each value."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.FormattedValue):
        return "value"
    between = " " if isinstance(node, ast.IfExp) else ""
    return between.join(rendered(each) for each in ast.iter_child_nodes(node))


def test_no_remedy_on_the_command_line_names_a_python_call(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["axisbus", "move", "my.toml"])
    found = list(texts())
    assert len(found) > 15  # the search finds them
    left = [
        (place, said)
        for place, text in found
        if CALLS.search(said := in_commands(AxisbusError("x: no", remedy=text)))
    ]
    assert not left


def test_the_remedies_on_the_page_name_its_buttons():
    found = [text for _, text in texts() if "axis." in text]
    assert len(found) > 10
    assert not [said for text in found if re.search(r"axis\.\w+", said := in_page_terms(text))]
    assert (
        in_page_terms("let it cool down; then reset it: axis.reset()")
        == "let it cool down; then reset it: Reset"
    )


@pytest.mark.parametrize(
    ("remedy", "said"),
    [
        ("halt it first: axis.halt()", "halt it first: axisbus stop my.toml"),
        ("read why (axis.error), then reset it: axis.reset()", "reset it: axisbus reset my.toml x"),
        ("give velocity = ... in the call, or y in [z]; never", "give --velocity, or y in [z]; never"),
        ("give slope = ... (N·m/s) in the call, or y in [z]", "write y in [z]"),
        ("check the cable; then open the machine again", "check the cable; then repeat the command"),
        (
            start_and_reset(2),
            "start it (axisbus nmt start 2 --cell my.toml), and reset the axis: axisbus reset my.toml x",
        ),
        (
            f"mend it; then {REOPEN}",
            "mend it; then if the machine is already running, end it (Ctrl-C in axisbus run) and start it again; then repeat "
            "the command",
        ),
    ],
)
def test_a_remedy_names_the_command_instead_of_the_call(monkeypatch, remedy, said):
    monkeypatch.setattr(sys, "argv", ["axisbus", "move", "my.toml", "x=1"])
    assert in_commands(StateError("x.move_absolute(1 deg): no", remedy=remedy)) == (
        f"x.move_absolute(1 deg): no\n  remedy:   {said}"
    )


def test_a_path_of_windows_stays_as_it_is(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["axisbus", "home", r"C:\new\cell.toml"])
    assert r"axisbus stop C:\new\cell.toml" in in_commands(StateError("x: no", remedy="axis.halt()"))


def test_without_a_cell_file_the_remedy_names_no_table_of_it(monkeypatch):
    remedy = "set the link: ip; or correct bitrate in [bus]"
    monkeypatch.setattr(sys, "argv", ["axisbus", "scan", "-i", "socketcan"])
    assert "or give the link's with -b" in in_commands(AdapterError("no", remedy=remedy))
    monkeypatch.setattr(sys, "argv", ["axisbus", "scan", "cell.toml"])
    assert "or correct bitrate in [bus]" in in_commands(AdapterError("no", remedy=remedy))


def test_the_remedy_for_an_axis_that_is_not_homed_names_the_option(monkeypatch, capsys):
    err = command_line.runner(monkeypatch, capsys)("move", command_line.CELL, "x=1").err
    assert "remedy:   add --home; with an absolute encoder" in err


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            'scan_period = "1s"\nheartbeat = "100ms"',
            'heartbeat = "1000ms", or scan_period = "100ms" or shorter',
        ),
        ('scan_period = "4.2ms"\nheartbeat = "4.4ms"', 'heartbeat = "5ms"'),
        ("scan_period = 4", 'add the unit: "4ms"\n'),
        ("scan_period = 5000", "add the unit: us, ms, s or min"),
    ],
)
def test_no_remedy_repeats_the_value_that_fails(monkeypatch, capsys, tmp_path, lines, said):
    text = re.sub(
        r"(?m)^(scan_period|heartbeat) .*\n",
        "",
        (command_line.ROOT / "examples" / "cell.toml").read_text("utf-8"),
    )
    path = tmp_path / "cell.toml"
    path.write_text(text.replace("[bus]\n", f"[bus]\n{lines}\n"), "utf-8")
    out = command_line.runner(monkeypatch, capsys)("check", path).out
    assert said in out


def test_the_demo_without_matplotlib_points_to_the_csv_file(monkeypatch, capsys, tmp_path):
    from axisbus.cli import demo
    from axisbus.errors import UserError
    from axisbus.record import plot

    def missing(*_):
        raise UserError("drawing needs matplotlib, which is not installed")

    monkeypatch.setattr(plot, "_maker", missing)
    monkeypatch.setattr(demo, "_job", lambda machine, _: machine.sleep(0.05))
    code, out, _ = command_line.runner(monkeypatch, capsys)("demo", "-o", tmp_path / "out")
    assert code == 0
    assert "no picture: drawing needs matplotlib" in out
    assert "motion.png" not in out
    assert f"next: open {tmp_path / 'out' / 'recording.csv'}" in out
