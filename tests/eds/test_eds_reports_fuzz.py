"""Whatever a damaged file says, every report of it is made."""

from __future__ import annotations

import cantools
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.eds import diff, loads
from axisbus.eds.device_doc import html, markdown, reference
from axisbus.eds.report import codegen, export_values, frames, show
from axisbus.eds.report.show import Screen
from kit.eds.samples import BUILTIN

LINES = BUILTIN[0].read_text().splitlines()
WHOLE = loads("\n".join(LINES).encode(), "whole.eds")
VALUES = (
    "",
    "0",
    "-1",
    "255",
    "254",
    "0xFFFFFFFF",
    "0xFFFFFFFFFFFFFFFFFF",
    "$NODEID+0x80000000",
    "$NODEID",
    "1e308",
)
MAPPED = (
    "0x60410010",
    "0x00050008",
    "0x20000000",
    "0x6041FF40",
    "0x604100FF",
    "é\u2028x",
    '"',
    "\x00",
    "0x1F",
    "012",
)
SECTIONS = (
    "[1800sub1]",
    "[1A00sub0]",
    "[1A00sub8]",
    "[16FFsub1]",
    "[1BFF]",
    "[6041sub1]",
    "[0005]",
    "[FFFF]",
    "[1400]",
)
damage = st.tuples(
    st.integers(0, len(LINES) - 1),
    st.one_of(
        st.sampled_from((*VALUES, *MAPPED)).map(lambda value: ("value", value)),
        st.sampled_from(SECTIONS).map(lambda section: ("line", section)),
        st.sampled_from(LINES).map(lambda line: ("line", line)),
    ),
)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.lists(damage, min_size=1, max_size=25))
def test_every_report_is_made(damages: list[tuple[int, tuple[str, str]]]) -> None:
    lines = list(LINES)
    for at, (kind, text) in damages:
        key, separator, _ = lines[at].partition("=")
        lines[at] = f"{key}={text}" if kind == "value" and separator else text
    eds = loads("\n".join(lines).encode(), "damaged.eds")
    page = reference(eds, 5)
    text = html(page)
    assert all(f"{index:04X}h" in text for index in eds.objects)
    assert page.title.split()[0] in markdown(page)
    assert len([line for line in show.tree(eds, 5, Screen(80)) if line.startswith("  ")]) > len(eds.objects)
    for entry in list(eds)[::5]:
        assert any(
            entry.name in line for line in show.object_lines(eds, show.ObjectMatch(entry), 5, Screen())
        )
    compile(codegen.module(eds), "damaged.py", "exec")
    assert export_values.csv_text(eds, None).count("\n") > len(eds.objects)
    cantools.database.load_string(frames.dumps(eds, 5).text, "dbc")
    assert len(diff(eds, WHOLE)) == len(diff(WHOLE, eds))
