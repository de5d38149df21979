"""Random plays of one axis on a simulated drive: commands, faults of drive and wire, late cycles; the same for each seed."""

from __future__ import annotations

import random
from collections.abc import Iterator

from axisbus.cia301.emcy import Emcy
from axisbus.cia402.port import Inputs, Sample, ValueTransport
from axisbus.errors import StateError
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.homing import HomingJob
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import AxisLimits, HomingParameters
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from axisbus.sim.device import Device
from kit.direct.cycle import DirectCycle, DirectPort
from kit.motion.rig import GENERIC, PERIOD, SCALE, dictionary_of, parameters

EVERY = 30  # cycles between two commands, on average
MISHAP = 150  # and between two faults
SAMPLES = ("statusword", "mode", "position", "velocity", "torque", "demand")
PORTS = (
    {},
    {
        "inputs": {
            "demand": ValueTransport.NONE,
            "velocity": ValueTransport.NONE,
            "torque": ValueTransport.NONE,
        }
    },
    {"inputs": {"statusword": ValueTransport.EVENT_PDO, "demand": ValueTransport.SDO}},
    {"inputs": {"demand": ValueTransport.NONE, "torque": ValueTransport.EVENT_PDO}},
)
CHANGES = (
    {},
    {"limits": AxisLimits(position=(-40.0, 60.0), velocity=300.0)},
    {
        "limits": AxisLimits(position=(-40.0, 60.0), velocity=300.0),
        "homing": HomingParameters(method=37, required=True),
    },
    {"limits": AxisLimits(velocity=200.0, acceleration=2000.0), "following_error": 3000},
)


