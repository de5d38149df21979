"""The recipe of a drawn cell as plain values, which can be printed, pasted, and simplified one by one."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterator
from typing import NamedTuple

from kit.campaign.cells.files import ABSENT, corpus_names, motor_of

GENERIC, GIM = "generic-cia402", "gim6010-8"
FIRST_NODE = 11
NORM = 400.0  # norm degrees per second at max_velocity
# Increments per unit that mechanisms have.
_SCALES = {
    "deg": (100.0, 131072 / 360, 10000 / 360, 2000.0),
    "mm": (1000.0, 131072 / 5, 400.0),
    "rev": (10000.0, 131072.0, 4096.0),
    "rad": (10000.0, 5729.578),
    "um": (1.0, 0.5),
    "increments": (1.0,),
}
_SPEEDS = (4e3, 1e4, 4e4, 2e5)  # increments/s
# increments/s: with fewer, a slow motion cannot be distinguished from the noise of its encoder
_SLOWEST = 300.0
_RAMP_TIMES = (0.05, 0.1, 0.25, 0.5, 1.0)  # s to max_velocity
_SPANS = (0.3, 1.0, 1.0, 3.0)  # s at max_velocity from one limit to the other
# Objects that some drives lack. Without any one of them the drive still has pp.
MISSING = (
    0x6062,
    0x6062,
    0x606C,
    0x6077,
    0x605A,
    0x605D,
    0x6084,
    0x6085,
    0x60C5,
    0x607D,
    0x6065,
    0x60C2,
    0x6067,
    0x60A4,
)
# Objects that drives do not let be written.
FIXED = (0x6084, 0x6083, 0x60C5, 0x6085, 0x605A, 0x6065)
_PERIODS = (2, 4, 5, 10, 10, 20, 25, 50)  # ms
_NO_HOMING = 0x38D  # 6502h without bit 5
_VALUES = ("velocity", "torque", "demand")
_WRITTEN = ("mode", "target_velocity", "target_torque")


class AxisRecipe(NamedTuple):
    """One axis. ``speed`` and ``acceleration`` are max_velocity and max_acceleration in increments per s and s².

    ``file``: ``generic-cia402``, ``gim6010-8`` or a file of the EDS corpus. ``without``: objects taken out of it, ``fixed``: those
    made read-only, accelerations with such a part of max_acceleration. ``rpm``: the drive has turns per minute with this
    power of ten. ``scaled``: the cell file has velocity_scale and acceleration_scale. ``ease``: default velocity and acceleration
    as shares of the maxima; ``stop``: that of the quick stop's deceleration. ``limits``: from and to, in s at max_velocity.
    ``demand``: the value of 6062h: ``real``, ``zero`` or ``target``. ``slow``: values sent with every n-th SYNC; ``polled``:
    those that are read by SDO; ``apart``: those with a TPDO of their own. ``event_timer``: that of all TPDOs in ms, which are then
    event-driven; 0: they answer SYNC. ``written``: outputs that are written by SDO. ``word_first``: the controlword is in an
    RPDO before that of the target. ``start``: the motor's position at power-up; ``homed``: whether it is homed at its position,
    or at the position reported by its drive. ``rejoin``: a node that has restarted is booted without a command; ``absolute``: the
    cell file says that the drive keeps its position without power.
    """

    file: str = GENERIC
    without: tuple[int, ...] = ()
    fixed: tuple[tuple[int, int], ...] = ()
    modes: int = 0
    rpm: int | None = None
    unit: str = "deg"
    scale: float = 100.0
    scaled: bool = True
    invert: str = ""
    speed: float = 40000.0
    acceleration: float = 100000.0
    ease: tuple[float, float] = (0.25, 0.5)
    stop: float = 1.0
    words: tuple[str, str] = ("ramp", "slow-ramp")
    limits: tuple[float, float] | None = None
    endless: bool = False
    jerk: float = 0.0
    noise: float = 0.0
    lag: float = 0.002
    demand: str = "real"
    slow: tuple[tuple[str, int], ...] = ()
    polled: tuple[str, ...] = ()
    apart: tuple[str, ...] = ()
    event_timer: int = 0
    written: tuple[str, ...] = ()
    word_first: bool = False
    start: int = 0
    homed: bool = True
    rejoin: bool = False
    absolute: bool = False

    @property
    def velocity(self) -> float:
        """max_velocity in units/s."""
        return self.speed / self.scale

    @property
    def increments(self) -> float:
        """Increments per norm degree."""
        return self.speed / NORM

    @property
    def counted(self) -> bool:
        """Whether the cell file gives the scale of the drive's velocities and accelerations."""
        return self.scaled or self.unit != "increments"

    @property
    def edges(self) -> tuple[float, float] | None:
        """The position limits in units, as the cell file has them."""
        if self.limits is None:
            return None
        low, high = (round(edge * self.speed) / self.scale for edge in self.limits)
        return float(f"{low:.9g}"), float(f"{high:.9g}")


