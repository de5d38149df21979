"""The commands of drawn cells, by name: for an axis, a group, a gantry; their numbers fit the limits and the scale of each axis."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.coupling import Cam
from axisbus.machine.groups import Group
from axisbus.machine.handle import Handle
from axisbus.machine.streaming.controller import AxisFeedback
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.campaign.cells.cell_setup import ENCODER, PAIR, VIRTUAL, DrawnCell
from kit.campaign.cells.recipe import AxisRecipe

_MODES = ("low", "previous", "next", "high")
_LOOP = 2.0  # seconds of a controller
_LEFT_ON_ARCS = 0.6  # of an acceleration, for the speed along an arc; the other part of it turns the axes
_HALTS = 1.0  # s that a halt on an arc takes
HOLDS = -0.4  # the value of an event below which an override is 0
HUGE: Sequence[float] = (
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    -1e308,
    10**400,
    1e15,
    2.0**31,
    -(2.0**31),
    1e-12,
    -0.0,
    0.0,
)


class Args:
    """The numbers of one command of one axis, drawn from its value; notes the goal of the command.

    ``goal``: the final position of the axis in units, None if unknown. ``direction``: that of the motion,
    in units, 0 if it may be either. ``outside``: a number of it is beyond a limit, so that it has to be refused or to stop
    there. ``extreme``: it has a number that no machine has.
    """

    def __init__(self, cell: DrawnCell, name: str, value: float) -> None:
        self.cell, self.name, self.value = cell, name, value
        self.recipe: AxisRecipe = cell.recipe.axis(name)
        self.chance = random.Random(f"{name}{value}")
        self.goal: float | None = None
        self.direction = 0.0
        self.outside = False
        self.extreme = False

    @property
    def axis(self) -> Axis:
        """The axis."""
        return self.cell[self.name]

    @property
    def here(self) -> float:
        """Where the motor is, in units of the axis."""
        drive = self.cell.drive(self.name).axis
        place = drive.to_user(drive.motor.position) - self.cell.core(self.name).image.origin
        return place / self.cell.factor(self.name)

    @property
    def led(self) -> float:
        """Where a trajectory has to begin."""
        return self.cell[self.name].commanded_position

    # -- numbers ---------------------------------------------------------------------------------------------------------

    def position(self) -> float:
        """Draw a position: within the limits, at a limit, or seldom beyond it; near the axis if it has no limits."""
        edges = self.recipe.edges
        if edges is None:
            target = self.here + self.chance.uniform(-1.5, 1.5) * self.recipe.velocity
        elif (kind := self.chance.random()) < 0.25:
            target = self.chance.choice(edges)
        elif kind < 0.31:
            target = (
                edges[1] + self.chance.choice((0.5, 5.0, 200.0)) * self.recipe.increments / self.recipe.scale
            )
        else:
            target = self.chance.uniform(*edges)
        return self._to(target)

    def inside(self, share: float = 0.5) -> float:
        """Return a position within the limits, at this share of their span."""
        edges = self.recipe.edges
        if edges is None:
            return self._to(self.here + self.value * self.recipe.velocity)
        return self._to(edges[0] + share * (edges[1] - edges[0]))

    def distance(self) -> float:
        """Return the distance from the present position to such a position."""
        here = self.here
        target, edges = self.position(), self.recipe.edges
        grain = (3.0 + 2.0 * self.recipe.noise) / self.recipe.scale  # by which it may be seen elsewhere
        self.outside = self.outside or (
            edges is not None and not edges[0] + grain < target < edges[1] - grain
        )
        return target - here

    def _to(self, target: float) -> float:
        edges = self.recipe.edges
        self.goal = None if self.recipe.endless else target
        self.outside = self.outside or (edges is not None and not edges[0] <= target <= edges[1])
        self.direction = 0.0 if self.recipe.endless else math.copysign(1.0, target - self.here)
        return target

    def is_beyond(self, place: float) -> bool:
        """Whether a position is outside the limits."""
        edges = self.recipe.edges
        return edges is not None and not edges[0] <= place <= edges[1]

    def turn(self) -> float:
        """A signed velocity."""
        self.direction = math.copysign(1.0, self.value)
        share = 1.4 if abs(self.value) > 0.93 else 0.1 + 0.95 * abs(self.value)
        self.outside = share > 1.0
        return self.recipe.velocity * math.copysign(share, self.value)

    def ramps(self, *, soft: float = 0.15) -> dict[str, float]:
        """Velocity, acceleration, deceleration and jerk, each of them left out as often."""
        chance, recipe = self.chance, self.recipe
        ramp = recipe.acceleration / recipe.scale
        given = {
            "velocity": recipe.velocity * chance.choice((0.2, 0.5, 0.9, 1.0)),
            "acceleration": ramp * chance.choice((0.2, 0.5, 1.0)),
            "deceleration": ramp * chance.choice((0.2, 0.5, 1.0)),
        }
        chosen = {key: value for key, value in given.items() if chance.random() < 0.6}
        if chance.random() < 0.12:  # more than the axis may
            key = chance.choice(tuple(given))
            chosen[key] = 1.5 * (recipe.velocity if key == "velocity" else ramp)
            self.outside = True
        if chance.random() < soft:
            chosen["jerk"] = ramp * chance.choice((5.0, 20.0, 100.0))
        return chosen

    def without(self, *keys: str) -> dict[str, float]:
        """The same without some of them."""
        return {key: value for key, value in self.ramps(soft=0.15).items() if key not in keys}

    def blending(self) -> str:
        """One of the four modes."""
        return f"blending_{self.chance.choice(_MODES)}"

    def master(self) -> Axis:
        """Another axis, of whatever kind."""
        others = [axis for axis in self.cell.machine if axis.name not in (self.name, "m")]
        if not others:
            return self.axis
        return next((axis for axis in others if axis.name in (ENCODER, VIRTUAL)), self.chance.choice(others))

    def unit_of(self, master: Axis) -> float:
        """Return the distance in units that a master axis travels in a second at its max_velocity."""
        return self.cell.recipe.axis(master.name).velocity if master.name in self.cell.recipe.names else 400.0


class Order(NamedTuple):
    """How a command is given, and its kind: ``move``, ``turn``, ``torque``, ``couple``, ``stop``, ``power`` or ``set``."""

    give: Callable[[Args], Handle]
    kind: str


def _chain(args: Args) -> Handle:
    """Three moves in a row within the limits, by one of PLCopen's BufferModes."""
    axis, mode = args.axis, args.blending()
    return _in_a_row(
        args,
        {
            0.3: lambda target: axis.move_absolute(target, buffer=mode, **args.without("jerk")),
            0.45: lambda target: axis.move_absolute(target, buffer=mode, **args.without("jerk")),
            0.8 if args.value > 0.0 else 0.1: lambda target: axis.move_absolute(target, buffer=mode),
        },
    )


