"""The file of a node's program: its path, its contents, and the deadline of its download."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell.model import CellConfig, NodeConfig, ProgramConfig
from axisbus.cia302.program import NodeProgram, ProgramVersion, Version
from axisbus.errors import ConfigError

LEAST_DEADLINE = 60.0  # seconds; clearing a large flash memory takes several tens of them
_SLOWEST = 10_000  # bytes/s, the lowest expected rate at which a node writes its memory


def path_of(cell: CellConfig, program: ProgramConfig) -> Path | None:
    """Return the path of the file, None if no file is named."""
    return None if program.file is None else cell.folder / program.file


def read_file(cell: CellConfig, program: ProgramConfig) -> bytes | None:
    """Return the bytes to transfer, None if no file is named; blocks while the file is read.

    Raises:
        ConfigError: the file cannot be read, or is empty.
    """
    path = path_of(cell, program)
    if path is None:
        return None
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise _unusable(cell, program, "cannot be read", _why(path, error)) from None
    if not data:
        raise _unusable(cell, program, "is empty", f"{path} has 0 bytes")
    return data


def deadline_of(program: ProgramConfig, size: int) -> float:
    """Return the seconds that each part of a download may take: from the cell file, else by the size in bytes."""
    return program.deadline if program.deadline is not None else deadline_for(size)


def deadline_for(size: int) -> float:
    """Return the seconds that each part of a download of ``size`` bytes may take."""
    return max(LEAST_DEADLINE, size / _SLOWEST)


def wanted_program(cell: CellConfig, node: NodeConfig, late: bool = False) -> NodeProgram | None:
    """Return the program that a node must have; the file is read only if the download is allowed.

    No download is allowed while the machine runs (``late``): closing the machine would leave half a program in the node.

    Raises:
        ConfigError: as ``read_file``.
    """
    program = node.program
    if program is None:
        return None
    allowed = program.download and not late
    data = read_file(cell, program) if allowed else None
    return NodeProgram(mark_of(program), data, allowed, deadline_of(program, len(data or b"")))


def mark_of(program: ProgramConfig) -> ProgramVersion:
    """Return the properties that identify the program."""
    version = None if program.date_time is None else Version(*program.date_time)
    return ProgramVersion(version, program.identification)


def _why(path: Path, error: Exception) -> str:
    if path.is_dir():
        return f"{path} is a folder"
    if isinstance(error, FileNotFoundError):
        return f"{path} does not exist"
    return f"{path}: {getattr(error, 'strerror', None) or error}"


def _unusable(cell: CellConfig, program: ProgramConfig, what: str, observed: str) -> ConfigError:
    return ConfigError(
        f"the program {program.file!r} {what}",
        file=cell.file,
        line=program.at.of("file"),
        observed=observed,
        remedy="name the file with the new program, by a path relative to the cell file",
    )
