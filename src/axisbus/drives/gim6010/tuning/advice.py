"""What the manual has one try next (v2.2, 3.1.3): more until it oscillates or overshoots, then less."""

from __future__ import annotations

from axisbus.drives.gim6010.tuning.response import Response
from axisbus.drives.gim6010.tuning.trial import Loop

MORE, LESS, HALF = 1.3, 0.85, 0.5
_RIPPLE = 0.1  # of the step: what is taken for an oscillation
_OVERSHOOT = 0.05  # of the step


def following(loop: Loop, response: Response, gain: float | None) -> str:
    """Return what to try next; ``gain`` is the one that was tried (vel_gain or pos_gain), None where it is not known."""
    if loop is Loop.VELOCITY:
        if response.ripple > _RIPPLE or response.settled is None:
            return f"it oscillates or does not settle: vel_gain is halved{_value(gain, HALF)}"
        return f"it is smooth: vel_gain may be raised by 30 %{_value(gain, MORE)} until it oscillates, and halved then"
    if response.overshoot > _OVERSHOOT or response.ripple > _RIPPLE:
        return f"it overshoots: pos_gain is lowered little by little{_value(gain, LESS)} until it does not"
    return f"it does not overshoot: pos_gain may be raised by 30 %{_value(gain, MORE)} until it does, and lowered then"


def _value(gain: float | None, factor: float) -> str:
    return "" if not gain else f", to {gain * factor:.4g}"
