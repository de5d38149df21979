"""Direct access to one node, in addition to its axes: typed objects by number or name; thread-safe."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from axisbus.boot import error_state
from axisbus.boot.objects import NodeObjects, Progress, read_int
from axisbus.boot.program_facts import ProgramOrder, ProgramWritten
from axisbus.boot.report import NodeReport
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cia301 import emcy as errorfield
from axisbus.cia301.datatypes import Value
from axisbus.cia301.emcy import Emcy, ErrorEntry
from axisbus.cia301.incident import EmcyLog, Incident
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.pdo import PdoLocation
from axisbus.cia402.axes import own_index
from axisbus.core.node_access_parts import NodeParts
from axisbus.drives.emcy_text import history_words, incident_words
from axisbus.drives.plugin import STANDARD_MEASURED, DrivePlugin, MeasuredObject
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import NodeTimeout, StateError

if TYPE_CHECKING:
    from axisbus.configuration.replacement_order import FoundDrive, ReplacementOrder, ReplacementOutcome, Tell
    from axisbus.core.core import CoreInterface

Key = int | str | tuple[int | str, int]


class SdoAccess:
    """Objects of a node by SDO, as a mapping: ``sdo[0x6081]``, ``sdo["Profile velocity"]``, ``sdo[0x607D, 1] = -1000``.

    Each read and each assignment is one transfer; it blocks until the node has answered.
    """

    def __init__(
        self,
        objects: NodeObjects,
        dictionary: Dictionary,
        cyclic: frozenset[tuple[int, int]] = frozenset(),
        require_unclaimed: Callable[[str], None] = lambda _: None,
    ) -> None:
        """``cyclic``: the objects that the scan sends in every cycle. ``require_unclaimed``: as in ``NodeAccess``."""
        self._objects = objects
        self._require_unclaimed = require_unclaimed
        self._dictionary = dictionary
        self.cyclic = cyclic

    def __getitem__(self, key: Key) -> Value:
        """Read an object as a value of its data type.

        Raises:
            ArgumentError: no object of this name.
            SdoAbort, SdoTimeout: the node refuses, or does not answer.
        """
        index, subindex = self._resolve(key)
        return self._objects.read(index, subindex)

    def __setitem__(self, key: Key, value: Value) -> None:
        """Write an object, checked against its type and limits.

        Raises:
            StateError: the object is in an RPDO that the scan sends: the value would be overwritten at once; or the node is being
                booted, or its program is being written.
            ArgumentError, LimitError: no such object, or a value out of its range.
            SdoAbort, SdoTimeout: the node refuses, or does not answer.
        """
        index, subindex = self._resolve(key)
        if (index, subindex) in self.cyclic:
            raise StateError(
                f"node {self._objects.node_id}: {index:04X}h:{subindex:02X} is sent by PDO in every cycle",
                observed="a value written by SDO would be overwritten at once",
                remedy="use the commands of the axis for it",
            )
        self._require_unclaimed(f"the value of {index:04X}h:{subindex:02X}")
        self._objects.write(index, subindex, value)

    def _resolve(self, key: Key) -> tuple[int, int]:
        name, subindex = key if isinstance(key, tuple) else (key, 0)
        entry = self._dictionary.resolve(name, subindex)
        return entry.index, entry.subindex


class NoSdoAccess(SdoAccess):
    """The SDO access of a node of another protocol, which has no objects: each read and each assignment raises StateError."""

    def __init__(
        self, refused: Callable[[str], StateError], objects: NodeObjects, dictionary: Dictionary
    ) -> None:
        """``refused`` makes the error from its reason."""
        super().__init__(objects, dictionary)
        self._refused = refused

    def _resolve(self, key: Key) -> tuple[int, int]:
        name, _ = key if isinstance(key, tuple) else (key, 0)
        shown = f"{name:04X}h" if isinstance(name, int) else repr(name)
        raise self._refused(f"it has no object dictionary, so it has no {shown}")


class NodeAccess:
    """One node: ``sdo``, its NMT state and commands, its emergency messages, and its active PDOs."""

    def __init__(
        self,
        parts: NodeParts,
        await_cycle: Callable[[], None] = lambda: None,
        core: CoreInterface | None = None,
    ) -> None:
        """``parts``: the node's parts of its link. ``await_cycle`` waits until the axes have values of a later time.

        ``core``: that of the running machine; None if none runs.
        """
        self.parts = parts
        self._await_cycle = await_cycle
        self._core = core
        self.node_id = node_id = parts.node_id
        self.eds = eds = parts.eds
        self.plans = parts.plans
        dictionary = Dictionary(eds, node_id)
        self.sdo = (
            SdoAccess(parts.objects, dictionary, _cyclic(parts.plans), self.require_unclaimed)
            if parts.objects_refused is None
            else NoSdoAccess(parts.objects_refused, parts.objects, dictionary)
        )
        self._objects = parts.objects
        self._node = parts.node
        self._clock = parts.clock
        self._events = parts.events
        self._make = parts.make

    def __repr__(self) -> str:
        product = self.eds.info.get("deviceinfo", {}).get("productname", "") or self._make.name
        return f"<NodeAccess {self.node_id}: {product}, {self.nmt.text}>"

    def measure(self, what: str, drive_axis: int = 1) -> float:
        """Read ``temperature`` (°C), ``voltage`` (V) or ``current`` (A) of an axis (from 1); blocks for one or two transfers.

        Raises:
            StateError: the object for it is unknown, or the drive has none.
            SdoAbort, SdoTimeout: the node refuses, or does not answer.
        """
        if self.parts.objects_refused is not None:
            raise self.parts.objects_refused("")
        return measure(what, self._objects, self.eds, self._make, drive_axis)

    @property
    def nmt(self) -> NmtState:
        """The NMT state that the node reported last."""
        state: NmtState = self._node.nmt.state
        return state

    def command(self, command: NmtCommand, timeout: float = 2.0) -> None:
        """Send an NMT command and wait until the node confirms it; blocks up to ``timeout`` seconds.

        If a node leaves operational, its axes treat it as lost: they stop and go to ErrorStop. When this method returns, the axes
        have processed the new state, so that a reset may follow at once.

        Raises:
            StateError: the node uses CAN Simple, which has no NMT; or it is being booted, or its program is being written.
            NodeRefused: the node is present and reports another state; the error includes its error state.
            NodeTimeout: no confirmation.
        """
        self.require_unclaimed(f"the NMT command {command.name.lower().replace('_', ' ')}")
        before = self._node.nmt.reports
        try:
            self._node.command(command, timeout)
        except NodeTimeout as error:
            if self._node.nmt.reports > before:  # the node is present
                error.observed = f"{error.observed}; {self._errors()}"
            raise
        self._await_cycle()

    def require_unclaimed(self, what: str) -> None:
        """Check that the node is not being booted and its program not written; ``what`` would be sent.

        Raises:
            StateError: it is: a write or an NMT command would disturb that.
        """
        if self._core is not None:
            self._core.require_unclaimed(self.node_id, what)

    def boot(self, progress: Callable[[str], None] = lambda _: None) -> NodeReport:
        """Boot the node while the machine runs, as when it was opened (CiA 302-2), and return its report; energises nothing.

        For a node that was lost or has restarted, and for one that is to be configured again. The other axes continue. Its own
        axes begin again in ErrorStop: reset and enable them, and home those that need it (an axis with ``absolute`` in its
        homing table stays homed). Nothing else from before remains: overrides, couplings, interrupted paths. Blocks for the
        boot-up, at most some seconds, longer if its program is replaced; a stop that is under way ends first. Several nodes may
        be booted at the same time, in several threads. ``progress`` is called in this thread with the name of each step as it
        begins.

        Raises:
            StateError: an axis of the node is enabled or commanded, two devices have its node-ID, the node uses CAN Simple, or the
                machine is being closed.
            OwnershipError: this program has no control.
            BootError: the boot-up has failed, or the drive is still enabled; the node may be booted again.
        """
        return self._running().boot_node(self.node_id, progress).report

    def find_replacement(self) -> list[FoundDrive]:
        """Return the drives that can replace the drive of this node, for ``axisbus replace``; blocks for up to about 12 s.

        Raises:
            OwnershipError: this program has no control.
            StateError, LssError, BusError: as ``configuration.replacement.find_drives``.
        """
        return self._running().find_replacement(self.node_id)

    def replace_drive(self, order: ReplacementOrder, progress: Tell = lambda _: None) -> ReplacementOutcome:
        """Configure and boot the new drive of this node, for ``axisbus replace``; blocks for up to about a minute.

        The other axes continue, and nothing is enabled. The axes of the node begin again, as after ``boot``. ``progress`` is called
        in this thread with each step as it begins.

        Raises:
            StateError: an axis of the node is enabled or commanded, or the node is neither lost nor another drive.
            OwnershipError: this program has no control.
            Other errors as ``boot`` and ``configuration.replacement.DriveReplacement.run``.
        """
        return self._running().replace_drive(order, progress)

    def _running(self) -> CoreInterface:
        if self._core is None:
            raise StateError(f"node {self.node_id} can only be booted by a running machine")
        return self._core

    def write_program(
        self,
        data: bytes,
        *,
        identification: int | None = None,
        deadline: float | None = None,
        progress: Progress | None = None,
    ) -> ProgramWritten:
        """Replace the program (firmware) of the node while the machine runs, and return what it reports before and after.

        For a node whose axes are disabled, or in ErrorStop. They cannot be enabled meanwhile, and the node must be booted
        afterwards (``boot``). The other axes continue. The program is stopped, cleared, transferred and started (CiA 302-3:
        1F50h, 1F51h). After an interruption, for example of the node's supply, call it again: it begins from the start. Blocks
        for minutes. If the machine is closed meanwhile, the node has no program.

        ``data`` are the bytes of 1F50h. ``identification``: the value that 1F56h:01 must have afterwards. ``deadline``: seconds for
        each part of the work, by default 60, more for large programs. ``progress(done, all)`` is called with the confirmed bytes.

        Raises:
            ArgumentError: no data.
            StateError: an axis of the node is enabled or commanded, the node is being booted, or it has no 1F50h and 1F51h.
            OwnershipError: this program has no control.
            NodeError: the write has failed; write the program again.
            SdoTimeout: the node did not answer before the write began.
        """
        order = ProgramOrder(bytes(data), identification, deadline)
        return self._running().write_program(self.node_id, order, progress)

    def _errors(self) -> str:
        last = self.emcy[-1] if self.emcy else None
        ago = 0.0 if last is None else self._clock.now() - last.stamp
        return error_state.read(self._objects, last, ago).words(self._make)

    @property
    def emcy(self) -> deque[Emcy]:
        """The last 64 emergency messages, oldest first."""
        log: EmcyLog = self._node.emcy
        return log.history

    @property
    def events(self) -> list[NodeEvent]:
        """The events of error control for this node since the scan began, oldest first, each with its reaction time.

        At most the last 256, and at most one of each kind per second, which contains the number of occurrences. Empty for a node
        that did not come up.
        """
        return [] if self._events is None else self._events.events

    def on_event(self, callback: Callable[[NodeEvent], None]) -> None:
        """Register ``callback`` for every further event. It runs in the scan's thread and must not block."""
        if self._events is not None:
            self._events.subscribe(callback)

    @property
    def incidents(self) -> tuple[Incident, ...]:
        """The last 32 incidents, oldest first: faults, the messages within 0.1 s, and the resets that followed."""
        log: EmcyLog = self._node.emcy
        return tuple(log.incidents)

    def format_incident(self, incident: Incident) -> list[str]:
        """Return an incident as lines of text, according to CiA 301, CiA 402 and the drive plug-in's table."""
        return incident_words(incident, self._make, self._clock.now())

    @property
    def pdo_events(self) -> tuple[PdoEvent, ...]:
        """The last 64 times that a TPDO, or a message of CAN Simple, timed out or returned, oldest first."""
        return tuple(self._node.pdo_events)

    def error_history(self) -> tuple[ErrorEntry, ...] | None:
        """Read the node's own list of its errors (1003h), newest first; None if it has none. Blocks for a few transfers.

        Raises:
            SdoTimeout, BusError: the node does not answer.
        """
        if not self.parts.has_objects:
            return None
        return errorfield.read(lambda index, subindex: read_int(self._objects, index, subindex))

    def format_error_history(self) -> list[str]:
        """Return the same list as lines of text; blocks and raises as ``error_history``."""
        entries = self.error_history()
        if entries is None:
            return ["the node stores no error history (no 1003h)"]
        return [history_words(entry, self._make) for entry in entries] or ["no errors are listed in 1003h"]

    @property
    def canopen(self) -> Any:
        """The node as ``canopen.RemoteNode``, for programs that use that library; its SDO uses the client of axisbus.

        The library loads the EDS for it, which may take a second, once per file.

        Raises:
            StateError: the bus belongs to another process; or the node uses CAN Simple.
        """
        if self.parts.objects_refused is not None:
            raise self.parts.objects_refused("it is not a node of CANopen")
        from axisbus.bus.node.node import CanopenNode
        from axisbus.bus.node.remote import remote_node

        node = self._node
        if not isinstance(node, CanopenNode):
            raise StateError(
                f"node {self.node_id}: its bus belongs to the core in its own process",
                remedy='write process = "thread" in [bus] to use it by the canopen library, or use node.sdo and node.command',
            )
        return remote_node(node)

    def mapped_in(self, index: int, subindex: int = 0) -> PdoLocation | None:
        """Return the active PDO that contains an object: identifier, PDO, first bit, number of bits. None if there is none.

        ``index`` is the device's own. Does not block.
        """
        found = (plan.carrier(index, subindex) for plan in self.parts.plans)
        return next((place for place in found if place is not None), None)

    def pdos(self) -> list[str]:
        """Return the active PDOs, each as a line of text."""
        from axisbus.bus.pdo.plantext import describe

        return [line for plan in self.plans for line in describe(plan).splitlines()]


