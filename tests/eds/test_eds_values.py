"""Each form in which real files write a value, with its meaning; the numbers are computed by hand."""

from __future__ import annotations

import pytest

from axisbus.cia301.datatypes import DataType as T
from axisbus.eds.io import values
from axisbus.eds.model import Number


@pytest.mark.parametrize(
    ("text", "data_type", "expected", "rule"),
    [
        ("10", T.UNSIGNED8, 10, ""),
        ("+10", T.UNSIGNED8, 10, ""),
        ("0x1F", T.UNSIGNED8, 31, ""),
        ("0X1f", T.UNSIGNED8, 31, ""),
        ("0", T.UNSIGNED8, 0, ""),
        ("00", T.UNSIGNED8, 0, ""),
        ("010", T.UNSIGNED8, 8, "V012"),
        ("0777", T.UNSIGNED16, 511, "V012"),
        ("089", T.UNSIGNED8, 89, "V012"),
        ("-010", T.INTEGER8, -8, "V012"),
        ("-5", T.INTEGER16, -5, ""),
        ("0xFFFFFFFF", T.INTEGER32, -1, "V010"),
        ("0x80000000", T.INTEGER32, -2147483648, "V010"),
        ("0x7FFFFFFF", T.INTEGER32, 2147483647, ""),
        ("65535", T.INTEGER16, -1, "V010"),
        ("0xFD", T.INTEGER8, -3, "V010"),
        ("0xFFFFFF", T.INTEGER24, -1, "V010"),
        ("0xFFFFFFFFFFFFFFFF", T.INTEGER64, -1, "V010"),
        ("0x-3", T.INTEGER8, -3, "V021"),
        ("-0x7f", T.INTEGER8, -127, "V010"),
        ("256", T.UNSIGNED8, None, "V005"),
        ("0x100", T.INTEGER8, None, "V005"),
        ("-200", T.INTEGER8, None, "V005"),
        ("-1", T.UNSIGNED32, None, "V009"),
        ("2", T.BOOLEAN, None, "V005"),
        ("1", T.BOOLEAN, 1, ""),
        ("False", T.UNSIGNED8, 0, "V015"),
        ("TRUE", T.BOOLEAN, 1, "V015"),
        ("5.0", T.UNSIGNED8, 5, "V011"),
        ("0.5", T.UNSIGNED8, None, "V011"),
        ("4x0", T.UNSIGNED8, None, "V001"),
        ("1_000", T.UNSIGNED16, None, "V001"),
        ("٣", T.UNSIGNED8, None, "V001"),
        ("- 5", T.INTEGER8, None, "V001"),
        ("9" * 5000, T.UNSIGNED32, None, "V001"),
        ("12 ; twelve", T.UNSIGNED8, 12, "S011"),
        ("0x0007 # UNSIGNED32", T.UNSIGNED16, 7, "S011"),
        ("0x0007#UNSIGNED32", T.UNSIGNED16, None, "V001"),
        ("16#1F4", T.UNSIGNED16, None, "V001"),
        ("16#01_F4", T.UNSIGNED16, None, "V001"),
        ("2#1010", T.UNSIGNED16, None, "V001"),
        ("8#17", T.INTEGER8, None, "V001"),
        ("2#12", T.UNSIGNED8, None, "V001"),
        ("16#" + "F" * 5000, T.UNSIGNED8, None, "V001"),
        ("16#1F4 ; five hundred", T.UNSIGNED16, None, "V001 S011"),
        ("$NODEID+16#180", T.UNSIGNED32, None, "V020"),
        ("16#180+$NODEID", T.UNSIGNED32, None, "V020"),
        ("16#FF", T.REAL32, None, "V001"),
    ],
)
def test_an_integer_is_read_as_it_is_meant(text: str, data_type: T, expected: int | None, rule: str) -> None:
    value, problems = values.parse(text, data_type)
    assert value == (None if expected is None else Number(expected))
    assert [problem.rule for problem in problems] == rule.split()


@pytest.mark.parametrize(
    ("text", "meant"), [("16#1F4", "0x1F4"), ("2#1010", "0xA"), ("8#17", "0xF"), ("10#1_000", "1000")]
)
def test_a_number_of_iec_61131_is_refused_with_the_valid_form(text: str, meant: str) -> None:
    (problem,) = values.parse(text, T.UNSIGNED16).problems
    assert problem.text == f"{text} is a number of IEC 61131-3, DS 306 has it as {meant}"


@pytest.mark.parametrize(
    ("text", "constant", "rule"),
    [
        ("$NODEID", 0, ""),
        ("$NODEID+0x180", 0x180, ""),
        ("$NODEID + 0x180", 0x180, ""),
        ("$NODEID+0x40000180", 0x40000180, ""),
        ("0x80+$NODEID", 0x80, "V006"),
        ("$NodeID + 0x80", 0x80, "V006"),
        ("$nodeid+128", 128, "V006"),
        ("$MY_NODE_ID+0x200", 0x200, "V020"),
        ("=$NODEID+0x300", 0x300, "V020"),
        ("NODEID+0x300", 0x300, "V020"),
        ("$NODEID+0x80000000+0x200", 0x80000200, ""),
    ],
)
def test_every_spelling_of_the_node_id_formula_is_understood(text: str, constant: int, rule: str) -> None:
    value, problems = values.parse(text, T.UNSIGNED32)
    assert value == Number(constant, plus_node_id=True)
    assert isinstance(value, Number)
    assert value.resolve(5) == constant + 5
    assert [problem.rule for problem in problems] == ([rule] if rule else [])


