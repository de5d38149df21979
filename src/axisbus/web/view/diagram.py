"""The state machine of CiA 402 (figure of part 2, 7.2) as a drawing; the page highlights the present state."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia402.state import PowerState

_WIDTH, _HEIGHT = 156, 34


class Box(NamedTuple):
    """The middle of a state in the drawing."""

    x: int
    y: int


_S = PowerState
# As the standard draws it: power off above, power on below, faults at the right.
BOXES = {
    _S.NOT_READY_TO_SWITCH_ON: Box(90, 30),
    _S.SWITCH_ON_DISABLED: Box(90, 100),
    _S.READY_TO_SWITCH_ON: Box(90, 170),
    _S.SWITCHED_ON: Box(90, 240),
    _S.OPERATION_ENABLED: Box(90, 310),
    _S.QUICK_STOP_ACTIVE: Box(330, 310),
    _S.FAULT_REACTION_ACTIVE: Box(330, 170),
    _S.FAULT: Box(330, 100),
}
# Paths of the arrows, with the location of their number and the transition that they represent.
_ARROWS = (
    ("M90 47V81", 104, 68, "1"),
    ("M74 117V151", 60, 138, "2"),
    ("M106 153V119", 120, 138, "7"),
    ("M74 187V221", 60, 208, "3"),
    ("M106 223V189", 120, 208, "6"),
    ("M74 257V291", 60, 278, "4"),
    ("M106 293V259", 120, 278, "5"),
    ("M168 304H250", 210, 298, "11"),
    ("M252 318H170", 210, 334, "16"),
    ("M300 293V232Q300 205 230 205H196V112H170", 288, 262, "12"),
    ("M330 153V119", 344, 138, "14"),
    ("M252 94H170", 210, 88, "15"),
    ("M420 205V170H410", 424, 222, "13"),
)
LABEL = "State machine of the drive by CiA 402; the present state is highlighted"


def svg(number: int = 0) -> str:
    """Return the drawing; each state is a group with the attribute ``data-power`` and its name.

    ``number`` distinguishes several drawings on a page: an arrow cannot use the arrow tip of a drawing that is hidden.
    """
    arrows = "".join(
        f'<path class="arrow" d="{path}" marker-end="url(#tip{number})"/><text class="number" x="{x}" y="{y}">{transition}</text>'
        for path, x, y, transition in _ARROWS
    )
    return (
        f'<svg class="diagram" viewBox="0 0 440 340" role="img" aria-label="{LABEL}">'
        f'<defs><marker id="tip{number}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path class="tip" d="M0 0L8 4L0 8z"/></marker></defs>{arrows}{"".join(map(_state, BOXES))}</svg>'
    )


def _state(state: PowerState) -> str:
    x, y = BOXES[state]
    return (
        f'<g class="power" data-power="{state.value}"><rect x="{x - _WIDTH // 2}" y="{y - _HEIGHT // 2}" width="{_WIDTH}" '
        f'height="{_HEIGHT}" rx="6"/><text x="{x}" y="{y + 4}">{state.value}</text></g>'
    )
