"""However a cell file is damaged, the check finds problems or none, and never fails in another way."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from axisbus.cell import reader
from axisbus.cell.parameters import axis_parameters
from axisbus.cell.problem import CellProblem, errors
from axisbus.check import devices
from axisbus.check.run import check, check_cell
from axisbus.eds.model import Severity
from axisbus.errors import ConfigError
from kit import cells

LINES = cells.CLEAN.split("\n")
# A busy computer is no failure.
PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
FILE = str(cells.HERE / "cell.toml")  # beside the EDS that it names

VALUES = st.one_of(
    st.integers(-(2**70), 2**70).map(str),
    st.floats().map(lambda value: repr(value)),
    st.sampled_from(
        [
            "true",
            "false",
            '""',
            '"4ms"',
            '"off"',
            "[]",
            "[1, 2]",
            '["x"]',
            "{}",
            "{ a = 1 }",
            "1979-05-27",
            "12:00:00",
            "0x80",
            "1e400",
            "-0.0",
            '"131072/360"',
            '"6040"',
            '["6040", "x"]',
            "'$'",
            '"\\u0000"',
            "[[[]]]",
        ]
    ),
    st.text(max_size=8).map(lambda text: '"' + text.replace("\\", "").replace('"', "") + '"'),
)


def examine(text: str) -> list[CellProblem]:
    """Check a text as a cell; every problem must have its place and a message, every error a remedy.

    A cell without errors must be good for parameters of each of its axes.
    """
    cell, problems = reader.loads(text, FILE)
    found = problems if cell is None else check_cell(cell, problems)
    count = text.count("\n") + 1
    for problem in found:
        assert problem.file == FILE
        assert 0 <= problem.line <= count
        assert problem.message
        assert problem.remedy or problem.severity is Severity.NOTE, problem
        assert str(problem)
    if cell is not None and not errors(found):
        files, _ = devices.load_all(cell)
        for axis in cell.axes.values():
            assert axis_parameters(cell, axis.name, files[axis.node]).name == axis.name
    return found


def accepted(text: str) -> bool:
    try:
        tomllib.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


@given(st.integers(0, len(LINES) - 1))
@settings(PATIENT)
def test_a_line_that_is_lost(number: int) -> None:
    examine("\n".join(LINES[:number] + LINES[number + 1 :]))


@given(st.sampled_from([number for number, line in enumerate(LINES) if " = " in line]), VALUES)
@settings(PATIENT, max_examples=300)
def test_a_value_that_is_another(number: int, value: str) -> None:
    key = LINES[number].split(" = ")[0]
    text = "\n".join([*LINES[:number], f"{key} = {value}", *LINES[number + 1 :]])
    found = examine(text)
    if not accepted(text):
        assert [problem.severity for problem in found] == [Severity.ERROR]


@given(st.sampled_from([number for number, line in enumerate(LINES) if " = " in line]), st.text(max_size=12))
@settings(PATIENT)
def test_a_key_that_is_another(number: int, key: str) -> None:
    value = LINES[number].split(" = ")[1]
    quoted = '"' + "".join(char for char in key if char.isprintable() and char not in '"\\') + '"'
    examine("\n".join([*LINES[:number], f"{quoted} = {value}", *LINES[number + 1 :]]))


@given(st.integers(0, len(LINES)), st.text(max_size=40))
@settings(PATIENT, max_examples=200)
def test_garbage_between_the_lines(number: int, garbage: str) -> None:
    text = "\n".join([*LINES[:number], garbage, *LINES[number:]])
    examine(text)


@given(st.permutations(range(len(LINES))), st.integers(2, len(LINES)))
@settings(PATIENT)
def test_lines_in_another_order(order: list[int], count: int) -> None:
    examine("\n".join(LINES[number] for number in order[:count]))


@given(st.binary(max_size=200))
@settings(PATIENT)
def test_any_bytes(data: bytes) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "read_bytes", lambda _: data)
        patch.setattr(Path, "is_file", lambda _: True)
        found = check(FILE)
        assert found
        try:
            reader.load(FILE)
        except ConfigError:
            return
        raise AssertionError("200 bytes are no cell")


@given(st.integers(0, len(cells.CLEAN)), st.integers(0, 20))
@settings(PATIENT, max_examples=200)
def test_a_file_cut_short_or_with_a_hole(start: int, length: int) -> None:
    examine(cells.CLEAN[:start] + cells.CLEAN[start + length :])
    examine(cells.CLEAN[:start])


def test_the_clean_cell_itself_is_clean() -> None:
    assert {problem.severity for problem in examine(cells.CLEAN)} == {Severity.NOTE}