def _in_a_row(args: Args, moves: Mapping[float, Callable[[float], Handle]]) -> Handle:
    """Give moves to these shares of the limits until one is refused; return the last one that was taken: its goal counts."""
    targets = {share: args.inside(share) for share in moves}
    taken: Handle | None = None
    for share, move in moves.items():
        try:
            taken = move(targets[share])
        except AxisbusError:
            if taken is None:
                raise
            break
        args.inside(share)
    args.direction = 0.0  # that of the first one, and later another
    assert taken is not None
    return taken


def _behind(args: Args) -> Handle:
    """A move of the drive, and one that passes into it."""
    axis, mode = args.axis, args.blending()
    return _in_a_row(
        args,
        {
            0.4: lambda target: axis.move_absolute(target, **args.without("jerk")),
            0.6 if args.value > 0.0 else 0.2: lambda target: axis.move_absolute(target, buffer=mode),
        },
    )


def _timed(args: Args) -> Handle:
    """Start a long and slow move whose time-out is too short."""
    edges = args.recipe.edges
    far = (
        50.0 * args.recipe.velocity
        if edges is None
        else max(edges, key=lambda edge: abs(edge - args.here)) - args.here
    )
    args.direction = math.copysign(1.0, far)
    mode = args.chance.choice((False, True, "blending_low"))
    jerk = {"jerk": 50.0 * args.recipe.acceleration / args.recipe.scale} if args.value > 0.6 else {}
    return args.axis.move_relative(far, velocity=0.1 * args.recipe.velocity, timeout=0.5, buffer=mode, **jerk)


def _additive(args: Args) -> Handle:
    """From where it was commanded last, which may be elsewhere than it is."""
    handle = args.axis.move_additive(args.distance(), **args.ramps())
    args.goal, args.direction, args.outside = None, 0.0, True
    return handle


