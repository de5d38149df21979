"""Fault settings of a simulated module on RS485, and behaviour that the manual leaves open; may be changed at any time."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class LineDials:
    """Fault settings of one module on the line; those of the module itself are its ``ModuleDials``.

    ``silent``: so many requests (-1: all) are executed but not answered; ``deaf``: so many are not even executed.
    ``wrong_checksum``: so many answers have a wrong checksum. ``delay`` in s: of each answer. ``late``: by number of a request,
    from 0, the additional delay in s of its answer. ``exceptions``: by first address and whether it is a write, the exception code
    of all such requests. ``short``: so many answers to reads have one register too few.

    ``dead_in_idle``: position and velocity are 0 except in closed loop, as over CAN. ``keeps_target``: when it enters closed loop,
    the module moves to the last set-point, which no firmware should do. ``node_id_at_once``: a new node ID takes effect when it is
    written, otherwise with the restart. ``save_restarts``: saving restarts the module. ``number_hidden``: A1h cannot be read.
    ``clamps``: by address, the highest value that is stored.
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
