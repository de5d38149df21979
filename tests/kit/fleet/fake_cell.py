"""A fake cell with its bridge: it follows the protocol with code of its own, and can be set to lose messages."""

from __future__ import annotations

import itertools
import threading
import time
import uuid
from collections import Counter
from contextlib import suppress

import msgspec
import zenoh

from axisbus.errors import LimitError, OwnershipError, StateError
from axisbus.fleet import messages as m
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.ipc.errors import to_fields
from axisbus.version import __version__

LEASE = 1.0
VERBS = {
    "halt", "quick_stop", "halt_all", "quick_stop_all", "enable", "disable", "reset", "stop", "release", "home",
    "set_position", "set_override", "move_additive", "move_absolute", "move_relative", "move_velocity", "torque_control", "jog",
}  # fmt: skip


class FakeCell:
    """A cell of axes that are where they are commanded to be at once; ``moved`` counts how often each was moved."""

    def __init__(
        self, session, plant, name, axes=("x",), *, version=__version__, protocol=m.PROTOCOL, rate=20.0
    ):
        self.name, self.axes, self.rate = name, axes, rate
        self.bridge = uuid.uuid4().hex[:12]
        self.keys = ZenohCellKeys(plant, name)
        self.position = dict.fromkeys(axes, 0.0)
        self.moved = Counter()
        self.stopped = Counter()
        self.jogs = []
        self.given = []
        self.asked = Counter()  # by id
        self.deaf = 0  # so many commands are lost
        self.dumb = 0  # so many are done, and not answered
        self.overtaken = 0  # so many come too late
        self.runs = 0  # so many answers are that it runs
        self.silent = False  # publishes no states
        self.holder, self.token, self.until = None, "", 0.0
        self.leases = Counter()
        self.objects = {(1, 0x1008, 0): "stand-in"}
        self.events = []
        self._info = m.CellInfo(
            protocol, version, self.bridge, plant, name, time.time(), True,
            tuple(m.AxisInfo(axis, "deg", number, {"max_velocity": 100.0}) for number, axis in enumerate(axes, 1)),
        )  # fmt: skip
        self._answers = {}
        self._highest = Counter()
        self._numbers = {axis: itertools.count(1) for axis in axes}
        self._session = session
        self._ended = threading.Event()
        self._tokens = []
        self._declared = [
            session.declare_queryable(key, self._answering(answer))
            for key, answer in (
                (self.keys.info, self._tell),
                (self.keys.state("*"), self._of_states),
                (self.keys.events, self._of_events),
                (self.keys.lease, self._of_lease),
                (self.keys.command("*"), self._command),
                (self.keys.objects, self._object),
                (self.keys.history, self._history),
            )
        ]
        self.appear()
        self._thread = threading.Thread(target=self._publish, daemon=True)
        self._thread.start()

    # -- actions of a test ---------------------------------------------------------------------------------------------

    def appear(self):
        liveliness = self._session.liveliness()
        self._tokens = [
            liveliness.declare_token(key) for key in (self.keys.presence(self.bridge), self.keys.alive)
        ]

    def machine_ends(self):
        self._tokens.pop().undeclare()

    def vanish(self):
        for token in self._tokens:
            token.undeclare()
        self._tokens = []

    def end(self):
        self._ended.set()
        self._thread.join()
        self.vanish()
        for each in self._declared:
            each.undeclare()

    def happen(self, text, *, tell=True, kind="incident", severity="error", n=None):
        event = m.Event(
            n or len(self.events) + 1, self.bridge, time.time(), kind, text, self.axes[0], severity, "a cause", "a remedy"
        )  # fmt: skip
        self.events.append(event)
        if tell:
            self.put(self.keys.events, event)
        return event

    def state(self, axis, **more):
        told = {
            "age": 0.001,
            "position": self.position[axis],
            "velocity": 0.0,
            "torque": 0.0,
            "following_error": 0.0,
        }
        return m.AxisStateMessage(
            next(self._numbers[axis]), self.bridge, time.time(), "deg", "Standstill", **{**told, **more}
        )  # fmt: skip

    def put(self, key, message):
        payload = message if isinstance(message, bytes) else msgspec.json.encode(message)
        self._session.put(key, payload)

    # -- its own actions -----------------------------------------------------------------------------------------------

    def _publish(self):
        while not self._ended.wait(1.0 / self.rate):
            for axis in () if self.silent else self.axes:
                with suppress(zenoh.ZError):  # a test has closed the session
                    self.put(self.keys.state(axis), self.state(axis))

    def _answering(self, answer):
        def called(query):
            try:
                found = answer(query, b"" if query.payload is None else query.payload.to_bytes())
                if found is not None:
                    query.reply(query.key_expr, msgspec.json.encode(found))
            finally:
                query.drop()

        return called

    def _tell(self, _query, _payload):
        return self._info

    def _of_states(self, query, _payload):
        for axis in () if self.silent else [str(query.key_expr).split("/")[-2]]:
            query.reply(self.keys.state(axis), msgspec.json.encode(self.state(axis)))

    def _of_events(self, _query, payload):
        ask = msgspec.json.decode(payload, type=m.EventsAsk)
        last = ask.last or len(self.events)
        found = tuple(event for event in self.events if ask.first <= event.n <= last)[:256]
        ends = (self.events[0].n, self.events[-1].n) if self.events else (0, 0)
        return m.EventsAnswer(self.bridge, *ends, found)

    def _of_lease(self, _query, payload):
        ask = msgspec.json.decode(payload, type=m.LeaseAsk)
        self.leases[ask.verb] += 1
        now = time.monotonic()
        if now >= self.until:
            self.holder, self.token = None, ""
        if ask.verb == "take" and (self.holder is None or ask.over):
            self.holder, self.token, self.until = ask.who, uuid.uuid4().hex, now + LEASE
            return m.LeaseAnswer(self.holder, LEASE, self.token)
        if ask.verb in ("renew", "release") and self.token and ask.token == self.token:
            self.until = now + LEASE if ask.verb == "renew" else 0.0
            return m.LeaseAnswer(self.holder, LEASE, self.token)
        if ask.verb == "look":
            return m.LeaseAnswer(self.holder)
        return m.LeaseAnswer(self.holder, refused=to_fields(OwnershipError(f"{self.holder} has the lease")))

    def _command(self, query, payload):
        ask, verb = msgspec.json.decode(payload, type=m.CommandAsk), str(query.key_expr).rpartition("/")[2]
        if self.deaf:
            self.deaf -= 1
            return None
        self.asked[ask.id] += 1
        key = ask.client, ask.id
        assert verb in VERBS
        if key not in self._answers:
            self._answers[key] = self._done(ask, verb)
        self._highest[ask.client] = max(ask.id, self._highest[ask.client])
        if self.dumb:
            self.dumb -= 1
            return None
        if self.runs and self._answers[key].status == "done":
            self.runs -= 1
            return m.CommandAnswer("running")
        return self._answers[key]

    def _done(self, ask, verb):
        if verb in ("halt", "quick_stop", "halt_all", "quick_stop_all"):
            self.stopped[verb] += 1
            return m.CommandAnswer("done", None, "it stands")
        if ask.id < self._highest[ask.client] or self.overtaken:
            self.overtaken = max(0, self.overtaken - 1)
            return _error(StateError(f"command {ask.id} {m.TOO_LATE}"))
        if ask.token != self.token or time.monotonic() >= self.until:
            return _error(OwnershipError("no command is executed without a lease"))
        (axis,) = ask.axes
        self.given.append((verb, ask.values))
        if verb == "jog":
            self.jogs.append(ask.values)
            return m.CommandAnswer("running")
        if verb == "move_absolute":
            if abs(ask.values["position"]) > 1000.0:
                return _error(LimitError("beyond position_limits", observed="a limit", remedy="less"))
            self.moved[axis] += 1
            self.position[axis] = ask.values["position"]
        return m.CommandAnswer("done")

    def _object(self, query, payload):
        node, index, subindex = str(query.key_expr).split("/")[-3:]
        key = int(node), int(index, 16), int(subindex, 16)
        if payload:
            ask = msgspec.json.decode(payload, type=m.ObjectWrite)
            if ask.token != self.token:
                return m.ObjectAnswer(error=to_fields(OwnershipError("no lease")))
            self.objects[key] = ask.value
        if key not in self.objects:
            return m.ObjectAnswer(error=to_fields(StateError("there is no such object")))
        value = self.objects[key]
        return m.ObjectAnswer(hex=value.hex()) if isinstance(value, bytes) else m.ObjectAnswer(value)

    def _history(self, _query, payload):
        ask = msgspec.json.decode(payload, type=m.HistoryAsk)
        if not ask.recording:
            return m.HistoryAnswer((m.RecordingInfo("run.mcap", 1000, 1.0),))
        return m.HistoryAnswer(times=(0.0, 0.1), values=dict.fromkeys(ask.signals, (1.0, None)))


def _error(error):
    return m.CommandAnswer("error", to_fields(error))