def _follow(args: Args) -> Handle:
    """A trapezoid from the commanded position of the axis, gentler than the limits."""
    recipe, start = args.recipe, args.led
    target = args.inside(args.chance.random())
    args.direction = math.copysign(1.0, target - start)
    pace = (
        recipe.velocity * args.chance.choice((0.3, 0.9)),
        recipe.acceleration / recipe.scale * args.chance.choice((0.3, 0.5, 0.9)),
    )
    return args.axis.follow(TrapezoidalTrajectory(start, target, *pace))


def _gear(args: Args) -> Handle:
    master = args.master()
    ratio = args.value * args.recipe.velocity / args.unit_of(master)
    return args.axis.gear_in(
        master, ratio or 1.0, master_value_source=args.chance.choice(("command", "command", "actual"))
    )


def _cam(args: Args) -> Handle:
    master = args.master()
    turn, lift = args.unit_of(master), 0.05 * args.recipe.velocity
    lobe = Cam(
        [(0.0, 0.0), (0.25 * turn, lift), (0.5 * turn, 0.0), (0.75 * turn, -lift), (turn, 0.0)], periodic=True
    )
    return args.axis.cam_in(master, lobe, relative=True, slave_scaling=args.value or 1.0)


def _phase(args: Args) -> Handle:
    unit = args.unit_of(args.master())
    return args.axis.phasing_relative(0.1 * args.value * unit, velocity=0.1 * unit, acceleration=0.5 * unit)


def _loop(args: Args) -> Handle:
    """A controller that keeps the axis near where it is; it fails after some seconds."""
    end, here, gain = args.cell.now + _LOOP, args.here, 0.1 * args.recipe.velocity

    def loop(seen: AxisFeedback) -> float:
        if seen.position is None or args.cell.now > end:
            raise ValueError("seen enough")
        return gain * args.value * math.sin(2.0 * seen.time) - 0.5 * (seen.position - here)

    return args.axis.controller(loop).handle


def _superimposed(args: Args) -> Handle:
    distance = 0.1 * args.value * args.recipe.velocity
    return args.axis.move_superimposed(distance, velocity=0.2 * args.recipe.velocity)


def _override(args: Args) -> float:
    return 0.0 if args.value < HOLDS else 0.1 + 1.4 * abs(args.value)


def _position(args: Args) -> Handle:
    """Near where it was, so that limits are met from both sides; seldom outside of them."""
    edges = args.recipe.edges
    if edges is None:
        return args.axis.set_position(args.value * args.recipe.velocity)
    span = edges[1] - edges[0]
    return args.axis.set_position(edges[0] + (0.5 + 0.6 * args.value) * span)


def _probe(args: Args) -> Handle:
    handle = args.axis.probe(1, "both", continuous=args.value > 0.0)
    signal = args.cell.drive(args.name).touch_probe
    args.cell.after(0.1, lambda: signal.set_input(1, True))
    args.cell.after(0.15, lambda: signal.set_input(1, False))
    args.cell.after(1.0, handle.cancel)
    return handle


def _extreme(args: Args) -> Handle:
    """Call with a number that fits no machine, or with one at the end of an object's range."""
    args.extreme = True
    number = args.chance.choice(
        (*HUGE, *(past / args.recipe.scale for past in (2.0**31 - 1, 2.0**31, -(2.0**31) - 1, 2.0**32 + 5.0)))
    )
    axis = args.axis
    calls: list[Callable[[], Handle]] = [
        lambda: axis.move_absolute(number),
        lambda: axis.move_relative(number),
        lambda: axis.move_additive(number),
        lambda: axis.move_absolute(args.inside(), velocity=number),
        lambda: axis.move_absolute(args.inside(), acceleration=number),
        lambda: axis.move_absolute(args.inside(), deceleration=number),
        lambda: axis.move_absolute(args.inside(), jerk=number),
        lambda: axis.move_absolute(args.inside(), timeout=number),
        lambda: axis.move_velocity(number),
        lambda: axis.jog(number),
        lambda: axis.cyclic_velocity(number),
        lambda: axis.torque_control(number),
        lambda: axis.cyclic_torque(number),
        lambda: axis.set_position(number),
        lambda: axis.set_override(number),
        lambda: axis.gear_in(args.master(), number),
        lambda: axis.move_superimposed(number),
    ]
    call = args.chance.choice(calls)
    handle = call()
    args.goal = None
    return handle


