"""The view of one axis: its states, values and commands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from nicegui import ui

from axisbus.cell.model import AxisConfig
from axisbus.cia402.state import PowerState
from axisbus.machine.axis import Axis
from axisbus.motion.parameters import AxisParameters
from axisbus.web.page.tags import Tag, button, live
from axisbus.web.view import Bar, Span, bars_of

_ENABLE = "Enable {0}? This energises its motor. It does not move the axis."
_HOME = "Home {0}? The axis may move, depending on its homing method."
_PRESS = (
    "Apply {{torque}} N·m to {0}? If no load holds the axis, it accelerates up to its limits. The torque remains until the "
    "axis is halted."
)
_SLOPE = "Slope in N·m/s (empty: as in the cell file)"


def axis_view(number: int, axis: Axis, config: AxisConfig, parameters: AxisParameters) -> None:
    """Put the view of an axis into the page; ``number`` distinguishes it from the others."""
    name = axis.name
    with Tag("section", data_view=f"axis-{name}", data_axis=name, aria_label=f"Axis {name}"):
        with Tag("div", classes="title"):
            Tag("h1", f"Axis {name}")
            live(f"{name}.state", "state")
        with Tag("div", classes="columns"):
            with Tag("div"):
                _values(axis, config)
                _power(name)
                Tag("pre", "", "live error", data_live=f"{name}.error")
                bars_view(bars_of(parameters))
            with Tag("div"):
                _motion(axis, config)
            # not sanitised: the drawing contains no foreign text
            ui.html(svg(number), sanitize=False).classes("live figure")


def _values(axis: Axis, config: AxisConfig) -> None:
    name, unit = axis.name, axis.unit
    torque = "of rated torque" if config.rated_torque is None else "N·m"
    rows = (
        ("Position", "position", unit, "position_age"),
        ("Velocity", "velocity", f"{unit}/s", "image_age"),
        ("Torque", "torque", torque, "image_age"),
        ("Target", "target", unit, ""),
    )
    with Tag("table", classes="values"), Tag("tbody"):
        for title, value, of, age in rows:
            with Tag("tr"):
                Tag("th", title, scope="row")
                with Tag("td", classes="number"):
                    live(f"{name}.{value}")
                Tag("td", of)
                with Tag("td", classes="age"):
                    if age:
                        live(f"{name}.{age}")
    with Tag("p", classes="facts"):
        for fact in ("power", "mode", "homed", "bits"):
            live(f"{name}.{fact}")


def _power(name: str) -> None:
    with Tag("div", classes="row"):
        button("Enable", "enable", "go", data_question=_ENABLE.format(name))
        button("Disable", "disable")
        button("Reset", "reset")
        button("Release", "release", title="Releases the lock after a stop")
    with Tag("div", classes="row"):
        button("Halt", "halt", "halt")
        button("Quick stop", "quick_stop", "stop")


def _motion(axis: Axis, config: AxisConfig) -> None:
    unit, defaults = axis.unit, config.defaults
    with Tag("fieldset", data_values="ramps"):
        Tag("legend", "Profile (empty: as in the cell file)")
        _field("velocity", f"Velocity in {unit}/s", _shown(defaults.velocity))
        _field("acceleration", f"Acceleration in {unit}/s²", _shown(defaults.acceleration))
    with Tag("fieldset"):
        Tag("legend", "Jog: press and hold")
        with Tag("div", classes="row"):
            Tag("button", "− back", "jog", type="button", data_jog="-1")
            Tag("button", "forward +", "jog", type="button", data_jog="1")
        Tag("p", "It stops when the button is released, and when this page is hidden or closed.", "hint")
    _asked("Move to", "position", f"Position in {unit}", "move_absolute")
    _asked("Step by", "distance", f"Distance in {unit}", "move_relative")
    _asked("Turn at", "velocity", f"Velocity in {unit}/s, with its sign", "move_velocity")
    _torque(axis.name, defaults.torque_slope)
    with Tag("div", classes="row"):
        button("Home", "home", data_question=_HOME.format(axis.name))


def _torque(name: str, slope: float | None) -> None:
    with Tag("fieldset"):
        Tag("legend", "Press with")
        _field("slope", _SLOPE, _shown(slope))
        with Tag("div", classes="row"):
            _field("torque", "Torque in N·m, with its sign", "")
            button("Press with", "torque_control", data_question=_PRESS.format(name))


def _asked(title: str, value: str, label: str, do: str) -> None:
    with Tag("fieldset"):
        Tag("legend", title)
        with Tag("div", classes="row"):
            _field(value, label, "")
            button(title, do)


def _field(value: str, label: str, placeholder: str) -> None:
    with Tag("label"):
        Tag("span", label)
        Tag(
            "input",
            type="text",
            inputmode="decimal",
            autocomplete="off",
            data_value=value,
            placeholder=placeholder,
        )


def _shown(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


# -- The limits of an axis as bars; the page's own script draws their values -------------------------------------------


def bars_view(bars: Iterable[Bar]) -> None:
    """Put the bars of an axis into its view; if no limit is known, a text says so instead of the bar."""
    with Tag("div", classes="bars"):
        Tag("h2", "Limits")
        for bar in bars:
            if bar.bounds is None:
                Tag("p", f"{bar.title}: no limit is known", "none")
            else:
                _bar(bar, bar.bounds)


def _bar(bar: Bar, bounds: Span) -> None:
    low, high = (f"{each:g}" for each in bounds)
    with Tag("div", classes="bar live", data_bar=bar.name):
        with Tag("div", classes="said"):
            Tag("span", bar.title)
            Tag("output")
            Tag("span", bar.unit)
        meter = {"aria_label": bar.title, "aria_valuemin": low, "aria_valuemax": high}
        with Tag("div", classes="track", role="meter", data_unit=bar.unit, **meter):
            Tag("i", classes="fill")
            Tag("i", classes="mark")
        with Tag("div", classes="ends"):
            Tag("span", low)
            Tag("em")
            Tag("span", high)


# -- The state machine of CiA 402 (figure of part 2, 7.2) as a drawing; the page highlights the present state ----------


_WIDTH, _HEIGHT = 156, 34


class Box(NamedTuple):
    """The middle of a state in the drawing."""

    x: int
    y: int


_S = PowerState
# As the standard draws it: power off above, power on below, faults at the right.
BOXES = {
    _S.NOT_READY_TO_SWITCH_ON: Box(90, 30),
    _S.SWITCH_ON_DISABLED: Box(90, 100),
    _S.READY_TO_SWITCH_ON: Box(90, 170),
    _S.SWITCHED_ON: Box(90, 240),
    _S.OPERATION_ENABLED: Box(90, 310),
    _S.QUICK_STOP_ACTIVE: Box(330, 310),
    _S.FAULT_REACTION_ACTIVE: Box(330, 170),
    _S.FAULT: Box(330, 100),
}
# Paths of the arrows, with the location of their number and the transition that they represent.
_ARROWS = (
    ("M90 47V81", 104, 68, "1"),
    ("M74 117V151", 60, 138, "2"),
    ("M106 153V119", 120, 138, "7"),
    ("M74 187V221", 60, 208, "3"),
    ("M106 223V189", 120, 208, "6"),
    ("M74 257V291", 60, 278, "4"),
    ("M106 293V259", 120, 278, "5"),
    ("M168 304H250", 210, 298, "11"),
    ("M252 318H170", 210, 334, "16"),
    ("M300 293V232Q300 205 230 205H196V112H170", 288, 262, "12"),
    ("M330 153V119", 344, 138, "14"),
    ("M252 94H170", 210, 88, "15"),
    ("M420 205V170H410", 424, 222, "13"),
)
LABEL = "State machine of the drive (CiA 402); the present state is highlighted"


def svg(number: int = 0) -> str:
    """Return the drawing; each state is a group with the attribute ``data-power`` and its name.

    ``number`` distinguishes several drawings on a page: an arrow cannot use the arrow tip of a drawing that is hidden.
    """
    arrows = "".join(
        f'<path class="arrow" d="{path}" marker-end="url(#tip{number})"/><text class="number" x="{x}" y="{y}">{transition}</text>'
        for path, x, y, transition in _ARROWS
    )
    return (
        f'<svg class="diagram" viewBox="0 0 440 340" role="img" aria-label="{LABEL}">'
        f'<defs><marker id="tip{number}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path class="tip" d="M0 0L8 4L0 8z"/></marker></defs>{arrows}{"".join(map(_state, BOXES))}</svg>'
    )


def _state(state: PowerState) -> str:
    x, y = BOXES[state]
    return (
        f'<g class="power" data-power="{state.value}"><rect x="{x - _WIDTH // 2}" y="{y - _HEIGHT // 2}" width="{_WIDTH}" '
        f'height="{_HEIGHT}" rx="6"/><text x="{x}" y="{y + 4}">{state.value}</text></g>'
    )