class Play:
    """One life; ``cores`` all take the same inputs and commands, the first one's outputs go to the drive."""

    every = EVERY

    def __init__(self, seed: int, count: int = 1) -> None:
        self.random = random.Random(seed)
        dictionary = dictionary_of(GENERIC)
        self.port = DirectPort(Device(dictionary, 1), **self.random.choice(PORTS))
        self.cycle = DirectCycle([self.port])
        changes = self.random.choice(CHANGES)
        self.cores = [
            AxisCore(parameters("x", dictionary, **changes), self.port.capabilities) for _ in range(count)
        ]
        self.tickets: list[list[CommandStatus]] = [[] for _ in self.cores]
        self._mishap, self._left = "", 0
        self._before: Inputs | None = None

    def inputs(self, cycles: int) -> Iterator[Inputs]:
        """Yield the inputs of so many cycles, after the commands that come before each."""
        due = self.cycle.now()
        for _ in range(cycles):
            due += PERIOD
            if self._begin_mishap() == "late":
                due += self.random.choice((0.005, PERIOD, 3 * PERIOD, 0.4))
            self.cycle.wait_until(due + self.random.random() * 0.0003)
            self.cycle.sync()
            if self.random.random() < 1 / self.every:
                self.command(self._some_command())
            self._before = self._spoilt(self.port.read(self.cycle.now()))
            yield self._before
            self.cycle.commit()
            self.cycle.heartbeat()

    def command(self, command: c.Command) -> None:
        """Have every core take a command."""
        for core, tickets in zip(self.cores, self.tickets, strict=True):
            tickets.append(CommandStatus(type(command).__name__))
            try:
                accept(core, command, tickets[-1])
            except StateError as error:
                core.finish(tickets[-1], error)

    def _some_command(self) -> c.Command:
        core, pick = self.cores[0], self.random.choice
        here = 0.0 if core.image.position is None else (core.image.position - core.image.origin) / SCALE
        if self.random.random() < 0.8 and (not core.powered or core.stop_sequence is not None):
            return pick(
                (c.ResetCommand(), c.EnableCommand(), c.EnableCommand(), c.Release(), c.ResetCommand())
            )
        speed, ramp = pick((20_000, 90_000, 350_000)), pick((100_000, 500_000))
        profile = MoveProfile(speed, ramp, ramp, float(speed), float(ramp), None, float(ramp), float(ramp))
        signed = profile._replace(velocity=speed * pick((1, -1)))
        path = TrapezoidalTrajectory(here, here + pick((-30.0, 5.0, 45.0)), pick((20.0, 90.0)), 400.0)
        points = SampledTrajectory([here, here, here + pick((0.01, 0.5, 5.0)), here + 0.02, here], 0.1)
        moves = (
            c.FollowTrajectory(path),
            c.FollowTrajectory(path),
            c.FollowTrajectory(points),
            c.Move(pick(tuple(c.TargetReference)), pick((-20_000, 0, 30_000)), profile),
            c.MoveVelocity(signed, pick((None, 0.2))),
            c.TorqueControl(pick((-200, 100)), None, None),
            c.CyclicVelocity(speed * pick((1, -1)), float(ramp), float(ramp)),
            c.CyclicTorque(pick((-200, 100)), pick((500, 5000))),
            c.Home(HomingJob(37, None, None, None, 5.0)),
        )
        ends = (
            c.Halt(),
            c.Stop(),
            c.Release(),
            c.QuickStop(),
            c.Disable(),
            c.Disable(coast=True),
            c.ResetCommand(),
        )
        others = (c.SetPosition(pick((0, 5000))), c.PolicyStop("of another"), c.EnableCommand(moving=True))
        return pick(moves) if self.random.random() < 0.6 else pick(ends + others)

    def _begin_mishap(self) -> str:
        self._left -= 1
        if self._left <= 0:
            self._mishap = ""
            if self.random.random() < 1 / MISHAP:
                self._mishap, self._left = self.random.choice(MISHAPS), self.random.choice((1, 2, 3, 12, 40))
        return self._mishap

    def _spoilt(self, inputs: Inputs) -> Inputs:
        """The inputs after the present fault."""
        old, what = self._before or inputs, self._mishap
        if what in SAMPLES:  # one that stays away
            return inputs._replace(**{what: getattr(old, what)})
        if what == "stale":
            return inputs._replace(**{name: getattr(old, name) for name in SAMPLES})
        if what == "nothing":
            return inputs._replace(**dict.fromkeys(SAMPLES))
        if what == "gone":
            return inputs._replace(operational=False, nmt=self.random.choice((-1, 4, 5, 127)), overdue=True)
        if what == "emcy":
            return inputs._replace(emcy=(Emcy(0x8611, 1, bytes(5), inputs.now),))
        if what == "early":  # received after the cycle has begun
            return (
                _with(inputs, "position", 0, inputs.now + 0.0002 - inputs.position.stamp)
                if inputs.position
                else inputs
            )
        if what == "blocked" and old.position is not None and inputs.position is not None:
            return inputs._replace(position=Sample(old.position.value, inputs.position.stamp))
        return self._shown(inputs, what)

    def _shown(self, inputs: Inputs, what: str) -> Inputs:
        words = {"fault": 0x0008, "dropped": 0x0250, "quick stop": 0x0017, "odd": 0x0001}
        word = inputs.statusword
        if what in words and word is not None:
            return inputs._replace(statusword=Sample(words[what], word.stamp))
        if what == "other mode" and inputs.mode is not None:
            return inputs._replace(mode=Sample(3, inputs.mode.stamp))
        if what == "jump":
            return _with(inputs, "position", 25_000)
        return _with(inputs, "demand", 9_000) if what == "pull" else inputs


def _with(inputs: Inputs, name: str, more: int, later: float = 0.0) -> Inputs:
    sample = getattr(inputs, name)
    return (
        inputs
        if sample is None
        else inputs._replace(**{name: Sample(sample.value + more, sample.stamp + later)})
    )


MISHAPS = (
    *SAMPLES,
    "late",
    "stale",
    "nothing",
    "gone",
    "emcy",
    "early",
    "blocked",
    "fault",
    "dropped",
    "quick stop",
    "odd",
)
MISHAPS += ("other mode", "jump", "pull")
