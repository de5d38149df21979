"""One axis of a drive on the bus, as motion sees it: its newest values in, its outputs as RPDO frames and SDO writes out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace

from axisbus.bus.link.channel import Receiver
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo import freshness, setpoint_edge_order
from axisbus.bus.pdo.freshness import lags_of
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.rpdo import REPEAT, Frame, RpdoImage, RpdoPace
from axisbus.bus.pdo.sdo_exchange import Poller, SdoOutputs, is_motion, is_stop, prime_inputs, prime_outputs
from axisbus.bus.pdo.setpoint_edge_order import CONTROLWORD
from axisbus.bus.pdo.tpdo_inputs import Requests, TpdoInputs, TpdoSlot
from axisbus.bus.pdo.tpdo_timeout import Deadline
from axisbus.bus.sdo.worker import SdoJob
from axisbus.cia301 import abort, cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia402.axes import own_index
from axisbus.cia402.controlword import HALT, NEW_SET_POINT, PowerCommand
from axisbus.cia402.port import (
    INPUT_OBJECTS,
    OUTPUT_OBJECTS,
    Capabilities,
    Inputs,
    Outputs,
    Sample,
    SdoReply,
    SdoRequest,
)
from axisbus.cia402.state import ENERGISED, decode
from axisbus.errors import BusError, BusOff

_OPERATIONAL = NmtState.OPERATIONAL  # compared in every cycle
assert Inputs._fields[2:8] == tuple(INPUT_OBJECTS)  # the order in which ``read`` uses them
_ALL_QUIET = Inputs(0.0, True, *(None,) * 6, nmt=int(_OPERATIONAL))[
    8:
]  # of an operational node without further events
_tuple = tuple.__new__  # makes a named tuple from fitting values without the cost of its own ``__new__``
_DUPLICATE_WITHIN = 1.0  # seconds after a boot-up message in which an energised drive proves a second device
_QUICK_STOP_SDO = bytes((0x2B, 0, 0, 0)) + PowerCommand.QUICK_STOP.word.to_bytes(4, "little")


class CanPort:
    """One axis over CAN (``axisbus.cia402.port.Port``); holds state: the PDO images, the samples, and the running SDO transfers.

    ``read``, ``write`` and ``take_frames`` belong to the scan's thread, ``stop_frames`` may be called from any.

    A boot-up message has three possible causes: the node has restarted and lost its PDO configuration, a second device has its
    node-ID, or the message is forged. The same is possible if the first report of a node after a bus-off is not operational. From
    then on the node counts as not operational until a new port is made. The port sends it only stops, in three ways: the last
    committed RPDOs with the controlword of the stop, the controlword by SDO, and NMT stop. These RPDOs cannot enable a drive that
    has really restarted and maps them differently: their content does not change, and enabling takes several different
    controlwords.
    """

    def __init__(
        self,
        node: CanopenNode,
        plan: PdoPlan,
        *,
        scan_period: float,
        remappable: bool = True,
        rpdo_repeat: float = REPEAT,
        foreign_sync: bool = False,
    ) -> None:
        """Listen to the TPDOs of ``plan``, which the drive has; ``scan_period`` in seconds. Sends nothing.

        ``rpdo_repeat``: maximum time in seconds until an unchanged event-driven RPDO is sent again. ``foreign_sync``: another
        device sends SYNC.
        """
        self.node = node
        self.plan = plan
        self.axis = plan.axis
        self._capabilities = Capabilities(
            inputs=dict(plan.inputs),
            outputs=dict(plan.outputs),
            remappable=remappable,
            max_age=freshness.max_ages(plan, scan_period),
            edge_delay=setpoint_edge_order.delay(plan.edge_after_target, foreign_sync),
        )
        self._nmt = node.nmt
        self._bootups = node.nmt.bootups
        received = [pdo for pdo in plan.active if not pdo.receive]
        self._slots = [TpdoSlot(pdo, self._dropping(pdo.target.cob_id)) for pdo in received]
        deadlines = [
            Deadline(node.node_id, pdo.name, pdo.target.cob_id, freshness.pdo_age(pdo, scan_period))
            for pdo in received
        ]
        self._lags = lags_of(list(zip(self._slots, received, strict=True)), scan_period, node, foreign_sync)
        self._look_by = self._lags.look_by
        self._tpdo_inputs = TpdoInputs(
            list(zip(self._slots, deadlines, strict=True)), scan_period, self._lags
        )
        self._requests = Requests(self._slots)
        self.asks = bool(self._requests)  # whether there are TPDOs to request at all
        sent = [pdo for pdo in plan.active if pdo.receive]
        self._images = [RpdoImage(pdo) for pdo in sent]
        self._pace = RpdoPace(sent, self._images, scan_period, rpdo_repeat)
        self._now = -math.inf  # of the newest ``read``
        self._operational = False  # as last reported to motion
        polls = freshness.polls(plan)
        self._poller = Poller(node.worker, polls, self.index) if polls else None
        self._sdo_outputs = SdoOutputs(node.worker, plan.outputs, self.index)
        # The only RPDO, if it carries all outputs to the drive in every cycle.
        is_only = len(sent) == 1 and self._pace.plain and self._sdo_outputs.none
        self._only_image = self._images[0] if is_only and self._images[0].holds_controlword else None
        self._has_optional_outputs = len(plan.outputs.keys() - OUTPUT_OBJECTS.keys()) > 0
        self._emcy = node.emcy.feed()
        self._emergencies = self._emcy.waiting
        self._replies: deque[SdoReply] = deque()
        self._controlword: int | None = None
        self._frames: list[Frame] = []
        self._committed: dict[int, bytes] = {}  # the last frame of each RPDO, by its COB-ID
        self._nmt_stopped = False
        self._channel = node.channel
        self._bus_off_count = node.channel.bus_off_count
        self._returning = False  # from a bus-off; no report of the node has come since
        self._doubtful_since: float | None = None  # end of a bus-off during which the node may have restarted
        self._energised_stamp = (
            -math.inf
        )  # of the newest statusword after a boot-up that shows an energised drive
        for slot in self._slots:
            node.channel.subscribe_cyclic(slot.cob_id, slot.on_frame)

    # -- interface to motion ------------------------------------------------------------------------------------------------------

    @property
    def capabilities(self) -> Capabilities:
        """The transport of the axis's values."""
        return replace(self._capabilities, guarded=self.node.nmt.guarded)

    @property
    def rebooted(self) -> bool:
        """Whether the node has sent a boot-up message since this port was made."""
        return self.node.nmt.bootups != self._bootups

    def read(self, now: float) -> Inputs:
        """Return the newest values and start due polls; does not block."""
        nmt, tpdo_inputs = self._nmt, self._tpdo_inputs
        if tpdo_inputs.steady and now < self._look_by and not self._emergencies and not self._replies:
            channel = self._channel
            if (
                nmt.state is _OPERATIONAL
                and now <= nmt.deadline
                and nmt.bootups == self._bootups
                and channel.bus_off_count == self._bus_off_count
                and channel.off is None
            ):
                samples = tpdo_inputs.renewed(now)
                if samples is not None:
                    self._now = now
                    return _tuple(Inputs, (now, True, *samples, *_ALL_QUIET))
        emcy = self._emcy.take() if self._emergencies else ()
        replies = self._take_replies() if self._replies else ()
        channel = self._channel
        bus_changed = (
            channel.bus_off_count != self._bus_off_count or self._returning or channel.off is not None
        )
        bus = self._bus_off() if bus_changed else None
        state, silent = nmt.state, now > nmt.deadline  # now, and not before the frames that may cause them
        since = self._restarted_since
        operational = bus is None and since is None and state is _OPERATIONAL and not silent
        if operational and not self._operational:
            self._pace.forget()  # the drive has not accepted what was sent before
        self._now, self._operational = now, operational
        samples, events = tpdo_inputs.look(now, operational, self._poller)
        if events:
            self.node.pdo_events.extend(events)
        if since is not None:
            samples = [each if each is not None and each.stamp > since else None for each in samples]
            self._look_for_duplicate(samples[0], since)
        lags = self._lags
        lags.ask(now, operational, self.node.worker)
        self._look_by = lags.look_by
        return _tuple(
            Inputs,
            (
                *(now, operational, *samples, emcy, replies, int(state), bus, silent),
                *(since is not None, nmt.duplicate, lags.late),
            ),
        )

    def write(self, outputs: Outputs) -> None:
        """Set the outputs of this cycle; ``BusCycle.commit`` sends those with a PDO. Does not block.

        Raises:
            StateError: an RPDO would have to be sent although the port was not primed.
        """
        image = self._only_image
        controlword, _, _, _, _, sdo, cancel, nmt_stop, _, _, _ = outputs
        is_special = sdo or cancel or nmt_stop or controlword is None or self._nmt_stopped
        if (
            image is None
            or is_special
            or self._doubtful_since is not None
            or self._nmt.bootups != self._bootups
        ):
            self._write_any(outputs)
            return
        self._frames = [image.frame_of(outputs)]
        self._controlword = controlword

    def _write_any(self, outputs: Outputs) -> None:
        if outputs.cancel:
            self.node.worker.cancel({(self, number) for number in outputs.cancel})
        if self._restarted_since is None:
            self._write_all(outputs)
        else:
            self._write_stop(outputs)
        if outputs.nmt_stop and not self._nmt_stopped:
            self._frames.append((cob.NMT, bytes((NmtCommand.STOP, self.node.node_id))))
        self._nmt_stopped = outputs.nmt_stop

    def _write_all(self, outputs: Outputs) -> None:
        for request in outputs.sdo:
            self._submit(request)
        given = _standard_outputs(outputs)
        if self._has_optional_outputs:
            given.update(_optional_outputs(outputs))
        controlword = self._hold_back(self._sdo_outputs.take(given, outputs.controlword))
        self._frames = self._pace.frames(given, controlword, self._controlword, self._now)
        if controlword is not None:
            self._controlword = controlword

    def _write_stop(self, outputs: Outputs) -> None:
        """Send only stops to the drive, and only read requests."""
        self._frames = []
        for request in outputs.sdo:
            if request.value is None or _stops(request):
                self._submit(request)
            else:
                self._replies.append(SdoReply(request.id, None, abort.TIMED_OUT))
        word = outputs.controlword
        if word is not None and is_stop(word):
            self._sdo_outputs.take({}, word)
            self._frames = list(self._stops_by_pdo(word))

    # -- for the cycle ------------------------------------------------------------------------------------------------------------

    def index(self, first_axis: int) -> int:
        """Return this axis's index of an object of the first axis; other objects are shared by all axes."""
        return own_index(first_axis, self.axis)

    def take_frames(self) -> list[Frame]:
        """Return the frames given since the last call, in the order in which they must be sent."""
        frames = self._frames
        if frames:
            self._frames = []
            self._committed.update(frames)
        return frames

    @property
    def committed(self) -> Mapping[int, bytes]:
        """The last frame of each RPDO, by its COB-ID; it changes with every cycle."""
        return self._committed

    @property
    def controlwords(self) -> list[tuple[int, int]]:
        """The COB-ID of each RPDO that holds the controlword, and the number of bits before it."""
        return [(image.cob_id, image.controlword_shift) for image in self._images if image.holds_controlword]

    @property
    def cleared_bits(self) -> list[tuple[int, int]]:
        """The COB-ID of each RPDO with bits that are set to 0 in a stop, and these bits (see ``RpdoImage.cleared_bits``)."""
        return [(image.cob_id, bits) for image in self._images if (bits := image.cleared_bits)]

    def drop_frames(self) -> None:
        """Discard the frames given since the last call: the bus cannot carry them, and later they would be outdated."""
        self._frames = []
        self._pace.forget()
        self._nmt_stopped = False  # it was not sent, and must be sent if it is still requested then

    def begin_again(self) -> None:
        """Discard the frames to send and all values received: the adapter was opened again, and the drive was stopped by SDO."""
        self.drop_frames()
        self._tpdo_inputs.forget()

    def take_requests(self, now: float) -> list[tuple[int, int]]:
        """Return the TPDOs to request by remote frames now, as COB-ID and data length; none while the node cannot answer."""
        return self._requests.due(now) if self.asks and self.node.nmt.operational(now) else []

    def stop_frames(self) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
        """Return the frames of a quick stop, by PDO and by SDO; none for an axis that never got a controlword.

        The PDO frames are the last committed ones, with the controlword replaced and offsets of 0.
        """
        if self._controlword is None and not self._sdo_outputs.commanded:
            return (), ()
        index = self.index(OUTPUT_OBJECTS[CONTROLWORD]).to_bytes(2, "little")
        sdo = _QUICK_STOP_SDO[:1] + index + _QUICK_STOP_SDO[3:]
        by_pdo = self._stops_by_pdo(PowerCommand.QUICK_STOP.word)
        return by_pdo, ((cob.SDO_RX + self.node.node_id, sdo),)

    def prime(self) -> None:
        """Read by SDO the values that no TPDO may send soon, and those that an RPDO would overwrite; blocks for a dozen transfers.

        Call this after the plan has been applied and before the scan starts.

        Raises:
            BootError: an RPDO holds an object that cannot be read.
            SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
        """
        samples = self._tpdo_inputs.samples
        samples.update(prime_inputs(self.node.sdo, self.plan, self.index))
        prime_outputs(self.node.sdo, self.plan, self._images, samples)

    def close(self) -> None:
        """Stop listening; harmless when repeated."""
        self.node.emcy.end_feed(self._emcy)
        for slot in self._slots:
            self.node.channel.unsubscribe(slot.cob_id, slot.on_frame)

    def _dropping(self, cob_id: int) -> Receiver:
        drops, node_id = self.node.channel.drops, self.node.node_id
        return lambda data, stamp: drops.note(DropReason.SHORT_PDO, node_id, stamp, cob_id, data)

    # -- details ------------------------------------------------------------------------------------------------------------------

    def _bus_off(self) -> BusError | None:
        """Return why nothing can be sent, at least once for each bus-off, however short it was."""
        channel = self._channel
        bus_off_count, self._bus_off_count = self._bus_off_count, channel.bus_off_count
        off = channel.off or (channel.last_bus_off if bus_off_count != self._bus_off_count else None)
        if bus_off_count != self._bus_off_count or isinstance(off, BusOff):
            self._returning = True
        elif off is None and self._returning and self.node.nmt.state is not NmtState.UNKNOWN:
            self._returning = False
            if self.node.nmt.assumed or self.node.nmt.state is not NmtState.OPERATIONAL:
                self._doubtful_since = self._now if self._doubtful_since is None else self._doubtful_since
        return off

    @property
    def _restarted_since(self) -> float | None:
        """Time of the node's boot-up message, or of a possible unnoticed restart; None if there is neither."""
        if self.rebooted:
            return self.node.nmt.bootup_stamp or 0.0
        return self._doubtful_since

    def _look_for_duplicate(self, statusword: Sample | None, since: float) -> None:
        """Detect a second device: a drive that has restarted is not energised, so an energised drive sent no boot-up message.

        Two statuswords are required, because the first may have been sent before the boot-up and delayed. Both must come shortly
        after the boot-up, because later another master may have enabled the drive.
        """
        if statusword is None or statusword.stamp <= self._energised_stamp or not self.rebooted:
            return
        late = statusword.stamp - since > _DUPLICATE_WITHIN
        if late or self._nmt.duplicate or decode(statusword.value) not in ENERGISED:
            return
        first, self._energised_stamp = self._energised_stamp, statusword.stamp
        if first > since:
            after = (statusword.stamp - since) * 1000
            seen = f"statusword 0x{statusword.value:04X}, of an energised drive, {after:.0f} ms after it"
            self._nmt.note_duplicate(f"a boot-up message came, and the drive has not restarted: {seen}")

    def _stops_by_pdo(self, word: int) -> tuple[Frame, ...]:
        """Return the last committed RPDOs with the controlword of a stop, and offsets of 0."""
        committed = self._committed.copy()
        return tuple(
            image.with_controlword(committed[image.cob_id], word)
            for image in self._images
            if image.cob_id in committed and (image.holds_controlword or image.cleared_bits)
        )

    def _hold_back(self, controlword: int | None) -> int | None:
        """Hold back a controlword that may start a motion until the values written by SDO have arrived.

        A halt is never held back. During a halt only the edge of bit 4 waits; without the new target the drive would use its old
        one.
        """
        if controlword is None or not self._sdo_outputs.pending:
            return controlword
        if is_motion(controlword):
            return self._controlword
        if controlword & HALT and not (self._controlword or 0) & NEW_SET_POINT:
            return controlword & ~NEW_SET_POINT
        return controlword

    def _take_replies(self) -> tuple[SdoReply, ...]:
        replies = self._replies
        return tuple(replies.popleft() for _ in range(len(replies)))

    def _submit(self, request: SdoRequest) -> None:
        index = self.index(request.index)
        undo = self._into_images(index, request)

        def done(value: int | None, code: int | None) -> None:
            if code is not None:
                for image, old in undo:
                    image.put(index, request.subindex, old)
            self._replies.append(SdoReply(request.id, value, code))

        job = SdoJob((self, request.id), index, request.subindex, request.value, done)
        if _stops(request):
            self.node.worker.urgent(job)  # no transfer that waits for an answer may be before it
        else:
            self.node.worker.submit(job)

    def _into_images(self, index: int, request: SdoRequest) -> list[tuple[RpdoImage, int]]:
        """Store a value in the RPDOs that hold the object, before it is written.

        Else the next frame would restore the old value.
        """
        undo: list[tuple[RpdoImage, int]] = []
        if request.value is None:
            return undo
        for image in self._images:
            old = image.value(index, request.subindex)
            if old is not None and image.put(index, request.subindex, request.value):
                undo.append((image, old))
        return undo


def _stops(request: SdoRequest) -> bool:
    """Whether an SDO request writes a controlword that stops the drive."""
    return (
        request.index == OUTPUT_OBJECTS[CONTROLWORD] and request.value is not None and is_stop(request.value)
    )


def _optional_outputs(outputs: Outputs) -> dict[str, int]:
    """Return the outputs that only some axes have."""
    values = (
        ("velocity_offset", outputs.velocity_offset),
        ("torque_offset", outputs.torque_offset),
        ("interpolation_target", outputs.interpolation_target),
    )
    return {name: value for name, value in values if value is not None}


def _standard_outputs(outputs: Outputs) -> dict[str, int]:
    values = (
        ("mode", outputs.mode),
        ("target_position", outputs.target_position),
        ("target_velocity", outputs.target_velocity),
        ("target_torque", outputs.target_torque),
    )
    return {name: value for name, value in values if value is not None}