class CellRecipe(NamedTuple):
    """A cell. ``group``: number of axes in a group (0: none), ``on_fault``: its policy; ``beside``: other devices on the bus.

    ``kinematics``: kind of workspace of the group; ``gantry``: the first two axes, alike, carry a beam.
    """

    axes: tuple[AxisRecipe, ...]
    period: int = 10  # ms
    group: int = 0
    on_fault: str = ""
    kinematics: str = ""
    gantry: bool = False
    beside: str = ""  # "", "io", "module", "encoder", "virtual"

    @property
    def names(self) -> str:
        """One letter for each axis."""
        return "abcdef"[: len(self.axes)]

    def axis(self, name: str) -> AxisRecipe:
        """The recipe of an axis."""
        return self.axes[self.names.index(name)]


def draw(chance: random.Random) -> CellRecipe:
    """Draw a cell."""
    count = chance.choices((1, 2, 3, 4, 5, 6), (34, 30, 15, 9, 6, 6))[0]
    period = chance.choice(_PERIODS if count < 3 else _PERIODS[3:])
    axes = [_axis(chance) for _ in range(count)]
    gantry = count > 1 and chance.random() < 0.2
    if gantry:
        axes[0] = axes[0]._replace(endless=False)
        axes[1] = axes[0]
    group = chance.choice((0, 2, count)) if count > 1 and not gantry else 0
    kinematics = ""
    if group and chance.random() < 0.35:
        kinematics = chance.choice(("corexy", "scara", "delta") if count > 2 else ("corexy", "scara"))
        group = 3 if kinematics == "delta" else 2
        axes[:group] = [_for_kinematics(axes[0], kinematics)] * group
    beside = chance.choice(("", "", "io", "module", "encoder", "virtual")) if count < 3 else ""
    return CellRecipe(
        tuple(axes),
        period,
        group,
        chance.choice(("", "path", "each", "quick")) if group else "",
        kinematics,
        gantry,
        beside,
    )


def _for_kinematics(axis: AxisRecipe, kind: str) -> AxisRecipe:
    """Axes that are alike, and turn or slide as the mechanism needs it."""
    unit = "mm" if kind == "corexy" else "deg"
    scale = axis.speed / (100.0 if unit == "mm" else 60.0)
    return axis._replace(
        unit=unit,
        scale=float(f"{scale:.6g}"),
        scaled=True,
        endless=False,
        limits=None,
        rpm=None,
        start=0,
        homed=True,
    )


def _axis(chance: random.Random) -> AxisRecipe:
    unit = chance.choice(("deg", "deg", "mm", "mm", "rev", "rad", "um", "increments", "increments"))
    axis = AxisRecipe(
        unit=unit,
        scale=chance.choice(_SCALES[unit]),
        scaled=chance.random() < 0.5,
        invert=chance.choice(("", "", "", "master", "drive")),
        ease=(chance.choice((0.1, 0.25, 0.5, 1.0)), chance.choice((0.1, 0.25, 0.5, 1.0))),
        stop=chance.choice((0.7, 1.0, 1.0, 2.0)),
        words=(
            chance.choice(("ramp", "ramp", "ramp", "slow-ramp", "ramp-hold")),
            chance.choice(("slow-ramp", "slow-ramp", "ramp")),
        ),
        endless=chance.random() < 0.12,
        noise=chance.choice((0.0, 0.0, 0.0, 2.0)),
        lag=chance.choice((0.002, 0.002, 0.002, 0.02, 0.05)),
    )
    axis = _motor(chance, _drive(chance, axis))
    if not axis.endless and chance.random() < 0.7:
        span, share = chance.choice(_SPANS), chance.choice((0.0, 0.0, 0.2, 0.5, 1.0))
        axis = axis._replace(limits=(-share * span, (1.0 - share) * span))
    if chance.random() < 0.25:
        axis = axis._replace(jerk=chance.choice((5.0, 20.0, 100.0)))
    axis = axis._replace(start=round(chance.uniform(-1.0, 1.0) * axis.speed), homed=chance.random() < 0.6)
    if chance.random() < 0.06 and not axis.endless and axis.invert != "drive":
        end = chance.choice((1, -1)) * (2**31 - round(0.2 * axis.speed))
        axis = axis._replace(start=end, homed=False, limits=None)
    return _return(_values(chance, axis))


def _return(axis: AxisRecipe) -> AxisRecipe:
    """Draw what happens after a restart, by numbers of its own: the draws of other things stay as they were."""
    chance = random.Random(repr(axis))
    return axis._replace(rejoin=chance.random() < 0.3, absolute=chance.random() < 0.3)


