"""Requests to a module, one at a time, and the evaluation of its answers: dialogues without a clock or a bus.

Theory of operation. A dialogue is a generator: it yields a ``ProbeFrame`` and is sent the frame that answers it, or None if there
was no answer in time. It returns the facts it has learned. All requests only read: the messages that CAN Simple sends on request,
the version and the serial number, whose endpoints are the same in every known list, and CANopen uploads. If a module does not
answer one request of a kind, it gets no others of that kind.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.sdo import Garbled, NoAnswer, SdoAborted
from axisbus.cia301.sdo_upload import Upload
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple import codec, endpoint_messages, error_query
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, Outgoing, Unexpected
from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.can_simple.error_query import ErrorType
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.make import VENDOR_ID

VOLTAGE, COUNT = named("Get_Bus_Voltage_Current"), named("Get_Encoder_Count")
_ENDPOINTS = tuple(endpoint_messages.COMMANDS)
_COUNTS = range(16384)  # within a turn of the rotor
_STEP = 1.0  # s: time-out of an upload; the caller of the dialogue waits less
_LONGEST = 64  # bytes of a text that are accepted


@dataclass(frozen=True, slots=True)
class ProbeFrame:
    """A frame to be sent, with the identifiers of its answers and their first bytes (``begins`` at ``at``)."""

    frame: Outgoing
    answers: tuple[int, ...]
    begins: bytes = b""
    at: int = 0

    def answered_by(self, frame: CanFrame) -> bool:
        """Return whether a received frame is an answer, valid or not."""
        if frame.extended or frame.remote or frame.error or frame.can_id not in self.answers:
            return False
        found = frame.data[self.at : self.at + len(self.begins)]
        return found == self.begins[: len(found)]


@dataclass(slots=True)
class SimpleFacts:
    """Answers of a CAN Simple module; None: no answer. ``odd`` are the errors of invalid answers.

    ``errors`` are the error words by category, ``silent`` the requests without an answer.
    """

    voltage: float | None = None  # V
    version: Firmware | None = None
    serial: int | None = None  # its lowest 32 bits
    errors: dict[str, int] = field(default_factory=dict)
    silent: list[str] = field(default_factory=list)
    odd: list[str] = field(default_factory=list)


@dataclass(slots=True)
class CanopenFacts:
    """Answers of a CANopen node; missing: no answer, or an abort. Objects by index and sub-index; name and version as texts."""

    answers: bool = False
    objects: dict[tuple[int, int], int] = field(default_factory=dict)
    name: str = ""
    version: str = ""

    @property
    def is_ours(self) -> bool:
        """Whether its vendor ID is the module's."""
        return self.objects.get((o.IDENTITY, o.VENDOR_ID)) == VENDOR_ID


Asking = Generator[ProbeFrame, CanFrame | None, None]


def speaks(node: int, facts: SimpleFacts) -> Generator[ProbeFrame, CanFrame | None, bool]:
    """Find out whether a module uses a silent CAN Simple node ID: it must answer two different messages correctly."""
    yield from _voltage(node, facts, (True,))
    if facts.voltage is None or not 0 < facts.voltage < 200:
        return False
    answer = yield ProbeFrame(codec.request(node, COUNT), (can_id(node, COUNT.command),))
    values = _values(node, answer, facts)
    return values.get("Count_In_Cpr") in _COUNTS


def simple(node: int, facts: SimpleFacts, *, words: bool = True, remote: bool = True) -> Asking:
    """Request supply voltage, version and serial number of a module and, if ``words``, its error words.

    ``remote``: whether remote frames may be sent.
    """
    if facts.voltage is None:
        yield from _voltage(node, facts, (True, False) if remote else (False,))
    yield from _version(node, facts)
    for which in ErrorType if words else ():
        answer = yield ProbeFrame(
            error_query.request(node, which), (can_id(node, error_query.GET_ERROR.command),)
        )
        if answer is None:
            facts.silent.append("error words")
            return
        word = error_query.read(node, answer.data, which)
        if isinstance(word, Unexpected):
            facts.odd.append(word.words)
        else:
            facts.errors[which.category] = word


def _voltage(node: int, facts: SimpleFacts, ways: tuple[bool, ...]) -> Asking:
    """Request the voltage by a remote frame (True) or a data frame (False), in this order, until the module answers.

    A remote frame commands nothing, whichever node receives it.
    """
    for remote in ways:
        frame = codec.request(node, VOLTAGE, remote=remote)
        answer = yield ProbeFrame(frame, (can_id(node, VOLTAGE.command),))
        values = _values(node, answer, facts)
        if values:
            facts.voltage = float(values["Bus_Voltage"])
            return
    facts.silent.append("supply voltage")


