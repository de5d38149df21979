"""Make the command that couples a slave to its master from the arguments of a call, and check them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.cam import Cam
from axisbus.machine.request import AxisCall, flag_of
from axisbus.motion.coupling.definition import AtPlace, By, CamLaw, Entry, Gear, SyncAtSpeed, SyncInPlace
from axisbus.motion.group.commands import Couple
from axisbus.motion.numbers import told

if TYPE_CHECKING:
    from axisbus.machine.axis import Axis


class Coupling:
    """Makes a ``Couple`` from one call, such as ``y.gear_in(x, 2.0)``; ``text`` names the call in messages."""

    def __init__(self, slave: Axis, master: object, text: str, request: AxisCall, by: str) -> None:
        """Check the axes.

        Raises:
            ArgumentError: ``master`` is not another axis of the same machine, ``master_value_source`` is neither "command" nor
                "actual", the slave must be homed and is not, or its deceleration is unknown.
        """
        self._slave, self._request = slave, request
        self._text, self._call = request.text, text
        self._master = slave._require_master(master, text)
        if not isinstance(by, str) or by not in {kind.value for kind in By}:
            raise ArgumentError(
                f"{self._text}: master_value_source {told(by)} is not known",
                remedy='give "command" (the commanded position of the master) or "actual" (its actual position)',
            )
        self._by = By(by)
        slave._require_homed(text)
        request.led()

    def gear(
        self,
        ratio: float,
        acceleration: float | None,
        at: Sequence[float] | None,
        over: float | None,
    ) -> Couple:
        """Return the command of a gear; see ``Axis.gear_in``."""
        law = Gear(self._not_zero("ratio", ratio))
        if at is None:
            if over is not None:
                raise ArgumentError(
                    f"{self._text}: master_start_distance requires sync_positions",
                    remedy="give sync_positions = (position of the master, position of the slave) as well, or leave it out",
                )
            return self._couple(law, SyncAtSpeed(self._request.acceleration(acceleration)))
        return self._couple(law, self._meeting(at, over))

    def cam(
        self, cam: object, over: float, *, relative: bool, phase: float, master_scale: float, scale: float
    ) -> Couple:
        """Return the command of a cam; see ``Axis.cam_in``."""
        if not isinstance(cam, Cam):
            raise ArgumentError(
                f"{self._text}: {told(cam)} is not a cam", remedy="make one: Cam([(master, slave), ...])"
            )
        self._master._require_homed(self._call)
        stretch = self._request.finite("master_start_distance", over, self._master.unit)
        stretched = self._not_zero("master_scaling", master_scale)
        if stretch < 0.0 or stretched < 0.0:
            raise ArgumentError(f"{self._text}: master_start_distance and master_scaling are magnitudes")
        begins_here = flag_of(self._text, "relative", relative)
        law = cam._transfer_function(
            self._request.finite("master_offset", phase, self._master.unit),
            stretched,
            self._not_zero("slave_scaling", scale),
        )
        if not begins_here:
            self._require_room(cam, law, scale)
        return self._couple(law, SyncInPlace(stretch, begins_here))

    def _couple(self, law: Gear | CamLaw, entry: Entry) -> Couple:
        return Couple(self._master.name, self._slave.name, law, entry, self._by)

    def _meeting(self, at: Sequence[float], over: float | None) -> AtPlace:
        if over is None:
            raise ArgumentError(
                f"{self._text}: master_start_distance is missing",
                remedy="give the distance of the master before that position within which the slave synchronises",
            )
        if len(at) != 2:
            raise ArgumentError(
                f"{self._text}: sync_positions is the position of the master and that of the slave"
            )
        master = self._master._checked_position(self._call, at[0])
        slave = self._slave._checked_position(self._call, at[1])
        return AtPlace(
            master, slave, self._request.positive("master_start_distance", over, self._master.unit)
        )

    def _require_room(self, cam: Cam, law: CamLaw, scale: float) -> None:
        """Check a cam against the slave's limits. A cam whose turns add up is not checked here: the motion itself is."""
        limits = self._slave.limits.position
        if limits is None or law.lift:
            return
        low, high = sorted(place * scale for place in cam.span)
        if limits[0] <= low and high <= limits[1]:
            return
        raise LimitError(
            f"{self._text}: the cam leaves the position limits of {self._slave.name}",
            observed=f"its slave positions are from {low:g} to {high:g} {self._slave.unit}; allowed are {limits[0]:g} to "
            f"{limits[1]:g}",
            remedy="scale it, begin it at the present position of the axis (relative = True), or change position_limits in "
            f"[axes.{self._slave.name}] of cell.toml",
        )

    def _not_zero(self, what: str, value: float) -> float:
        found = self._request.finite(what, value, "units of one axis for one of the other")
        if found == 0.0:
            raise ArgumentError(f"{self._text}: {what} 0 couples nothing", remedy=f"give another {what}")
        return found
