"""Every way of stopping, from every mode, on plants that resist: after a stop that is done the axis stays at standstill."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import pytest

from axisbus.errors import AxisbusError, Interrupted
from axisbus.machine.handle import Handle
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.plant_probe import PlantMoves
from kit.plants import MOTIONS, PLANTS, cell_on, jam, set_in_motion

LONGEST = 15.0  # seconds: all steps of the stop sequence, and some
STAYS = 2.0  # seconds for which a stop that is done must hold
WAY, SPEED = 1.0, 10.0  # deg and deg/s that are no leap: an axis that rings, or the last of a lag

# Texts of an error that does not promise standstill.
NOT_CONFIRMED = ("MOVING", "could not be confirmed", "NOT CONFIRMED")
# Texts of an error about a stop by a later step.
NEXT_RUNG = (
    "harder stop",
    "could not be switched off",
    "did not execute the quick stop",
    "by itself",
    "without a command",
    "ErrorStop",
)


class Ending(NamedTuple):
    """The result of a stop as the master reports it: done, or the error."""

    errors: tuple[AxisbusError, ...]

    @property
    def text(self) -> str:
        return "\n".join(map(str, self.errors))

    @property
    def promises(self) -> bool:
        """Whether standstill is reported."""
        return not any(words in self.text for words in NOT_CONFIRMED)


# -- the ways of stopping: each lets time pass until it has come to its end ---------------------------------------------------


def of_handle(cell: Cell, handle: Handle) -> Ending:
    error = cell.end_of(handle, LONGEST)
    return Ending(() if error is None else (error,))


def of_close(leave: Callable[[], None]) -> Ending:
    try:
        leave()
    except AxisbusError as error:
        return Ending((error,))
    except ExceptionGroup as group:
        return Ending(tuple(_leaves(group)))
    return Ending(())


def _leaves(error: Exception) -> list[AxisbusError]:
    if isinstance(error, ExceptionGroup):
        return [leaf for one in error.exceptions for leaf in _leaves(one)]
    assert isinstance(error, AxisbusError)
    return [error]


def with_exit(cell: Cell) -> None:
    with cell.machine:
        pass


def with_exception(cell: Cell) -> None:
    """Errors while stopping are in the notes of the exception that ended the block."""
    try:
        with cell.machine:
            _ = 1 / 0
    except ZeroDivisionError as error:
        notes = getattr(error, "__notes__", [])
        if notes:
            raise AxisbusError("\n".join(notes)) from error


def by_ctrl_c(cell: Cell) -> Ending:
    return Ending(tuple(cell.ctrl_c(LONGEST)))


def of_policy(cell: Cell) -> Ending:
    """A stop of the policy has no handle: its end is the state that follows, or the error that stays."""
    cell.until(lambda: cell.core().stop_sequence is None and cell.core().activity is None, LONGEST)
    error = cell.x.error
    if error is None:
        assert cell.x.state in (AxisState.STANDSTILL, AxisState.DISABLED), cell.x.state
        return Ending(())
    return Ending((error,))


def by_lost_node(cell: Cell) -> Ending:
    """The node of another axis dies: the policy stops this one."""
    cell.device("y").dials.dead = True
    cell.run(0.5)
    return of_policy(cell)


def by_death(cell: Cell) -> Ending:
    """Its own node dies: the master does not see it any more, and the drive's own watchdog stops it."""
    cell.device().dials.dead = True
    cell.run(5.0)
    assert cell.x.error is not None
    return Ending((cell.x.error,))


def by_fault(cell: Cell) -> Ending:
    cell.drive().fault(0x2310)
    cell.run(5.0)  # the fault is reported at once, while the drive's own reaction still brakes
    return of_policy(cell)


def by_limit(cell: Cell) -> Ending:
    """It runs into its position limit: cell files of this scenario have it at 300 deg."""
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, LONGEST)
    return of_policy(cell)


WAYS: Mapping[str, Callable[[Cell], Ending]] = {
    "halt": lambda cell: of_handle(cell, cell.x.halt()),
    "stop": lambda cell: of_handle(cell, cell.x.stop()),
    "quick_stop": lambda cell: of_handle(cell, cell.x.quick_stop()),
    "disable": lambda cell: of_handle(cell, cell.x.disable()),
    "close": lambda cell: of_close(cell.machine.close),
    "with-exit": lambda cell: of_close(lambda: with_exit(cell)),
    "exception": lambda cell: of_close(lambda: with_exception(cell)),
    "ctrl-c": by_ctrl_c,
    "lost-node": by_lost_node,
    "its-own-node-dies": by_death,
    "fault": by_fault,
    "limit": by_limit,
}

# -- invariants ----------------------------------------------------------------------------------------------------------


def must_keep_its_promise(cell: Cell, ending: Ending, *, jammed: bool) -> None:
    """An axis reported at standstill stays there, and does not jump when a jam is removed; any other axis is reported as moving."""
    if not ending.promises:
        return
    begin = cell.moment()
    if cell.speed() > SPEED:
        raise PlantMoves(f"said to stand ({ending.text or 'done'}): {cell.told()}")
    cell.run(STAYS)
    cell.must_not_leap(since=begin, way=WAY, speed=SPEED)
    if jammed:
        freed = cell.free()
        cell.run(STAYS)
        cell.must_not_leap(since=freed, way=WAY, speed=SPEED)


def must_be_clear(ending: Ending) -> None:
    for error in ending.errors:
        assert not isinstance(error, Interrupted), f"a stop ended as interrupted: {error}"
        assert error.remedy or "\n" in str(error), f"no remedy: {error}"


def has_cell(plant: str, mode: str, way: str) -> bool:
    """A move beyond a limit is refused at the call, a homing knows no limits yet, and a jammed axis does not come to one."""
    return way != "limit" or (mode in ("pv", "csp", "csv", "tq", "cst") and PLANTS[plant].jams is None)


MATRIX = [
    pytest.param(plant, mode, way, id=f"{plant}-{mode}-{way}")
    for plant in PLANTS
    for mode in MOTIONS
    for way in WAYS
    if has_cell(plant, mode, way)
]


@pytest.mark.parametrize(("plant", "mode", "way"), MATRIX)
def test_after_a_completed_stop_the_axis_stays_at_standstill(scenario, plant, mode, way):
    must_stay_at_standstill(scenario, plant, mode, way)


@pytest.mark.parametrize(("plant", "mode", "way"), MATRIX[::19])  # each plant, mode and way occurs
def test_after_one_of_these_stops_the_axis_stays_at_standstill(scenario, plant, mode, way):
    must_stay_at_standstill(scenario, plant, mode, way)


def must_stay_at_standstill(scenario, plant, mode, way):
    names = "xy" if way == "lost-node" else "x"
    limits = "position_limits = [-3000.0, 300.0]" if way == "limit" else ""
    cell = cell_on(scenario, PLANTS[plant], names, search=mode == "hm", limits=limits)
    set_in_motion(cell, mode, "x")
    jams = PLANTS[plant].jams
    if jams is not None:
        cell.after(max(0.0, -jams), lambda: jam(cell, PLANTS[plant]))
        cell.run(max(0.0, jams))
    ending = WAYS[way](cell)
    must_be_clear(ending)
    must_keep_its_promise(cell, ending, jammed=jams is not None)
