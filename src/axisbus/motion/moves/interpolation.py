"""Prepare a drive for the first target of a cyclic mode: the interpolation time 60C2h, and offsets of 0."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.cia402 import objects
from axisbus.errors import DriveError, LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import SdoTransfers
from axisbus.motion.parameters import AxisParameters

OFFSETS = frozenset({objects.POSITION_OFFSET, objects.VELOCITY_OFFSET, objects.TORQUE_OFFSET})
# Powers of ten for 60C2h:02; the first one is known to every drive (its default in the standard).
_EXPONENTS = (-3, -4, -5, -6, -2, -1, 0)
_PERIOD = objects.INTERPOLATION_TIME_PERIOD


def no_offsets(parameters: AxisParameters, but: frozenset[int] = frozenset()) -> SdoTransfers:
    """Return the writes that set 60B0h, 60B1h and 60B2h to 0: values left by another program would cause a jump or a drift.

    ``but``: the offsets that the master itself sends in each cycle.
    """
    present = [index for index in sorted(OFFSETS - but) if parameters.has(index)]
    return SdoTransfers([(index, 0, 0) for index in present], parameters, OFFSETS)


class CyclicSetup:
    """Sets the offsets to 0 and 60C2h to the scan period, and reads 60C2h back; objects that the drive lacks are omitted.

    If an entry of 60C2h is read-only in the EDS, it stays unchanged; the drive must have the scan period nevertheless.
    """

    __slots__ = ("_exponent_read", "_offsets", "_parameters", "_purpose", "_read", "_wanted", "_write")

    def __init__(self, parameters: AxisParameters, purpose: str = "follow a trajectory") -> None:
        """``purpose``: the action that requires this, as text for the user."""
        self._parameters = parameters
        self._purpose = purpose
        self._wanted = interpolation_period(parameters.scan_period)
        given = parameters.feed_forward
        self._offsets = no_offsets(parameters, frozenset() if given is None else given.objects)
        present = parameters.has(_PERIOD)
        has_own_exponent = present and (_PERIOD, 2) in parameters.read_only
        self._exponent_read = SdoTransfers([(_PERIOD, 2, None)] if has_own_exponent else [], parameters)
        self._write: SdoTransfers | None = None
        self._read = SdoTransfers([(_PERIOD, 1, None), (_PERIOD, 2, None)] if present else [], parameters)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive interpolates over the scan period.

        Raises:
            DriveError: it does not accept the period, or does not answer.
        """
        if not self._offsets.step(image, order):
            return False
        try:
            if not self._exponent_read.step(image, order):
                return False
            if self._write is None:
                self._write = SdoTransfers(
                    self._items(self._exponent_read.values.get((_PERIOD, 2))), self._parameters
                )
            if not self._write.step(image, order) or not self._read.step(image, order):
                return False
        except (DriveError, LimitError) as error:
            seen = error.message.removeprefix(f"{self._parameters.name}: ")
            raise self._unfit(f"{seen}; {error.observed}" if error.observed else seen) from error
        got = tuple(self._read.values.values())
        if got and not math.isclose(_seconds(*got), _seconds(*self._wanted)):
            raise self._unfit(
                f"60C2h must be {self._wanted[0]} x 10^{self._wanted[1]} s and reads {got[0]} x 10^{got[1]} s{self._fixed()}"
            )
        return True

    def _items(self, exponent: int | None) -> list[tuple[int, int, int | None]]:
        """Return the writes; ``exponent``: the drive's own one, if it cannot be written."""
        parameters = self._parameters
        if exponent is not None:
            self._wanted = interpolation_period(parameters.scan_period, (exponent,))
        linear = parameters.interpolated and parameters.has(objects.INTERPOLATION_SUB_MODE)
        items: list[tuple[int, int, int | None]] = [(objects.INTERPOLATION_SUB_MODE, 0, 0)] if linear else []
        if parameters.has(_PERIOD):
            period = [(_PERIOD, sub, value) for sub, value in enumerate(self._wanted, start=1)]
            items += [item for item in period if item[:2] not in parameters.read_only]
        return items

    def _fixed(self) -> str:
        subs = [f"60C2h:{sub:02X}" for sub in (1, 2) if (_PERIOD, sub) in self._parameters.read_only]
        return f"; {' and '.join(subs)} cannot be written by the EDS" if subs else ""

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        for transfers in (self._offsets, self._exponent_read, self._write, self._read):
            if transfers is not None:
                transfers.cancel(order)

    def _unfit(self, observed: str) -> DriveError:
        name = self._parameters.name
        return DriveError(
            f"{name}: cannot {self._purpose}: the drive does not accept the scan period as its interpolation time",
            axis=name,
            observed=observed,
            remedy="choose a scan_period in cell.toml that the drive can interpolate over (its manual lists them)",
        )


def interpolation_period(period: float, exponents: Sequence[int] = _EXPONENTS) -> tuple[int, int]:
    """Return value and power of ten for 60C2h (value 1 to 255, seconds = value x 10^index); in milliseconds if possible.

    ``exponents``: the permitted powers of ten.

    Raises:
        LimitError: the period cannot be represented in this form.
    """
    for exponent in exponents:
        value = period * 10.0**-exponent
        if value >= 1 and abs(value - round(value)) < 1e-9 * value and round(value) <= 255:
            return round(value), exponent
    raise LimitError(
        f"a scan period of {period * 1000:g} ms cannot be written into 60C2h",
        observed="60C2h holds 1 to 255 times "
        + (
            "a power of ten"
            if len(exponents) > 1
            else f"10^{exponents[0]} s: its sub-index 2 cannot be written"
        ),
        remedy='choose a period such as "2ms", "2.5ms" or "10ms"',
    )


def _seconds(value: int, exponent: int) -> float:
    return float(value * 10.0**exponent)
