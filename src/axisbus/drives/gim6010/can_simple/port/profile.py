"""Objects of a profile that motion writes, in increments, and their values in the module's turns."""

from __future__ import annotations

from axisbus.cia402 import objects as o
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN


class ModuleProfile:
    """The values written last; 0 means not yet written, and is never used as a velocity or ramp."""

    def __init__(self, settings: ModuleSettings) -> None:
        self._settings = settings
        most = 1000 if settings.torque is not None else 0
        self.values: dict[int, int] = {
            o.PROFILE_VELOCITY: 0,
            o.PROFILE_ACCELERATION: 0,
            o.PROFILE_DECELERATION: 0,
            o.END_VELOCITY: 0,
            o.HOMING_METHOD: 0,
            o.HOME_OFFSET: 0,
        } | ({} if settings.torque is None else {o.TORQUE_SLOPE: 0, o.MAX_TORQUE: most})

    @property
    def speed(self) -> float:
        """6081h in turns/s."""
        return self.values[o.PROFILE_VELOCITY] / TURN

    @property
    def up(self) -> float:
        """6083h in turns/s²."""
        return self.values[o.PROFILE_ACCELERATION] / TURN

    @property
    def down(self) -> float:
        """6084h in turns/s²; if not written yet, the module's own velocity ramp: braking must always be possible."""
        return self.values[o.PROFILE_DECELERATION] / TURN or self._settings.velocity_ramp

    @property
    def complete(self) -> bool:
        """Whether velocity and acceleration of a trapezoid are known."""
        return self.speed > 0.0 and self.up > 0.0

    @property
    def slope(self) -> float:
        """6087h as N·m/s of the rotor, at most the module's own ramp, which is also used if 6087h is 0."""
        torque = self._settings.torque
        assert torque is not None  # without it, torque is not available
        asked = self.values[o.TORQUE_SLOPE] / 1000.0 * torque.rated
        return min(asked, torque.ramp) if asked > 0.0 else torque.ramp

    def torque(self, permille: int) -> float:
        """Convert a torque in ‰ to N·m of the rotor, limited to 6072h."""
        torque = self._settings.torque
        assert torque is not None
        most = self.values[o.MAX_TORQUE]
        return max(-most, min(most, permille)) / 1000.0 * torque.rated

    def permille(self, current: float) -> int:
        """Convert a current (A) to a torque in ‰."""
        torque = self._settings.torque
        assert torque is not None
        return round(current * torque.constant / torque.rated * 1000.0)
