"""Carry out authorised requests of pages as calls of the library; nothing here blocks."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import TypedDict, cast

from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import ArgumentError, AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import Status
from axisbus.web.commands.authorize import PageAction
from axisbus.web.commands.verbs import PageVerb


class _Ramps(TypedDict, total=False):
    velocity: float
    acceleration: float


def _ramps(values: Mapping[str, float], *names: str) -> _Ramps:
    return cast(_Ramps, {name: values[name] for name in names if name in values})


def _moved(axis: Axis, values: Mapping[str, float]) -> Handle:
    return axis.move_absolute(values["position"], **_ramps(values, "velocity", "acceleration"))


def _stepped(axis: Axis, values: Mapping[str, float]) -> Handle:
    return axis.move_relative(values["distance"], **_ramps(values, "velocity", "acceleration"))


def _turned(axis: Axis, values: Mapping[str, float]) -> Handle:
    return axis.move_velocity(values["velocity"], acceleration=values.get("acceleration"))


def _pressed(axis: Axis, values: Mapping[str, float]) -> Handle:
    return axis.torque_control(values["torque"], slope=values.get("slope"))


_CALLS: dict[PageVerb, Callable[[Axis, Mapping[str, float]], Handle]] = {
    PageVerb.ENABLE: lambda axis, _: axis.enable(),
    PageVerb.DISABLE: lambda axis, _: axis.disable(),
    PageVerb.RESET: lambda axis, _: axis.reset(),
    PageVerb.RELEASE: lambda axis, _: axis.release(),
    PageVerb.HOME: lambda axis, _: axis.home(),
    PageVerb.MOVE_ABSOLUTE: _moved,
    PageVerb.MOVE_RELATIVE: _stepped,
    PageVerb.MOVE_VELOCITY: _turned,
    PageVerb.TORQUE_CONTROL: _pressed,
}


_STOPS = {
    PageVerb.QUICK_STOP_ALL: "quick_stop",
    PageVerb.HALT_ALL: "halt",
    PageVerb.QUICK_STOP: "quick_stop",
    PageVerb.HALT: "halt",
}


def perform(machine: Machine, action: PageAction) -> list[Handle]:
    """Give the commands of an action that is no stop, as ``stop``."""
    call = _CALLS[action.verb]
    return _each(action, lambda name: call(machine[name], action.values))


def stop(stops: MergedStops, action: PageAction) -> list[Handle]:
    """Give the stops of an action; if one is refused at the call, the others are given nevertheless.

    Raises:
        AxisbusError: as the calls of the library (several: the first of them).
    """
    return _each(action, lambda name: stops.send(name, _STOPS[action.verb]))


def _each(action: PageAction, send: Callable[[str], Handle]) -> list[Handle]:
    handles, errors = list[Handle](), list[Exception]()
    for name in action.axes:
        try:
            handles.append(send(name))
        except Exception as error:  # noqa: BLE001  # the other axes have to be stopped in any case
            errors.append(error)
    if errors:
        raise errors[0]
    return handles


def take_command(machine: Machine) -> Handle:
    """Take control of the machine in a thread of its own: all moving axes halt first, which may take long."""
    handle = Handle("take_command()", machine.session.waiter)
    threading.Thread(target=_take_command, args=(machine, handle), name="axisbus-take", daemon=True).start()
    return handle


def _take_command(machine: Machine, handle: Handle) -> None:
    try:
        machine.take_control()
    except AxisbusError as error:
        handle._finish(Status.ERROR, error)
    else:
        handle._finish(Status.DONE)


def direction_of(action: PageAction) -> float:
    """Return the direction of a jog, 1 or -1.

    Raises:
        ArgumentError: the direction is 0 or not a number.
    """
    direction = action.values["direction"]
    if not abs(direction) > 0:
        raise ArgumentError(
            f"{action.axes[0]}.jog(): the direction is not valid", remedy="give a direction of 1 or -1"
        )
    return math.copysign(1.0, direction)


def jog(machine: Machine, action: PageAction, *, renews: bool) -> Handle:
    """Jog an axis for 0.2 s, at the velocity of the page or the default of the cell file; ``renews`` as of ``Axis.jog``.

    Raises:
        ArgumentError: neither velocity is known, or as ``Axis.jog``.
    """
    name = action.axes[0]
    speed = action.values.get("velocity", machine.cell.axes[name].defaults.velocity)
    if speed is None:
        raise ArgumentError(
            f"{name}.jog(): no velocity is given",
            remedy=f"give a velocity, or velocity in [axes.{name}.defaults] of the cell file",
        )
    acceleration = action.values.get("acceleration")
    return machine[name].jog(
        direction_of(action) * abs(speed), acceleration=acceleration, continue_only=renews
    )
