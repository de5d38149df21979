"""The errors of an SDO request that failed, in words: what was asked, what came, and what to do."""

from __future__ import annotations

from axisbus.cia301 import abort
from axisbus.cia301.sdo import Garbled, Refused
from axisbus.cia301.sdo_session import BROKEN_DIALOGUE, Request, Session
from axisbus.eds.dictionary import Entry
from axisbus.errors import Interrupted, SdoAbort, SdoError, SdoTimeout
from axisbus.wording import counted

_SHOWN = 8  # bytes of a value that are shown


def failed(node_id: int, entry: Entry, request: Request, session: Session, health: str) -> SdoError:
    """Return the error for a session that ended badly; ``health`` says in one line what the wire looks like."""
    doing, failure = _doing(node_id, entry, request), session.failure
    if isinstance(failure, Refused):
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
        observed=_what_came(session.strays, health),
        remedy="check the node's power, node ID and bitrate, the wiring, and that it is not in NMT stopped",
    )


def cancelled(node_id: int, entry: Entry, request: Request) -> Interrupted:
    """Return the error for a transfer that another thread ended."""
    return Interrupted(
        f"{_doing(node_id, entry, request)} was cut short", observed="something more urgent took over"
    )


def _doing(node_id: int, entry: Entry, request: Request) -> str:
    data = request.data
    if data is None:
        return f"node {node_id}: reading {entry}"
    value = data.hex(" ") if len(data) <= _SHOWN else counted(len(data), "byte")
    return f"node {node_id}: writing {entry} = {value}"


def _refused(node_id: int, doing: str, request: Request, code: int) -> SdoAbort:
    return SdoAbort(
        f"{doing} was refused",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        code=code,
        observed=f"abort code {abort.describe(code)}",
        remedy=abort.explain(code).hint,
    )


def _broken(node_id: int, doing: str, request: Request, observed: str) -> SdoError:
    return SdoError(
        f"{doing} failed in {counted(request.tries, 'attempt')}",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        observed=observed,
        remedy="check that no other program talks SDO with this node",
    )


def _what_came(strays: list[bytes], health: str) -> str:
    if strays:
        return f"{counted(len(strays), 'frame')} that answer something else, the last: {strays[-1].hex(' ')}"
    return health or "no frame from its SDO server"