ORDERS: Mapping[str, Order] = {
    "enable": Order(lambda args: args.axis.enable(), "power"),
    "disable": Order(lambda args: args.axis.disable(), "stop"),
    "coast": Order(lambda args: args.axis.disable(coast=True), "power"),
    "reset": Order(lambda args: args.axis.reset(), "power"),
    "halt": Order(lambda args: args.axis.halt(), "stop"),
    "stop": Order(lambda args: args.axis.stop(), "stop"),
    "release": Order(lambda args: args.axis.release(), "power"),
    "quick_stop": Order(lambda args: args.axis.quick_stop(), "stop"),
    "move_absolute": Order(lambda args: args.axis.move_absolute(args.position(), **args.ramps()), "move"),
    "move_relative": Order(lambda args: args.axis.move_relative(args.distance(), **args.ramps()), "move"),
    "move_additive": Order(_additive, "move"),
    "move_led": Order(
        lambda args: args.axis.move_absolute(args.position(), buffer=args.blending(), **args.ramps(soft=0.5)),
        "move",
    ),
    "move_waiting": Order(lambda args: args.axis.move_absolute(args.inside(0.7), buffer=True), "move"),
    "move_chain": Order(_chain, "move"),
    "move_behind": Order(_behind, "move"),
    "move_timed": Order(_timed, "timed"),
    "move_velocity": Order(
        lambda args: args.axis.move_velocity(args.turn(), **args.without("velocity")), "turn"
    ),
    "turn_softly": Order(
        lambda args: args.axis.move_velocity(
            args.turn(), jerk=20.0 * args.recipe.acceleration / args.recipe.scale
        ),
        "turn",
    ),
    "jog": Order(lambda args: args.axis.jog(args.turn()), "turn"),
    "cyclic_velocity": Order(lambda args: args.axis.cyclic_velocity(args.turn()), "turn"),
    "torque": Order(lambda args: args.axis.torque_control(0.4 * args.value, slope=5.0), "torque"),
    "cyclic_torque": Order(lambda args: args.axis.cyclic_torque(0.4 * args.value, slope=5.0), "torque"),
    "controller": Order(_loop, "turn"),
    "follow": Order(_follow, "move"),
    "gear": Order(_gear, "couple"),
    "cam": Order(_cam, "couple"),
    "phase": Order(_phase, "couple"),
    "gear_out": Order(lambda args: args.axis.gear_out(), "couple"),
    "superimposed": Order(_superimposed, "couple"),
    "halt_superimposed": Order(lambda args: args.axis.halt_superimposed(), "couple"),
    "home": Order(lambda args: args.axis.home(), "home"),
    "set_position": Order(_position, "set"),
    "axis_override": Order(lambda args: args.axis.set_override(_override(args)), "override"),
    "probe": Order(_probe, "probe"),
    "extreme": Order(_extreme, "extreme"),
}


# -- groups and gantries -------------------------------------------------------------------------------------------------


class GroupArgs:
    """The numbers of one command of a group; ``goals``: the known end position of each axis, in units."""

    def __init__(self, cell: DrawnCell, value: float) -> None:
        self.cell, self.value = cell, value
        self.chance = random.Random(value)
        recipe = cell.recipe
        self.names = recipe.names[: recipe.group] if recipe.group else recipe.names
        self.group: Group = cell.machine.groups["all"] if recipe.group else cell.machine.group(*self.names)
        self.args = [Args(cell, name, round(self.chance.uniform(-1.0, 1.0), 4)) for name in self.names]
        self.goals: dict[str, float] = {}
        self.outside = False

    def end(self) -> tuple[float, ...]:
        """Return the end of a path: a pose in the workspace near the present one, or positions of the axes."""
        if self.cell.recipe.kinematics:
            return tuple(
                place + 15.0 * args.value
                for place, args in zip(self.group.tool_position, self.args, strict=True)
            )
        ends = tuple(args.position() for args in self.args)
        self.goals = {
            args.name: end for args, end in zip(self.args, ends, strict=True) if args.goal is not None
        }
        self.outside = any(args.outside for args in self.args)
        return ends

    def pace(self) -> float:
        """Return a velocity along a path."""
        if self.cell.recipe.kinematics:
            return 40.0
        return max(args.recipe.velocity for args in self.args) * self.chance.choice((0.3, 0.8))

    def along(self) -> dict[str, float]:
        """Return velocity and acceleration along a path; axes with other units slow it down by their own limits."""
        if self.cell.recipe.kinematics:
            return {"velocity": 40.0}
        return {
            "velocity": self.pace(),
            "acceleration": max(args.recipe.acceleration / args.recipe.scale for args in self.args),
        }

    def gently(self) -> tuple[tuple[float, ...], dict[str, float], float]:
        """Return end, velocity and acceleration of a path with corners, and its share of the usual speed and length.

        So slow that a halt takes a second, or 1.5 s under the highest override of 1.5: ``halt_time`` is 2 s or more. In a
        corner the weakest axis may have to take the speed of the fastest one, and 0.6 of its acceleration is left for braking.
        """
        end, along = self.end(), self.along()
        if self.cell.recipe.kinematics:
            return end, along, 1.0
        weakest = min(args.recipe.acceleration / args.recipe.scale for args in self.args)
        share = min(1.0, _LEFT_ON_ARCS * weakest * _HALTS / along["velocity"])
        if share < 1.0:
            end = self.between(end, share)
            ends = zip(self.args, end, strict=True)
            self.goals = {args.name: each for args, each in ends if args.name in self.goals}
        return end, along | {"velocity": share * along["velocity"]}, share

    def between(self, end: Sequence[float], share: float) -> tuple[float, ...]:
        """A point on the way to the end."""
        starts = (
            self.group.tool_position if self.cell.recipe.kinematics else [args.here for args in self.args]
        )
        return tuple(start + share * (to - start) for start, to in zip(starts, end, strict=True))


