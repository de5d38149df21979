"""Find the new drive of a node, and make it the drive of this node: node-ID, stored values, 1010h, restart, comparison.

LSS is used on a bus in operation only by the core of the running machine itself: it then changes nothing but the new drive.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from axisbus.bus.lss import LssMaster
from axisbus.bus.node import discover, nmt
from axisbus.bus.node.node import CanopenNode, NodeIdentity
from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtCommand
from axisbus.clock import poll_until
from axisbus.configuration import preconditions, store_parameters
from axisbus.configuration.dcf_values import SkipReason, require_values, require_within_limits, select
from axisbus.configuration.nameplate import identity_values
from axisbus.configuration.replacement_order import (
    FoundDrive,
    ReplacementOrder,
    ReplacementOutcome,
    ReplacementStep,
    Tell,
)
from axisbus.configuration.restore import Restore, RestoreReport, ValueEnd
from axisbus.drives import registry
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.drives.plugin import DrivePlugin, NodeIdObject
from axisbus.eds.io import reader
from axisbus.errors import NodeError, NodeTimeout, StateError
from axisbus.wording import counted, first_of

_BOOT_TIME = 10.0  # seconds that the new drive may need to answer
# Seconds for a drive whose node-ID was set by a program that was then killed: it takes the node-ID when the LSS search begins,
# which switches all slaves to waiting.
_NODE_ID_CHANGE_TIME = 3.0
_SLICE = 0.05
_SHOWN = 5


def find_drives(
    node: CanopenNode, others: Collection[int], *, in_operation: bool = False
) -> list[FoundDrive]:
    """Return the drives that may be the new one of a node; writes nothing. Blocks for up to about 12 s.

    If the node answers, it is the only one. Otherwise these are the nodes with a node-ID that the cell does not have (``others``
    are those that it has, and the master's), and the drives without a node-ID. ``in_operation``: the machine of the cell runs.

    Raises:
        StateError: the bus is in operation, several drives have the same identity, or only devices with a protocol other than
            CANopen were found.
        LssError, AdapterError: as ``LssMaster.find`` and ``discover.scan``.
    """
    if node.answers_sdo() or node.answers_sdo():  # one answer may be lost
        return [_drive(node.node_id, node.identity())]
    expected = {node.node_id, *others}
    foreign = ForeignProtocols()
    unexpected = [each for each in cob.NODE_IDS if each not in expected]
    scanned = discover.scan(node.channel, unexpected, listening=foreign)
    found = [_drive(each.node_id, each.identity) for each in scanned if each.answers_sdo]
    for slave in LssMaster(node.channel, beside_operation=in_operation).find().slaves:
        if slave.has_node_id:
            continue
        if slave.twins:
            raise StateError(
                "several drives without a node-ID have the same identity, so LSS cannot distinguish them",
                observed=f"LSS address {slave.address}",
                remedy="connect only the new drive of this node, and run the command again",
            )
        found.append(FoundDrive(None, *slave.address.parts))
    if not found and _answers_within(node, _NODE_ID_CHANGE_TIME):  # see ``_NODE_ID_CHANGE_TIME``
        return [_drive(node.node_id, node.identity())]
    of_cell = {*others} - {node.node_id}
    if not found and any(each.plain["node_id"] not in of_cell for each in foreign.speakers):
        raise StateError(
            f"no drive with CANopen was found that could replace that of node {node.node_id}; nothing was written",
            observed="; ".join(foreign.heard()),
            remedy="; ".join(foreign.remedies()),
        )
    return found


def _answers_within(node: CanopenNode, seconds: float) -> bool:
    clock = node.channel.clock
    return poll_until(clock, node.answers_sdo, clock.now() + seconds, _SLICE)


def _drive(node_id: int, identity: NodeIdentity) -> FoundDrive:
    return FoundDrive(node_id, **identity_values(identity))


class DriveReplacement:
    """Does the steps of an order at the device; holds the outcome so far. If it is interrupted, a new plan continues."""

    def __init__(
        self,
        node: CanopenNode,
        order: ReplacementOrder,
        makes: Sequence[DrivePlugin] = (),
        *,
        in_operation: bool = False,
        on_step: Tell = lambda _: None,
    ) -> None:
        """``on_step`` is called before each step. ``in_operation``: the core of the running machine calls this."""
        self._node = node
        self._order = order
        self._makes = makes
        self._in_operation = in_operation
        self._on_step = on_step
        self._restore: Restore | None = None
        self._written = self._calibration = 0
        self._not_stored = ""
        self._restarted = False

    def run(self) -> ReplacementOutcome:
        """Do all steps at the device; blocks for up to about a minute. Energises nothing.

        Raises:
            UserError: the file cannot be used, or the drive does not fit or may not be configured now; no object was written.
            NodeError: the drive rejects a value or has lost one, or another drive answers. LssError, BusError: it does not answer.
        """
        work = {
            ReplacementStep.NODE_ID: self._set_node_id,
            ReplacementStep.CONFIGURE: self._configure,
            ReplacementStep.STORE: self._store,
            ReplacementStep.RESTART: self._restart,
            ReplacementStep.VERIFY: self._verify,
        }
        for step in self._order.steps:
            if step in work:
                self._on_step(step)
                work[step]()
        self._require_this_drive()
        values = 0 if self._restore is None else len(self._restore.report().results)
        return ReplacementOutcome(values, self._written, self._calibration, self._not_stored)

    # -- steps ------------------------------------------------------------------------------------------------------------

    def _set_node_id(self) -> None:
        drive, node_id = self._order.drive, self._order.node_id
        node_id_object = registry.find(drive.vendor, drive.product, drive.revision, self._makes).node_id
        if node_id_object is not None and drive.node_id is not None:
            if drive.node_id != node_id:
                self._write_node_id(drive.node_id, node_id_object)
            return
        master = LssMaster(self._node.channel, beside_operation=self._in_operation)
        if drive.node_id == node_id:  # it got the node-ID before; whether it has stored it cannot be read
            master.store(drive.address)
            return
        if drive.node_id is not None:
            with CanopenNode(self._node.channel, drive.node_id) as before:
                preconditions.require_not_energised(before)
        master.set_node_id(drive.address, node_id, store=True, reset=True)
        self._await_answer("since it got its node-ID")

    def _write_node_id(self, before: int, node_id_object: NodeIdObject) -> None:
        """Set the node-ID by an object of the drive's make: unlike LSS, that concerns no other device."""
        with CanopenNode(self._node.channel, before) as drive:
            preconditions.require_not_energised(drive)
            size = len(drive.sdo.upload(*node_id_object.address))
            drive.sdo.download(*node_id_object.address, self._order.node_id.to_bytes(size, "little"))
            drive.sdo.download(
                *node_id_object.store, store_parameters.SAVE, timeout=store_parameters.WRITE_TIME, tries=1
            )
            # It restarts with another node-ID: its boot-up message comes with that.
            nmt.send(self._node.channel, NmtCommand.RESET_NODE, before)
        self._await_answer(
            "since it got its node-ID",
            f"if it has node-ID {before} again (axisbus scan), its switches set the node-ID: set them; otherwise switch it off "
            "and on; then run the command again",
        )

    def _configure(self) -> None:
        restore = self._restore = self._begin()
        missing = restore.report().of(ValueEnd.FAILED)
        if missing:
            raise StateError(
                f"node {self._node.node_id} cannot be configured as {self._order.file} requires; nothing was written",
                observed=_texts(restore.report()),
                remedy="use a drive with these objects, or give a file without them",
            )
        report = restore.run()
        self._written = report.writes
        self._require(report, "rejects", "correct these values in the file; then run the command again")

    def _begin(self) -> Restore:
        """Check everything that can be checked before the first write; return the restore, which has read all objects."""
        node, file = self._node, self._order.file
        assert file is not None
        reading = reader.read(reader.file_bytes(Path(file)), file)
        require_values(reading)
        self._require_this_drive()
        identity = node.identity()
        preconditions.require_same_device(reading.eds, identity, node.node_id, replacement=True)
        if self._in_operation:
            preconditions.require_not_energised(node)
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        else:
            preconditions.require_at_rest(node)
        selection = select(reading.eds, node.node_id, registry.of_identity(identity, self._makes))
        self._calibration = sum(each.why is SkipReason.CALIBRATION for each in selection.skipped)
        restore = Restore(node.sdo, selection)
        require_within_limits(restore.read_present(), reading.eds, node.node_id)
        return restore

    def _store(self) -> None:
        self._not_stored = store_parameters.can_store(self._node)
        if not self._not_stored:
            make = registry.of_identity(self._node.identity(), self._makes)
            self._restarted = store_parameters.store(self._node, make).restarted

    def _restart(self) -> None:
        # A restart loses the values of a drive that does not store them on command.
        if self._restarted or self._not_stored:
            return
        self._node.command(NmtCommand.RESET_NODE)
        self._await_answer("since its restart")

    def _verify(self) -> None:
        assert self._restore is not None
        self._restore.read_present()
        self._require(
            self._restore.report(), "has lost", "its memory may be full or locked: run the command again"
        )

    # -- checks -----------------------------------------------------------------------------------------------------------

    def _require(self, report: RestoreReport, verb: str, remedy: str) -> None:
        if not report.ok:
            count = len(report.of(ValueEnd.FAILED, ValueEnd.DIFFERS))
            raise NodeError(
                f"node {self._node.node_id} {verb} {counted(count, 'value')} of {self._order.file}; the replacement is unfinished",
                node=self._node.node_id,
                observed=_texts(report),
                remedy=remedy,
            )

    def _require_this_drive(self) -> None:
        wanted, found = self._order.drive.serial, self._node.identity().serial
        if wanted != found:
            raise NodeError(
                f"node {self._node.node_id} is not the drive that was found; the replacement is unfinished",
                node=self._node.node_id,
                observed=f"its serial number (1018h:04) is {found}, that of the found drive is {wanted}",
                remedy="check that only one device has this node-ID (axisbus scan); then run the command again",
            )

    def _await_answer(
        self, since: str, remedy: str = "switch it off and on, and run the command again"
    ) -> None:
        if not _answers_within(self._node, _BOOT_TIME):
            raise NodeTimeout(
                f"node {self._node.node_id} has not answered {since}; the replacement is unfinished",
                node=self._node.node_id,
                observed=f"{_BOOT_TIME:.0f} s without an answer",
                remedy=remedy,
            )


def _texts(report: RestoreReport) -> str:
    failed = report.of(ValueEnd.FAILED, ValueEnd.DIFFERS)
    named = [
        f"{each.item.key[0]:04X}h:{each.item.key[1]:02X} ({each.item.variable.name}): {each.reason or 'it has another value'}"
        for each in failed
    ]
    return first_of(named, _SHOWN)
