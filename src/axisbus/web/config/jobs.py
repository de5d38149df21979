"""The jobs themselves: what ``axisbus config`` does with a node, done with one of a machine that runs.

A restore is none of them. The library writes a configuration to a node that is pre-operational, and run by nobody else; the nodes
of a machine that runs are neither. So the page tells what a restore would write, why it is not done here, and what to type.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

from axisbus.bus.link.listen import link_bitrate
from axisbus.bus.node.node import read_identity
from axisbus.configuration import dcf_values, live, preconditions, save, words
from axisbus.configuration.restore import Restore
from axisbus.drives import registry
from axisbus.eds import builtin, dcf, writer
from axisbus.eds.io import reader
from axisbus.errors import StateError
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.web.config.files import MOST, Dcf
from axisbus.web.config.report import Kind, Report, Wanted
from axisbus.web.objects.paced import PacedNode
from axisbus.web.view.axes import explained
from axisbus.wording import counted

Tell = Callable[[int, int], None]
_OBJECT, _NAME = "Object", "Name"


def carry_out(machine: Machine, node: PacedNode, wanted: Wanted, tell: Tell) -> Report:
    """Do a job; blocks for a transfer for each object. ``tell(done, all)`` is called after each.

    Raises:
        AxisbusError: whatever the library says of the file, or the node.
    """
    if wanted.kind is Kind.BACKUP:
        return backup(machine, node, tell)
    assert wanted.file is not None
    if wanted.kind is Kind.COMPARE:
        return compare(node, wanted.file, tell)
    return would_restore(machine, node, wanted.file, tell)


def backup(machine: Machine, node: PacedNode, tell: Tell) -> Report:
    """Read every object of a node into a DCF."""
    file = machine.cell.nodes[node.node_id].file
    assert file is not None  # only a node that has no objects needs none
    path = builtin.resolve(file, machine.cell.folder)
    reading = reader.read(reader.file_bytes(path), str(path))
    who = read_identity(node.sdo)
    bus = machine.cell.bus
    settings = dcf.Settings(
        node.node_id,
        save.known_rate(reading, bus.bitrate or link_bitrate(bus.interface, bus.channel)),
        file_name=save.file_name(node.node_id, who.serial),
        last_eds=path.name,
    )
    made = save.backup(node.sdo, reading, settings, tell)
    data = writer.dumps(made.reading)
    if len(data) > MOST:
        raise StateError(
            f"the backup of node {node.node_id} has {counted(len(data), 'octet')}, more than a page keeps",
            remedy="make it by axisbus config backup",
        )
    name = str(settings.file_name)
    lines = (*words.device(who, path.name, node.node_id), f"{name}: {counted(len(data), 'octet')}")
    rows = tuple((f"{each.index:04X}h:{each.subindex:02X}", each.name, each.reason) for each in made.left_out)
    return Report(words.read(made), lines, (_OBJECT, _NAME, "Left out, since"), rows, dcf=Dcf(name, data))


def compare(node: PacedNode, file: Dcf, tell: Tell) -> Report:
    """Compare a file with a node as it is now."""
    found = live.against(node, file.reading().eds, tell)
    rows = tuple(
        (
            f"{each.variable.index:04X}h:{each.variable.subindex:02X}",
            each.variable.name,
            *(("", each.note) if each.note else words.sides(each)),
        )
        for each in found.differences
    )
    titles = (_OBJECT, _NAME, words.short(file.name), f"node {node.node_id}")
    return Report(words.compared(found), (), titles, rows)


def would_restore(machine: Machine, node: PacedNode, file: Dcf, tell: Tell) -> Report:
    """Tell what a restore would write, and why it is not done in a machine that runs."""
    reading = file.reading()
    dcf_values.require_values(reading)
    who = read_identity(node.sdo)
    preconditions.require_same_device(reading.eds, who, node.node_id, replacement=False)
    make = registry.find(who.vendor_id, who.product_code)
    selection = dcf_values.select(reading.eds, node.node_id, make)
    restore = Restore(node.sdo, selection, lambda _, done, whole: tell(done, whole))
    differing = restore.look()
    dcf_values.require_within_limits(differing, reading.eds, node.node_id)
    held = {each.item.key: each.before for each in restore.report().results}
    rows = tuple(
        (
            f"{each.variable.index:04X}h:{each.variable.subindex:02X}",
            each.variable.name,
            words.data_shown(each.variable, held[each.key]),
            words.data_shown(each.variable, each.data),
        )
        for each in differing
    )
    return Report(
        words.would(differing, selection),
        tuple(f"it would skip {line}" for line in words.skipped(selection.skipped)),
        (_OBJECT, _NAME, "It has", "It would get"),
        rows,
        explained(refusal(machine.node(node.node_id), node)),
        f"axisbus config restore {shlex.quote(file.name)} {node.node_id} --cell {shlex.quote(Path(machine.cell.file).name)}",
    )


def refusal(access: NodeAccess, node: PacedNode) -> StateError:
    """Return why a node of a machine that runs is not restored: by the library's own conditions, else since it is one."""
    try:
        preconditions.require_not_energised(node)
        preconditions.require_pre_operational(node.node_id, access.nmt)
    except StateError as error:
        return error
    return StateError(
        f"node {node.node_id} belongs to a machine that runs: it is not configured; nothing was written",
        observed="its core brings it back up, and sends to it in every cycle",
        remedy="end the program that runs it",
    )
