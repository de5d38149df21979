"""Decode frames to text: determine the service and node of each CAN identifier, and the contents of the frame.

Theory of operation
-------------------
``Decoder.feed`` takes frames in the order of the bus and never raises: an undecodable frame gives a value that says so.
Identifiers are looked up in this order: SYNC, EMCY and SDO channels as learned, PDOs as known or learned, and then the predefined
connection set (CiA 301 7.3.5). Before all of them come the frames of nodes that are named as nodes of another protocol
(``other_protocols``), and of a device that was found to use another protocol (``drives.foreign_protocols``). A finished SDO
transfer that writes or reads communication objects (1005h, 1014h, 12xxh, 14xxh to 1Bxxh) changes how later frames are decoded,
exactly as it changes the behaviour of the node.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from axisbus.bus.link import controller
from axisbus.cia301 import abort, cob
from axisbus.cia301 import objects as o
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.nmt import NmtState
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.trace import lss, services, value_text
from axisbus.trace.context import NOTHING, KnownNode, TraceContext
from axisbus.trace.decoded import Decoded, DecodedSdo, FrameKind, ObjectValue
from axisbus.trace.other_protocols import decoders
from axisbus.trace.pdos import PdoParameters, PdoTable
from axisbus.trace.sdo import SdoChannelDecoder
from axisbus.trace.services import Words
from axisbus.trace.transfer import TransferText
from axisbus.trace.value_text import Values
from axisbus.wording import counted

_FUNCTION = 0x780
_NODE = 0x7F
_SDO_SERVER = range(0x1200, 0x1280)
_SAM, _DAM = 0xFE, 0xFF  # sub-index 0 of an MPDO's mapping (CiA 301 7.5.2.36)
_PREDEFINED_PDOS = {
    **{base: (True, number) for number, base in enumerate(cob.RPDO, start=1)},
    **{base: (False, number) for number, base in enumerate(cob.TPDO, start=1)},
}


_NO_NODES: Mapping[str, Collection[int]] = {}


class Decoder:
    """Decodes one bus; holds state: the running SDO transfers, learned identifiers and mappings, last NMT states and modes."""

    def __init__(
        self, known: TraceContext = NOTHING, named: Mapping[str, Collection[int]] = _NO_NODES
    ) -> None:
        """``named`` are node IDs of other protocols, by protocol, in addition to those in ``known``."""
        self._known = known
        others = {protocol: set(node_ids) for protocol, node_ids in named.items()}
        for node_id, other in known.others.items():
            others.setdefault(other.protocol, set()).add(node_id)
        self._others = decoders(others)
        self._values = Values(known)
        self._pdos = PdoTable(tuple(known.nodes.values()))
        self._dialogues: dict[tuple[int, int], SdoChannelDecoder] = {}  # request and response identifier
        self._states: dict[int, NmtState] = {}
        self._asked: set[int] = set()  # nodes with an open guarding request
        self._toggles: dict[int, int] = {}
        self._sync = {cob.SYNC}
        self._emcy: dict[int, int] = {}
        self._sdo: dict[int, tuple[int, bool, tuple[int, int]]] = {}
        self._before: float | None = None
        self.foreign = ForeignProtocols()

    def feed(self, frame: CanFrame) -> Decoded:
        """Return the decoded frame."""
        delta = 0.0 if self._before is None else frame.time - self._before
        self._before = frame.time
        for other in self._others:
            decode = other.decode(frame)
            if decode is not None:
                known = self._known.others.get(decode.node)
                name = "" if known is None else known.name
                return _DecodedBuilder(frame, delta, FrameKind.FOREIGN, decode.node, name).words(
                    decode.words, from_node=decode.from_node
                )
        self.foreign.note(frame)
        text = self.foreign.text(frame)
        if text is not None:
            return _DecodedBuilder(frame, delta, FrameKind.FOREIGN, None, "").words(Words(text))
        kind, node = self.classify(frame)
        made = _DecodedBuilder(frame, delta, kind, node, self._name(node))
        return _DECODERS[kind](self, made)

    def classify(self, frame: CanFrame) -> tuple[FrameKind, int | None]:
        """Return the service and the node of a frame by its identifier, without decoding it."""
        if frame.error:
            return FrameKind.ERROR_FRAME, None
        identifier = frame.can_id
        learned = None if frame.extended else self._learned(identifier)
        if learned is not None:
            return learned
        pdos = self._pdos.find(_wire(frame))
        if pdos:
            return (FrameKind.RPDO if pdos[0].receive else FrameKind.TPDO), pdos[0].node
        return (FrameKind.UNKNOWN, None) if frame.extended else _predefined(frame)

    def _learned(self, identifier: int) -> tuple[FrameKind, int | None] | None:
        if identifier in self._sync:
            return FrameKind.SYNC, None
        if identifier in self._emcy:
            return FrameKind.EMCY, self._emcy[identifier]
        if identifier in self._sdo:
            return FrameKind.SDO, self._sdo[identifier][0]
        return None

    def node_text(self, node: int) -> str:
        """Return the name of a node for people: ``node 5 (x)``."""
        name = self._name(node)
        return f"node {node} ({name})" if name else f"node {node}"

    def _name(self, node: int | None) -> str:
        if node is None:
            return ""
        known = self._known.nodes.get(node)
        if known is not None:
            return known.name
        return "master" if node == self._known.master_id else ""

    # -- services -----------------------------------------------------------------------------------------------------------------

    def _nmt(self, made: _DecodedBuilder) -> Decoded:
        data = made.frame.data
        if len(data) == 2 and data[0] in (129, 130):
            for node in range(1, 128) if data[1] == 0 else (data[1],):
                self._toggles.pop(node, None)
        target = data[1] if len(data) == 2 and data[1] in cob.NODE_IDS else None
        made = made.with_node(target, self._name(target))
        return made.words(services.nmt(data, self.node_text), from_node=False)

    def _sync_frame(self, made: _DecodedBuilder) -> Decoded:
        return made.words(services.sync(made.frame.data), from_node=False)

    def _time(self, made: _DecodedBuilder) -> Decoded:
        return made.words(services.time(made.frame.data), from_node=False)

    def _emergency(self, made: _DecodedBuilder) -> Decoded:
        return made.words(services.emergency(made.frame.data, self._node(made).make))

    def _heartbeat(self, made: _DecodedBuilder) -> Decoded:
        node, frame = made.node or 0, made.frame
        if frame.remote:
            self._asked.add(node)
            return made.words(
                Words("state asked for by a remote frame"), kind=FrameKind.GUARD, from_node=False
            )
        if frame.data == b"\0":
            self._toggles.pop(node, None)
            self._states[node] = NmtState.PRE_OPERATIONAL
            return made.words(Words("boot-up: enters pre-operational"), kind=FrameKind.BOOT_UP)
        said, state = services.heartbeat(frame.data, self._states.get(node))
        if state is not None:
            self._states[node] = state
        if node not in self._asked or len(frame.data) != 1:
            return made.words(said)
        self._asked.discard(node)
        return made.words(self._guarded(node, frame.data[0], said), kind=FrameKind.GUARD)

    def _guarded(self, node: int, data: int, said: Words) -> Words:
        """Check the toggle bit, which alternates from one answer to the next (CiA 301 7.2.8.3.2.1)."""
        toggle = data & services.TOGGLE
        before, self._toggles[node] = self._toggles.get(node), toggle
        if before is not None and before == toggle and not said.problem:
            return said._replace(problem="the toggle bit did not change since the last answer")
        return said

    def _lss(self, made: _DecodedBuilder) -> Decoded:
        request = made.frame.can_id == cob.LSS_RX
        what, problem = lss.words(made.frame.data, request=request)
        return made.words(Words(what, problem=problem), from_node=not request)

    def _error_frame(self, made: _DecodedBuilder) -> Decoded:
        """Decode the error class of Linux; recordings of other systems have none, and give only the words error frame."""
        return made.words(Words(controller.describe(made.frame.can_id, made.frame.data), error=True))

    def _unknown(self, made: _DecodedBuilder) -> Decoded:
        return made.words(Words(_bytes(made.frame)))

    # -- PDO ----------------------------------------------------------------------------------------------------------------------

    def _pdo(self, made: _DecodedBuilder) -> Decoded:
        pdos, receive = self._pdos.find(_wire(made.frame)), made.kind is FrameKind.RPDO
        if not pdos:
            function = made.frame.can_id & _FUNCTION
            name = f"{'RPDO' if receive else 'TPDO'}{_PREDEFINED_PDOS[function][1]}"
            return made.words(
                Words(f"{name}, mapping not known: {_bytes(made.frame)}"), from_node=not receive
            )
        first, others = pdos[0], pdos[1:]
        name = first.name + "".join(f" (taken by node {each.node} as {each.name})" for each in others)
        mapping = first.mapping
        if made.frame.remote:
            return made.words(Words(f"{name}: asked for by a remote frame"), from_node=False)
        if first.count in (_SAM, _DAM):
            return self._multiplexed(made, first)
        if not mapping:
            return made.words(
                Words(f"{name}, mapping not known: {_bytes(made.frame)}"), from_node=not receive
            )
        return self._mapped(made, name, first)

    def _mapped(self, made: _DecodedBuilder, name: str, pdo: PdoParameters) -> Decoded:
        mapping, data = pdo.mapping or (), made.frame.data
        size = (sum(entry.bits for entry in mapping) + 7) // 8
        from_node = not pdo.receive
        if len(data) < size:
            problem = f"{counted(len(data), 'byte')} where {size} are mapped"
            return made.words(Words(f"{name}: {_bytes(made.frame)}", problem=problem), from_node=from_node)
        values = tuple(self._values.of_pdo(pdo.node, mapping, data))
        # A receiver takes the first bytes of a longer frame (CiA 301 7.2.2.5.2); a sender never sends more than it maps.
        problem = (
            f"{counted(len(data), 'byte')} where {size} are mapped" if len(data) > size and from_node else ""
        )
        error = any(value_text.in_trouble(value.index, value.value) for value in values)
        return made.words(Words(name, error, problem), values=values, from_node=from_node)

    def _multiplexed(self, made: _DecodedBuilder, pdo: PdoParameters) -> Decoded:
        """Decode an MPDO, which carries its own multiplexer (CiA 301 7.2.2.5)."""
        data = made.frame.data
        if len(data) != 8:
            return made.words(
                Words(pdo.name, problem=f"{counted(len(data), 'byte')}, a multiplexed PDO has 8"),
                from_node=not pdo.receive,
            )
        node = data[0] & _NODE
        owner = node if node in cob.NODE_IDS else pdo.node
        value, _ = self._values.of_bytes(owner, data[1] | data[2] << 8, data[3], data[4:8], sized=False)
        to = "all nodes" if not node else self.node_text(node)
        direction = f"for {to}" if data[0] & 0x80 else f"from {to}"
        return made.words(
            Words(f"{pdo.name}, multiplexed, {direction}"), values=(value,), from_node=not pdo.receive
        )

    # -- SDO ----------------------------------------------------------------------------------------------------------------------

    def _sdo_frame(self, made: _DecodedBuilder) -> Decoded:
        identifier, node = made.frame.can_id, made.node or 0
        if identifier in self._sdo:
            _, request, pair = self._sdo[identifier]
        else:
            request, pair = identifier & _FUNCTION == cob.SDO_RX, (cob.SDO_RX + node, cob.SDO_TX + node)
        if made.frame.remote:
            return made.words(Words("", problem="an SDO is not a remote frame"), from_node=not request)
        said = self._dialogues.setdefault(pair, SdoChannelDecoder()).feed(
            made.frame.data, made.frame.time, request=request
        )
        values, problem = self._transferred(node, said)
        error = said.sdo.abort is not None or bool(said.note)
        what = (
            said.note
            if said.sdo.abort is None
            else "; ".join(filter(None, (abort.describe(said.sdo.abort), said.note)))
        )
        return made.words(
            Words(what, error, said.problem or problem), values=values, sdo=said.sdo, from_node=not request
        )

    def _transferred(self, node: int, said: TransferText) -> tuple[tuple[ObjectValue, ...], str]:
        if said.address is None:
            return (), ""
        if said.value is None:
            return (self._values.name(node, *said.address),), ""
        value, problem = self._values.of_bytes(node, *said.address, said.value, sized=said.sized)
        if said.settled and isinstance(value.value, int):
            self._learn(node, value.index, value.subindex, value.value)
        return (value,), problem

    def _learn(self, node: int, index: int, subindex: int, value: int) -> None:
        self._pdos.learn(node, index, subindex, value)
        if subindex == 0 and index == o.COB_ID_SYNC:
            self._sync.add(value & cob.ID_MASK_11)
        elif subindex == 0 and index == o.COB_ID_EMCY and not value & cob.INVALID:
            self._emcy[value & cob.ID_MASK_11] = node
        elif index in _SDO_SERVER and subindex in (1, 2):
            self._learn_channel(node, index, subindex, value)

    def _learn_channel(self, node: int, index: int, subindex: int, value: int) -> None:
        """Learn an additional SDO server of a node (12xxh:01 from the client, :02 to it)."""
        identifier = value & cob.ID_MASK_11
        if value & cob.INVALID or identifier == (cob.SDO_RX, cob.SDO_TX)[subindex - 1] + node:
            return
        self._sdo[identifier] = (node, subindex == 1, (-node, index))

    def _node(self, made: _DecodedBuilder) -> KnownNode:
        return self._known.nodes.get(made.node or 0) or KnownNode(made.node or 0)


class _DecodedBuilder:
    """A ``Decoded`` under construction: the information from its identifier."""

    __slots__ = ("delta", "frame", "kind", "name", "node")

    def __init__(self, frame: CanFrame, delta: float, kind: FrameKind, node: int | None, name: str) -> None:
        self.frame, self.delta, self.kind, self.node, self.name = frame, delta, kind, node, name

    def with_node(self, node: int | None, name: str) -> _DecodedBuilder:
        return _DecodedBuilder(self.frame, self.delta, self.kind, node, name)

    def words(
        self,
        said: Words,
        *,
        kind: FrameKind | None = None,
        values: tuple[ObjectValue, ...] = (),
        sdo: DecodedSdo | None = None,
        from_node: bool = True,
    ) -> Decoded:
        return Decoded(
            self.frame,
            self.delta,
            kind or self.kind,
            self.node,
            self.name,
            from_node,
            said.what,
            values,
            sdo,
            said.error,
            said.problem,
        )


def _predefined(frame: CanFrame) -> tuple[FrameKind, int | None]:
    """Return the service of an identifier in the predefined connection set (CiA 301 7.3.5)."""
    identifier = frame.can_id
    fixed = _FIXED.get(identifier)
    if fixed is not None:
        return fixed, None
    function, node = identifier & _FUNCTION, identifier & _NODE
    if not node or identifier > cob.ID_MASK_11:
        return FrameKind.UNKNOWN, None
    if function in _PREDEFINED_PDOS:
        return (FrameKind.RPDO if _PREDEFINED_PDOS[function][0] else FrameKind.TPDO), node
    kind = _BY_FUNCTION.get(function)
    return (FrameKind.UNKNOWN, None) if kind is None else (kind, node)


def _wire(frame: CanFrame) -> int:
    return frame.can_id | cob.EXTENDED if frame.extended else frame.can_id


def _bytes(frame: CanFrame) -> str:
    if frame.remote:
        return "remote frame"
    return frame.data.hex(" ").upper() or "no data"


_FIXED = {
    cob.NMT: FrameKind.NMT,
    cob.SYNC: FrameKind.SYNC,
    cob.TIME: FrameKind.TIME,
    cob.LSS_RX: FrameKind.LSS,
    cob.LSS_TX: FrameKind.LSS,
}
_BY_FUNCTION = {
    cob.EMCY: FrameKind.EMCY,
    cob.SDO_TX: FrameKind.SDO,
    cob.SDO_RX: FrameKind.SDO,
    cob.HEARTBEAT: FrameKind.HEARTBEAT,
}
_DECODERS: dict[FrameKind, Callable[[Decoder, _DecodedBuilder], Decoded]] = {
    FrameKind.NMT: Decoder._nmt,
    FrameKind.SYNC: Decoder._sync_frame,
    FrameKind.TIME: Decoder._time,
    FrameKind.EMCY: Decoder._emergency,
    FrameKind.TPDO: Decoder._pdo,
    FrameKind.RPDO: Decoder._pdo,
    FrameKind.SDO: Decoder._sdo_frame,
    FrameKind.HEARTBEAT: Decoder._heartbeat,
    FrameKind.LSS: Decoder._lss,
    FrameKind.ERROR_FRAME: Decoder._error_frame,
    FrameKind.UNKNOWN: Decoder._unknown,
}
