"""Show running motions on a terminal: position, percentage, and remaining time, in a line that is redrawn."""

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
_SLOWEST = 0.001  # fraction of the path per second: if slower, the remaining time is unknown


@dataclass(slots=True)
class MoverProgress:
    """A running command of an axis or a pair; holds the longest remaining distance, which is the whole distance."""

    mover: Mover
    handle: Handle
    longest: float = 0.0

    def text(self) -> str:
        """Return the position and the remainder; the end of a homing is not known in advance."""
        axis = self._axis
        try:
            where = f"{self.mover.name} {axis.position:.3f} {axis.unit}"
        except StaleError:
            return f"{self.mover.name} position unknown"
        remaining = axis.distance_to_go
        if not self.handle.busy or remaining is None:
            return where
        self.longest = max(self.longest, abs(remaining))
        share = 1.0 - abs(remaining) / self.longest if self.longest else 1.0
        return f"{where}, {share:.0%}, {abs(remaining):.3f} {axis.unit}{self._seconds(abs(remaining))} left"

    @property
    def _axis(self) -> Axis:
        """The axis, or the axis of a pair that defines the position of the beam."""
        return axes_of(self.mover)[0]

    def _seconds(self, remaining: float) -> str:
        try:
            speed = abs(self._axis.velocity)
        except StaleError:
            return ""
        return f" and {remaining / speed:.1f} s" if speed > self.longest * _SLOWEST else ""


def follow(machine: Machine, movers: Sequence[MoverProgress], hold_time: float | None = None) -> None:
    """Wait until all have ended; on a terminal, show their progress in a line.

    ``hold_time``: the seconds of ``Machine.hold_to_run``, which is renewed meanwhile.

    Raises:
        ExceptionGroup: as ``wait``.
    """
    handles = [each.handle for each in movers]
    if hold_time is not None or is_terminal():
        try:
            while any(handle.busy for handle in handles):
                if hold_time is not None:
                    machine.hold_to_run(hold_time)
                draw("; ".join(each.text() for each in movers))
                machine.sleep(_REDRAW)
        finally:
            draw("")
    wait(handles)


def is_terminal() -> bool:
    """Whether standard error is a terminal."""
    return sys.stderr.isatty()


def speed_text(mover: Mover) -> str:
    """Return position and velocity of an axis or a pair, as far as known."""
    texts, axis = [], axes_of(mover)[0]
    for known, unit in (("position", axis.unit), ("velocity", f"{axis.unit}/s")):
        with suppress(StaleError):
            texts.append(f"{getattr(axis, known):.3f} {unit}")
    return f"{mover.name} {', '.join(texts) or 'position unknown'}"


def draw(text: str) -> None:
    """Redraw the progress line, if standard error is a terminal."""
    if not is_terminal():
        return
    room = shutil.get_terminal_size().columns - 1
    with suppress(OSError):  # the loss of the terminal must not end a motion
        click.echo(f"\r{printable(text)[:room]}\x1b[K", err=True, nl=False)
