"""Errors of a failed SDO request as text: the request, the received frames, and the remedy."""

from __future__ import annotations

from axisbus.cia301 import abort
from axisbus.cia301.sdo import Garbled, SdoAborted
from axisbus.cia301.sdo_session import BROKEN_DIALOGUE, SdoSession, SdoTransferRequest
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import Interrupted, SdoAbort, SdoError, SdoTimeout
from axisbus.wording import counted

_SHOWN = 8  # bytes of a value in a message


def failed(
    node_id: int, entry: DictionaryEntry, request: SdoTransferRequest, session: SdoSession, health: str
) -> SdoError:
    """Return the error for a session that failed; ``health`` describes the state of the bus in one line."""
    doing, failure = _doing(node_id, entry, request), session.failure
    if isinstance(failure, SdoAborted):
        if failure.code not in BROKEN_DIALOGUE:
            return _refused(node_id, doing, request, failure.code)
        return _broken(node_id, doing, request, f"the node aborted with {abort.describe(failure.code)}")
    if isinstance(failure, Garbled):
        return _broken(node_id, doing, request, str(failure))
    return SdoTimeout(
        f"{doing} got no answer in {counted(request.tries, 'attempt')} of {request.timeout:g} s",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        observed=_what_came(request, session, health),
        remedy=_remedy(request, session),
    )


def cancelled(node_id: int, entry: DictionaryEntry, request: SdoTransferRequest) -> Interrupted:
    """Return the error for a transfer that another thread ended."""
    return Interrupted(
        f"{_doing(node_id, entry, request)} was cut short", observed="a more urgent transfer replaced it"
    )


def _doing(node_id: int, entry: DictionaryEntry, request: SdoTransferRequest) -> str:
    data = request.data
    if data is None:
        return f"node {node_id}: reading {entry}"
    value = data.hex(" ") if len(data) <= _SHOWN else counted(len(data), "byte")
    return f"node {node_id}: writing {entry} = {value}"


def _refused(node_id: int, doing: str, request: SdoTransferRequest, code: int) -> SdoAbort:
    return SdoAbort(
        f"{doing} was refused",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        code=code,
        observed=f"abort code {abort.describe(code)}",
        remedy=abort.explain(code).hint,
    )


def _broken(node_id: int, doing: str, request: SdoTransferRequest, observed: str) -> SdoError:
    return SdoError(
        f"{doing} failed in {counted(request.tries, 'attempt')}",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        observed=observed,
        remedy="check that no other program sends SDO requests to this node",
    )


def _late(request: SdoTransferRequest, session: SdoSession) -> list[bytes]:
    """Return the answers for the object that came after the attempt had ended."""
    asked = request.index.to_bytes(2, "little") + bytes([request.subindex])
    return [frame for frame in session.strays if frame[1:4] == asked]


def _what_came(request: SdoTransferRequest, session: SdoSession, health: str) -> str:
    late, strays = _late(request, session), session.strays
    if late:
        return f"{counted(len(late), 'answer')} for this object came after {request.timeout:g} s, the last: {late[-1].hex(' ')}"
    if strays:
        return f"{counted(len(strays), 'frame')} that answer another request, the last: {strays[-1].hex(' ')}"
    if session.answers_others:
        return "it answered for another object meanwhile, but not for this one"
    return health or "no frame from its SDO server"


def _remedy(request: SdoTransferRequest, session: SdoSession) -> str:
    if _late(request, session):
        return "the device is slow: try again when it is idle, and check the bus load (axisbus monitor)"
    if session.answers_others:
        return (
            "the node has power and is wired, but does not answer for this object; check in its manual whether it has "
            "the object"
        )
    return "check the node's power, node ID and bitrate, the wiring, and that it is not in NMT stopped"