def _linear(args: GroupArgs) -> Handle:
    return args.group.move_linear(args.end(), **args.along())


def _soft_line(args: GroupArgs) -> Handle:
    ramps = [one.recipe.acceleration / one.recipe.scale for one in args.args]
    ramp = min(ramps) if args.cell.recipe.kinematics else max(ramps)  # as ``along``
    return args.group.move_linear(args.end(), velocity=args.pace(), acceleration=0.5 * ramp, jerk=20.0 * ramp)


def _joining(args: GroupArgs) -> Handle:
    mode = f"blending_{args.chance.choice(_MODES)}"
    end, along, share = args.gently()
    if (
        share < 1.0
    ):  # it begins where the line before it ends, which may be so far away that it would take minutes
        return args.group.move_linear(end, **along)
    return args.group.move_linear(end, **along, buffer=mode, blend=0.02 * share * args.pace())


def _path(args: GroupArgs) -> Handle:
    end, along, share = args.gently()
    return args.group.move_path([args.between(end, 0.4), end], **along, blend=0.01 * share * args.pace())


def _circle(args: GroupArgs) -> Handle:
    end, along, share = args.gently()
    via = tuple(
        point + (0.1 * share * one.recipe.velocity if number == 0 else 0.0)
        for number, (point, one) in enumerate(zip(args.between(end, 0.5), args.args, strict=True))
    )
    args.goals = {}
    return args.group.move_circular(end, via=via, **along)


def _direct(args: GroupArgs) -> Handle:
    ends = tuple(one.position() for one in args.args)
    args.goals = {one.name: end for one, end in zip(args.args, ends, strict=True) if one.goal is not None}
    args.outside = any(one.outside for one in args.args)
    return args.group.move_direct(ends)


def _stream(args: GroupArgs) -> Handle:
    """A sine from the commanded positions of the axes, gentler than the limits: ended, or left to run out."""
    starts = args.group.tool_position if args.cell.recipe.kinematics else [one.led for one in args.args]
    sizes = (
        [5.0] * len(starts)
        if args.cell.recipe.kinematics
        else [0.02 * one.recipe.velocity * one.value for one in args.args]
    )
    if not args.cell.recipe.kinematics:  # from near a limit it may sway beyond that
        ends = [start + 2.0 * size for start, size in zip(starts, sizes, strict=True)]
        args.outside = any(one.is_beyond(end) for one, end in zip(args.args, ends, strict=True))
    step = max(0.02, args.cell.recipe.period / 1000.0)
    points = args.group.stream(period=step, buffer=0.5, on_underrun="error" if args.value < -0.5 else "hold")
    ended = (
        args.value >= -0.5
    )  # an axis that holds at the end of a stream waits for more points, or for its end
    for number in range(round(2.0 / step)):
        sway = 1.0 - math.cos(2.0 * step * number)
        try:
            if not points.try_push([start + size * sway for start, size in zip(starts, sizes, strict=True)]):
                break
        except AxisbusError:  # no more points come, and it must not be waited for them
            ended = True
            break
    else:
        ended = True  # there is still room for more points, and until there is none it does not begin
    if ended:
        with suppress(AxisbusError):
            points.finish()
    return points.handle


class GroupOrder(NamedTuple):
    """As ``Order``, for a group."""

    give: Callable[[GroupArgs], Handle]
    kind: str


