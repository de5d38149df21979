"""One axis of a drive on the bus, as motion sees it: its newest values in, its outputs as RPDO frames and SDO writes out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace

from axisbus.bus.link.channel import Receiver
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo import freshness, setpoint_edge_order
from axisbus.bus.pdo.initial_values import prime_inputs, prime_outputs
from axisbus.bus.pdo.lag import lags_of
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.poller import Poller
from axisbus.bus.pdo.rpdo import Frame, RpdoImage
from axisbus.bus.pdo.rpdo_schedule import REPEAT, RpdoPace
from axisbus.bus.pdo.sdo_output import SdoOutputs, is_motion, is_stop
from axisbus.bus.pdo.setpoint_edge_order import CONTROLWORD
from axisbus.bus.pdo.tpdo import Requests, TpdoSlot
from axisbus.bus.pdo.tpdo_inputs import Incoming
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

_OPERATIONAL = NmtState.OPERATIONAL  # looked at in every cycle
assert Inputs._fields[2:8] == tuple(INPUT_OBJECTS)  # ``read`` takes them in this order
_ALL_QUIET = Inputs(0.0, True, *(None,) * 6, nmt=int(_OPERATIONAL))[
    8:
]  # of a node that is operational, and says nothing more
_tuple = tuple.__new__  # makes a named tuple of what is known to fit, without the call of its own ``__new__``
_DUPLICATE_WITHIN = 1.0  # seconds after a boot-up message in which an energised drive shows a second device
_QUICK_STOP_SDO = bytes((0x2B, 0, 0, 0)) + PowerCommand.QUICK_STOP.word.to_bytes(4, "little")


class CanPort:
    """One axis over CAN (``cia402.port.Port``); holds state: the PDO images, the samples, and what is under way by SDO.

    ``read``, ``write`` and ``take_frames`` belong to the scan's thread, ``stop_frames`` may be called from any.

    A boot-up message says that the node has restarted and lost its PDO configuration, or that a second device has its node-ID, or
    it is forged. The same is possible of a node that is not operational in its first word after a bus-off. From then on the node is
    not operational until a new port is made, and the port sends it only what stops a drive, by every path: the RPDOs that were
    committed last with the controlword of the stop, the controlword by SDO, and NMT stop. The RPDOs cannot enable a drive that
    really has restarted and maps them otherwise: their content does not change, and enabling takes several controlwords in turn.
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
        """Listen to the TPDOs of ``plan``, which holds in the drive; ``scan_period`` in seconds. Sends nothing.

        ``rpdo_repeat``: seconds after which an event-driven RPDO is sent again at the latest, though nothing has changed.
        ``foreign_sync``: another device sends SYNC.
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
        self._incoming = Incoming(list(zip(self._slots, deadlines, strict=True)), scan_period, self._lags)
        self._requests = Requests(self._slots)
        self.asks = bool(self._requests)  # whether there are TPDOs to be asked for at all
        sent = [pdo for pdo in plan.active if pdo.receive]
        self._images = [RpdoImage(pdo) for pdo in sent]
        self._pace = RpdoPace(sent, self._images, scan_period, rpdo_repeat)
        self._now = -math.inf  # of the newest ``read``
        self._operational = False  # as it has told
        polls = freshness.polls(plan)
        self._poller = Poller(node.worker, polls, self.index) if polls else None
        self._sdo_outputs = SdoOutputs(node.worker, plan.outputs, self.index)
        # Where one RPDO takes all outputs to the drive, in every cycle: that.
        alone = len(sent) == 1 and self._pace.plain and self._sdo_outputs.none
        self._only_image = self._images[0] if alone and self._images[0].holds_controlword else None
        self._sends_more = len(plan.outputs.keys() - OUTPUT_OBJECTS.keys()) > 0
        self._emcy = node.emcy.feed()
        self._emergencies = self._emcy.waiting
        self._replies: deque[SdoReply] = deque()
        self._controlword: int | None = None
        self._frames: list[Frame] = []
        self._committed: dict[int, bytes] = {}  # the last frame of each RPDO, by its COB-ID
        self._nmt_stopped = False
        self._channel = node.channel
        self._offs = node.channel.offs
        self._returning = False  # from a bus-off; nothing was heard of it since
        self._doubtful_since: float | None = None  # when a bus-off ended during which it may have restarted
        self._energised_stamp = (
            -math.inf
        )  # of the newest statusword after a boot-up that shows an energised drive
        for slot in self._slots:
            node.channel.subscribe_cyclic(slot.cob_id, slot.on_frame)

    # -- the seam -----------------------------------------------------------------------------------------------------------------

    @property
    def capabilities(self) -> Capabilities:
        """How the axis's values travel."""
        return replace(self._capabilities, guarded=self.node.nmt.guarded)

    @property
    def rebooted(self) -> bool:
        """Whether the node has sent a boot-up message since this port was made."""
        return self.node.nmt.bootups != self._bootups

    def read(self, now: float) -> Inputs:
        """Return the newest values and start what polling is due; does not block."""
        nmt, incoming = self._nmt, self._incoming
        if incoming.steady and now < self._look_by and not self._emergencies and not self._replies:
            channel = self._channel
            if (
                nmt.state is _OPERATIONAL
                and now <= nmt.deadline
                and nmt.bootups == self._bootups
                and channel.offs == self._offs
                and channel.off is None
            ):
                samples = incoming.renewed(now)
                if samples is not None:
                    self._now = now
                    return _tuple(Inputs, (now, True, *samples, *_ALL_QUIET))
        emcy = self._emcy.take() if self._emergencies else ()
        replies = self._take_replies() if self._replies else ()
        channel = self._channel
        news = channel.offs != self._offs or self._returning or channel.off is not None
        bus = self._bus_off() if news else None
        state, silent = nmt.state, now > nmt.deadline  # now, and not before what they may be the answer to
        since = self._restarted_since
        operational = bus is None and since is None and state is _OPERATIONAL and not silent
        if operational and not self._operational:
            self._pace.forget()  # what was sent before, it has not taken
        self._now, self._operational = now, operational
        samples, events = incoming.look(now, operational, self._poller)
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
        """Take the outputs of this cycle; what travels by PDO is sent by ``BusCycle.commit``. Does not block.

        Raises:
            StateError: an RPDO would have to be sent although the port was not primed.
        """
        image = self._only_image
        controlword, _, _, _, _, sdo, cancel, nmt_stop, _, _, _ = outputs
        seldom = sdo or cancel or nmt_stop or controlword is None or self._nmt_stopped
        if image is None or seldom or self._doubtful_since is not None or self._nmt.bootups != self._bootups:
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
        given = _given(outputs)
        if self._sends_more:
            given.update(_more(outputs))
        controlword = self._held_back(self._sdo_outputs.take(given, outputs.controlword))
        self._frames = self._pace.frames(given, controlword, self._controlword, self._now)
        if controlword is not None:
            self._controlword = controlword

    def _write_stop(self, outputs: Outputs) -> None:
        """Send only what stops the drive, and ask only for what shows how it is."""
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
        """Return the index that an object of the first axis has for this axis; others are shared by all axes."""
        return own_index(first_axis, self.axis)

    def take_frames(self) -> list[Frame]:
        """Return the frames given since the last call, in the order in which they must go out."""
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
        """The COB-ID of each RPDO that holds the controlword, and how many bits before it are others'."""
        return [(image.cob_id, image.controlword_shift) for image in self._images if image.holds_controlword]

    @property
    def cleared_bits(self) -> list[tuple[int, int]]:
        """The COB-ID of each RPDO with bits that are set to 0 in a stop, and these bits (see ``RpdoImage.cleared_bits``)."""
        return [(image.cob_id, bits) for image in self._images if (bits := image.cleared_bits)]

    def drop_frames(self) -> None:
        """Forget the frames given since the last call: the bus carries none, and later they would be of long ago."""
        self._frames = []
        self._pace.forget()
        self._nmt_stopped = False  # it was not sent, and must be if it is still wanted then

    def take_requests(self, now: float) -> list[tuple[int, int]]:
        """Return the TPDOs to be asked for by a remote frame now, as COB-ID and data length; none while the node cannot answer."""
        return self._requests.due(now) if self.asks and self.node.nmt.operational(now) else []

    def stop_frames(self) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
        """Return the frames of a quick stop, by PDO and by SDO; none for an axis that never got a controlword.

        The PDO frames are those that were last committed, with the controlword replaced and offsets of 0.
        """
        if self._controlword is None and not self._sdo_outputs.commanded:
            return (), ()
        index = self.index(OUTPUT_OBJECTS[CONTROLWORD]).to_bytes(2, "little")
        sdo = _QUICK_STOP_SDO[:1] + index + _QUICK_STOP_SDO[3:]
        by_pdo = self._stops_by_pdo(PowerCommand.QUICK_STOP.word)
        return by_pdo, ((cob.SDO_RX + self.node.node_id, sdo),)

    def prime(self) -> None:
        """Read by SDO what no TPDO may bring soon, and what an RPDO would otherwise overwrite; blocks for a dozen transfers.

        To be called once the plan holds and before the scan starts.

        Raises:
            BootError: an RPDO holds an object that cannot be read.
            SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
        """
        samples = self._incoming.samples
        samples.update(prime_inputs(self.node.sdo, self.plan, self.index))
        prime_outputs(self.node.sdo, self.plan, self._images, samples)

    def close(self) -> None:
        """Stop listening; harmless when repeated."""
        for slot in self._slots:
            self.node.channel.unsubscribe(slot.cob_id, slot.on_frame)

    @property
    def short_frames(self) -> int:
        """How many TPDO frames came with less data than their mapping."""
        return sum(slot.short for slot in self._slots)

    def _dropping(self, cob_id: int) -> Receiver:
        drops, node_id = self.node.channel.drops, self.node.node_id
        return lambda data, stamp: drops.note(DropReason.SHORT_PDO, node_id, stamp, cob_id, data)

    # -- details ------------------------------------------------------------------------------------------------------------------

    def _bus_off(self) -> BusError | None:
        """Why nothing can be sent, told at least once for each bus-off, however short it was."""
        channel = self._channel
        offs, self._offs = self._offs, channel.offs
        off = channel.off or (channel.last_off if offs != self._offs else None)
        if offs != self._offs or isinstance(off, BusOff):
            self._returning = True
        elif off is None and self._returning and self.node.nmt.state is not NmtState.UNKNOWN:
            self._returning = False
            if self.node.nmt.assumed or self.node.nmt.state is not NmtState.OPERATIONAL:
                self._doubtful_since = self._now if self._doubtful_since is None else self._doubtful_since
        return off

    @property
    def _restarted_since(self) -> float | None:
        """When the node sent a boot-up message, or may have restarted unheard; None while neither is so."""
        if self.rebooted:
            return self.node.nmt.bootup_stamp or 0.0
        return self._doubtful_since

    def _look_for_duplicate(self, statusword: Sample | None, since: float) -> None:
        """A drive that has restarted is not energised: one that is has not sent the boot-up message.

        Two statuswords are asked for, because the first may have been sent before the boot-up and overtaken on its way, and both
        shortly after the boot-up, because later another master may have enabled the drive.
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
        """The RPDOs that were committed last, with the controlword of a stop, and offsets of 0."""
        committed = self._committed.copy()
        return tuple(
            image.with_controlword(committed[image.cob_id], word)
            for image in self._images
            if image.cob_id in committed and (image.holds_controlword or image.cleared_bits)
        )

    def _held_back(self, controlword: int | None) -> int | None:
        """Keep a controlword that may start a motion until the values that travel by SDO have arrived.

        A halt is never kept. Under halt only the edge of bit 4 waits; without the new target the drive would take its old one.
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
        """An object that is also in an RPDO must have its new value there first, or the next frame would bring back the old one."""
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


def _more(outputs: Outputs) -> dict[str, int]:
    """What only some axes are sent."""
    values = (
        ("velocity_offset", outputs.velocity_offset),
        ("torque_offset", outputs.torque_offset),
        ("interpolation_target", outputs.interpolation_target),
    )
    return {name: value for name, value in values if value is not None}


def _given(outputs: Outputs) -> dict[str, int]:
    values = (
        ("mode", outputs.mode),
        ("target_position", outputs.target_position),
        ("target_velocity", outputs.target_velocity),
        ("target_torque", outputs.target_torque),
    )
    return {name: value for name, value in values if value is not None}
