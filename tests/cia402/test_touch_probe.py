"""The bits of a touch probe, compared with a separately typed table of the standard; the other bits are left unchanged."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia402 import touch_probe
from axisbus.cia402.touch_probe import Edge, ProbeSource

TABLE = Path(__file__).parent / "touch_probe.csv"


def rows():
    with TABLE.open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@pytest.mark.parametrize(
    "row", rows(), ids=lambda row: "-".join([row["input"], row["edge"], row["source"], row["continuous"]])
)
def test_a_touch_probe_is_armed_and_read_according_to_the_standard(row):
    number, edge = int(row["input"]), Edge(row["edge"])
    bits = touch_probe.function_bits(
        frozenset({edge}), ProbeSource(row["source"]), continuous=row["continuous"] == "yes"
    )
    assert touch_probe.with_byte(0, number, bits) == int(row["function"], 16)
    assert touch_probe.STORED[edge] << 8 * (number - 1) == int(row["stored"], 16)
    assert touch_probe.POSITIONS[number, edge] == int(row["position"], 16)
    assert touch_probe.COUNTERS[number, edge] == int(row["counter"], 16)


@given(st.integers(0, 0xFFFF), st.sampled_from([1, 2]), st.integers(0, 0x3F))
def test_the_other_input_and_the_makers_bits_stay_as_they_are(word, number, bits):
    changed = touch_probe.with_byte(word, number, bits)
    assert touch_probe.byte_of(changed, 3 - number) == touch_probe.byte_of(word, 3 - number)
    assert touch_probe.byte_of(changed, number) == (touch_probe.byte_of(word, number) & 0xC0) | bits
