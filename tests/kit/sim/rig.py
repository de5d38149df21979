"""A bench for one simulated drive in virtual time: enable it, let time pass, wait for something."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.sim.drive import Drive
from axisbus.sim.fault_injection import DriveFaults
from axisbus.sim.motor import MotorParams
from kit.sim.eds import drive_eds

PP, PV, TQ, HM, CSP, CSV, CST = 1, 3, 4, 6, 8, 9, 10
# The statusword's bits, typed from the standard's table.
VOLTAGE, WARNING, REMOTE, LIMIT = 0x0010, 0x0080, 0x0200, 0x0800
BIT_10, BIT_12, BIT_13 = 0x0400, 0x1000, 0x2000


def state(word: int) -> str:
    """The state by the standard's masks, the test's own copy."""
    for mask, value, name in (
        (0x4F, 0x00, "not ready to switch on"),
        (0x4F, 0x40, "switch on disabled"),
        (0x6F, 0x21, "ready to switch on"),
        (0x6F, 0x23, "switched on"),
        (0x6F, 0x27, "operation enabled"),
        (0x6F, 0x07, "quick stop active"),
        (0x4F, 0x0F, "fault reaction active"),
        (0x4F, 0x08, "fault"),
    ):
        if word & mask == value:
            return name
    return f"unknown 0x{word:04X}"


class Rig:
    """A drive that steps by ``dt``."""

    def __init__(self, *, dt: float = 0.001, params: MotorParams | None = None, **changes: int) -> None:
        self.dials = DriveFaults()
        self.drive = Drive(drive_eds(**changes), params=params, dials=self.dials)
        self.dt = dt

    @property
    def state(self) -> str:
        return state(self.drive.statusword)

    @property
    def time(self) -> float:
        return self.drive.time

    def has(self, bit: int) -> bool:
        return bool(self.drive.statusword & bit)

    def write(self, index: int, value: int, subindex: int = 0) -> None:
        self.drive.dictionary.write(index, subindex, value)

    def read(self, index: int, subindex: int = 0) -> int:
        return self.drive.dictionary.read(index, subindex)

    def run(self, seconds: float, each: Callable[[], None] | None = None) -> None:
        for _ in range(round(seconds / self.dt)):
            self.drive.step(self.dt)
            if each is not None:
                each()

    def until(self, done: Callable[[], bool], limit: float = 20.0) -> float:
        """Step until ``done``; return the seconds it took."""
        start = self.time
        while not done():
            assert self.time - start < limit, (
                f"not within {limit} s; statusword 0x{self.drive.statusword:04X}"
            )
            self.drive.step(self.dt)
        return self.time - start

    def word(self, word: int) -> None:
        self.drive.controlword = word
        self.drive.step(self.dt)

    def enable(self, mode: int) -> Rig:
        self.drive.mode = mode
        for word, wanted in ((6, "ready to switch on"), (7, "switched on"), (15, "operation enabled")):
            self.until(lambda: self.state != "not ready to switch on")
            self.drive.controlword = word
            self.until(lambda wanted=wanted: self.state == wanted)
        return self

    def present(self, target: int, bits: int = 0) -> None:
        """One set-point with its whole handshake."""
        self.drive.target_position = target
        self.word(0x0F | 0x10 | bits)
        self.until(lambda: self.has(BIT_12))
        self.word(0x0F | bits)

    def arrive(self, limit: float = 30.0) -> float:
        return self.until(lambda: self.has(BIT_10), limit)
