"""The option ``--record`` of commands that move axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from axisbus.cli.shared.common import FAILURE, OK, say
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import require_writable
from axisbus.machine.machine import Machine
from axisbus.record.recording import Recording
from axisbus.wording import counted

_Function = TypeVar("_Function", bound=Callable[..., object])


def record_option(function: _Function) -> _Function:
    """Add --record: the MCAP file for a recording of the command."""
    return click.option(
        "--record", type=PATH, callback=_checked, help="Record it into this MCAP file, which is replaced."
    )(function)


def _checked(ctx: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:  # noqa: ARG001  # click's signature
    """Check before anything is opened whether recording is possible."""
    if path is not None:
        from axisbus.record.mcap_writer import library

        library()
        require_writable(path)
    return path


@dataclass(slots=True)
class RecordingEnd:
    """Whether writing of a recording failed; known after the block of ``recorded``."""

    failed: bool = False

    @property
    def code(self) -> int:
        """The exit code of a command that has otherwise succeeded."""
        return FAILURE if self.failed else OK


@contextmanager
def recorded(machine: Machine, path: Path | None) -> Iterator[RecordingEnd]:
    """Record the machine during the block if there is a ``path``; print where the recording is, also after an error.

    A full disk does not end the motion: the command continues, and its exit code reports it (``RecordingEnd.code``).
    """
    end = RecordingEnd()
    if path is None:
        yield end
        return
    recording = machine.recording(path)
    try:
        with recording:
            yield end
    finally:
        end.failed = bool(recording.failed)
        say(summary(recording))


def summary(recording: Recording) -> str:
    """Return a summary of a recording."""
    text = f"recorded: {recording.path}, {recording.seconds:.1f} s, {counted(recording.cycles, 'cycle')}"
    text += f", {recording.size / 1e6:.2f} MB"
    if recording.lost:
        text += f"; {counted(recording.lost, 'cycle')} not read in time"
    for label, reads in recording.reads.items():
        text += f"; {label}: {counted(reads, 'value')} ({reads / max(recording.seconds, 1e-3):.0f} a second)"
    return f"{text}; then the file could not be written: {recording.failed}" if recording.failed else text
