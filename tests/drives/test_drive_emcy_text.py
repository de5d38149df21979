"""Emergency messages, incidents and entries of 1003h in words, by the standards and by the make."""

from __future__ import annotations

import pytest

from axisbus.cia301.emcy import decode, parse
from axisbus.cia301.incident import group
from axisbus.drives.emcy_text import emcy_words, history_words, incident_words
from axisbus.drives.plugin import DrivePlugin


# frame, parts of its line. Names by CiA 301 table 26 and CiA 402-2 table 6.
@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("10 23 03 00 00 00 00 00", ["0x2310", "error register: generic error, current"]),
        ("30 81 11 00 00 00 00 00", ["0x8130", "communication"]),
        ("11 86 20", ["0x8611", "error register: device profile"]),
        ("20 32", ["0x3220"]),
        (
            "00 ff 81 01 02 03 04 05",
            ["0xFF00", "manufacturer-specific", "manufacturer-specific bytes 01 02 03 04 05"],
        ),
        ("00 00 00 00 00 00 00 00", ["0x0000, error reset"]),
        ("00 00 05 00 00 00 00 00", ["0x0000, error reset (still there: generic error, voltage)"]),
    ],
)
def test_a_message_in_words(frame: str, words: list[str]) -> None:
    line = emcy_words(parse(bytes.fromhex(frame), 0.0))
    assert all(word in line for word in words), line
    assert "\n" not in line


def test_a_short_message_does_not_claim_a_register() -> None:
    assert "register" not in emcy_words(parse(bytes.fromhex("20 32"), 0.0))


def test_the_make_adds_its_explanation_of_the_code() -> None:
    make = DrivePlugin("one", explain=lambda code, _: [f"code {code:X}: the supply is low"])
    under_voltage = parse(bytes.fromhex("20 32 05"), 0.0)
    assert "code 3220: the supply is low" in emcy_words(under_voltage, make)
    assert "the supply is low" not in emcy_words(under_voltage)
    assert "code 3220: the supply is low" in history_words(decode(1, 0x3220), make)


def test_the_error_register_narrows_the_explanation_of_the_make() -> None:
    seen = []
    make = DrivePlugin(
        "one", explain=lambda code, details: seen.append((code, dict(details))) or ["as the maker says"]
    )
    assert emcy_words(parse(bytes.fromhex("00 ff 81"), 0.0), make).endswith("as the maker says")
    assert seen == [(0xFF00, {(0x1001, 0): 0x81})]


def test_an_incident_in_lines() -> None:
    frames = [(10.0, "10 23 03"), (10.02, "20 32 07"), (14.0, "00 00 00")]
    (incident,) = group(parse(bytes.fromhex(data), stamp) for stamp, data in frames)
    head, *lines = incident_words(incident, now=20.0)
    assert head == "incident 1: recovered after 4.000 s by an error reset, 10.0 s ago"
    assert [line[:11] for line in lines] == ["  +0.000 s ", "  +0.020 s ", "  +4.000 s "]
    (unresolved,) = group(parse(bytes.fromhex(data), stamp) for stamp, data in frames[:1])
    assert incident_words(unresolved)[0] == "incident 1: unresolved"
