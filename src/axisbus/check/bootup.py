"""Check that the nodes support the boot-up that the cell file asks for."""

from __future__ import annotations

from axisbus.check.context import Check, CheckContext, Problems
from axisbus.cia301 import objects as cia301


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
