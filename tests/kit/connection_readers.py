"""The readers of messages from other programs and browsers, each with valid messages, for the fuzzer."""

from __future__ import annotations

import json
import os
import socket
import struct
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import patch

import msgspec

from axisbus.bus.link.claims import ChannelClaim
from axisbus.core.process import listener
from axisbus.errors import AxisbusError, ScanError, StateError, UserError
from axisbus.fleet import messages as f
from axisbus.fleet.command_retry import CommandRetry, error_of
from axisbus.fleet.lease_session import HeldLease
from axisbus.fleet.messages import read
from axisbus.fleet.subscriptions import FleetSubscriptions
from axisbus.ipc import messages as m
from axisbus.ipc.errors import to_fields
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotSendable
from axisbus.link import StopResult
from axisbus.machine.machine import Machine
from axisbus.motion import commands as c
from axisbus.motion.group.commands import ForEach
from axisbus.version import __version__
from axisbus.web.access.admission import ServedOrigin, decide
from axisbus.web.access.limits import FOREIGN_MESSAGE
from axisbus.web.access.middleware import arrival_of
from axisbus.web.access.tokens import PageSessions, Role
from axisbus.web.config.files import Dcf, named, summary
from axisbus.web.scope import saving, signals
from axisbus.web.view import explained
from kit.cell import cell_file
from kit.frame_readers import Conversations, reader_of, unshown
from kit.page_clients import Pages
from kit.pages import ROOT
from kit.reader_limits import MB, Limits, Names, PassedOver, Reader

_LENGTH = struct.Struct("<I")
_BUFFER = 100_000  # octets that a socket takes without a reader
_LIMITS = Limits(seconds=1.0, memory=32 * MB)


def says(*words: str) -> Names:
    """Return a function that looks for all of these words in a message."""
    return lambda message, _: all(word in message for word in words)


# -- the sockets of a core -----------------------------------------------------------------------------------------------


def _core_messages() -> Conversations:
    told = StateError("no", observed="seen", remedy="do")
    sent = [
        m.Attach(__version__, "text", command=True),
        m.Submit(1, "x", c.Halt(), "x.halt"),
        m.Submit(2, "xy", ForEach({"x": c.QuickStop(), "y": c.HandOver("why")}), "xy.halt"),
        m.CoreQuery(3, "programs"),
        m.CoreQuery(4, "sdo", 1, (0x1000, 0, b"\0\1", None, 1.5)),
        m.CoreReply(3, (True, {"x": 1.0}, frozenset({1}), [b"", 5])),
        m.CoreReply(4, None, told),
        m.CoreProgress(5, "find"),
        m.CoreReply(5, (Fraction(3, 4), datetime(2026, 1, 1, tzinfo=UTC))),
        m.AddGroup("xy", ("x", "y")),
        m.Observe(True),
        m.HoldToRunMessage(0.5, None),
        m.Logged("axisbus", 20, "text"),
        m.Leave("over"),
    ]
    return [[_LENGTH.pack(len(data)) + data for data in map(m.CODEC.pack, sent)]]


def _core(parts: Sequence[bytes]) -> None:
    ours, theirs = socket.socketpair()
    with theirs:
        stream = MessageStream(ours, m.CODEC.pack, "fuzzed", 1 << 18)
        try:
            theirs.sendall(b"".join(parts)[:_BUFFER])
            theirs.shutdown(socket.SHUT_WR)
            for data in stream.messages():
                m.CODEC.unpack(data)
        finally:
            stream.finish()


def _first_words() -> Conversations:
    requests = [
        listener.StopRequest(),
        listener.StopRequest(("x", "y"), quick=False),
        listener.StopRequest(("x" * 5000,)),
    ]
    return (
        [[each.pack()] for each in requests]
        + [[each.pack()[:4], each.pack()[4:]] for each in requests]
        + [[b"a"]]
    )