GROUP: Mapping[str, GroupOrder] = {
    "group_enable": GroupOrder(lambda args: args.group.enable(), "power"),
    "group_disable": GroupOrder(lambda args: args.group.disable(), "stop"),
    "group_halt": GroupOrder(lambda args: args.group.halt(), "stop"),
    "group_stop": GroupOrder(lambda args: args.group.stop(), "stop"),
    "group_release": GroupOrder(lambda args: args.group.release(), "power"),
    "group_reset": GroupOrder(lambda args: args.group.reset(), "power"),
    "group_quick_stop": GroupOrder(lambda args: args.group.quick_stop(), "stop"),
    "move_linear": GroupOrder(_linear, "path"),
    "move_softly": GroupOrder(_soft_line, "path"),
    "move_joining": GroupOrder(_joining, "path"),
    "move_path": GroupOrder(_path, "path"),
    "move_circular": GroupOrder(_circle, "path"),
    "move_direct": GroupOrder(_direct, "move"),
    "stream": GroupOrder(_stream, "path"),
    "resume": GroupOrder(lambda args: args.group.resume(), "path"),
    "override": GroupOrder(lambda args: args.group.set_override(0.3 + abs(args.value)), "override"),
    "cell_override": GroupOrder(
        lambda args: args.cell.machine.set_override(
            0.0 if args.value < HOLDS else 0.1 + 1.4 * abs(args.value)
        ),
        "override",
    ),
}


def _pair_position(args: Args) -> Handle:
    return args.cell.machine.gantry(PAIR).set_position(
        args.position() if args.value < 0.8 else args.chance.choice(HUGE)
    )


def _pair(give: Callable[[Args], Handle], kind: str) -> Order:
    return Order(give, kind)


def _of(args: Args):
    return args.cell.machine.gantry(PAIR)


GANTRY: Mapping[str, Order] = {
    "pair_enable": _pair(lambda args: _of(args).enable(), "power"),
    "pair_disable": _pair(lambda args: _of(args).disable(), "stop"),
    "pair_halt": _pair(lambda args: _of(args).halt(), "stop"),
    "pair_stop": _pair(lambda args: _of(args).stop(), "stop"),
    "pair_quick_stop": _pair(lambda args: _of(args).quick_stop(), "stop"),
    "pair_release": _pair(lambda args: _of(args).release(), "power"),
    "pair_reset": _pair(lambda args: _of(args).reset(), "power"),
    "pair_move_absolute": _pair(
        lambda args: _of(args).move_absolute(args.position(), **args.without("jerk", "deceleration")), "move"
    ),
    "pair_move_relative": _pair(
        lambda args: _of(args).move_relative(args.distance(), **args.without("jerk", "deceleration")), "move"
    ),
    "pair_move_velocity": _pair(lambda args: _of(args).move_velocity(args.turn()), "turn"),
    "pair_set_position": _pair(_pair_position, "set"),
    "pair_override": _pair(lambda args: _of(args).set_override(_override(args)), "override"),
    "pair_resume": _pair(lambda args: _of(args).resume(), "couple"),
}

MOTIONS = (
    *["move_absolute", "move_absolute", "move_relative", "move_led", "move_velocity", "move_velocity"] * 2,
    "move_additive", "move_waiting", "move_chain", "move_behind", "move_timed", "turn_softly", "jog", "cyclic_velocity",
    "torque", "cyclic_torque", "controller", "follow", "follow", "gear", "cam", "gear", "home", "extreme",
)  # fmt: skip
ALONG = (
    "superimposed",
    "phase",
    "gear_out",
    "halt_superimposed",
    "axis_override",
    "axis_override",
    "probe",
    "set_position",
)
STOPS = ("halt", "halt", "halt", "stop", "quick_stop", "disable", "coast")
GROUP_MOTIONS = (
    "move_linear",
    "move_linear",
    "move_softly",
    "move_joining",
    "move_path",
    "move_circular",
    "move_direct",
    "stream",
    "resume",
)
GROUP_STOPS = ("group_halt", "group_halt", "group_stop", "group_quick_stop", "group_disable")
PAIR_MOTIONS = (
    "pair_move_absolute",
    "pair_move_absolute",
    "pair_move_relative",
    "pair_move_velocity",
    "pair_move_velocity",
    "pair_set_position",
)
PAIR_STOPS = ("pair_halt", "pair_halt", "pair_stop", "pair_quick_stop", "pair_disable")