def _values(node: int, answer: CanFrame | None, facts: SimpleFacts) -> dict[str, float]:
    """Return the fields of an answer; an empty dict if there is none or it is invalid, which is noted."""
    if answer is None:
        return {}
    found = codec.decode(answer.can_id, answer.data, from_module=True)
    if isinstance(found, Unexpected):
        facts.odd.append(found.words)
    return dict(found.values) if isinstance(found, DecodedMessage) and found.node == node else {}


def _version(node: int, facts: SimpleFacts) -> Asking:
    numbers = []
    for frame in endpoint_messages.request_version(node):
        data = yield from endpoint(node, frame, facts)
        if data is None:
            facts.silent.append("endpoints")
            return
        numbers.append(int.from_bytes(data[:1], "little"))
    facts.version = Firmware(*numbers)
    serial = yield from endpoint(node, endpoint_messages.request_serial(node), facts)
    facts.serial = None if serial is None else int.from_bytes(serial, "little")


def endpoint(
    node: int, frame: Outgoing, facts: SimpleFacts
) -> Generator[ProbeFrame, CanFrame | None, bytes | None]:
    """Send a frame that reads an endpoint; return the bytes of its value, None without a valid answer."""
    answers = tuple(can_id(node, command) for command in _ENDPOINTS)
    answer = yield ProbeFrame(frame, answers, frame.data[1:3], 1)
    if answer is None:
        return None
    found = endpoint_messages.answer(answer.can_id, answer.data)
    if isinstance(found, Unexpected):
        facts.odd.append(found.words)
        return None
    return found.data


# -- CANopen ------------------------------------------------------------------------------------------------------------------

STATUSWORD, ERROR_CODE, SUPPLY = (0x6041, 0), (0x603F, 0), (0x6079, 0)
_WHO = ((o.IDENTITY, o.VENDOR_ID), (o.IDENTITY, o.PRODUCT_CODE), (o.IDENTITY, 3), (o.IDENTITY, 4))
_HOW = (STATUSWORD, ERROR_CODE, *faults.OBJECTS, SUPPLY)
_NAME, _VERSION = (0x1008, 0), (0x100A, 0)


def canopen(node: int, facts: CanopenFacts) -> Asking:
    """Request the identity of a CANopen node; if it is a module, also its state, errors and supply voltage."""
    yield from _number(node, (o.DEVICE_TYPE, 0), facts)
    if not facts.answers:
        return
    for key in _WHO:
        yield from _number(node, key, facts)
    facts.name = yield from _text(node, _NAME)
    if not facts.is_ours:
        return
    facts.version = yield from _text(node, _VERSION)
    for key in _HOW:
        yield from _number(node, key, facts)


def _number(node: int, key: tuple[int, int], facts: CanopenFacts) -> Asking:
    data = yield from _upload(node, key, facts)
    if data is not None and 0 < len(data) <= 4:
        facts.objects[key] = int.from_bytes(data, "little")


def _text(node: int, key: tuple[int, int]) -> Generator[ProbeFrame, CanFrame | None, str]:
    data = yield from _upload(node, key, CanopenFacts())
    text = (data or b"").split(b"\0")[0].decode("ascii", "replace")
    return "".join(each if each.isprintable() else "?" for each in text)


def _upload(
    node: int, key: tuple[int, int], facts: CanopenFacts
) -> Generator[ProbeFrame, CanFrame | None, bytes | None]:
    dialogue = Upload(*key, _STEP, most=_LONGEST)
    frames = dialogue.start()
    try:
        while not dialogue.done:
            answer = yield _upload_question(node, frames[0])
            if answer is None:
                return None
            facts.answers = True
            frames = dialogue.receive(answer.data) or frames
    except (NoAnswer, Garbled, SdoAborted):
        return None
    return dialogue.data


def _upload_question(node: int, data: bytes) -> ProbeFrame:
    """Return the request with an upload's frame; the answer to the first one names the object, that to a segment does not."""
    first = data[:1] == b"\x40"
    return ProbeFrame(Outgoing(cob.SDO_RX + node, data), (cob.SDO_TX + node,), data[1:4] if first else b"", 1)
