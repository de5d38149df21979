"""One random play of three axes: paths, blended and soft moves, streams, trajectories, gears, replans, overrides, halts."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from axisbus import CoreXY, Group, PointStream
from axisbus.errors import AxisbusError, Interrupted, LimitError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.bounds.highest_shares import Ledger, Worst
from kit.cell import MODULE, Cell, Stage

PERIOD = 0.01  # seconds
HARDEST = 2000.0  # deg/s²
AXIS = f"max_acceleration = {HARDEST}\nposition_limits = [-300.0, 300.0]"
PAUSES = (0.0, 0.01, 0.05, 0.2, 0.5, 1.0)  # seconds between two commands
REACH = 120.0  # degrees


@dataclass
class Play:
    """The commands of one play, and their results."""

    asked: Counter[str] = field(default_factory=Counter)
    done: Counter[str] = field(default_factory=Counter)  # to their end
    broken_off: Counter[str] = field(default_factory=Counter)  # by a halt, or another command
    worst: Worst = field(default_factory=Worst)

    def join(self, other: Play) -> None:
        """Add the observations of another play."""
        self.asked += other.asked
        self.done += other.done
        self.broken_off += other.broken_off
        self.worst.join(other.worst)


@dataclass
class Walk:
    """A stream, and the state of its random walk: position and velocity, a step apart in time."""

    points: PointStream
    step: float
    place: list[float]
    speed: list[float]


class Sheared:
    """Kinematics of a program: the motion of x depends on y, and that of y on z, by curves."""

    def forward(self, joints: Sequence[float]) -> tuple[float, ...]:
        """Return the place."""
        x, y, z = joints
        return x + 30.0 * math.sin(0.02 * y), y - 0.001 * z * z, z

    def inverse(self, coordinates: Sequence[float], _near: Sequence[float]) -> tuple[float, ...]:
        """Return the axes' positions."""
        a, b, c = coordinates
        y = b + 0.001 * c * c
        return a - 30.0 * math.sin(0.02 * y), y, c


