"""Check that the program that the cell file expects of a node can be checked, and replaced if that is allowed."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.cell.model import NodeConfig, ProgramConfig
from axisbus.cell.program_file import deadline_of, mark_of, read_file
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as o
from axisbus.cia302.program import NUMBER
from axisbus.eds.model import Eds
from axisbus.errors import ConfigError
from axisbus.wording import counted

_DOWNLOAD = ((o.PROGRAM_DATA, NUMBER), (o.PROGRAM_CONTROL, NUMBER))


def files(case: CheckContext) -> Problems:
    """Check that a program's file is readable, present if it is needed, and used if it is present."""
    for node, program in _programs(case):
        if program.file is not None:
            yield from _file(case, node, program)
        elif program.download and program.at.sound("file"):
            yield case.error(
                program.at.of("download"),
                f"node {node.node_id}: its program may be replaced, and no file is given",
                f"[{program.at.name}] has download = true without file",
                'add file = "firmware.bin", a path relative to this file, or remove download = true',
            )


def _file(case: CheckContext, node: NodeConfig, program: ProgramConfig) -> Problems:
    line, name = program.at.of("file"), f"node {node.node_id}"
    try:
        data = read_file(case.cell, program) or b""
    except ConfigError as error:
        said = error.message.removeprefix(f"{error.file}:{error.line}: ")
        yield case.error(line, f"{name}: {said}", error.observed, error.remedy)
        return
    if not program.download:
        yield case.note(
            line,
            f"{name}: the file of its program is not used",
            f"[{program.at.name}] does not say download = true, so a program is only checked, never replaced",
        )
        return
    limit = "" if program.deadline is not None else " (no deadline is given: by the size)"
    yield case.note(
        program.at.of("download"),
        f"{name}: boot replaces its program if it is not the expected one",
        f"{counted(len(data), 'byte')}; each part of it may take {deadline_of(program, len(data)):g} s{limit}",
    )


def objects(case: CheckContext) -> Problems:
    """Warn of a device whose program can be neither checked nor replaced: boot would end with letter G or I."""
    for node, eds, _ in case.nodes:
        program = node.program
        if program is None:
            continue
        if lacking := _lacking(eds, mark_of(program).numbers):
            yield case.warning(
                program.at.line,
                f"node {node.node_id}: whether it has the expected program cannot be checked",
                f"{eds.source} lacks {lacking} (1F52h is the date of the application software, 1F56h its identification)",
                f"identify the program by the other one, or leave [{program.at.name}] out: boot would refuse it with the "
                "letter G",
            )
        elif program.download and (lacking := _lacking(eds, _DOWNLOAD)):
            yield case.warning(
                program.at.of("download"),
                f"node {node.node_id}: its program cannot be replaced over the bus",
                f"{eds.source} lacks {lacking} (program data and program control)",
                "remove download = true if the device does not have them: boot would fail with the letter I",
            )


def _programs(case: CheckContext) -> list[tuple[NodeConfig, ProgramConfig]]:
    return [(node, node.program) for node in case.cell.nodes.values() if node.program is not None]


def _lacking(eds: Eds, wanted: Iterable[tuple[int, int]]) -> str:
    return ", ".join(f"{index:04X}h:{sub:02X}" for index, sub in wanted if eds.get(index, sub) is None)


CHECKS: tuple[Check, ...] = (files, objects)
