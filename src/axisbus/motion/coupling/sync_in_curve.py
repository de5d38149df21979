"""The synchronisation curve of a slave, from its own position and slope to the required ones, over a distance of its master."""

from __future__ import annotations

from axisbus.motion.coupling.gear_and_cam import SlaveReference


class SyncInCurve:
    """A polynomial of degree five over the master's positions ``begin`` to ``end``; slope and ``bend`` do not jump at its ends."""

    __slots__ = ("_begin", "_factors", "_length", "_slope")

    def __init__(self, begin: float, end: float, start: SlaveReference, goal: SlaveReference) -> None:
        """``begin`` and ``end`` must differ; ``end`` is the lower one if the master moves backwards."""
        length = end - begin
        a, b, c = start.place, start.slope * length, 0.5 * start.bend * length**2
        place = goal.place - a - b - c
        slope = goal.slope * length - b - 2.0 * c
        bend = goal.bend * length**2 - 2.0 * c
        d = 10.0 * place - 4.0 * slope + 0.5 * bend
        e = -15.0 * place + 7.0 * slope - bend
        f = 6.0 * place - 3.0 * slope + 0.5 * bend
        self._begin, self._length = begin, length
        self._factors = a, b, c, d, e, f
        self._slope = start.slope

    def share(self, master: float) -> float:
        """Return the share of the curve that the master has passed: 0 at its beginning, 1 at its end."""
        return (master - self._begin) / self._length

    def at(self, master: float) -> float:
        """Return the slave's set-point; before the beginning, linear extrapolation."""
        a, b, c, d, e, f = self._factors
        u = self.share(master)
        if u <= 0.0:
            return a + self._slope * (master - self._begin)
        return a + u * (b + u * (c + u * (d + u * (e + u * f))))
