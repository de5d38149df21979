"""One device on the channel: its SDO client and worker, NMT state, emergency messages and identity."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import nmt
from axisbus.bus.node.nmt import Confirmation, NodeMonitor
from axisbus.bus.pdo.tpdo_timeout import HISTORY, PdoEvent
from axisbus.bus.sdo.access import SdoUploads, try_upload
from axisbus.bus.sdo.client import TIMEOUT, TRIES, SdoClient
from axisbus.bus.sdo.worker import SdoWorker
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, decode
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.emcy import Emcy, parse
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import NmtCommand, is_boot_up
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, SdoAbort, SdoError

_PROBE_TIMEOUT = 0.5


@dataclass(frozen=True, slots=True)
class NodeIdentity:
    """Identity of a device; None for objects that it does not have."""

    device_type: int | None = None
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    device_name: str | None = None
    hardware_version: str | None = None
    software_version: str | None = None

    @property
    def profile(self) -> int | None:
        """Number of the device profile (402 for drives), the low word of 1000h."""
        return None if self.device_type is None else self.device_type & 0xFFFF


def read_identity(sdo: SdoUploads) -> NodeIdentity:
    """Read 1000h, 1018h:1-4, 1008h, 1009h and 100Ah; blocks for up to eight transfers.

    A value is None if the device refuses it or does not answer with a value (see ``access.try_upload``).

    Raises:
        SdoTimeout: it answers for no object. AdapterError: the channel failed.
    """
    return NodeIdentity(
        device_type=_number(sdo, o.DEVICE_TYPE, 0),
        vendor_id=_number(sdo, o.IDENTITY, o.VENDOR_ID),
        product_code=_number(sdo, o.IDENTITY, o.PRODUCT_CODE),
        revision=_number(sdo, o.IDENTITY, o.REVISION_NUMBER),
        serial=_number(sdo, o.IDENTITY, o.SERIAL_NUMBER),
        device_name=_text(sdo, o.DEVICE_NAME),
        hardware_version=_text(sdo, o.HARDWARE_VERSION),
        software_version=_text(sdo, o.SOFTWARE_VERSION),
    )


def _number(sdo: SdoUploads, index: int, subindex: int) -> int | None:
    data = try_upload(sdo, index, subindex)
    return int.from_bytes(data, "little") if isinstance(data, bytes) else None


def _text(sdo: SdoUploads, index: int) -> str | None:
    data = try_upload(sdo, index)
    return str(decode(data, DataType.VISIBLE_STRING)).strip("\0 ") if isinstance(data, bytes) else None


class CanopenNode:
    """One device; holds state: its receivers and its worker thread. ``eds`` is None if no file is given."""

    def __init__(
        self,
        channel: Channel,
        node_id: int,
        eds: Eds | None = None,
        *,
        sdo_timeout: float = TIMEOUT,
        sdo_tries: int = TRIES,
        emcy_cob_id: int | None = None,
    ) -> None:
        """Listen to the node; sends nothing. ``emcy_cob_id`` is that of 1014h, None for the predefined one.

        Raises:
            ArgumentError: the node-ID is not 1 to 127.
        """
        if node_id not in cob.NODE_IDS:
            raise ArgumentError(f"{node_id} is not a node ID", remedy="CANopen node IDs are 1 to 127")
        self.channel = channel
        self.node_id = node_id
        self.eds = eds
        self.sdo = SdoClient(channel, node_id, eds, timeout=sdo_timeout, tries=sdo_tries)
        self.nmt = NodeMonitor(channel, node_id)
        self.emcy = EmcyMonitor(channel, node_id, emcy_cob_id)
        self.worker = SdoWorker(channel, self.sdo)
        self.pdo_events: deque[PdoEvent] = deque(maxlen=HISTORY)  # TPDOs that stopped coming, and came again

    def identity(self) -> NodeIdentity:
        """Read the identity of the device; blocks, raises as ``read_identity``."""
        return read_identity(self.sdo)

    def command(self, wanted: NmtCommand, timeout: float = nmt.CONFIRM_TIMEOUT) -> Confirmation:
        """Send an NMT command and wait until it is confirmed; blocks, raises as ``nmt.command``."""
        if wanted is NmtCommand.START:
            self.nmt.note_start(self.channel.syncs.count)
        return nmt.command(self.channel, self.nmt, wanted, timeout=timeout, answers_sdo=self.answers_sdo)

    def answers_sdo(self, timeout: float = _PROBE_TIMEOUT) -> bool:
        """Try once whether the SDO server answers (a refusal is an answer); blocks up to ``timeout`` seconds.

        Raises:
            AdapterError: the channel failed.
        """
        try:
            self.sdo.upload(o.DEVICE_TYPE, timeout=timeout, tries=1)
        except SdoAbort:
            return True
        except SdoError:
            return False
        return True

    def close(self) -> None:
        """End the worker and stop listening; harmless when repeated."""
        self.sdo.cancel()
        self.worker.close()
        self.sdo.close()
        self.nmt.close()
        self.emcy.close()

    def __enter__(self) -> CanopenNode:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


# ----------------------------------------------------------------------------------------------------------------------
# Emergency messages of one node: received in any length, stored in a bounded history, grouped, fed to each axis of the node.


FEED = 64
_SHORTEST = 2  # bytes: the error code


class EmcyFeed:
    """Messages that one reader has not read yet; holds state: the newest 64 at most, ``lost`` counts older ones."""

    def __init__(self) -> None:
        self.lost = 0
        self.waiting: deque[Emcy] = deque(maxlen=FEED)

    def put(self, emcy: Emcy) -> None:
        """Add a message; called in the receive thread."""
        self.lost += len(self.waiting) == FEED
        self.waiting.append(emcy)  # removes the oldest message of a full queue

    def take(self) -> tuple[Emcy, ...]:
        """Return and remove all messages; called by the one reader."""
        count = len(self.waiting)
        return tuple(self.waiting.popleft() for _ in range(count))


class EmcyMonitor(EmcyLog):
    """Receives a node's emergency messages; holds state: the log and the feeds.

    Frames shorter than 8 bytes are filled with zeros. Frames without an error code are counted in ``malformed``.
    """

    def __init__(self, channel: Channel, node_id: int, cob_id: int | None = None) -> None:
        """``cob_id`` is that of object 1014h, None for the predefined 80h + node-ID."""
        super().__init__()
        self.malformed = 0
        self._feeds: tuple[EmcyFeed, ...] = ()
        self._channel = channel
        self._cob_id = cob.EMCY + node_id if cob_id is None else cob_id
        self._node_id = node_id
        channel.subscribe(self._cob_id, self._on_frame)
        channel.subscribe(cob.HEARTBEAT + node_id, self._on_heartbeat)

    def feed(self) -> EmcyFeed:
        """Return a new feed, which gets every message from now on."""
        feed = EmcyFeed()
        self._feeds = (*self._feeds, feed)
        return feed

    def end_feed(self, feed: EmcyFeed) -> None:
        """Fill ``feed`` no more; harmless when repeated."""
        self._feeds = tuple(each for each in self._feeds if each is not feed)

    def listen_to(self, cob_id: int) -> None:
        """Change the COB-ID to that of the node's own 1014h."""
        if cob_id == self._cob_id:
            return
        self._channel.unsubscribe(self._cob_id, self._on_frame)
        self._cob_id = cob_id
        self._channel.subscribe(cob_id, self._on_frame)

    def close(self) -> None:
        """Stop listening."""
        self._channel.unsubscribe(self._cob_id, self._on_frame)
        self._channel.unsubscribe(cob.HEARTBEAT + self._node_id, self._on_heartbeat)

    def _on_heartbeat(self, data: bytes, stamp: float) -> None:
        if is_boot_up(data):
            self.incidents.booted(stamp)

    def _on_frame(self, data: bytes, stamp: float) -> None:
        if len(data) < _SHORTEST:
            self.malformed += 1
            self._channel.drops.note(DropReason.EMCY, self._node_id, stamp, self._cob_id, data)
            return
        emcy = parse(data, stamp)
        self.note(emcy)
        for feed in self._feeds:
            feed.put(emcy)
