"""The commands of the campaign, by name: for one axis, and for the group of all."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import NamedTuple

from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.coupling import Cam
from axisbus.machine.handle import Handle
from axisbus.machine.streaming.controller import AxisFeedback
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import Cell
from kit.plants import Ramp

STOPS = frozenset({"halt", "stop", "quick_stop", "disable"})  # done, they promise standstill
OVERRIDES = {"override", "axis_override", "cell_override"}
QUIET = (
    STOPS | OVERRIDES | {"coast", "enable", "release", "reset", "set_position", "set_square", "probe"}
)  # nothing moves by these
_LOOP = 5.0  # seconds of a controller
PLACES = frozenset(
    {"move_absolute", "move_near", "move_blended", "move_chain", "move_behind"}
)  # moves that can be blended
PATHS = frozenset({"follow", "follow_on"})  # those that come from the caller, however short their ramps


LOBE = Cam([(0.0, 0.0), (90.0, 30.0), (180.0, 0.0), (270.0, -20.0), (360.0, 0.0)], periodic=True)


class Order(NamedTuple):
    """How a command is given, with a number from -1 to 1, and its target: ``value * goal``, from the commanded position of the axis
    if ``relative`` (deg); None: no target that is known before.
    """

    give: Callable[[Cell, str, float], Handle]
    goal: float | None = None
    relative: bool = False


def _controller(cell: Cell, name: str, value: float) -> Handle:
    """A loop that follows a place; it fails where it gets lost, and after some seconds."""

    def loop(seen: AxisFeedback) -> float:
        if seen.position is None or (value < -0.7 and seen.position > 20.0) or cell.now > end:
            raise ValueError("lost sight of it")
        return 3.0 * (60.0 * value * math.sin(2.0 * seen.time) - seen.position)

    end = cell.now + _LOOP
    return cell[name].controller(loop).handle


def _torque_controller(cell: Cell, name: str, value: float) -> Handle:
    def loop(seen: AxisFeedback) -> float:
        if cell.now > end:
            raise ValueError("seen enough")
        return 0.3 * value - 0.002 * (seen.velocity or 0.0)

    end = cell.now + _LOOP
    return cell[name].controller(loop, output="torque", slope=5.0).handle


def demand_of(cell: Cell, name: str) -> float:
    """Where a trajectory has to begin, in the axis's unit."""
    snapshot = cell.core(name).snapshot()
    units = cell.core(name).parameters.units.position
    reference = cell.core(name).image.reference
    return units.to_units((reference or 0) - snapshot.origin)


def _trapezoid(cell: Cell, name: str, value: float) -> Handle:
    start = demand_of(cell, name)
    return cell[name].follow(TrapezoidalTrajectory(start, start + 200.0 * value, 100.0, 500.0))


def _master(cell: Cell, name: str) -> Axis:
    """The axis beside one."""
    names = [axis.name for axis in cell.machine]
    return cell[names[names.index(name) - 1]]


def _cam(cell: Cell, name: str, value: float) -> Handle:
    return cell[name].cam_in(_master(cell, name), LOBE, relative=True, slave_scaling=value)


def _probe(cell: Cell, name: str, value: float) -> Handle:
    """Of one edge or of all, with an edge in between, and cancelled after a second, whatever became of it."""
    handle = cell[name].probe(1 if value < 0.0 else 2, "both", continuous=abs(value) > 0.5)
    signal = cell.drive(name).touch_probe
    for after, level in ((abs(value), True), (abs(value) + 0.02, False)):
        cell.after(after, lambda level=level: signal.set_input(1 if value < 0.0 else 2, level))
    cell.after(1.0, handle.cancel)
    return handle


def _search(cell: Cell, name: str, value: float) -> Handle:
    """Towards a mark, or away from it."""
    cell.drive(name).touch_probe.put_mark(1, 30.0 * cell.scale_of(name), 60.0 * cell.scale_of(name))
    return cell[name].probe_move(150.0 * value, velocity=120.0)


def _blending(value: float) -> str:
    """One of the four modes, by the second digit of a number."""
    modes = ("low", "previous", "next", "high")
    return f"blending_{modes[round(abs(value) * 100) % len(modes)]}"


def _chain(cell: Cell, name: str, value: float) -> Handle:
    """Three moves in a row, of which the last may go back; the first is blended with the running motion, or begins."""
    axis, mode = cell[name], _blending(value)
    axis.move_relative(40.0 * value, velocity=60.0, buffer=mode)
    axis.move_relative(15.0 * value, velocity=140.0, acceleration=900.0, buffer=mode)
    back = -1.0 if value < -0.5 else 1.0
    return axis.move_relative(80.0 * back * value, velocity=90.0, buffer=mode)


