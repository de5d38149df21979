"""``axisbus gim6010 modbus state``: print the state of a module."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.modbus.target_module import ModbusTarget, opened, target_options
from axisbus.cli.gim6010.modbus.values import show
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_next

_SHOWN = (
    "control_mode",
    "input_mode",
    "position_setpoint",
    "velocity_setpoint",
    "torque_setpoint",
    "velocity_limit",
    "current_limit",
    "bus_voltage",
    "bus_current",
    "iq_feedback",
)


@click.command("state")
@target_options
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(target: ModbusTarget, as_json: bool) -> int:
    """Show the state of a module: its errors, modes, set-points, limits, supply, and in closed loop its position and velocity.

    It commands nothing. Exit code 1 when there is an error. In idle, position and velocity are not shown: they may be outdated.
    """
    from axisbus.drives.gim6010.can_simple.states import state_words
    from axisbus.drives.gim6010.modbus.motion.look import look
    from axisbus.drives.gim6010.modbus.registers import named
    from axisbus.drives.gim6010.parameters import values

    with opened(target) as module:
        seen = look(module, tries=3)
        found = {name: module.read(name) for name in _SHOWN}
    if as_json:
        plain = {name: values.plain(value) for name, value in found.items()}
        say_json(
            {
                "state": seen.state,
                "flags": seen.flags,
                "position": seen.position,
                "velocity": seen.velocity,
                **plain,
            }
        )
        return WRONG if seen.flags else OK
    say(f"module {target.node} is in {state_words(seen.state)}" + (", with errors" if seen.flags else ""))
    for name, value in (("position_feedback", seen.position), ("velocity_feedback", seen.velocity)):
        say(f"  {name}: {'not alive' if value is None else show(named(name), value)}")
    for name, value in found.items():
        say(f"  {name}: {show(named(name), value)}")
    if seen.flags:
        say_next(f"axisbus gim6010 modbus errors {target.words}")
    return WRONG if seen.flags else OK
