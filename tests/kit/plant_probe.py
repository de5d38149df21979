"""The plant probe: the motors behind the axes, now and over time, by the same calls in virtual and in real time.

It looks at the simulated motors alone, never at the values of the master. Every step of a plant is recorded by the plant's own
clock, so that the record continues when the scan is dead, the machine closed or the process's master hung.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

from axisbus.sim.drive import Drive

# The simulated drive's own numbers of its power-stage states (figure of CiA 402-2 7.2).
NOT_READY, SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT = range(8)
OFF = (SWITCH_ON_DISABLED, READY, SWITCHED_ON, FAULT)  # the motor is not energised
STAGE_NAMES = (
    "not ready to switch on",
    "switch on disabled",
    "ready to switch on",
    "switched on",
    "operation enabled",
    "quick stop active",
    "fault reaction active",
    "fault",
)


_TIME = attrgetter("time")


class PlantMoves(AssertionError):
    """The plant does not stop as the scenario promises; raised only by the look at the plant itself."""


class PlantSample(NamedTuple):
    """One step of a plant: seconds of its own clock, axis units, ‰ of rated torque, the number of the simulated power stage.

    ``position`` is the motor's own, 0 at power-up; ``demand`` is that of its controller.
    """

    time: float
    position: float
    velocity: float
    torque: float
    stage: int
    demand: float


class PlantRecord:
    """Everything that one plant has done since the probe was attached; holds the samples."""

    def __init__(self, drive: Drive, scale: float) -> None:
        """``scale``: increments per unit of the axis."""
        self.drive = drive
        self.samples: list[PlantSample] = []
        self._scale = scale
        self._step: Callable[[float], None] = drive.step
        drive.step = self._recorded  # type: ignore[method-assign]

    def _recorded(self, dt: float) -> None:
        self._step(dt)
        self.samples.append(self.sample)

    @property
    def sample(self) -> PlantSample:
        """The plant now."""
        drive, scale = self.drive, self._scale
        axis, motor = drive.axis, drive.axis.motor
        return PlantSample(
            drive.time,
            motor.position / scale,
            motor.velocity / scale,
            motor.torque,
            int(drive.power.stage),
            (axis.position + axis.drift) / scale,
        )

    def since(self, moment: float) -> list[PlantSample]:
        """The samples from a moment on, by the plant's clock (``sample.time``)."""
        return self.samples[bisect_right(self.samples, moment, key=_TIME) :]