def _behind(cell: Cell, name: str, value: float) -> Handle:
    """A move of the drive, and one that is blended while it moves, in its direction or back."""
    axis = cell[name]
    axis.move_relative(60.0 * value, velocity=80.0)
    on = 1.0 if abs(value) < 0.7 else -1.0
    return axis.move_additive(50.0 * on * value, velocity=40.0 + 100.0 * abs(value), buffer=_blending(value))


ORDERS: Mapping[str, Order] = {
    "enable": Order(lambda cell, name, _: cell[name].enable()),
    "disable": Order(lambda cell, name, _: cell[name].disable()),
    "coast": Order(lambda cell, name, _: cell[name].disable(coast=True)),
    "reset": Order(lambda cell, name, _: cell[name].reset()),
    "halt": Order(lambda cell, name, _: cell[name].halt()),
    "stop": Order(lambda cell, name, _: cell[name].stop()),
    "release": Order(lambda cell, name, _: cell[name].release()),
    "quick_stop": Order(lambda cell, name, _: cell[name].quick_stop()),
    "move_relative": Order(
        lambda cell, name, value: cell[name].move_relative(300.0 * value, velocity=100.0),
        300.0,
        relative=True,
    ),
    "move_additive": Order(lambda cell, name, value: cell[name].move_additive(100.0 * value, velocity=60.0)),
    "move_absolute": Order(
        lambda cell, name, value: cell[name].move_absolute(200.0 * value, velocity=150.0), 200.0
    ),
    "move_near": Order(
        lambda cell, name, value: cell[name].move_absolute(20.0 * value, velocity=150.0), 20.0
    ),
    "move_velocity": Order(lambda cell, name, value: cell[name].move_velocity(100.0 * value)),
    "move_fast": Order(lambda cell, name, value: cell[name].move_velocity(330.0 * value, acceleration=900.0)),
    "jog": Order(lambda cell, name, value: cell[name].jog(80.0 * value)),
    "torque": Order(lambda cell, name, value: cell[name].torque_control(0.3 * value)),
    "cyclic_velocity": Order(lambda cell, name, value: cell[name].cyclic_velocity(150.0 * value)),
    "cyclic_torque": Order(lambda cell, name, value: cell[name].cyclic_torque(0.3 * value, slope=5.0)),
    "controller": Order(_controller),
    "torque controller": Order(_torque_controller),
    "home": Order(lambda cell, name, _: cell[name].home()),
    "set_position": Order(lambda cell, name, value: cell[name].set_position(100.0 * value)),
    "move_waiting": Order(
        lambda cell, name, value: cell[name].move_absolute(60.0 * value, velocity=90.0, buffer=True)
    ),
    "move_blended": Order(
        lambda cell, name, value: cell[name].move_absolute(
            100.0 * value, velocity=50.0 + 100.0 * abs(value), buffer=_blending(value)
        ),
        100.0,
    ),
    "move_chain": Order(_chain),
    "move_behind": Order(_behind),
    "gear": Order(lambda cell, name, value: cell[name].gear_in(_master(cell, name), 1.5 * value)),
    "phase": Order(
        lambda cell, name, value: cell[name].phasing_relative(20.0 * value, velocity=30.0, acceleration=200.0)
    ),
    "superimposed": Order(
        lambda cell, name, value: cell[name].move_superimposed(
            60.0 * value, velocity=20.0 + 200.0 * abs(value)
        )
    ),
    "halt_superimposed": Order(lambda cell, name, _: cell[name].halt_superimposed()),
    "cam": Order(_cam),
    "gear_out": Order(lambda cell, name, _: cell[name].gear_out()),
    "move_softly": Order(
        lambda cell, name, value: cell[name].move_absolute(
            200.0 * value, velocity=150.0, jerk=6000.0 + 30000.0 * abs(value)
        ),
        200.0,
    ),
    "turn_softly": Order(
        lambda cell, name, value: cell[name].move_velocity(150.0 * value, jerk=6000.0 + 30000.0 * abs(value))
    ),
    "blend_softly": Order(
        lambda cell, name, value: cell[name].move_absolute(
            100.0 * value, velocity=50.0 + 100.0 * abs(value), jerk=8000.0, buffer=_blending(value)
        ),
        100.0,
    ),
    "axis_override": Order(lambda cell, name, value: cell[name].set_override(_override(value))),
    "probe": Order(_probe),
    "move_probing": Order(_search),
    "follow": Order(_trapezoid, 200.0, relative=True),
    "follow_on": Order(lambda cell, name, _: cell[name].follow(Ramp(demand_of(cell, name)))),
}


def _override(value: float) -> float:
    """Each fourth holds; the others are from 0.1 to 1.5."""
    return 0.0 if value < -0.5 else 0.1 + 1.4 * abs(value)


def _line(cell: Cell, value: float) -> tuple[float, ...]:
    return (200.0 * value, 150.0, -40.0 * value)[: len(cell.machine)]


