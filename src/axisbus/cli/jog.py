"""``axisbus jog``: move an axis while an arrow key is held."""

from __future__ import annotations

import math
import os
import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path

import click

from axisbus.check.run import checked
from axisbus.cli.shared.axes_and_pairs import require_no_pair
from axisbus.cli.shared.common import echo
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import MotionOptions, commanded, enable, motion_options, say_position
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.progress import draw, speed_text
from axisbus.cli.shared.recordings import recorded
from axisbus.errors import Interrupted, Stopped, with_alarm
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from axisbus.machine.handle import Handle
from axisbus.motion.states import AxisState
from axisbus.system.terminal import key_by_key

_POLL_PERIOD = 0.05  # seconds between two readings of the keys: a jog lasts 0.2 s
_REPEAT_TIME = 0.2  # seconds: a key that is repeated sooner is held
_RELEASE_TIME = 0.6  # seconds without a key after which it counts as released: terminals repeat keys sooner


# -- Read single keys from a terminal, without echo and without waiting for a line -------------------------------------


class TerminalKey(Enum):
    """A key with a function."""

    FORWARD = "forward"
    BACK = "back"
    HALT = "halt"
    QUIT = "quit"


_KEYS = {
    b"\x1b[C": TerminalKey.FORWARD,
    b"\x1bOC": TerminalKey.FORWARD,
    b"\x1b[A": TerminalKey.FORWARD,
    b"\x1bOA": TerminalKey.FORWARD,
    b"\x1b[D": TerminalKey.BACK,
    b"\x1bOD": TerminalKey.BACK,
    b"\x1b[B": TerminalKey.BACK,
    b"\x1bOB": TerminalKey.BACK,
    b" ": TerminalKey.HALT,
    b"q": TerminalKey.QUIT,
    b"\x04": TerminalKey.QUIT,  # Ctrl-D
}
_INCOMPLETE_KEYS = (b"\x1b", b"\x1b[", b"\x1bO")  # the beginning of a key whose rest has not arrived yet


class TerminalKeyReader:
    """Decode keys from a terminal's bytes; holds the received part of an incomplete key."""

    def __init__(self) -> None:
        self._incomplete = b""

    def feed(self, data: bytes) -> TerminalKey | None:
        """Return the last key in the bytes, except that *halt* has priority, and *quit* before *halt*.

        A delayed terminal delivers many repetitions at once: they are old, and count as one.
        """
        data, self._incomplete = self._incomplete + data, b""
        found: list[TerminalKey] = []
        while data:
            known = next((keys for keys in _KEYS if data.startswith(keys)), None)
            if known is None and data in _INCOMPLETE_KEYS:
                self._incomplete = data
                break
            if known is not None:
                found.append(_KEYS[known])
            data = data[len(known or b"?") :]
        urgent = [key for key in (TerminalKey.QUIT, TerminalKey.HALT) if key in found]
        return (urgent or found[-1:] or [None])[0]


class Keyboard:
    """The terminal of this command, read key by key."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._keys = TerminalKeyReader()
        self._read_at = time.monotonic()

    def read(self, timeout: float) -> TerminalKey | None:
        """Return the key pressed within ``timeout`` s, None if there was none; *quit* if the terminal is gone.

        A key that may have waited in the terminal for more than 0.2 s is old, and moves nothing: this command was suspended, or
        waited for a halt. *halt* and *quit* always count.
        """
        key, before = self._read(timeout), self._read_at
        self._read_at = time.monotonic()
        old = self._read_at - before > timeout + _REPEAT_TIME
        return None if old and key in _SIGN else key

    def _read(self, timeout: float) -> TerminalKey | None:
        if not select.select([self._terminal], [], [], timeout)[0]:
            return None
        try:
            data = os.read(self._terminal, 4096)
        except OSError:
            return TerminalKey.QUIT
        return self._keys.feed(data) if data else TerminalKey.QUIT


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Read the terminal key by key until the end of the block.

    Raises:
        StateError: standard input is not a terminal. PlatformError: on Windows.
    """
    with key_by_key() as terminal:
        yield Keyboard(terminal)


