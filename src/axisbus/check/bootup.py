"""Check that the nodes support the boot-up that the cell file asks for."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.cell.model import NodeConfig, ProgramConfig
from axisbus.cell.program_file import deadline_of, mark_of, read_file
from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as cia301
from axisbus.cia301 import objects as o
from axisbus.cia302.program import NUMBER
from axisbus.eds.model import Eds
from axisbus.errors import ConfigError
from axisbus.wording import counted


def version(case: CheckContext) -> Problems:
    """Check that date and time of a configuration are both given, and that the node stores them (1020h)."""
    for node in case.cell.nodes.values():
        given = [key for key in ("configuration_date", "configuration_time") if node.at.gives(key)]
        if len(given) == 1:
            yield case.error(
                node.at.of(given[0]),
                f"node {node.node_id}: {given[0]} is given without the other key",
                "1020h has a date and a time, and the configuration is skipped only if both have the expected values",
                "give configuration_date and configuration_time, or neither",
            )
    for node, eds, _ in case.nodes:
        if node.version is not None and cia301.VERIFY_CONFIGURATION not in eds:
            yield case.warning(
                node.at.of("configuration_date"),
                f"node {node.node_id}: the drive does not store the date of its configuration",
                f"{eds.source} lacks 1020h (verify configuration), so it is configured at every boot-up",
                "leave configuration_date and configuration_time out",
            )


def restore(case: CheckContext) -> Problems:
    """Check that a node supports the restoring of its defaults (1011h:01) if the cell file asks for it."""
    for node, eds, _ in case.nodes:
        if node.restore_defaults and eds.get(cia301.RESTORE_DEFAULTS, 1) is None:
            yield case.error(
                node.at.of("restore_defaults"),
                f"node {node.node_id} cannot restore its defaults",
                f"{eds.source} lacks 1011h:01 (restore all default parameters)",
                "leave restore_defaults out, and write the required values into [nodes.N.objects]",
            )


def identity(case: CheckContext) -> Problems:
    """Warn of a serial number or revision that the node does not report: the node would be refused at boot-up."""
    for node, eds, _ in case.nodes:
        for key, subindex in (("serial", cia301.SERIAL_NUMBER), ("revision", cia301.REVISION_NUMBER)):
            if getattr(node, key) is not None and eds.get(cia301.IDENTITY, subindex) is None:
                yield case.warning(
                    node.at.of(key),
                    f"node {node.node_id}: a {key} is expected, which the drive does not report",
                    f"{eds.source} lacks 1018h:{subindex:02X}, and a node that does not report it is refused at boot-up",
                    f"leave {key} out",
                )


def optional_in_group(case: CheckContext) -> Problems:
    """Note groups that are usable only while an optional node is present."""
    for group in case.cell.groups.values():
        for name in group.axes:
            axis = case.cell.axes.get(name)
            node = None if axis is None else case.cell.nodes.get(axis.node)
            if node is not None and node.optional:
                yield case.note(
                    group.at.of("axes"),
                    f"group {group.name} cannot be used while node {node.node_id} is not present",
                    f"axis {name} is on it, and it is optional",
                )


CHECKS: tuple[Check, ...] = (version, restore, identity, optional_in_group)


# -- Check that the program that the cell file expects of a node can be checked, and replaced if that is allowed -------


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


PROGRAM_CHECKS: tuple[Check, ...] = (files, objects)