class Player:
    """Asks a cell for one thing after the other."""

    def __init__(self, cell: Cell, seed: int) -> None:
        self.random = random.Random(seed)
        self.cell, self.group = cell.enabled(), cell.machine.group("x", "y", "z")
        self.seed = seed
        self.play = Play()
        self.ledger = Ledger(cell, PERIOD, self.play.worst)
        self.handles: list[tuple[str, Handle]] = []
        self.walk: Walk | None = None  # the last stream

    def step(self) -> None:
        """Ask for something, and let time pass."""
        self._revive()
        what = self.random.choice(ORDERS)
        self.play.asked[what] += 1
        self.ledger.what = f"seed {self.seed}, {sum(self.play.asked.values())}: {what}"
        with suppress(AxisbusError):
            self.handles.append((what, ORDER[what](self)))
        self.cell.run(self.random.choice(PAUSES))

    def end(self) -> None:
        """Halt all; every handle has ended by then."""
        self._without_override()
        self.cell.end_of(self.group.halt())
        self.cell.run(0.5)
        for what, handle in self.handles:
            assert not handle.busy, (self.ledger.what, handle)
            self.play.done[what] += handle.done
            self.play.broken_off[what] += isinstance(handle.exception(), Interrupted)

    def _without_override(self) -> None:
        for whose in (self.group, self.cell.machine, *self.cell.machine):
            self.cell.end_of(whose.set_override(1.0))

    def _revive(self) -> None:
        for axis in self.cell.machine:
            if axis.state in (AxisState.ERRORSTOP, AxisState.DISABLED):
                self.cell.run(0.5)
                for call in (axis.reset, axis.enable):
                    self.cell.end_of(call())

    # -- commands ---------------------------------------------------------------------------------------------------------

    def _point(self) -> list[float]:
        return [self.random.uniform(-REACH, REACH) for _ in self.group]

    def _pace(self) -> dict[str, float]:
        return {
            "velocity": self.random.choice([20.0, 150.0, 900.0]),
            "acceleration": self.random.choice([200.0, 1000.0, 9000.0]),
        }

    def _rest(self, share: float) -> None:
        """In a part of the cases let all axes stop: a path begins there."""
        if self.random.random() < share:
            self.cell.end_of(self.group.halt())
            self.cell.run(0.1)

    def _smooth(self) -> Handle:
        """A line, a path or a circle with a limit of jerk, from standstill to its end; it may be overridden and halted.

        On a circle the jerk is that of the speed along it, and the turning is added: its jerk is not checked.
        """
        random, jerk, pace = self.random, self.random.choice([2000.0, 20000.0, 300000.0]), self._pace()
        self._rest(1.0)
        kind = random.choice(["line", "line", "path", "path", "circle"])
        if kind == "line":
            handle = self.group.move_linear(self._point(), **pace, jerk=jerk)
        elif kind == "path":
            points = [self._point() for _ in range(random.randint(2, 8))]
            blend = random.choice([0.0, 0.5, 5.0, 40.0])
            handle = self.group.move_path(points, **pace, jerk=jerk, blend=blend)
        else:
            handle = self.group.move_circular(self._point(), via=self._point(), **pace, jerk=jerk)
        self.cell.run(2 * PERIOD)
        self.ledger.jerk = jerk if kind != "circle" else None
        try:
            self._disturb(handle)
        finally:
            self.ledger.jerk = None
        return handle

    def _disturb(self, handle: Handle) -> None:
        """Override it, and perhaps halt it, until it has ended."""
        halted = self.random.random() < 0.5
        for _ in range(30):
            self.cell.run(self.random.choice(PAUSES))
            if not handle.busy:
                return
            if halted and self.random.random() < 0.3:
                self.cell.end_of(self.group.halt())
                return
            self.group.set_override(self.random.choice([0.1, 0.5, 1.0, 1.5]))

    def _soft_velocity(self) -> Handle:
        """Velocities with a limit of jerk, and moves with the same one, each out of the other; overridden and halted softly."""
        random, axis, jerk = self.random, self.cell[self.random.choice("xyz")], self._jerk()
        self._rest(1.0)
        self.ledger.jerk = jerk
        try:
            handle = axis.move_velocity(0.0, **self._ramps(), jerk=jerk)
            for _ in range(random.randint(2, 8)):
                self.cell.run(2 * PERIOD)
                if random.random() < 0.2 and axis.state is AxisState.CONTINUOUS_MOTION:
                    axis.halt()
                elif random.random() < 0.3:
                    axis.set_override(random.choice([0.0, 0.3, 1.0, 1.5]))
                elif random.random() < 0.4:
                    place = random.uniform(-REACH, REACH)
                    handle = axis.move_absolute(place, velocity=150.0, **self._ramps(), jerk=jerk)
                else:
                    handle = self._turn(axis, jerk)
                self.cell.run(random.choice(PAUSES))
            self.cell.run(2 * PERIOD)
            if axis.state is AxisState.CONTINUOUS_MOTION:
                self.cell.end_of(axis.halt())
        finally:
            self.ledger.jerk = None
        return handle

    def _turn(self, axis: Axis, jerk: float) -> Handle:
        """A velocity that does not reach the position limits, where the axis would be stopped as hard as necessary."""
        random = self.random
        inwards = -math.copysign(1.0, axis.position)
        if abs(axis.position) < 60.0 and random.random() < 0.3:
            axis.move_velocity(400.0 * inwards, acceleration=HARDEST, jerk=jerk)
            self.cell.run(random.choice(PAUSES[:4]))
            return axis.move_velocity(20.0 * inwards, acceleration=HARDEST, jerk=jerk)
        speed = random.choice([0.0, 20.0, random.uniform(0.0, 120.0), 120.0])
        either = random.choice([1.0, -1.0]) if abs(axis.position) < 60.0 else 1.0
        return axis.move_velocity(speed * inwards * either, **self._ramps(), jerk=jerk)

    def _softly_blended(self) -> Handle:
        """Moves of one axis that pass into each other with a limit of jerk, and are overridden."""
        random, axis, jerk = self.random, self.cell[self.random.choice("xyz")], self._jerk()
        self._rest(1.0)
        modes = [f"blending_{mode}" for mode in ("low", "previous", "next", "high")]
        self.ledger.jerk = jerk
        try:
            handle = axis.move_absolute(
                random.uniform(-REACH, REACH), **self._pace_within(jerk), buffer=random.choice(modes)
            )
            for _ in range(random.randint(1, 8)):
                self.cell.run(random.choice(PAUSES))
                far = random.choice([0.0, 0.02, 1.0, 10.0, 60.0]) * random.choice([1.0, 1.0, 1.0, -1.0])
                with suppress(AxisbusError):
                    handle = axis.move_relative(far, **self._pace_within(jerk), buffer=random.choice(modes))
                if random.random() < 0.2:
                    axis.set_override(random.choice([0.0, 0.2, 0.7, 1.0, 1.5]))
            self._without_override()
            self.cell.end_of(handle, 60.0)
        finally:
            self.ledger.jerk = None
        return handle

    def _jerk(self) -> float:
        return self.random.choice([10_000.0, 20_000.0, 300_000.0])

    def _ramps(self) -> dict[str, float]:
        hardest = [200.0, 1000.0, HARDEST]
        return {"acceleration": self.random.choice(hardest), "deceleration": self.random.choice(hardest)}

    def _pace_within(self, jerk: float) -> dict[str, float]:
        return {**self._own_pace(), "jerk": jerk}

    def _line(self) -> Handle:
        self._rest(0.6)
        return self.group.move_linear(self._point(), **self._pace(), buffer=self.random.random() < 0.3)

    def _path(self) -> Handle:
        self._rest(0.6)
        points = [self._point() for _ in range(self.random.randint(2, 8))]
        blend = self.random.choice([0.0, 0.5, 5.0, 40.0])
        return self.group.move_path(points, **self._pace(), blend=blend, buffer=self.random.random() < 0.2)

    def _blended(self) -> Handle:
        """Lines that pass into each other, and points that are added, in time, late, or when there is nothing any more."""
        self._rest(0.7)
        random, handle = self.random, self.group.move_linear(self._point(), **self._pace())
        for _ in range(random.randint(1, 8)):
            self.cell.run(random.choice(PAUSES))
            blend = random.choice([0.5, 5.0, 40.0])
            with suppress(AxisbusError):
                if random.random() < 0.5:
                    mode = f"blending_{random.choice(['low', 'previous', 'next', 'high'])}"
                    handle = self.group.move_linear(self._point(), **self._pace(), buffer=mode, blend=blend)
                else:
                    points = [self._point() for _ in range(random.randint(1, 5))]
                    handle = self.group.extend_path(points, **self._pace(), blend=blend)
            if random.random() < 0.2:
                self.group.set_override(random.choice([0.2, 0.7, 1.0, 1.5]))
        return handle

    def _blended_moves(self) -> Handle:
        """Moves of one axis that pass into each other, in time, late, back and forth; some ends lie close together."""
        self._rest(0.7)
        random, axis = self.random, self.cell[self.random.choice("xyz")]
        modes = [f"blending_{mode}" for mode in ("low", "previous", "next", "high")]
        handle = axis.move_absolute(
            random.uniform(-REACH, REACH), **self._own_pace(), buffer=random.choice(modes)
        )
        for _ in range(random.randint(1, 8)):
            self.cell.run(random.choice(PAUSES))
            far = random.choice([0.0, 0.02, 1.0, 10.0, 60.0]) * random.choice([1.0, 1.0, 1.0, -1.0])
            with suppress(AxisbusError):
                handle = axis.move_relative(far, **self._own_pace(), buffer=random.choice(modes))
            if random.random() < 0.2:
                axis.set_override(random.choice([0.0, 0.2, 0.7, 1.0, 1.5]))
            if random.random() < 0.1:
                axis.move_superimposed(random.uniform(-5.0, 5.0), velocity=20.0)
        return handle

    def _own_pace(self) -> dict[str, float]:
        """Of one axis: none that the call would refuse."""
        hardest = [200.0, 1000.0, HARDEST]
        return {
            "velocity": self.random.choice([20.0, 150.0, 400.0]),
            "acceleration": self.random.choice(hardest),
            "deceleration": self.random.choice(hardest),
        }

    def _circle(self) -> Handle:
        self._rest(0.6)
        return self.group.move_circular(self._point(), via=self._point(), **self._pace())

    def _stream(self) -> Handle:
        """Points of a random walk that keeps some of its speed, given in time, late, or not at all any more."""
        return self._streamed(self.group, tuple(axis.commanded_position for axis in self.group))

    def _workspace_stream(self) -> Handle:
        """The same through places of a workspace."""
        belt = CoreXY()
        return self._streamed(
            self.group.with_kinematics(belt),
            belt.forward(tuple(axis.commanded_position for axis in self.group)),
        )

    def _streamed(self, group: Group, start: Sequence[float]) -> Handle:
        self._rest(1.0)
        random = self.random
        step = random.choice([0.003, 0.01, 0.04, 0.2])
        points = group.stream(
            period=step, buffer=random.choice([0.01, 0.25, 1.0]), on_underrun=random.choice(["hold", "error"])
        )
        self.walk = Walk(points, step, list(start), [0.0, 0.0, 0.0])
        return self._walk_on(self.walk)

    def _walk_on(self, walk: Walk) -> Handle:
        random, step, late = self.random, walk.step, self.random.choice([0.0, 0.02, 0.3])
        for _ in range(random.randint(0, 120)):
            with suppress(LimitError):  # a point may be refused, and the next one is given
                if not walk.points.try_push(walk.place):
                    self.cell.run(random.choice([step, 10 * step]))
                    continue
            walk.speed = [v + random.uniform(-1.0, 1.0) * min(1400.0 * step, 60.0) for v in walk.speed]
            walk.place = [p + v * step for p, v in zip(walk.place, walk.speed, strict=True)]
            if random.random() < late:
                self.cell.run(random.choice(PAUSES))
            if random.random() < 0.05:
                self.group.set_override(random.choice([0.2, 0.7, 1.0, 1.5]))
        if random.random() < 0.8:
            walk.points.finish()
        return walk.points.handle

    def _resumed_stream(self) -> Handle:
        """The last stream, which may have been broken off, with more points."""
        if self.walk is None:
            return self._stream()
        self._rest(0.9)
        self.walk.points.resume()
        return self._walk_on(self.walk)

    def _own_kinematics_path(self) -> Handle:
        """A path by kinematics of the program's own."""
        self._rest(0.8)
        points = [self._point() for _ in range(self.random.randint(1, 4))]
        blend = self.random.choice([0.0, 5.0, 40.0])
        group = self.group.with_kinematics(Sheared())
        return group.move_path(points, **self._pace(), blend=blend, buffer=self.random.random() < 0.2)

    def _trajectory(self) -> Handle:
        self._rest(0.5)
        axis = self.cell[self.random.choice("xyz")]
        return axis.follow(
            TrapezoidalTrajectory(axis.position, self.random.uniform(-REACH, REACH), 300.0, 1500.0)
        )

    def _laid_over(self) -> Handle:
        """A trajectory with superimposed distances, and overrides meanwhile: none of it is refused during the motion."""
        self._rest(1.0)
        random, axis = self.random, self.cell[self.random.choice("xyz")]
        self.cell.end_of(axis.set_override(1.0))
        handle = axis.follow(
            TrapezoidalTrajectory(axis.position, random.uniform(-REACH, REACH), 300.0, 1500.0)
        )
        for _ in range(random.randint(1, 4)):
            self.cell.run(random.choice(PAUSES))
            axis.set_override(random.choice([0.0, 0.4, 1.0, 1.2, 1.5]))
            hardest = random.choice([200.0, 1000.0])
            axis.move_superimposed(random.uniform(-15.0, 15.0), velocity=100.0, acceleration=hardest)
        error = handle.exception() if not handle.busy else None
        assert error is None, (self.ledger.what, error)
        return handle

    def _replan(self) -> Handle:
        """A move that takes over from any motion; an axis at standstill is not moved by its drive."""
        axis = self.cell[self.random.choice("xyz")]
        if self.cell.core(axis.name).active_path is None:
            return self._trajectory()
        return axis.move_absolute(self.random.uniform(-REACH, REACH))

    def _gear(self) -> Handle:
        slave, master = self.random.sample("xyz", 2)
        return self.cell[slave].gear_in(self.cell[master], self.random.choice([-0.7, 0.5, 1.0]))

    def _override(self) -> Handle:
        return self.group.set_override(self.random.choice([0.0, 0.3, 1.0, 1.0, 1.5]))

    def _axis_override(self) -> Handle:
        """Of one axis, or of the cell: also of trajectories, and of moves that are planned again."""
        whose = self.random.choice([*self.cell.machine, self.cell.machine])
        return whose.set_override(self.random.choice([0.0, 0.4, 1.0, 1.0, 1.2, 1.5]))

    def _resume(self) -> Handle:
        self._rest(0.8)
        return self.group.resume()

    def _halt(self) -> Handle:
        return self.group.halt()


