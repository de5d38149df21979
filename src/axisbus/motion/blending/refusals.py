"""Errors of a group motion that cannot be appended to the active motion, with their remedies."""

from __future__ import annotations

from axisbus.errors import StateError
from axisbus.motion.blending.append_path import PathContinuation
from axisbus.motion.group.path_motion import MOST, PathMotion
from axisbus.wording import counted

COMMANDS = 100  # that share one motion


def no_path_to_extend(name: str) -> StateError:
    """Return the error if points cannot be added."""
    return StateError(
        f"{name}: the group follows no path to which points could be added",
        observed="its last path has ended, or another command runs",
        remedy="begin a new one at the present position of the axes: group.move_path(points, velocity=..., blend=...)",
    )


def not_a_line(name: str) -> StateError:
    """Return the error if the active command cannot be blended into the requested one."""
    return StateError(
        f"{name}: the present motion of the group cannot be blended with the next one",
        observed="only a line or a path of the same axes can be blended, and only if no other command waits behind it",
        remedy='let it begin at standstill, with buffer="buffered", or wait for the motion before it',
    )


def require_joint(line: PathMotion, following: PathContinuation, name: str) -> None:
    """Raise StateError if ``following`` cannot be appended to ``line``, or if too many commands or segments are ahead."""
    if line.commands >= COMMANDS or line.pieces + len(following.way.pieces) > MOST:
        raise StateError(
            f"{name}: too many commands are blended into this motion already",
            observed=(
                f"{counted(line.commands, 'command')}, segments of the path: {line.pieces}; allowed are {COMMANDS} and "
                f"{MOST}"
            ),
            remedy="wait for some of their handles before you give more commands",
        )
    why = line.why_not(following)
    if why:
        raise StateError(
            f"{name}: the present motion of the group cannot be blended with the next one",
            observed=why,
            remedy='let it begin at standstill, with buffer="buffered"',
        )