class PlantProbe(ABC):
    """The plants of a cell, by the names of its axes; a subclass for each kind of cell defines how time passes and the drives."""

    # -- provided by a kind of cell --------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def now(self) -> float:
        """Seconds of the cell's clock."""

    @abstractmethod
    def run(self, seconds: float) -> None:
        """Let time pass for the plant; the scan runs along while it lives."""

    @abstractmethod
    def drive(self, name: str = "x") -> Drive:
        """The drive behind an axis."""

    @abstractmethod
    def scale_of(self, name: str) -> float:
        """Increments per unit of an axis."""

    @property
    @abstractmethod
    def lock(self) -> AbstractContextManager[object]:
        """The lock that stops the plants meanwhile."""

    # -- the record ------------------------------------------------------------------------------------------------------

    def record(self, name: str = "x") -> PlantRecord:
        """The record of an axis's plant; it begins with the first call (or ``watch``)."""
        records: dict[str, PlantRecord] = self.__dict__.setdefault("_records", {})
        if name not in records:
            with self.lock:
                records[name] = PlantRecord(self.drive(name), self.scale_of(name))
        return records[name]

    def moment(self, name: str = "x") -> float:
        """The plant's clock now, for the questions below; the record begins."""
        with self.lock:
            return self.record(name).sample.time

    def positions(self, name: str = "x", since: float = 0.0) -> list[float]:
        """Where the motor was, in units."""
        return [sample.position for sample in self.record(name).since(since)]

    def speeds(self, name: str = "x", since: float = 0.0) -> list[float]:
        """How fast it was, in units per second, without the sign."""
        return [abs(sample.velocity) for sample in self.record(name).since(since)]

    def top_speed(self, name: str = "x", since: float = 0.0) -> float:
        """The highest speed in units per second."""
        return max(self.speeds(name, since), default=0.0)

    def farthest(self, name: str = "x", since: float = 0.0) -> tuple[float, float]:
        """The lowest and the highest position."""
        positions = self.positions(name, since) or [self.where(name)]
        return min(positions), max(positions)

    def hardest_change(self, name: str = "x", since: float = 0.0) -> float:
        """The largest change of velocity over 4 ms or more, in units per s²: how hard the load was jolted."""
        worst, samples = 0.0, self.record(name).since(since)
        kept = samples[:1]
        for sample in samples[1:]:
            if sample.time - kept[-1].time > 0.0039:
                kept.append(sample)
        for before, after in pairwise(kept):
            worst = max(worst, abs(after.velocity - before.velocity) / (after.time - before.time))
        return worst

    def was_energised(self, name: str = "x", since: float = 0.0) -> bool:
        """Whether the power stage was on at any time."""
        return any(
            sample.stage in (ENABLED, QUICK_STOP, REACTION) for sample in self.record(name).since(since)
        )

    # -- the plant now ---------------------------------------------------------------------------------------------------

    def sample(self, name: str = "x") -> PlantSample:
        """The plant of an axis, all values of one moment."""
        with self.lock:
            return self.record(name).sample

    def speed(self, name: str = "x") -> float:
        """The motor's speed in units per second."""
        return abs(self.sample(name).velocity)

    def where(self, name: str = "x") -> float:
        """The motor's position in units, 0 at power-up."""
        return self.sample(name).position

    def torque(self, name: str = "x") -> float:
        """The motor's torque in ‰ of the rated one."""
        return self.sample(name).torque

    def stage(self, name: str = "x") -> int:
        """The state of the power stage, by the simulated drive's number."""
        return self.sample(name).stage

    def told(self, name: str = "x") -> str:
        """The plant of an axis in words."""
        return f"{name} turns at {self.speed(name):g} deg/s at {self.where(name):g} deg, {STAGE_NAMES[self.stage(name)]}"

    # -- events ----------------------------------------------------------------------------------------------------------

    def jam(self, name: str = "x") -> None:
        """Hold the rotor by something mechanical."""
        with self.lock:
            self.drive(name).dials.blocked = True

    def free(self, name: str = "x") -> float:
        """Release the rotor; return the moment by the plant's clock."""
        moment = self.moment(name)
        with self.lock:
            self.drive(name).dials.blocked = False
        return moment

    # -- assertions of scenarios -------------------------------------------------------------------------------------------

    def must_move(self, name: str = "x", faster_than: float = 20.0) -> None:
        """Make sure that the axis is in motion."""
        assert self.speed(name) > faster_than, f"{name} does not move: {self.speed(name):g} deg/s"

    def must_be_still(
        self,
        name: str = "x",
        *,
        within: float,
        stages: int | tuple[int, ...],
        for_good: float = 1.0,
        wander: float = 0.05,
    ) -> float:
        """Let time pass until the motor is at standstill in one of ``stages``, and ``for_good`` seconds more; both must stay so.

        Return the seconds that it took. ``wander``: units that it may be off its position meanwhile.

        Raises:
            PlantMoves: it does not.
        """
        wanted = (stages,) if isinstance(stages, int) else stages
        start = self.now
        while self.speed(name) > 0.0 or self.stage(name) not in wanted:
            if self.now - start > within:
                raise PlantMoves(f"after {within:g} s: {self.told(name)}")
            self.run(0.01)
        took, place = self.now - start, self.where(name)
        self.run(for_good)
        if self.speed(name) > 0.0 or self.stage(name) not in wanted or abs(self.where(name) - place) > wander:
            raise PlantMoves(f"{for_good:g} s after it stood at {place:g}: {self.told(name)}")
        return took

    def must_be(self, stages: int | tuple[int, ...], name: str = "x") -> None:
        """Make sure that the power stage is in one of ``stages`` now.

        Raises:
            PlantMoves: it is not.
        """
        if self.stage(name) not in ((stages,) if isinstance(stages, int) else stages):
            raise PlantMoves(self.told(name))

    def must_have_moved(self, name: str, start: float, between: tuple[float, float]) -> None:
        """Make sure that a motor at standstill has braked on a ramp: its distance from ``start``, in units.

        Raises:
            PlantMoves: it stopped with a jolt, or too late.
        """
        if not between[0] <= abs(self.where(name) - start) <= between[1]:
            raise PlantMoves(
                f"{name} came from {start:g} deg to rest at {self.where(name):g} deg, not {between} deg away"
            )

    def must_not_leap(self, name: str = "x", *, since: float, way: float = 1.0, speed: float = 10.0) -> None:
        """Make sure that the motor has stayed within ``way`` units of its position, and slow, since a moment.

        Raises:
            PlantMoves: it has not.
        """
        low, high = self.farthest(name, since)
        if high - low > way or self.top_speed(name, since) > speed:
            raise PlantMoves(
                f"{name} went from {low:g} to {high:g} deg at up to {self.top_speed(name, since):g} deg/s"
            )


class RealTime:
    """The clock of a cell whose simulated drives run in real time; a mix-in of ``PlantProbe``."""

    @property
    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def run(self, seconds: float) -> None:
        """Let time pass."""
        time.sleep(seconds)
