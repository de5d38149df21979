"""``axisbus gim6010 pwm``: the mapping of a remote control's pulses, and how to configure it."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.settings.common import over_usb
from axisbus.cli.shared.common import OK, say


@click.command("pwm", context_settings={"ignore_unknown_options": True})
@click.argument("follows", type=click.Choice(["position", "velocity", "torque"]))
@click.argument("low", type=float)
@click.argument("high", type=float)
def command(follows: str, low: float, high: float) -> int:
    """Show how pulses of 1 to 2 ms are mapped to LOW to HIGH (turns, turns/s or N·m of the rotor), and the steps to set it over
    USB.

    Sends nothing and writes nothing: the parameter that follows the pulses is set by a reference that only USB has.
    """
    from axisbus.drives.gim6010.settings.pulse_inputs import Follows, Mapping

    mapping = Mapping(Follows[follows.upper()], low, high)
    for line in mapping.table:
        say(line)
    for note in mapping.notes:
        say(f"  note: {note}")
    over_usb(mapping.steps)
    return OK