def _cyclic(plans: tuple[PdoPlan, ...]) -> frozenset[tuple[int, int]]:
    """Return the objects that the scan sends by PDO, as index and sub-index."""
    sent = [pdo for plan in plans for pdo in plan.active if pdo.receive]
    return frozenset((mapped.index, mapped.subindex) for pdo in sent for mapped in pdo.target.mapping)


# ----------------------------------------------------------------------------------------------------------------------
# Values of a drive that are not cyclic: temperature, voltage, current, by standard objects or those of the drive plug-in.


def measure(what: str, objects: NodeObjects, eds: Eds, make: DrivePlugin, drive_axis: int = 1) -> float:
    """Read ``what`` (``temperature`` in °C, ``voltage`` in V, ``current`` in A) of a drive's axis (from 1); blocks.

    Raises:
        StateError: the object for it is unknown, or the drive does not have it.
        SdoAbort, SdoTimeout: the drive refuses, or does not answer.
    """
    found = make.measured.get(what) or STANDARD_MEASURED.get(what)
    if found is None:
        raise StateError(
            f"node {objects.node_id}: its {what} is not known",
            observed=f"CiA 402 has no object for it, and no object of the manufacturer ({make.name}) is known",
            remedy="read the manufacturer's object: machine.node(ID).sdo[0x2000]",
        )
    _require(found, what, objects, eds, drive_axis)
    value = _read(objects, own_index(found.index, drive_axis), found.subindex) * found.factor
    return value if found.of is None else value * _read(objects, own_index(found.of, drive_axis), 0)


def _require(found: MeasuredObject, what: str, objects: NodeObjects, eds: Eds, drive_axis: int) -> None:
    wanted = [(found.index, found.subindex)] + ([] if found.of is None else [(found.of, 0)])
    for index, subindex in wanted:
        index = own_index(index, drive_axis)
        if eds.get(index, subindex) is None:
            raise StateError(
                f"node {objects.node_id}: it does not report its {what}",
                observed=f"its EDS has no {index:04X}h:{subindex:02X}",
                remedy="if the drive has it, name the drive's own EDS in cell.toml",
            )


def _read(objects: NodeObjects, index: int, subindex: int) -> float:
    value = objects.read(index, subindex)
    assert isinstance(value, (int, float)), f"{index:04X}h:{subindex:02X} is not a number"
    return float(value)