@pytest.mark.parametrize(
    "text", ["$NODE+5", "$NODEID+x", "$NODEID+$NODEID", "$", "$NODEID+", "$NODEID*2", "$OTHER+$THING"]
)
def test_a_text_that_only_resembles_a_formula_is_no_value(text: str) -> None:
    value, problems = values.parse(text, T.UNSIGNED32)
    assert value is None
    assert [problem.rule for problem in problems] == ["V020"]


@pytest.mark.parametrize(
    ("text", "data_type", "expected", "rule"),
    [
        ("1.5", T.REAL32, 1.5, ""),
        ("-2e-3", T.REAL64, -0.002, ""),
        ("7", T.REAL32, 7.0, ""),
        (".5", T.REAL32, 0.5, ""),
        ("0x3F800000", T.REAL32, 1.0, "V014"),
        ("0x4000000000000000", T.REAL64, 2.0, "V014"),
        ("0x0", T.REAL32, 0.0, "V014"),
        ("0x7FC00000", T.REAL32, None, "V001"),
        ("1,5", T.REAL32, None, "V001"),
        ("nan", T.REAL32, None, "V001"),
        ("1e999", T.REAL64, None, "V001"),
        ("Drive 7", T.VISIBLE_STRING, "Drive 7", ""),
        ('"Drive 7"', T.VISIBLE_STRING, "Drive 7", "V013"),
        ("010", T.VISIBLE_STRING, "010", ""),
        ("DEADBEEF", T.OCTET_STRING, b"\xde\xad\xbe\xef", ""),
        ("de ad be ef", T.DOMAIN, b"\xde\xad\xbe\xef", ""),
        ("0x01FF", T.OCTET_STRING, b"\x01\xff", "V017"),
        ("0", T.DOMAIN, None, "V017"),
        ("0x0", T.OCTET_STRING, None, "V017"),
        ("NULL", T.DOMAIN, None, "V017"),
        ("1", T.TIME_OF_DAY, b"\x01\x00\x00\x00\x00\x00", ""),
        ("000102030405", T.TIME_DIFFERENCE, b"\x00\x01\x02\x03\x04\x05", ""),
        ("noon", T.TIME_OF_DAY, None, "V001"),
        ("", T.UNSIGNED8, None, ""),
        ("", T.VISIBLE_STRING, None, ""),
        ("anything", T(0x1234), None, ""),
    ],
)
def test_other_types_are_read_as_they_are_meant(
    text: str, data_type: T, expected: float | str | bytes | None, rule: str
) -> None:
    value, problems = values.parse(text, data_type)
    assert value == expected
    assert [problem.rule for problem in problems] == ([rule] if rule else [])


@pytest.mark.parametrize(
    ("low", "high", "data_type", "expected", "rules"),
    [
        ("1", "127", T.UNSIGNED8, (1, 127), []),
        ("-10", "10", T.INTEGER8, (-10, 10), []),
        ("0x80000000", "0x7FFFFFFF", T.INTEGER32, (-2147483648, 2147483647), ["V010"]),
        ("0x80", "0xFF", T.INTEGER8, (-128, -1), ["V010", "V010"]),
        ("", "10", T.INTEGER8, (None, 10), []),
        ("5", "", T.UNSIGNED8, (5, None), []),
        ("0", "0", T.INTEGER16, (None, None), ["V018"]),
        ("0x00", "0xFF", T.INTEGER8, (None, None), ["V002"]),
        ("", "255", T.INTEGER8, (None, None), ["V002"]),
        ("9", "3", T.UNSIGNED8, (None, None), ["V004"]),
        ("-1", "100", T.UNSIGNED8, (None, 100), ["V009"]),
        ("0", "0x7FFFFFFF", T.UNSIGNED8, (0, None), ["V005"]),
        ("-1.5", "1.5", T.REAL32, (-1.5, 1.5), []),
        ("1", "10", T.VISIBLE_STRING, (None, None), []),
    ],
)
def test_senseless_limits_count_as_no_limits(
    low: str, high: str, data_type: T, expected: tuple[float | None, float | None], rules: list[str]
) -> None:
    found = values.limits(low, high, data_type)
    resolved = tuple(limit.value if isinstance(limit, Number) else limit for limit in (found.low, found.high))
    assert resolved == expected
    assert [problem.rule for problem in found.problems] == rules


def test_two_limits_of_zero_apply_if_they_are_intended() -> None:
    found = values.limits("0", "0x0", T.INTEGER16, only_zero=True)
    assert (found.low, found.high, found.problems) == (Number(0), Number(0), ())
