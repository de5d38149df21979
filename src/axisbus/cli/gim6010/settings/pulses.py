"""``axisbus gim6010 pulses``: the meaning of a pulse of pulse and direction, and how to configure it."""

from __future__ import annotations

import click

from axisbus.cli.gim6010.settings.common import over_usb
from axisbus.cli.shared.common import OK, say


@click.command("pulses")
@click.option("--per-turn", type=int, required=True, help="Pulses per turn of the rotor.")
@click.option("--turns", type=int, required=True, help="The range of set-points, in turns of the rotor.")
@click.option("--circular", is_flag=True, help="Let set-points wrap around at the end of that range.")
def command(per_turn: int, turns: int, circular: bool) -> int:
    """Show the size of a pulse at rotor and output, the velocity at the highest pulse rate, and the steps to set it over USB.

    Sends nothing and writes nothing: the modes of the pins are set by names that only USB has.
    """
    from axisbus.drives.gim6010.settings.pulse_inputs import Pulses

    pulses = Pulses(per_turn, turns, circular)
    for line in pulses.table:
        say(line)
    for note in pulses.notes:
        say(f"  note: {note}")
    over_usb(pulses.steps)
    return OK
