"""The source of frames for ``trace`` and ``load``: a bus, a recording, or candump's output on standard input."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cell.model import SIMULATED
from axisbus.cli.shared.buses import require_rate, simulated, with_options
from axisbus.cli.shared.options import PATH, bus_options, packed, parse_options, together
from axisbus.eds import Eds, load
from axisbus.errors import ArgumentError

if TYPE_CHECKING:
    from axisbus.bus.link.frame_files import SkippedLines
    from axisbus.cell.model import CellConfig
    from axisbus.cia301.frame import CanFrame
    from axisbus.trace.context import TraceContext

STDIN = "-"


@dataclass(frozen=True, slots=True)
class FrameSourceOptions:
    """The user's options: ``source`` (a recording, - or a cell file), bus options, and files for decoding."""

    source: str | None
    interface: str | None
    channel: str | None
    bitrate: int | None
    option: tuple[str, ...]
    cell: Path | None
    eds: tuple[str, ...]

    @property
    def live(self) -> bool:
        """Whether frames come from a bus."""
        return self.recording is None

    @property
    def recording(self) -> str | None:
        """The recording, or -; None if there is none."""
        return self.source if self.source is not None and not self.source.endswith(".toml") else None

    @property
    def cell_file(self) -> Path | None:
        """The cell file, from either option."""
        return Path(self.source) if self.source is not None and self.recording is None else self.cell

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the cell file, which is read for this; none without one.

        Raises:
            UsageError, ConfigError: as ``open_frames``.
        """
        from axisbus.cell import reader

        self.check()
        if self.cell_file is not None:
            return tuple(reader.load(self.cell_file).axes)
        return ()

    def check(self) -> None:
        """Refuse contradictory options.

        Raises:
            UsageError: no source, or two.
        """
        if self.recording is not None and self.interface is not None:
            raise click.UsageError(
                f"{self.recording} and -i both name the source of the frames: leave one of them out"
            )
        if self.source is not None and self.recording is None and self.cell is not None:
            raise click.UsageError(f"{self.source} and --cell are both cell files: leave one of them out")
        if self.recording is None and self.interface is None and self.cell_file is None:
            raise click.UsageError(
                "give a cell file, a recording, - for candump's output, or the bus with -i and -c (such as: -i socketcan -c can0)"
            )


@dataclass(slots=True)
class FrameSource:
    """An open source; ``loaded`` is the cell (None without one), ``skipped`` counts lines that were not frames."""

    frames: Iterator[CanFrame]
    loaded: CellConfig | None
    skipped: SkippedLines
    known: TraceContext = field(repr=False)


# SOURCE, the bus options, --cell and --eds; a command gets them together as ``options``.
source_options = together(
    click.argument("source", required=False),
    bus_options,
    click.option(
        "--cell",
        type=PATH,
        help="Cell file to decode with; frames come from SOURCE or -i if one is given, otherwise from its bus.",
    ),
    click.option("--eds", multiple=True, metavar="N=FILE", help="EDS or DCF of node N; may be repeated."),
    packed(FrameSourceOptions, "options"),
)


def open_frames(stack: ExitStack, frame_options: FrameSourceOptions, seconds: float | None) -> FrameSource:
    """Open the requested source; ``stack`` closes it.

    Raises:
        UsageError, ArgumentError: as ``FrameSourceOptions.check``, or --eds is not N=FILE.
        ConfigError, EdsError, UserError, AdapterError: a file or the bus cannot be opened.
    """
    from axisbus.bus.link import frame_files

    frame_options.check()
    loaded, known = _known(frame_options)
    skipped = frame_files.SkippedLines()
    if frame_options.recording == STDIN:
        text_lines = frame_files.lines((raw.decode("ascii", "replace") for raw in sys.stdin.buffer), skipped)
        frames = frame_files.of_channel(text_lines, skipped, frame_options.channel, "standard input")
    elif frame_options.recording is not None:
        frames = frame_files.read(Path(frame_options.recording), skipped, frame_options.channel)
    else:
        frames = _live(stack, frame_options, loaded, seconds)
    return FrameSource(frames, loaded, skipped, known)


def _live(
    stack: ExitStack, frame_options: FrameSourceOptions, loaded: CellConfig | None, seconds: float | None
) -> Iterator[CanFrame]:
    if frame_options.interface == SIMULATED:
        from axisbus.core.listen_only import listen_to

        return listen_to(simulated(frame_options.channel, frame_options.option), stack).frames(seconds)
    if frame_options.interface is not None:
        from axisbus.bus.link.listen import listen

        options = parse_options(frame_options.option)
        require_rate(frame_options.interface, frame_options.bitrate, options)
        return stack.enter_context(
            listen(frame_options.interface, frame_options.channel, frame_options.bitrate, options)
        ).frames(seconds)
    from axisbus.core.listen_only import listen_to

    assert loaded is not None  # ``FrameSourceOptions.check``
    bus = with_options(loaded, frame_options.channel, frame_options.bitrate, frame_options.option)
    if frame_options.channel is None and not frame_options.option:
        from axisbus.cli.shared.attach_or_open import frames_of_machine

        frames_of_running = frames_of_machine(stack, Path(loaded.file), seconds)
        if frames_of_running is not None:
            return frames_of_running
    return listen_to(bus, stack).frames(seconds)


def _known(frame_options: FrameSourceOptions) -> tuple[CellConfig | None, TraceContext]:
    from dataclasses import replace

    from axisbus.cell import reader
    from axisbus.core.files import load_dictionaries
    from axisbus.trace import context

    files = dict(eds_of(text) for text in frame_options.eds)
    if frame_options.cell_file is None:
        return None, context.of_eds(files)
    loaded = reader.load(frame_options.cell_file)
    found = context.of_cell(
        loaded, {**load_dictionaries(loaded), **{n: eds for n, eds in files.items() if n in loaded.nodes}}
    )
    extra = context.of_eds({n: eds for n, eds in files.items() if n not in loaded.nodes})
    return loaded, replace(found, nodes={**extra.nodes, **found.nodes})


def eds_of(text: str) -> tuple[int, Eds]:
    """Read ``N=FILE``.

    Raises:
        ArgumentError: the text has another form.
        EdsError: the file cannot be read.
    """
    number, sign, file = text.partition("=")
    if not sign or not number.strip().isdigit() or not 1 <= int(number) <= 127:
        raise ArgumentError(
            f"--eds {text} does not name a node and a file",
            remedy="write --eds 5=drive.eds, with the node ID before the =",
        )
    return int(number), load(file)
