"""Axes that a command enables and moves: at its end they are at standstill, and those that were disabled are disabled again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from axisbus import wait
from axisbus.cia402.state import PowerState
from axisbus.cli.shared.attach_or_open import machine_of, take_option
from axisbus.cli.shared.axes_and_pairs import Mover, all_axes, axes_of
from axisbus.cli.shared.common import echo, say
from axisbus.cli.shared.options import beside_option, packed, together
from axisbus.cli.shared.progress import MoverProgress, follow
from axisbus.cli.shared.recordings import record_option
from axisbus.errors import (
    AxisbusError,
    BusError,
    NodeStateError,
    OwnershipError,
    StateError,
    one_line,
    with_alarm,
)
from axisbus.link import StopResult
from axisbus.machine.axis import Axis
from axisbus.machine.gantry import Gantry
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState

_FAULTS = frozenset({PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE})
_OFF = frozenset({AxisState.DISABLED, AxisState.ERRORSTOP})


class MotionOptions(NamedTuple):
    """The options of each command that moves axes: the file of its recording, and how it opens or joins the machine."""

    record: Path | None
    beside: bool
    take: bool


# --record, --beside and --take; a command gets them together as ``how``.
motion_options = together(record_option, beside_option, take_option, packed(MotionOptions, "how"))


@contextmanager
def commanded(
    cell: Path, names: Sequence[str], how: MotionOptions, before: Callable[[], object] = lambda: None
) -> Iterator[tuple[Machine, list[Axis]]]:
    """Give the block control of a machine and some of its axes; see ``machine_of``.

    At the end the axes are as before. Closing a machine that the command itself has opened disables all axes. In a machine that it
    has joined, the axes that were disabled before are disabled again, also after Ctrl-C or an error, when all motion has halted.
    """
    found_off: list[str] = []
    try:
        with machine_of(cell, command=True, take=how.take, beside=how.beside, before=before) as machine:
            axes = [machine[name] for name in names]
            if machine.is_attached:
                found_off = [axis.name for axis in axes if axis.state is AxisState.DISABLED]
            yield machine, axes
            wait([machine[name].disable() for name in found_off])
            _report_still_enabled(machine)
    except BaseException:
        _disable_again(cell, found_off)
        raise


def _report_still_enabled(machine: Machine) -> None:
    all_off = not machine.is_attached or all(axis.state is AxisState.DISABLED for axis in machine)
    say(
        "all axes are at standstill and disabled"
        if all_off
        else "the axes are at standstill; those that were enabled before are still enabled"
    )


def _disable_again(cell: Path, names: Sequence[str]) -> None:
    """Disable axes of a machine that this command has already left; report those that cannot be disabled."""
    try:
        still_enabled = _still_on(cell, names)
        if not still_enabled:
            return
        machine = Machine.try_attach(cell, command=True)
        if machine is not None:
            with machine:
                wait([machine[name].disable() for name in still_enabled])
        echo(f"disabled again: {', '.join(still_enabled)}", err=True)
    except OwnershipError as error:
        echo(f"left enabled: {', '.join(still_enabled)}; {error.observed}", err=True)
    except (AxisbusError, ExceptionGroup) as error:
        _say_unknown(names, one_line(error))
    except BaseException:  # a further Ctrl-C, or SIGTERM
        _say_unknown(names, "interrupted")
        raise


def _say_unknown(names: Sequence[str], why: str) -> None:
    echo(f"check {', '.join(names)}: it is not known whether it is enabled ({why})", err=True)


def _still_on(cell: Path, names: Sequence[str]) -> list[str]:
    machine = Machine.try_attach(cell) if names else None
    if machine is None:
        return []
    with machine:
        return [name for name in names if machine[name].state not in _OFF]


def enable(chosen: Sequence[Mover]) -> None:
    """Enable axes and pairs, with a progress line: all, or none if one of them is in fault.

    Raises:
        StateError: one is in fault; none was enabled.
    """
    for axis in all_axes(chosen):
        if axis.state is AxisState.ERRORSTOP or axis.snapshot.power_state in _FAULTS:
            message = f"{axis.name}: the axis is in fault; no axis was enabled"
            if isinstance(axis.error, BusError):  # a reset alone does not recover its node
                raise NodeStateError(message, observed=axis.error.message, remedy=axis.error.remedy)
            raise StateError(
                message,
                observed="" if axis.error is None else with_alarm(axis.error.message, axis.error),
                remedy="read why (axis.error), then reset it: axis.reset()",
            )
    wait([each.enable() for each in chosen])
    say(f"enabled: {', '.join(each.name for each in chosen)}")


def home(machine: Machine, chosen: Sequence[Mover]) -> None:
    """Home axes and pairs, with progress lines."""
    follow(machine, [MoverProgress(each, each.home()) for each in chosen])
    for each in chosen:
        say_position(each, "homed, at")


def say_position(mover: Mover, what: str) -> None:
    """Print the position of an axis or pair, if it is known, and the skew of a pair."""
    known = all(axis.snapshot.position is not None for axis in axes_of(mover))
    where = f"{mover.position:.4f} {mover.unit}" if known else "an unknown position"
    if known and isinstance(mover, Gantry) and mover.homed:
        where += f", {abs(mover.skew):.4f} {mover.unit} out of square"
    say(f"{mover.name}: {what} {where}")


def say_stopped(results: Iterable[StopResult]) -> None:
    """Print the state of axes after a stop."""
    for each in results:
        say(f"{each.axis}: {each.text}")


def say_state(mover: Mover) -> None:
    """Print the state of an axis, or of both axes of a pair."""
    for axis in axes_of(mover):
        say(f"{axis.name}: {axis.state.value}")
