"""What a stand-in on RS485 is made to do wrong, or does where the manual is silent; turned at any time."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class LineDials:
    """Switches of one module on the line; those of the module itself are its ``ModuleDials``.

    ``silent``: for so many requests (-1: for all) there is no answer, though they are obeyed; ``deaf``: so many are not even
    obeyed. ``wrong_checksum``: so many answers end with another one. ``delay`` in s: of each answer. ``late``: by position of a
    request, from 0, the seconds by which its answer alone comes later. ``exceptions``: by first address and whether it is written,
    the exception code of all requests for it. ``short``: so many answers to reads have a register less than was asked for.

    ``dead_in_idle``: position and velocity are 0 but in closed loop, as over CAN. ``keeps_target``: entering closed loop the module
    goes to the set-point that was written before, as no firmware should. ``node_id_at_once``: a new one holds when it is written,
    else from the restart on. ``save_restarts``. ``number_hidden``: A1h cannot be read. ``clamps``: by address, the highest value
    that is kept.
    """

    silent: int = 0
    deaf: int = 0
    wrong_checksum: int = 0
    delay: float = 0.0
    late: dict[int, float] = field(default_factory=dict)
    exceptions: dict[tuple[int, bool], int] = field(default_factory=dict)
    short: int = 0
    dead_in_idle: bool = True
    keeps_target: bool = False
    node_id_at_once: bool = True
    save_restarts: bool = True
    number_hidden: bool = False
    clamps: dict[int, float] = field(default_factory=dict)
