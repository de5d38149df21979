"""The view of one axis: its states, values and commands."""

from __future__ import annotations

from nicegui import ui

from axisbus.cell.model import AxisConfig
from axisbus.machine.axis import Axis
from axisbus.motion.parameters import AxisParameters
from axisbus.web.page.bars_view import bars_view
from axisbus.web.page.tags import Tag, button, live
from axisbus.web.view.bars import bars_of
from axisbus.web.view.diagram import svg

_ENABLE = "Enable {0}? This energises its motor. It does not move the axis."
_HOME = "Home {0}? The axis may move, depending on its homing method."
_PRESS = (
    "Apply {{torque}} N·m to {0}? If no load holds the axis, it accelerates up to its limits. The torque remains until the "
    "axis is halted."
)
_SLOPE = "Slope in N·m/s (empty: as in the cell file, otherwise the drive's value)"


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
        Tag("legend", "Velocity and acceleration (empty: as in the cell file)")
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
