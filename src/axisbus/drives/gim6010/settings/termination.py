"""The module's switchable terminating resistor of 120 Ω (manual v2.2, 3.1.8)."""

from __future__ import annotations

from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.settings.parameter_batch import ParameterBatch
from axisbus.errors import StateError

ENABLED, PIN = "can.config.enable_r120", "can.config.r120_gpio_num"
_PIN = 5  # by the manual
_ENDS = "a bus is terminated at its two ends and nowhere else: 60 Ω between CAN high and low, measured with everything switched off"
_FACTORY = "every module is delivered with it switched on: more than two on a bus are too many"


def wanted(*, on: bool) -> ParameterBatch:
    """Return the parameters that switch the resistor on or off."""
    return ParameterBatch(((ENABLED, on),), (_ENDS, _FACTORY))


def require_switch(module: ModuleParameters) -> None:
    """Check that the resistor is switched by the pin given in the manual; blocks.

    Raises:
        StateError: it is another pin. BusError: as ``ModuleParameters.read``.
    """
    pin = module.read(PIN)
    if pin != _PIN:
        raise StateError(
            f"{PIN} is {pin}, and the manual has {_PIN}: whether {ENABLED} switches the resistor is not known",
            remedy=f"if nothing else is known of this module: axisbus gim6010 params set {PIN}={_PIN}",
        )