def _drive(chance: random.Random, axis: AxisRecipe) -> AxisRecipe:
    kind = chance.random()
    files = corpus_names()
    if kind < 0.2:
        return axis._replace(file=chance.choice(files or (ABSENT,)), noise=0.0)
    if kind < 0.3:
        return axis._replace(file=GIM)
    if kind < 0.5:
        return axis
    if kind < 0.6:
        return axis._replace(rpm=chance.choice((0, -3)))
    return axis._replace(
        without=tuple(sorted(set(chance.sample(MISSING, chance.choice((0, 1, 1, 2)))))),
        fixed=tuple(
            (index, chance.choice((1, 2, 4))) for index in chance.sample(FIXED, chance.choice((0, 1, 1, 2)))
        ),
        modes=_NO_HOMING if chance.random() < 0.1 else 0,
    )


def _motor(chance: random.Random, axis: AxisRecipe) -> AxisRecipe:
    """Draw max_velocity and max_acceleration within the resolution of the drive."""
    time = chance.choice(_RAMP_TIMES)
    if axis.file == GENERIC:
        speed = chance.choice(_SPEEDS)
    else:
        turn, _ = motor_of(axis.file)
        speed = max(_SLOWEST, float(f"{turn * chance.choice((0.5, 2.0, 6.0)):.3g}"))
    if axis.rpm is not None or axis.file != GENERIC:
        time = max(time, 0.1)
    if axis.unit == "increments":
        return axis._replace(speed=speed, acceleration=speed / time)
    scale = axis.scale if axis.file == GENERIC else float(f"{speed / chance.choice((10.0, 90.0, 300.0)):.6g}")
    return axis._replace(speed=speed, acceleration=speed / time, scale=scale)


def _values(chance: random.Random, axis: AxisRecipe) -> AxisRecipe:
    """The transport of the values of the drive, and the behaviour of 6062h."""
    if 0x6062 not in axis.without and chance.random() < 0.25:
        axis = axis._replace(demand=chance.choice(("zero", "target")))
    if axis.file not in (GENERIC, GIM) and chance.random() < 0.7:
        return axis  # as its maker has arranged it: many of these drives accept no other arrangement
    if chance.random() < 0.25:
        axis = axis._replace(
            slow=tuple((name, chance.choice((5, 25))) for name in _VALUES if chance.random() < 0.6)
        )
    if chance.random() < 0.25:
        axis = axis._replace(polled=tuple(name for name in _VALUES if chance.random() < 0.6))
    return axis if chance.random() < 0.7 else _mapped(chance, axis)


def _mapped(chance: random.Random, axis: AxisRecipe) -> AxisRecipe:
    """Draw another arrangement of the PDOs than that of boot."""
    return axis._replace(
        apart=tuple(name for name in _VALUES if chance.random() < 0.5),
        event_timer=chance.choice((0, 0, 5, 10, 20)),
        written=tuple(name for name in _WRITTEN if chance.random() < 0.3),
        word_first=chance.random() < 0.3,
    )


def with_usual(cell: CellRecipe, fields: Collection[str]) -> CellRecipe:
    """Return the cell with the usual values of these fields in every axis."""
    usual = {field: AxisRecipe._field_defaults[field] for field in fields}
    return cell._replace(axes=tuple(axis._replace(**usual) for axis in cell.axes)) if usual else cell


def simpler(cell: CellRecipe) -> Iterator[CellRecipe]:
    """Yield cells that differ from this one by one thing that is more usual."""
    if cell.gantry or cell.kinematics:
        yield cell._replace(kinematics="")
    elif len(cell.axes) > 1:
        yield cell._replace(axes=cell.axes[:-1], group=min(cell.group, len(cell.axes) - 1))
    for field, usual in CellRecipe._field_defaults.items():
        if getattr(cell, field) != usual and field != "gantry":
            yield cell._replace(**{field: usual})
    for number, axis in enumerate(cell.axes):
        for field, usual in AxisRecipe._field_defaults.items():
            if getattr(axis, field) == usual or field in ("scale", "speed", "acceleration", "unit"):
                continue
            simple = axis._replace(**{field: usual})
            yield cell._replace(axes=(*cell.axes[:number], simple, *cell.axes[number + 1 :]))


def told(cell: CellRecipe) -> str:
    """Return the recipe as source text without its default values."""
    axes = "".join(f"\n        {_short(axis)}," for axis in cell.axes)
    more = "".join(f", {name}={value!r}" for name, value in _unusual(cell))
    return f"CellRecipe(({axes}\n    ){more})"


def _short(axis: AxisRecipe) -> str:
    return f"AxisRecipe({', '.join(f'{name}={value!r}' for name, value in _unusual(axis))})"


def _unusual(values: AxisRecipe | CellRecipe) -> list[tuple[str, object]]:
    usual = values._field_defaults
    return [(name, getattr(values, name)) for name in usual if getattr(values, name) != usual[name]]
