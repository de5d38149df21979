"""The module's two limit switch inputs: LW1 at the lowest position, LW2 at the highest (manual v2.2, 2.4.8 and 3.1.8)."""

from __future__ import annotations

from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import ArgumentError, StateError

_PINS = {"min": 1, "max": 2}  # by the manual
PATHS = tuple(f"axis0.{end}_endstop.config.{what}" for end in _PINS for what in ("gpio_num", "enabled"))
_WITHOUT = (3, 7)  # latest hardware without them, by the manual
_HARDWARE = ("hw_version_major", "hw_version_minor")
_TOLD = (
    "a switch that is reached is an error of the axis (MIN_ENDSTOP_PRESSED, MAX_ENDSTOP_PRESSED): the program that "
    "commands it must react"
)
_UNTRIED = "the manual does not say whether it stops the motor: try it slowly before you rely on it"
_CONFLICT = "pulse and direction inputs use the same place: only one of both can be set"


def wanted(lowest: bool | None, highest: bool | None) -> ParameterBatch:
    """Return the parameters that switch each input on or off; None: unchanged.

    Raises:
        ArgumentError: neither is given.
    """
    given = {"min": lowest, "max": highest}
    if lowest is None and highest is None:
        raise ArgumentError("no switch is named", remedy="give --min on or off, --max on or off, or both")
    values = [
        (f"axis0.{end}_endstop.config.{what}", value)
        for end, on in given.items()
        if on is not None
        for what, value in (*((("gpio_num", _PINS[end]),) if on else ()), ("enabled", on))
    ]
    return ParameterBatch(tuple(values), (_TOLD, _UNTRIED, _CONFLICT) if lowest or highest else ())


def require_hardware(module: ModuleParameters) -> None:
    """Check that the module's hardware has the inputs, if its endpoint list contains the hardware version; blocks.

    Raises:
        StateError: it does not have them. BusError: as ``ModuleParameters.read``.
    """
    if not all(path in module.listed.endpoints for path in _HARDWARE):
        return
    major, minor = (int(module.read(path)) for path in _HARDWARE)
    if (major, minor) <= _WITHOUT:
        raise StateError(
            f"hardware {major}.{minor} has no limit switches (manual v2.2, 3.1.8)",
            remedy="home the axis against a stop, or by a switch that the master reads",
        )
