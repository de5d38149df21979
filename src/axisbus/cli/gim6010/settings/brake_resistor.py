"""``axisbus gim6010 brake-resistor``: the resistor that dissipates the energy of a braking motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.gim6010.params.module import ModuleSelection, module_options
from axisbus.cli.gim6010.settings.common import end, put, save_option, show, with_module
from axisbus.cli.shared.common import OK

if TYPE_CHECKING:
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters

Ramp = tuple[float, float]


@click.command("brake-resistor")
@click.option("--ohm", type=float, help="The resistance of the resistor, in Ω.")
@click.option(
    "--max-regen", type=float, help="Highest current in A into the supply; the rest goes into the resistor."
)
@click.option(
    "--ramp",
    nargs=2,
    type=float,
    metavar="BEGIN END",
    help="Supply voltages in V at which the resistor begins to act, and at which it is fully on.",
)
@click.option("--off", "switched_off", is_flag=True, help="Switch it off.")
@module_options
@save_option
def command(
    asked: ModuleSelection,
    ohm: float | None,
    max_regen: float | None,
    ramp: Ramp | None,
    switched_off: bool,
    save: bool,
) -> int:
    """Switch a braking resistor on or off; with no option, show its settings.

    --ohm goes with --max-regen, with --ramp, or with both. Written as parameters and read back, only to a module that is idle.
    A ramp that ends above the module's own overvoltage limit is refused.
    """
    from axisbus.drives.gim6010.settings import brake_resistor as resistor

    given = ohm is not None or max_regen is not None or ramp is not None
    if switched_off and given:
        raise click.UsageError("--off excludes all other options")
    if not switched_off and not given:
        return show(asked, resistor.PATHS)
    if not switched_off and ohm is None:
        raise click.UsageError("give the resistance with --ohm")
    wanted = resistor.off() if ohm is None else resistor.wanted(ohm, max_regen, ramp)

    def act(module: ModuleParameters) -> None:
        resistor.require_below_trip(module, ramp)
        put(module, wanted, save=save)

    code = with_module(asked, act, wanted.over_usb)
    if code == OK:
        end(asked, f"brake-resistor {_typed(ohm, max_regen, ramp)}", saved=save)
    return code


def _typed(ohm: float | None, max_regen: float | None, ramp: Ramp | None) -> str:
    if ohm is None:
        return "--off"
    current = "" if max_regen is None else f" --max-regen {max_regen:g}"
    volts = "" if ramp is None else f" --ramp {ramp[0]:g} {ramp[1]:g}"
    return f"--ohm {ohm:g}{current}{volts}"