def _path(cell: Cell, value: float) -> list[tuple[float, ...]]:
    """Out and across itself, and to the end of the line."""
    end = _line(cell, value)
    return [tuple(0.5 * place + 20.0 for place in end), tuple(20.0 - place for place in end[::-1]), end]


def _stream(cell: Cell, value: float) -> Handle:
    """As many points as find room, at up to 130 deg/s and 430 deg/s²: ended, or left to run out."""
    starts = [demand_of(cell, axis.name) for axis in cell.machine]
    points = _group(cell).stream(
        period=0.01, buffer=0.5 + abs(value), on_underrun="error" if value < 0.0 else "hold"
    )
    refused = False
    for number in range(400):
        way = 40.0 * value * (1.0 - math.cos(3.3 * 0.01 * number))
        try:
            if not points.try_push([start + way / (1 + axis) for axis, start in enumerate(starts)]):
                break
        except AxisbusError:  # no more points come, and it must not be waited for them
            refused = True
            break
    if value >= 0.0 or refused:
        points.finish()
    return points.handle


def _joining(cell: Cell, value: float) -> Handle:
    return _group(cell).move_linear(
        _line(cell, value), velocity=60.0 + 80.0 * abs(value), buffer=_blending(value), blend=5.0
    )


def _growing(cell: Cell, value: float) -> Handle:
    """A path, and points that are added to it at once, and later."""
    group, points = _group(cell), _path(cell, value)
    path = group.move_path(points[:2], velocity=120.0, blend=4.0, more=value > 0.0)
    cell.after(0.1 + 0.5 * abs(value), lambda: _try(lambda: group.extend_path(points[:1], blend=4.0)))
    with suppress(AxisbusError):  # refused: it continues to the previous target
        return group.extend_path(points[2:], blend=4.0)
    return path


def _try(give: Callable[[], object]) -> None:
    with suppress(AxisbusError):
        give()


def _group(cell: Cell):
    return cell.machine.group(*(axis.name for axis in cell.machine))


GROUP: Mapping[str, Callable[[Cell, float], Handle]] = {
    "group_enable": lambda cell, _: _group(cell).enable(),
    "group_disable": lambda cell, _: _group(cell).disable(),
    "group_halt": lambda cell, _: _group(cell).halt(),
    "group_stop": lambda cell, _: _group(cell).stop(),
    "group_release": lambda cell, _: _group(cell).release(),
    "group_reset": lambda cell, _: _group(cell).reset(),
    "group_quick_stop": lambda cell, _: _group(cell).quick_stop(),
    "move_linear": lambda cell, value: _group(cell).move_linear(
        _line(cell, value), velocity=100.0, jerk=4000.0 if value > 0.5 else None
    ),
    "move_path": lambda cell, value: _group(cell).move_path(
        _path(cell, value), velocity=150.0, blend=max(0.0, 10.0 * value)
    ),
    "move_circular": lambda cell, value: _group(cell).move_circular(
        _line(cell, value), via=_path(cell, value)[1], velocity=150.0
    ),
    "move_joining": _joining,
    "move_growing": _growing,
    "extend_path": lambda cell, value: _group(cell).extend_path(
        [_line(cell, value)], velocity=80.0, blend=6.0
    ),
    "stream": _stream,
    "override": lambda cell, value: _group(cell).set_override(1.0 + 0.5 * value),
    "cell_override": lambda cell, value: cell.machine.set_override(_override(value)),
    "resume": lambda cell, _: _group(cell).resume(),
    "move_direct": lambda cell, value: _group(cell).move_direct(_line(cell, value), velocity=100.0),
}

MOTIONS = (
    "move_relative",
    "move_absolute",
    "move_near",
    "move_softly",
    "turn_softly",
    "turn_softly",
    "blend_softly",
    "move_velocity",
    "move_fast",
    "move_additive",
    "move_waiting",
    "move_blended",
    "move_blended",
    "move_chain",
    "move_chain",
    "move_behind",
    "move_behind",
    "move_probing",
    "probe",
    "gear",
    "phase",
    "cam",
    "gear_out",
    "follow",
    "follow_on",
    "jog",
    "torque",
    "cyclic_velocity",
    "cyclic_velocity",
    "cyclic_torque",
    "controller",
    "torque controller",
    "home",
)
AXIS_STOPS = ("halt", "halt", "stop", "stop", "quick_stop", "disable", "coast")
GROUP_MOTIONS = (
    "move_linear",
    "stream",
    "stream",
    "move_path",
    "move_path",
    "move_circular",
    "move_direct",
    "move_joining",
    "move_joining",
    "move_growing",
    "extend_path",
    "resume",
)
GROUP_STOPS = ("group_halt", "group_stop", "group_quick_stop", "group_disable")
