"""Check that each node's EDS or DCF is usable, and describes a drive that fits the node's axes."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus import eds as eds_files
from axisbus.cell.model import CellConfig, NodeConfig
from axisbus.cell.other_protocols import has_own_interface
from axisbus.cell.problem import CellProblem
from axisbus.check.context import NEEDED, Check, CheckContext, Problems, own_title, titles
from axisbus.check.ids.table import UNREADABLE
from axisbus.cia402 import objects
from axisbus.configuration.dcf_values import require_within_limits, select
from axisbus.drives import registry
from axisbus.drives.plugin import GENERIC
from axisbus.drives.registry import make_of
from axisbus.eds import builtin
from axisbus.eds.model import BAUD_RATES, Eds, EdsFinding, Severity
from axisbus.errors import ArgumentError, EdsError, LimitError
from axisbus.wording import counted

_SHOWN = 3


def load_all(cell: CellConfig) -> tuple[Mapping[int, Eds], list[CellProblem]]:
    """Read the EDS of each node; an unreadable file is a problem, reported once for each file.

    Blocks for as long as the files take to read.
    """
    found: dict[int, Eds] = {}
    problems: list[CellProblem] = []
    failed: set[str] = set()
    for node in cell.nodes.values():
        spec = node.file
        if spec is None or not node.at.sound("eds", "dcf") or spec in failed:
            continue
        try:
            found[node.node_id] = load(spec, cell)
        except EdsError as error:
            failed.add(spec)
            problems.append(_unreadable(cell, node, error))
    return found, problems


def load(spec: str, cell: CellConfig) -> Eds:
    """Read an EDS or DCF by the name in the cell file.

    Raises:
        EdsError: the file is missing or unusable.
    """
    return eds_files.load(builtin.resolve(spec, cell.folder))


def _unreadable(cell: CellConfig, node: NodeConfig, error: EdsError) -> CellProblem:
    others = [other.node_id for other in cell.nodes.values() if other.file == node.file and other is not node]
    shared = f" (also of {_nodes(others)})" if others else ""
    said = error.message + (f"; {error.observed}" if error.observed else "")
    return CellProblem(
        Severity.ERROR,
        cell.file,
        node.at.of(node.file_key),
        f"node {node.node_id}: its {node.file_key} {node.file!r} cannot be used{shared}",
        said,
        error.remedy,
        error.page,
        UNREADABLE,
    )


def _nodes(node_ids: list[int]) -> str:
    return ("node " if len(node_ids) == 1 else "nodes ") + ", ".join(map(str, node_ids))


# -- checks ----------------------------------------------------------------------------------------------------------


def defects(case: CheckContext) -> Problems:
    """Warn of errors inside a file, once for each file, with its own line numbers."""
    seen: set[str] = set()
    for node, eds, _ in case.nodes:
        wrong = [finding for finding in eds.findings if finding.severity is Severity.ERROR]
        if not wrong or eds.source in seen:
            continue
        seen.add(eds.source)
        yield case.warning(
            node.at.of(node.file_key),
            f"node {node.node_id}: its {node.file_key} has {counted(len(wrong), 'defect')}",
            _listed(eds, wrong),
            f"defective entries are ignored; to fix the file: axisbus eds check {eds.source}",
        )


def _listed(eds: Eds, wrong: list[EdsFinding]) -> str:
    shown = [f"{eds.source}:{finding.line}: {finding.message}" for finding in wrong[:_SHOWN]]
    return "; ".join(shown + ["..."] * (len(wrong) > _SHOWN))


def made_for_node(case: CheckContext) -> Problems:
    """Check that a DCF belongs to the node that uses it: its COB-IDs are those of one node-ID."""
    for node, eds, _ in case.nodes:
        if eds.node_id not in (None, node.node_id):
            yield case.error(
                node.at.of(node.file_key),
                f"node {node.node_id}: {eds.source} is made for node {eds.node_id}",
                "a DCF has the COB-IDs of one node ID (NodeID in [DeviceComissioning])",
                f"name the DCF of node {node.node_id}, or the EDS of the drive",
            )


def dcf_values(case: CheckContext) -> Problems:
    """Check the values of a DCF, which boot writes: their types, and the file's own limits."""
    for node, eds, _ in case.nodes:
        if node.dcf is None or node.dcf != node.file:
            continue
        line = node.at.of("dcf")
        make = make_of(eds, node.makes)
        try:
            selection = select(eds, node.node_id, make)
        except ArgumentError as error:
            yield case.error(line, f"node {node.node_id}: {error.message}", error.observed, error.remedy)
            continue
        try:
            require_within_limits(selection.items, eds, node.node_id)
        except LimitError as error:
            yield case.warning(
                line,
                f"node {node.node_id}: {eds.source} has values beyond its own limits",
                error.observed,
                "if the drive does not have these values already, boot refuses them: correct the value or the limit",
            )


