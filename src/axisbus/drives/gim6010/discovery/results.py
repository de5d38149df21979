"""Results of the discovery for each module: values derived from its answers; the only texts are terms of the standards."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import NmtState
from axisbus.cia402.device_type import device_kind
from axisbus.cia402.state import PowerState, decode
from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.heartbeat import ALL, HeartbeatLayout, Heartbeats
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, state_words
from axisbus.drives.gim6010.discovery import questions
from axisbus.drives.gim6010.discovery.finder import Finder
from axisbus.drives.gim6010.discovery.questions import CanopenFacts, SimpleFacts
from axisbus.drives.gim6010.factory_protocols import addresses

_SEVERAL = (
    "several modules have this node ID: the values may be from any of them; connect them one by one and give each "
    "its own"
)


_JSON_NAMES = {"node": "node_id", "ours": "gim6010", "words": "error_words"}


class ProtocolsFound(Enum):
    """Protocol of a module."""

    CAN_SIMPLE = "CAN Simple"
    CANOPEN = "CANopen"
    EXTENDED = "29-bit"


@dataclass(frozen=True, slots=True)
class DiscoveredModule:
    """One module, or several that share a node ID (``several``).

    ``node`` is None if the frames do not identify the node; ``addresses`` then contains the possible node IDs. ``firmware`` is
    empty if unknown; ``state`` is None if unknown. ``enabled`` is whether there is power on the motor, None if unknown. ``voltage``
    in V. ``errors`` are sentences; ``words`` the error words by category. ``notes`` are remarks for the user.
    """

    protocol: ProtocolsFound
    node: int | None
    addresses: tuple[int, ...] = ()
    several: bool = False
    ours: bool = True  # a module of this product family, as far as known
    device: str = ""
    heartbeat: str = ""  # its layout, or the reason why there is none
    firmware: str = ""
    serial: int | None = None
    state: str | None = None
    enabled: bool | None = None
    voltage: float | None = None
    words: tuple[tuple[str, int], ...] = ()
    errors: tuple[str, ...] = ()
    endpoints: bool | None = None  # whether it answers endpoint requests; None: not tried
    notes: tuple[str, ...] = ()

    @property
    def plain(self) -> dict[str, Any]:
        named = {_JSON_NAMES.get(each.name, each.name): getattr(self, each.name) for each in fields(self)}
        return named | {
            "protocol": self.protocol.value,
            "firmware": self.firmware or None,
            "error_words": dict(self.words),
        }


def findings(finder: Finder) -> tuple[DiscoveredModule, ...]:
    """Return the modules found so far: CAN Simple by node ID, then CANopen, then the 29-bit protocol."""
    picture = finder.picture
    simple = [_simple(finder, node) for node in sorted(picture.simple) if node in finder.only]
    nodes = [_canopen(finder, node) for node in sorted(picture.canopen) if node in finder.only]
    wide = [_extended(each) for each in picture.listening.extended]
    return (*simple, *nodes, *(each for each in wide if any(node in finder.only for node in each.addresses)))


# -- CAN Simple ---------------------------------------------------------------------------------------------------------------


def _simple(finder: Finder, node: int) -> DiscoveredModule:
    facts = finder.simple.get(node, SimpleFacts())
    beats = finder.picture.beats.get(node) if node not in finder.picture.proven else None
    several = max(finder.picture.twins.get(node, 1), finder.answers.get(("CAN Simple", node), 1)) > 1
    asked = ("CAN Simple", node) in finder.requests
    last = None if beats is None else beats.last
    return DiscoveredModule(
        ProtocolsFound.CAN_SIMPLE,
        node,
        (node,),
        several,
        device="GIM6010-8",
        heartbeat=_layout(beats),
        firmware=str(facts.version or "") or _firmware(beats),
        serial=facts.serial,
        state=None if last is None else state_words(last.state),
        enabled=None if last is None else last.state != 1,
        voltage=facts.voltage,
        words=_words(facts, beats),
        errors=tuple(_errors(facts, beats)),
        endpoints=(facts.version is not None) if asked and not several else None,
        notes=tuple(_notes(finder, node, facts, beats, several=several)),
    )


def _layout(beats: Heartbeats | None) -> str:
    if beats is None:
        return "none: it was found by its answers"
    return " or ".join(each.value for each in HeartbeatLayout if each in beats.layouts)


def _firmware(beats: Heartbeats | None) -> str:
    """Return the firmware versions that the layout of the heartbeat allows."""
    layouts = frozenset() if beats is None else beats.layouts
    if not layouts or layouts == ALL:
        return ""
    if layouts == {HeartbeatLayout.COUNTED, HeartbeatLayout.NEWEST}:
        return "0.5.12 or later"
    return " or ".join(each.value.removeprefix("firmware ") for each in HeartbeatLayout if each in layouts)


def _words(facts: SimpleFacts, beats: Heartbeats | None) -> tuple[tuple[str, int], ...]:
    axis = [] if beats is None or beats.last is None else [("axis", beats.last.axis_error)]
    return (*axis, *facts.errors.items())


def _errors(facts: SimpleFacts, beats: Heartbeats | None) -> list[str]:
    found = [text for category, word in _words(facts, beats) for text in faults.words(category, word)]
    flagged = () if beats is None or beats.last is None else beats.last.faults
    for part in flagged:
        if part != "axis" and part not in facts.errors:
            found.append(f"{part}: its heartbeat reports a fault, but its error word was not reported")
        elif part != "axis" and not facts.errors[part]:
            found.append(
                f"{part}: its heartbeat reports a fault, and its error word is 0; some owners read a 1 as no fault"
            )
    return found


def _notes(
    finder: Finder, node: int, facts: SimpleFacts, beats: Heartbeats | None, *, several: bool
) -> list[str]:
    notes = []
    if several:
        notes.append(_SEVERAL)
    if node == 0:
        notes.append("node ID 0 is the factory's, and none of CANopen: give it another before it is switched")
    notes += [f"it does not answer: {each}" for each in dict.fromkeys(facts.silent)]
    notes += [f"an answer was not as it should be: {each}" for each in dict.fromkeys(facts.odd)]
    if beats is not None and beats.restarts:
        notes.append("it restarted meanwhile, or many of its heartbeats were lost")
    elif beats is not None and beats.missed:
        notes.append(f"heartbeats that its counter has and that were not heard: {beats.missed}")
    if beats is not None and beats.last is not None and beats.last.state == CLOSED_LOOP:
        notes.append("it is in closed loop: there is power on the motor")
    return notes if ("CAN Simple", node) in finder.requests or several else [*notes, "it was not asked"]


# -- CANopen ------------------------------------------------------------------------------------------------------------------


def _canopen(finder: Finder, node: int) -> DiscoveredModule:
    facts = finder.canopen.get(node, CanopenFacts())
    nmt = finder.picture.states.get(node)
    word = facts.objects.get(questions.STATUSWORD)
    state = None if word is None else decode(word)
    return DiscoveredModule(
        ProtocolsFound.CANOPEN,
        node,
        (node,),
        finder.answers.get(("CANopen", node), 1) > 1,
        ours=facts.is_ours,
        device=facts.name or device_kind(facts.objects.get((o.DEVICE_TYPE, 0))),
        heartbeat="" if nmt is None else NmtState(nmt).text,
        firmware=facts.version,
        serial=facts.objects.get((o.IDENTITY, o.SERIAL_NUMBER)),
        state=None if state is None else state.value,
        enabled=None if state is None else state in _POWERED,
        voltage=None if questions.SUPPLY not in facts.objects else facts.objects[questions.SUPPLY] / 1000,
        words=tuple((name, facts.objects[key]) for key, name in _NAMES.items() if key in facts.objects),
        errors=tuple(_canopen_errors(facts)),
        notes=tuple(_canopen_notes(finder, node, facts)),
    )


_POWERED = frozenset(
    {PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE, PowerState.FAULT_REACTION_ACTIVE}
)
_NAMES = {
    questions.ERROR_CODE: "603Fh",
    faults.ERROR_REGISTER: "1001h",
    faults.ERROR_BITS_LOW: "203Fh",
    faults.ERROR_BITS_HIGH: "203Eh",
}


def _canopen_errors(facts: CanopenFacts) -> list[str]:
    """Return the errors in its own objects; without these, only the error code."""
    code = facts.objects.get(questions.ERROR_CODE, 0)
    found = faults.explain(code, facts.objects)
    if code and not found:
        return [f"error code 0x{code:04X} is not in the module's fault table"]
    return found


def _canopen_notes(finder: Finder, node: int, facts: CanopenFacts) -> list[str]:
    if ("CANopen", node) not in finder.requests:
        return ["it was not asked"]
    if not facts.answers:
        return ["it does not answer SDO requests; its heartbeat was heard"]
    if finder.answers.get(("CANopen", node), 1) > 1:
        return [_SEVERAL]
    if not facts.is_ours:
        return ["it is not from this module's manufacturer"]
    return []


def _extended(identifier: int) -> DiscoveredModule:
    nodes = addresses(identifier)
    return DiscoveredModule(
        ProtocolsFound.EXTENDED,
        nodes[0] if len(nodes) == 1 else None,
        nodes,
        device="GIM6010-8 or another joint of its manufacturer",
        heartbeat=f"{identifier:08X}h",
        firmware="0.6.8 or later",
        notes=("this protocol is recognised only: nothing is asked or commanded in it",),
    )
