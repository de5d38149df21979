"""The inputs and outputs of one node on the bus: the newest TPDOs in, RPDOs out (``axisbus.cia401.port.IoPort``)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress

from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo import freshness
from axisbus.bus.pdo.freshness import lags_of
from axisbus.bus.pdo.io_plan import name_of
from axisbus.bus.pdo.plan import PdoPlan, PlannedPdo
from axisbus.bus.pdo.read import read_number
from axisbus.bus.pdo.rpdo import REPEAT, Frame, RpdoImage, RpdoPace
from axisbus.bus.pdo.sdo_exchange import prime_outputs
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import NmtState
from axisbus.cia301.pdo import PdoCodec
from axisbus.cia401.objects import ERROR_OBJECTS
from axisbus.cia401.port import MAY_HEAR, IoInputs, SignalValidity
from axisbus.cia401.signal import Address
from axisbus.cia402.port import Sample
from axisbus.errors import BusOff, SdoAbort


class _TpdoSlot:
    """The newest frame of one TPDO; one pair, replaced as a whole, so that a reader never sees half of one."""

    def __init__(self, pdo: PlannedPdo, node: CanopenNode, input_indices: dict[Address, int]) -> None:
        codec = PdoCodec(pdo.target.mapping, pdo.signed)
        self.cob_id = pdo.target.cob_id
        self._node = node
        self._size, self._unpack = codec.size, codec.unpack_from
        self.frames = 0
        self.latest: tuple[bytes, float] = (b"", -math.inf)
        self._input_indices = [
            (position, input_indices[mapped.index, mapped.subindex])
            for position, mapped in enumerate(pdo.target.mapping)
            if (mapped.index, mapped.subindex) in input_indices
        ]

    @property
    def stamp(self) -> float:
        """Time of the newest frame."""
        return self.latest[1]

    def on_frame(self, data: bytes, stamp: float) -> None:
        """Store a frame; one that is too short is dropped, and its values grow old."""
        self.frames += 1
        if len(data) < self._size:
            self._node.channel.drops.note(DropReason.SHORT_PDO, self._node.node_id, stamp, self.cob_id, data)
            return
        self.latest = data, stamp

    def read_into(self, samples: list[Sample | None], sampled: float) -> None:
        """Store its values if they are newer; ``sampled`` is their earliest sampling time (minus infinity: too long ago)."""
        data, stamp = self.latest
        if data:
            values = self._unpack(data)
            for position, input_index in self._input_indices:
                before = samples[input_index]
                if before is None or before.stamp < stamp:
                    samples[input_index] = None if sampled == -math.inf else Sample(values[position], sampled)


class CanIoPort:
    """Holds the images of its RPDOs and the samples of its TPDOs; ``read``, ``write`` and the frames belong to the scan's thread.

    A node that has rebooted has lost its PDO configuration, so nothing is sent to it any more. If the first report of a node after
    a bus-off is not operational, it may have rebooted unnoticed; it is treated in the same way.
    """

    asks = False

    def __init__(
        self,
        node: CanopenNode,
        plan: PdoPlan,
        inputs: Sequence[Address],
        outputs: Sequence[Address],
        scan_period: float,
        *,
        foreign_sync: bool = False,
    ) -> None:
        """Listen to the TPDOs of ``plan``, which the node has; ``foreign_sync``: another device sends SYNC. Sends nothing."""
        self.node, self.plan = node, plan
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.found: tuple[int, ...] = ()
        self.alone: tuple[int, ...] = ()
        received = [pdo for pdo in plan.active if not pdo.receive]
        input_indices = {address: input_index for input_index, address in enumerate(self.inputs)}
        self.max_age = tuple(_age(address, received, scan_period) for address in self.inputs)
        self.sources = tuple(plan.inputs[name_of(address)] for address in self.inputs)
        self._slots = [_TpdoSlot(pdo, node, input_indices) for pdo in received]
        self._lags = lags_of(list(zip(self._slots, received, strict=True)), scan_period, node, foreign_sync)
        sent = [pdo for pdo in plan.active if pdo.receive]
        self._images = [RpdoImage(pdo) for pdo in sent]
        self._paces = [
            RpdoPace([pdo], [image], scan_period, REPEAT)
            for pdo, image in zip(sent, self._images, strict=True)
        ]
        self._error_values: dict[
            Address, int
        ] = {}  # values that a module sets without the master, for all objects in its RPDOs
        self._samples: list[Sample | None] = [None] * len(self.inputs)
        self._frames: list[Frame] = []
        self._now = -math.inf
        self._bootups, self._bus_off_count = node.nmt.bootups, node.channel.bus_off_count
        self._returning = self._doubtful = False
        self._was_known = self._may_receive = False
        for slot in self._slots:
            node.channel.subscribe_cyclic(slot.cob_id, slot.on_frame)

    def prime(self) -> None:
        """Read by SDO the objects that RPDOs would overwrite, and inputs whose TPDO comes only after a change; blocks.

        Raises:
            BootError: an RPDO holds an object that cannot be read.
            SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
        """
        prime_outputs(self.node.sdo, self.plan, self._images, {})
        values = {address: value for image in self._images for address, value in _values(image)}
        self._error_values = {address: self._error_value(address, value) for address, value in values.items()}
        self.found = tuple(values[address] for address in self.outputs)
        self.alone = tuple(self._error_values[address] for address in self.outputs)
        for input_index, address in enumerate(self.inputs):
            if self.max_age[input_index] == math.inf:  # for other inputs, the first TPDO will come soon
                with suppress(SdoAbort):
                    self._samples[input_index] = Sample(
                        int(self.node.sdo.read(*address)), self.node.channel.clock.now()
                    )

    def read(self, now: float) -> IoInputs:
        """Return the newest values; does not block."""
        self._now = now
        known = self._reachable(now)
        if known is SignalValidity.YES and not self._was_known:
            for pace in self._paces:
                pace.forget()  # the node has not accepted what was sent before
        if self._was_known and known is not SignalValidity.YES:
            self._take_error_values()
        self._was_known, self._may_receive = known is SignalValidity.YES, known in MAY_HEAR
        if known is not SignalValidity.RESTARTED:
            sampled = self._lags.look(now, self._was_known)
            for slot, when in zip(self._slots, sampled, strict=True):
                slot.read_into(self._samples, when)
            self._lags.ask(now, self._was_known, self.node.worker)
        return IoInputs(known, tuple(self._samples), self._last_sign_of_life())

    def write(self, words: tuple[int | None, ...]) -> None:
        """Set a value for each output; an RPDO is sent after one of its values was set. Does not block."""
        if not self._may_receive:
            self._frames = []
            return
        given = {address: word for address, word in zip(self.outputs, words, strict=True) if word is not None}
        frames: list[Frame] = []
        for image, pace in zip(self._images, self._paces, strict=True):
            named = {
                name: given[mapped.index, mapped.subindex]
                for name, mapped in zip(image.names, image.mapping, strict=True)
                if name is not None and (mapped.index, mapped.subindex) in given
            }
            if named:
                frames += pace.frames(named, None, None, self._now)
        self._frames = frames

    # -- for the cycle -------------------------------------------------------------------------------------------------

    def take_frames(self) -> list[Frame]:
        """Return the frames given since the last call."""
        frames, self._frames = self._frames, []
        return frames

    def drop_frames(self) -> None:
        """Discard these frames: the bus cannot carry them, and later they would be outdated."""
        self._frames = []
        for pace in self._paces:
            pace.forget()

    begin_again = drop_frames

    def take_requests(self, now: float) -> list[tuple[int, int]]:  # noqa: ARG002
        """Return no requests: the TPDOs of inputs are sent automatically."""
        return []

    def stop_frames(self) -> tuple[tuple[Frame, ...], tuple[Frame, ...]]:
        """Return no frames: outputs become safe when the axes are at standstill, which takes longer than this."""
        return (), ()

    def close(self) -> None:
        """Stop listening; harmless when repeated."""
        for slot in self._slots:
            self.node.channel.unsubscribe(slot.cob_id, slot.on_frame)

    # -- details -------------------------------------------------------------------------------------------------------

    def _reachable(self, now: float) -> SignalValidity:
        nmt, channel = self.node.nmt, self.node.channel
        off = isinstance(channel.off, BusOff) or channel.bus_off_count != self._bus_off_count
        if off:
            self._returning, self._bus_off_count = True, channel.bus_off_count
        elif self._returning and nmt.state is not NmtState.UNKNOWN:
            self._returning = False
            self._doubtful |= nmt.assumed or nmt.state is not NmtState.OPERATIONAL
        if self._doubtful or nmt.bootups != self._bootups:
            return SignalValidity.RESTARTED
        if off:
            return SignalValidity.BUS_OFF
        if channel.off is not None:
            return SignalValidity.QUEUE_FULL
        if now > nmt.deadline:
            return SignalValidity.SILENT
        return SignalValidity.YES if nmt.state is NmtState.OPERATIONAL else SignalValidity.NOT_OPERATIONAL

    def _last_sign_of_life(self) -> float:
        """Return the time of the node's last sign of life; infinite if none is expected."""
        nmt = self.node.nmt
        if nmt.watched is None and not any(map(math.isfinite, self.max_age)):
            return math.inf
        return max([nmt.stamp or -math.inf, *(slot.stamp for slot in self._slots)])

    def _error_value(self, address: Address, found: int) -> int:
        row = ERROR_OBJECTS.get(address[0])
        if row is None:
            return found
        mode, value = (read_number(self.node.sdo, index, address[1]) for index in (row.mode, row.value))
        return found if mode is None or value is None else row.word(mode, value, found)

    def _take_error_values(self) -> None:
        """Set all objects of the RPDOs to the module's own values, so that the next frame does not restore the values before."""
        for image in self._images:
            for (index, subindex), _ in _values(image):
                image.put(index, subindex, self._error_values[index, subindex])


def _values(image: RpdoImage) -> Iterator[tuple[Address, int]]:
    """Yield the objects of an RPDO and their values, which are all known after priming."""
    for mapped in image.mapping:
        value = image.value(mapped.index, mapped.subindex)
        if value is not None:
            yield (mapped.index, mapped.subindex), value


def _age(address: Address, pdos: Sequence[PlannedPdo], scan_period: float) -> float:
    """Return the age for the most frequent PDO among those that carry an object."""
    carriers = [
        pdo for pdo in pdos if any((entry.index, entry.subindex) == address for entry in pdo.target.mapping)
    ]
    return min((freshness.pdo_age(pdo, scan_period) for pdo in carriers), default=math.inf)
