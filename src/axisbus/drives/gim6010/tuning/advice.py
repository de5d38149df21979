"""The manual's advice on the next gain (v2.2, 3.1.3): raise it until it oscillates or overshoots, then lower it."""

from __future__ import annotations

from axisbus.drives.gim6010.tuning.trial import Loop
from axisbus.step_response import Response

MORE, LESS, HALF = 1.3, 0.85, 0.5
_RIPPLE = 0.1  # share of the step: more counts as an oscillation
_OVERSHOOT = 0.05  # share of the step


def is_too_much(loop: Loop, response: Response) -> bool:
    """Return whether the gain is too high: the step oscillates or does not settle, or, for a position, overshoots."""
    if loop is Loop.VELOCITY:
        return response.ripple > _RIPPLE or response.settled is None
    return response.overshoot > _OVERSHOOT or response.ripple > _RIPPLE


def lowered(loop: Loop) -> float:
    """Return the factor by which a too high gain of a loop is lowered."""
    return HALF if loop is Loop.VELOCITY else LESS


def worse(*responses: Response | None) -> Response | None:
    """Return the worst of the measured responses, or None without any."""
    return max(
        (each for each in responses if each is not None),
        key=lambda each: (each.settled is None, each.overshoot + each.ripple),
        default=None,
    )


def following(loop: Loop, response: Response, gain: float | None) -> str:
    """Return the next step as text; ``gain`` is the gain tried (vel_gain or pos_gain), None if unknown."""
    more, less = _value(gain, MORE), _value(gain, lowered(loop))
    if loop is Loop.VELOCITY:
        if is_too_much(loop, response):
            return f"it oscillates or does not settle: vel_gain is halved{less}"
        return f"it is smooth: vel_gain may be raised by 30 %{more} until it oscillates, and halved then"
    if is_too_much(loop, response):
        return f"it overshoots: pos_gain is lowered little by little{less} until it does not"
    return f"it does not overshoot: pos_gain may be raised by 30 %{more} until it does, and lowered then"


def _value(gain: float | None, factor: float) -> str:
    return "" if not gain else f", to {gain * factor:.4g}"