def _door(parts: Sequence[bytes]) -> None:
    """Connect to the core's acceptor as another program does; the acceptor closes the connection after an invalid request."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        listening.bind(f"\0axisbus-fuzz-{os.getpid()}")
        listening.listen()
        here, caller = listener.ClientListener(listening), None
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
            line.connect(listening.getsockname())
            here._accept_connections()
            (new,) = here._pending.values()
            line.setblocking(False)
            with suppress(BrokenPipeError, BlockingIOError):
                for part in parts:
                    line.sendall(part[:_BUFFER])
                    caller = here._receive(new)
                    if caller is not None or not here._pending:
                        break  # the rest is not read by the acceptor
        while caller is None and here._pending:
            caller = here._receive(new)
        new.line.close()
    if caller is None:
        raise PassedOver


def _stop_answers() -> Conversations:
    stopped = [StopResult("x", True, "stands"), StopResult("y", False, "NOT CONFIRMED")]
    return [[b"2.5\n", json.dumps([[list(one) for one in map(_of, stopped)], "digest"]).encode() + b"\n"]]


def _of(one: StopResult) -> tuple[str, bool, str]:
    return one.axis, one.ok, one.text


def _stop_answer(parts: Sequence[bytes]) -> object:
    ours, theirs = socket.socketpair()
    with theirs, patch.object(listener, "_connect_to", lambda *_: ours):
        theirs.sendall(b"".join(parts)[:_BUFFER])
        theirs.shutdown(socket.SHUT_WR)
        claim = ChannelClaim("@fuzz", False, True, "", None, "", os.getpid(), os.geteuid(), os.getegid())  # type: ignore[arg-type]
        return listener.ask_to_stop(claim, listener.StopRequest(), 0.2)


# -- the page ------------------------------------------------------------------------------------------------------------


def _page_messages() -> Conversations:
    def one(do: str, axis: str = "", **more: Any) -> bytes:
        return json.dumps({"do": do, "axis": axis, "sent": 10.0, **more}).encode()

    return [
        [
            one("take"),
            one("enable", "x", sure=True),
            one("move_absolute", "x", values={"position": "5", "velocity": "10"}),
            one("jog", "x", press=1, values={"direction": "1"}),
            one("halt", "x"),
            one("torque_control", "x", sure=True, values={"torque": "1", "slope": "2"}),
            one("quick_stop_all"),
        ],
        [
            one("take"),
            one("read_objects", objects=["1:1000:00", "1:6041:00"]),
            one("keep_reading", objects=["1:6064:00"]),
            one("write_object", objects=["1:6081:00"], text="100"),
            one("verify", node=1),
            one("backup"),
            one("beat", seen=9.0),
            one("step_velocity", "x", values={"velocity": "5", "acceleration": "9", "seconds": "1"}),
            one("give_back"),
        ],
        [json.dumps({"choice": 1, "signals": ["x.position"]}).encode()],
    ]


class _Page:
    """The server side of a page at a simulated machine; each input is a new page."""

    @contextmanager
    def there(self) -> Iterator[None]:
        with tempfile.TemporaryDirectory() as folder:
            cell = cell_file(Path(folder), "xy", axis="rated_torque = 10.0\nmax_torque = 5.0")
            with Machine.simulated(cell) as machine:
                self.pages = Pages(machine)
                self.signals = {"x.position", "y.position"}
                yield

    def take(self, parts: Sequence[bytes]) -> None:
        pages = self.pages
        place = pages.admit()
        try:
            for part in parts:
                text = part.decode("utf-8", "surrogatepass" if part[:1] == b"{" else "replace")
                if signals.read(text, self.signals) is None:
                    pages.desk.receive(place, text, pages.now)
                pages.now += 0.05
            pages.desk.poll(pages.now)
            pages.machine.sleep(0.01)
            if any("does not belong to this page" in words for _, words in pages.told(place)):
                raise PassedOver
        except UnicodeDecodeError:  # the web server closes such a socket
            return
        finally:
            pages.desk.remove(place)


_PAGE = _Page()


def _arrivals() -> Conversations:
    return [
        [b"GET", b"/", b"", b"host: 127.0.0.1:8402", b"cookie: axisbus=COOKIE; other=1"],
        [b"GET", b"/enter", b"token=abc&token=def", b"host: 127.0.0.1:8402"],
        [
            b"POST",
            b"/own/config",
            b"page=1&name=x.dcf",
            b"host: 127.0.0.1:8402",
            b"origin: http://127.0.0.1:8402",
            b"content-length: 100",
            b"cookie: axisbus=COOKIE",
        ],
        [b"WEBSOCKET", b"/own/socket", b"", b"host: localhost:8402", b"origin: http://localhost:8402"],
    ]


def _arrival(parts: Sequence[bytes]) -> None:
    """Let the gate decide about a request whose head the web server has parsed."""
    method, path, query, *head = [*parts[:3], *[b""] * (3 - len(parts)), *parts[3:]]
    keys = PageSessions()
    cookie = str(keys.enter(keys.issue(Role.OPERATOR)))
    headers = [tuple(part.replace(b"COOKIE", cookie.encode()).partition(b": ")[::2]) for part in head]
    scope = {
        "type": "websocket" if method == b"WEBSOCKET" else "http",
        "method": method.decode("latin-1"),
        "path": path.decode("latin-1"),
        "query_string": query,
        "headers": headers,
        "client": ("127.0.0.1", 40000),
        "server": ("127.0.0.1", 8402),
    }
    door_ = ServedOrigin("http", frozenset({"127.0.0.1:8402", "localhost:8402"}))
    decide(arrival_of(scope, "axisbus"), door_, keys, {}, FOREIGN_MESSAGE)


def _scope_samples(_: Path) -> list[bytes]:
    names = json.dumps(["x.position", "y.position"]).encode()
    count = 50
    times = struct.pack(f"<{count}d", *(0.01 * n for n in range(count)))
    values = struct.pack(f"<{2 * count}f", *(float(n) for n in range(2 * count)))
    return [saving.HEAD.pack(count, len(names)) + names + times + values]


def _samples(path: Path) -> None:
    if saving.read(path.read_bytes(), {"x.position", "y.position"}) is None:
        raise PassedOver


def _dcf_of_page(path: Path) -> None:
    try:
        summary(Dcf(named(path.name), path.read_bytes()))
    except AxisbusError as error:
        raise UserError(json.dumps(explained(error))) from error


# -- a fleet --------------------------------------------------------------------------------------------------------------

_BASE = "ax/hall/press"


def _to_fleet() -> Conversations:
    """Return pairs of a key and its payload."""
    encode, fields = msgspec.json.encode, to_fields(StateError("no", observed="seen", remedy="do"))
    axes = (f.AxisInfo("x", "deg", 1, {"max_velocity": 400.0}), f.AxisInfo("y", "mm"))
    info = f.CellInfo(
        f.PROTOCOL, __version__, "a", "hall", "press", 1e9, True, axes, {"xy": ("x", "y")}, (1, 2)
    )
    state = f.AxisStateMessage(
        1, "a", 1e9, "deg", "Standstill", 0.01, "operation enabled", "pp", 1.0, 0.0, 0.0, 0.0, True
    )
    event = f.Event(1, "a", 1e9, "incident", "text", "x", "error", "cause", "remedy")
    pairs = [
        (f"{_BASE}/@alive", b"\1"),
        (f"{_BASE}/@bridge/a", b"\1"),
        (f"{_BASE}/info", encode(info)),
        (f"{_BASE}/x/state", encode(state)),
        (f"{_BASE}/x/state", encode(msgspec.structs.replace(state, n=2))),
        (f"{_BASE}/events", encode(event)),
        (
            f"{_BASE}/events/answer",
            encode(f.EventsAnswer("a", 1, 3, (event, msgspec.structs.replace(event, n=3)))),
        ),
        (f"{_BASE}/cmd/halt", encode(f.CommandAnswer("error", fields))),
        (f"{_BASE}/cmd/halt", encode(f.CommandAnswer("running"))),
        (f"{_BASE}/lease", encode(f.LeaseAnswer("anna", 1.0, "token"))),
        (f"{_BASE}/lease", encode(f.LeaseAnswer(refused=fields))),
        (f"{_BASE}/od/1/1000/00", encode(f.ObjectAnswer(5, error=fields))),
        (f"{_BASE}/history", encode(f.HistoryAnswer(times=(0.0, 1.0), values={"x.position": (1.0, None)}))),
    ]
    return [[part for key, data in pairs for part in (key.encode(), data)]]


class _Nobody:
    """An empty network."""

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_, **__: None


def _fleet(parts: Sequence[bytes]) -> None:
    hearing = FleetSubscriptions("hall", _Nobody(), _Nobody())  # type: ignore[arg-type]
    order, keeper = CommandRetry("press.x.halt", 0.0, "a"), HeldLease("token", 1.0, 0.0)
    for key, payload in zip(parts[::2], parts[1::2], strict=False):
        text = key.decode("ascii", "replace")
        kind = text.rpartition("/")[2]
        if len(text.split("/")) < 4:  # a fleet subscribes to no such key
            continue
        _heard(hearing, text, kind, payload)
        if (command := read(payload, f.CommandAnswer)) is not None:
            order.answered(command, 1.0)
        if (lease := read(payload, f.LeaseAnswer)) is not None:
            _kept(keeper, lease)
        for other in (f.ObjectAnswer, f.HistoryAnswer):
            told = read(payload, other)
            if told is not None and told.error is not None:
                str(error_of(told.error, "press"))
    for cell in hearing.names:
        hearing.inspect(cell, lambda watch, now: [watch.last_state(axis, now) for axis in watch.axes])
        hearing.inspect(
            cell,
            lambda watch, now: (watch.differs, watch.settled, watch.has_second_bridge(now), watch.log.events),
        )
        hearing._query_missing(cell)


def _heard(hearing: FleetSubscriptions, key: str, kind: str, payload: bytes) -> None:
    if "@alive" in key:
        hearing._token(key, payload != b"\0")
    elif "@bridge" in key and key.count("/") > 3:
        hearing._presence(key, payload != b"\0")
    elif kind == "state":
        hearing._state(key, payload)
    elif kind == "events":
        hearing._event(key, payload)
    elif kind == "answer":
        hearing._events("press", f.EventsAsk(), key, payload)
    elif kind == "info":
        hearing._info(key, payload)


def _kept(keeper: HeldLease, lease: f.LeaseAnswer) -> None:
    """Require that no wait for a lease is longer than an hour."""
    if lease.refused is None:
        keeper.renewed(lease.seconds, 0.0)
    else:
        str(error_of(lease.refused, "press"))
    for now in (0.0, 1.0):
        keeper.due(now)
        assert abs(min(keeper.next - now, keeper.remaining(now))) < 3600.0, (
            "it would wait for more than an hour"
        )


OF_CONNECTIONS: dict[str, Reader] = {
    "core's messages": reader_of(
        _core_messages,
        _core,
        errors=(NotSendable,),
        names=says("data from another process"),
        limits=_LIMITS,
    ),
    "core's door": reader_of(_first_words, _door, errors=(PassedOver,), names=unshown),
    "answer to a stop": reader_of(
        _stop_answers, _stop_answer, errors=(ScanError,), names=says("the machine that")
    ),
    "page": reader_of(
        _page_messages, _PAGE.take, errors=(PassedOver,), names=unshown, holds=_PAGE.there, limits=_LIMITS
    ),
    "page's requests": reader_of(_arrivals, _arrival),
    "page's samples": Reader(".bin", _scope_samples, _samples, errors=(PassedOver,), names=unshown),
    "page's DCF": Reader(
        ".dcf",
        lambda _: [(ROOT / "eds" / "generic-cia402.eds").read_bytes()],
        _dcf_of_page,
        names=lambda message, path: path.name in message,
    ),
    "fleet": reader_of(_to_fleet, _fleet, limits=_LIMITS),
}
