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
        f"{name}: the group is on no path to which points could be added",
        observed="its last path has ended, or something else is under way",
        remedy="begin a new one from where the axes stand: group.move_path(points, velocity=..., blend=...)",
    )


def not_a_line(name: str) -> StateError:
    """Return the error if the active command cannot be blended into the requested one."""
    return StateError(
        f"{name}: what the group does cannot be passed into the next without a stop",
        observed="blending goes on from a line or a path of the same axes, behind which nothing waits",
        remedy='let it begin from rest, with buffer="buffered", or wait for what is before it',
    )


def require_joint(line: PathMotion, following: PathContinuation, name: str) -> None:
    """Raise StateError if ``following`` cannot be appended to ``line``, or if too many commands or segments are ahead."""
    if line.commands >= COMMANDS or line.pieces + len(following.way.pieces) > MOST:
        raise StateError(
            f"{name}: too much is ahead of the axes already",
            observed=f"{counted(line.commands, 'command')}, pieces of the way: {line.pieces}; allowed are {COMMANDS} and {MOST}",
            remedy="wait for some of the handles before giving more",
        )
    why = line.why_not(following)
    if why:
        raise StateError(
            f"{name}: what the group does cannot be passed into the next without a stop",
            observed=why,
            remedy='let it begin from rest, with buffer="buffered"',
        )