# -- The command -------------------------------------------------------------------------------------------------------


_SIGN = {TerminalKey.FORWARD: 1.0, TerminalKey.BACK: -1.0}


@click.command("jog")
@click.argument("cell", type=PATH)
@click.argument("axis", shell_complete=complete_axes)
@click.option(
    "--velocity", type=float, help="Velocity in unit/s, instead of that of [axes.NAME.defaults] in CELL."
)
@click.option("--acceleration", type=float, help="Acceleration in unit/s², instead of the axis's default.")
@motion_options
def command(
    cell: Path, axis: str, velocity: float | None, acceleration: float | None, how: MotionOptions
) -> int:
    """Enable AXIS of CELL and move it by the arrow keys; each key press moves it for 0.2 s, and holding the key continues the
    motion.

    MOVES REAL MOTORS. Right and up are forward, left and down back, the space bar halts, q ends: then the axis is stopped and
    disabled. Position limits apply if the axis is homed. Keys need a terminal, also over ssh; if the connection is interrupted
    or lost, the axis begins to halt within 0.2 s, on its ramp.
    """
    config = checked(cell)
    require_no_pair(
        config, axis, "jog", f"move the pair: axisbus velocity {cell} PAIR=... --for 1s, or axisbus move"
    )
    rehearsal = DryRun(config)
    if axis in config.axes and velocity is None:
        velocity = config.axes[axis].defaults.velocity
    if axis in config.axes and not velocity:
        raise click.UsageError(
            f"no velocity is given: give --velocity, or velocity in [axes.{axis}.defaults] of {cell}"
        )
    speed = abs(velocity or 0.0)

    def rehearse() -> None:  # report impossible requests before the bus is opened
        rehearsal[axis].jog(speed, acceleration=acceleration)

    rehearse()
    with (
        keyboard() as keys,
        commanded(cell, [axis], how) as (machine, [moved]),
        recorded(machine, how.record) as recording,
    ):
        enable([moved])
        echo(f"{axis}: arrow keys move it at {speed:g} {moved.unit}/s, space halts, q ends", err=True)
        _Jogging(moved, speed, acceleration).run(keys)
        moved.halt().wait()
        say_position(moved, "stands at")
    return recording.code


class _Jogging:
    """An axis that is jogged by keys; holds the last jog, whose failure is reported."""

    def __init__(self, axis: Axis, speed: float, acceleration: float | None) -> None:
        self._axis, self._speed, self._acceleration = axis, speed, acceleration
        self._last: Handle | None = None
        self._velocity, self._pressed = 0.0, -math.inf

    def run(self, keys: Keyboard) -> None:
        """Execute keys until *quit*.

        Raises:
            AxisbusError: the axis is in ErrorStop, and why.
        """
        try:
            while (key := keys.read(_POLL_PERIOD)) is not TerminalKey.QUIT:
                reason = self._problem()
                if key is TerminalKey.HALT:
                    self._axis.halt().wait()
                elif key is not None:
                    self._jog(_SIGN[key] * self._speed)
                draw(f"{speed_text(self._axis)}  {reason}")
        finally:
            draw("")

    def _jog(self, velocity: float) -> None:
        """Start or continue the jog; if the axis was halted by another client, a key that is still held does not move it."""
        now = time.monotonic()
        since, self._pressed = now - self._pressed, now
        is_same, self._velocity = velocity == self._velocity, velocity
        was_halted = self._last is not None and type(self._last.error) is Interrupted
        if not (was_halted and is_same and since < _RELEASE_TIME):
            renews = is_same and since < _REPEAT_TIME
            self._last = self._axis.jog(velocity, acceleration=self._acceleration, continue_only=renews)

    def _problem(self) -> str:
        """Return why the last jog ended, unless no key was held: at a position limit, the opposite direction is still possible."""
        error = None if self._last is None else self._last.error
        if type(error) is Interrupted:
            return "it was halted: release the key, and press it again"
        if self._axis.state is AxisState.ERRORSTOP and (error := self._axis.error or error) is not None:
            raise error
        return "" if error is None or isinstance(error, Stopped) else with_alarm(error.message, error)
