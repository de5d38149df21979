"""``axisbus monitor`` on terminals of several sizes: the axes stay on the screen, and nothing is printed twice."""

from __future__ import annotations

from collections import Counter

import pytest
from rich.console import Console

from axisbus.cli.monitor import live
from kit.terminal_screen import Screen

ERROR = (
    "x: the drive went into fault\n"
    "  observed: error code 0x4310, Excess temperature drive; code 0x4310 without its bits is ambiguous, one of: axis OVER_TEMP: "
    "too hot (let it cool down; check load and ventilation); motor FET_THERMISTOR_OVER_TEMP: the power stage is too hot (let it "
    "cool down; check load and ventilation; compare 200B:01 with 200A:04); path: unknown > switch on disabled > fault\n"
    "  remedy:   let it cool down; check load, duty cycle and ventilation; then reset it: axisbus reset cell.toml x\n"
    "  more:     axisbus explain too-hot"
)
INCIDENT = [
    "node 1, incident 1: unresolved, 0.1 s ago",
    "  +0.000 s  0x4310, Excess temperature drive; generic error",
]
MACHINE = [
    "bus: 22% to 27% of 1000 kbit/s, 2541 frames/s",
    "cycle of 4 ms: 1847 cycles, half of them at most 2 µs late, 99 % 183, the worst 845; none was skipped",
]


def row(axis: str, state: str = "Disabled", power: str = "switch on disabled") -> dict[str, str]:
    return {
        "axis": axis,
        "state": state,
        "position": "-123.456 deg",
        "velocity": "0.000 deg/s",
        "age": "3 ms",
        "power": power,
        "mode": "none",
        "bits": "voltage enabled, remote",
    }


def shown(monkeypatch, width: int, height: int, looks: list[live.MonitorUpdate]) -> Screen:
    """Return the terminal after these looks."""
    screen = Screen(width, height)

    def console(**given: bool) -> Console:
        return Console(
            file=screen, width=width, height=height, force_terminal=True, color_system=None, **given
        )

    monkeypatch.setattr(live, "Console", console)
    each = iter(looks)
    live.show(lambda: next(each), lambda: None, len(looks))
    return screen


def after_a_fault(axes: str, looks: int) -> list[live.MonitorUpdate]:
    calm = [row(name) for name in axes]
    fault = [row("x", "ErrorStop", "fault"), *calm[1:]]
    quiet = [live.MonitorUpdate(fault, MACHINE, []) for _ in range(looks)]
    return [
        live.MonitorUpdate(calm, MACHINE, []),
        live.MonitorUpdate(fault, MACHINE, [ERROR, *INCIDENT]),
        *quiet,
    ]


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 24), (200, 50), (80, 12), (40, 8)])
def test_every_axis_stays_on_the_screen(monkeypatch, width, height):
    screen = shown(monkeypatch, width, height, after_a_fault("xyz", 50))
    first = [line.split(" ")[0] for line in screen.lines]
    for name in ("axis", "x", "y", "z"):
        assert first.count(name) == 1, screen.lines
    (of_x,) = (line for line in screen.lines if line.startswith("x "))
    assert "ErrorStop" in of_x
    assert "-123.456 deg" in of_x
    if width >= 60:
        assert "fault" in of_x
    if width >= 200:
        assert "voltage enabled, remote" in of_x


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 24), (80, 12)])
def test_events_are_printed_once_and_stay_in_the_scrolled_text(monkeypatch, width, height):
    screen = shown(monkeypatch, width, height, after_a_fault("xyz", 50))
    every = Counter([*screen.scrolled, *screen.lines])
    whole = " ".join("".join(line.ljust(width) for line in [*screen.scrolled, *screen.lines]).split())
    assert "the drive went into fault" in whole
    assert "unresolved, 0.1 s ago" in whole
    assert "explain too-hot" in whole
    assert len(screen.scrolled) < 2 * height
    assert all(count == 1 for line, count in every.items() if "fault" in line), every


def test_on_80_columns_the_fault_and_its_remedy_are_below_the_axes(monkeypatch):
    lines = shown(monkeypatch, 80, 24, after_a_fault("xyz", 5)).lines
    assert any("the drive went into fault" in line for line in lines)
    assert any("remedy:" in line for line in lines)


def test_more_axes_than_lines_are_counted(monkeypatch):
    lines = shown(monkeypatch, 80, 10, after_a_fault("xabcdefghijklm", 5)).lines
    assert any(line.startswith("x ") for line in lines)
    assert any(line.endswith("more: increase the height of the window") for line in lines)