def is_drive(case: CheckContext) -> Problems:
    """Check that a node with axes is a CiA 402 device (low word of 1000h)."""
    for node, eds, _ in case.nodes:
        if not any(case.cell.axes_of(node.node_id)):
            continue
        line, device_type = node.at.of(node.file_key), eds.device_type
        if device_type is None:
            yield case.note(
                line,
                f"node {node.node_id}: its {node.file_key} does not give the type of device",
                "1000h (device type) has no default",
                "boot asks the drive itself",
            )
        elif device_type & 0xFFFF != objects.PROFILE_NUMBER:
            # 0 means "no profile", and files that leave the profile open have it too: boot asks the drive.
            report = case.error if device_type & 0xFFFF else case.warning
            yield report(
                line,
                f"node {node.node_id} has axes, but by its {node.file_key} it is not a CiA 402 drive",
                f"1000h (device type) is {device_type:08X}h: profile {device_type & 0xFFFF}, not 402",
                "name the drive's own EDS, or correct the axis's node",
            )


def failed_plugins(case: CheckContext) -> Problems:
    """Warn of a drive plug-in that cannot be loaded, if it may be that of a drive whose make is unknown."""
    unknown = [
        node
        for node, eds, _ in case.nodes
        if any(case.cell.axes_of(node.node_id)) and make_of(eds, node.makes) is GENERIC
    ]
    if not unknown:
        return
    for source in registry.installed():
        if source.error:
            yield case.warning(
                unknown[0].at.of(unknown[0].file_key),
                f"the drive plug-in {source.name} cannot be loaded, and the make of "
                f"{_nodes([node.node_id for node in unknown])} is unknown",
                f"{source.origin}: {source.error}",
                source.remedy,
            )


def has_axis(case: CheckContext) -> Problems:
    """Check that the drive has the axis: controlword and statusword, 800h higher for each axis after the first."""
    for drive in case.incomplete:
        axis = drive.axis
        named = " and ".join(own_title(drive, index) for index in drive.missing(NEEDED))
        yield case.error(
            axis.at.of("drive_axis") if axis.at.gives("drive_axis") else axis.at.of("node"),
            f"axis {axis.name}: node {axis.node} has no axis {axis.drive_axis}",
            f"{drive.eds.source} does not have {named}",
            "correct drive_axis, or name the drive's own EDS",
        )


# Objects that motion reads and writes as one value.
_SINGLE = (
    *NEEDED,
    objects.MODES_OF_OPERATION,
    objects.MODES_OF_OPERATION_DISPLAY,
    objects.POSITION_ACTUAL,
    objects.VELOCITY_ACTUAL,
    objects.TARGET_TORQUE,
    objects.TORQUE_ACTUAL,
    objects.TARGET_POSITION,
    objects.PROFILE_VELOCITY,
    objects.PROFILE_ACCELERATION,
    objects.PROFILE_DECELERATION,
    objects.TARGET_VELOCITY,
)


def one_axis_per_object(case: CheckContext) -> Problems:
    """Reject a device that has several axes in the sub-indices of one object, which CiA 402 does not define."""
    for drive in case.drives:
        split = tuple(
            index for index in _SINGLE if drive.has(index) and drive.eds.objects[drive.index(index)].is_record
        )
        if split:
            yield case.error(
                drive.axis.at.of("node"),
                f"axis {drive.axis.name}: the device has several axes in the sub-indices of one object",
                f"in {drive.eds.source} these are not single values: {titles(split)}",
                "such a drive cannot be used; CiA 402 has the second axis 800h further",
            )


def bitrate(case: CheckContext) -> Problems:
    """Warn of a bit rate that CANopen does not define, or that a device does not support."""
    bus = case.cell.bus
    if bus.bitrate is None or has_own_interface(case.cell):
        return
    if bus.bitrate // 1000 not in BAUD_RATES or bus.bitrate % 1000:
        yield case.warning(
            bus.at.of("bitrate"),
            f"{bus.bitrate} bit/s is not a bitrate of CANopen",
            f"CiA 301 has {', '.join(map(str, BAUD_RATES))} kbit/s",
            "write the rate that is set in the drives",
        )
        return
    for node, eds, _ in case.nodes:
        device = eds.info.get("deviceinfo", {})
        has = [rate for rate in BAUD_RATES if device.get(f"baudrate_{rate}", "0").strip() == "1"]
        if has and bus.bitrate // 1000 not in has:
            yield case.warning(
                bus.at.of("bitrate"),
                f"node {node.node_id} does not run at {bus.bitrate // 1000} kbit/s",
                f"{eds.source} has {', '.join(map(str, has))} kbit/s in [DeviceInfo]",
                "write a rate that every node has, and set the nodes to it",
            )


CHECKS: tuple[Check, ...] = (
    defects,
    made_for_node,
    dcf_values,
    is_drive,
    failed_plugins,
    has_axis,
    one_axis_per_object,
    bitrate,
)
