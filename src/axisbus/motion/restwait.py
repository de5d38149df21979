"""What waits until the axis is seen to stand, without commanding anything."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import StateError
from axisbus.motion.handle import Handle
from axisbus.motion.image import Image
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.standing import Standing


class RestWait:
    """One command that takes effect at rest; holds its look for standstill, and until when it may take."""

    __slots__ = ("_deadline", "_parameters", "_standing", "handle", "then")

    def __init__(
        self, parameters: AxisParameters, handle: Handle, then: Callable[[], None], now: float
    ) -> None:
        """``then`` is done once the axis stands."""
        self._parameters = parameters
        self._standing = Standing(parameters, now)
        self._deadline = now + parameters.timing.transition
        self.handle = handle
        self.then = then

    def step(self, image: Image) -> bool:
        """Return True once the axis is seen to stand.

        Raises:
            StateError: it goes on moving.
        """
        if self._standing.seen(image):
            return True
        if image.now > self._deadline:
            raise StateError(
                f"{self.handle.name}: the axis does not stand",
                observed=self._standing.why_not(image),
                remedy="wait until it stands; what is turned by hand or by its load counts as moving, too",
            )
        return False