ORDER: dict[str, Callable[[Player], Handle]] = {
    "line": Player._line,
    "way with jerk": Player._smooth,
    "path": Player._path,
    "lines blended": Player._blended,
    "moves of an axis blended": Player._blended_moves,
    "velocity with jerk": Player._soft_velocity,
    "moves blended with jerk": Player._softly_blended,
    "circle": Player._circle,
    "stream": Player._stream,
    "stream of places": Player._workspace_stream,
    "stream gone on with": Player._resumed_stream,
    "path of own kinematics": Player._own_kinematics_path,
    "trajectory": Player._trajectory,
    "trajectory with more laid over": Player._laid_over,
    "replan": Player._replan,
    "gear": Player._gear,
    "override": Player._override,
    "override of an axis or all": Player._axis_override,
    "resume": Player._resume,
    "halt": Player._halt,
}
ORDERS = [
    *["line"] * 4,
    *["path"] * 4,
    *["lines blended"] * 4,
    *["moves of an axis blended"] * 4,
    *["circle"] * 2,
    *["stream"] * 2,
    "stream of places",
    *["stream gone on with"] * 2,
    *["path of own kinematics"] * 2,
    *["trajectory"] * 2,
    "trajectory with more laid over",
    *["replan"] * 4,
    "gear",
    *["override"] * 4,
    *["override of an axis or all"] * 4,
    *["resume"] * 3,
    "halt",
    *["way with jerk"] * 2,
    *["velocity with jerk"] * 2,
    *["moves blended with jerk"] * 2,
]


def played(seed: int, steps: int, folder: Path) -> Play:
    """Return the result of one play of so many commands."""
    with Stage(folder) as stage:
        player = Player(stage.simulated("xyz", eds=MODULE, axis=AXIS), seed)
        for _ in range(steps):
            player.step()
        player.end()
        return player.play
