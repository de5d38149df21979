"""Axes under way, on a terminal: position, percent, and what is left, in a line that is drawn again and again."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import click

from axisbus import wait
from axisbus.cli.shared.axes_and_pairs import Mover, axes_of
from axisbus.errors import StaleError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.wording import printable

_REDRAW = 0.1  # seconds
_SLOWEST = 0.001  # of the way per second: below that nobody knows how long it will take


@dataclass(slots=True)
class MoverProgress:
    """A command of an axis or a pair under way; holds the longest distance that was left, which is all of the way."""

    mover: Mover
    handle: Handle
    whole: float = 0.0

    def text(self) -> str:
        """Return where the axis is and what is left; a homing has no end that is known before."""
        axis = self._axis
        try:
            where = f"{self.mover.name} {axis.position:.3f} {axis.unit}"
        except StaleError:
            return f"{self.mover.name} position unknown"
        left = axis.distance_to_go
        if not self.handle.busy or left is None:
            return where
        self.whole = max(self.whole, abs(left))
        share = 1.0 - abs(left) / self.whole if self.whole else 1.0
        return f"{where}, {share:.0%}, {abs(left):.3f} {axis.unit}{self._seconds(abs(left))} left"

    @property
    def _axis(self) -> Axis:
        """The axis, or that of a pair which tells where the beam is."""
        return axes_of(self.mover)[0]

    def _seconds(self, left: float) -> str:
        try:
            speed = abs(self._axis.velocity)
        except StaleError:
            return ""
        return f" and {left / speed:.1f} s" if speed > self.whole * _SLOWEST else ""


def follow(machine: Machine, ways: Sequence[MoverProgress]) -> None:
    """Wait until all have ended; on a terminal with a line that shows how far they are.

    Raises:
        ExceptionGroup: as ``wait``.
    """
    handles = [way.handle for way in ways]
    if is_terminal():
        try:
            while any(handle.busy for handle in handles):
                draw("; ".join(way.text() for way in ways))
                machine.sleep(_REDRAW)
        finally:
            draw("")
    wait(handles)


def is_terminal() -> bool:
    """Whether standard error is one, and so is looked at."""
    return sys.stderr.isatty()


def speed_text(mover: Mover) -> str:
    """Return where an axis or a beam is and how fast it goes, as far as that is known."""
    texts, axis = [], axes_of(mover)[0]
    for known, unit in (("position", axis.unit), ("velocity", f"{axis.unit}/s")):
        with suppress(StaleError):
            texts.append(f"{getattr(axis, known):.3f} {unit}")
    return f"{mover.name} {', '.join(texts) or 'position unknown'}"


def draw(text: str) -> None:
    """Draw a line over the one before, where standard error is a terminal."""
    if not is_terminal():
        return
    room = shutil.get_terminal_size().columns - 1
    with suppress(OSError):  # a terminal that is gone must not end a motion
        click.echo(f"\r{printable(text)[:room]}\x1b[K", err=True, nl=False)
