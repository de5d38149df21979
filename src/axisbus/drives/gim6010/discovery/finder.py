"""Finding modules as a pure state machine: frames with their times in, at most one request at a time out, results at the end.

Theory of operation
-------------------
The finder listens first. Then it sends requests, in this order:

1. to modules whose heartbeats prove CAN Simple: supply voltage, version, error words;
2. to the other node IDs of CAN Simple: a remote frame for the supply voltage, which commands nothing whichever node receives it. A
   node that answers must also answer another message before it counts as a module;
3. to CANopen nodes that were heard, then to the other CANopen node IDs: an upload of 1000h. For a CAN Simple module with node ID 48
   to 51, the identifier of this request is a command. Therefore this step is last, and such an ID gets no upload if a module was
   found there.

No request uses an identifier on which another node was heard. A node ID that several modules share gets none, since their answers
destroy each other. If anything foreign was heard, silent node IDs get no requests (``ProbeScope``). If no remote frames can be
sent, silent node IDs of CAN Simple get none: a data frame might be a command for some other node. Only one request is pending at a
time, with ``pace`` between two requests, and at most ``most`` per module. The first sign that requests are not acknowledged
(``trouble``) ends all requests.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.identifier import COMMANDS, NODES, can_id, split
from axisbus.drives.gim6010.discovery import questions
from axisbus.drives.gim6010.discovery.bus_snapshot import BusSnapshot
from axisbus.drives.gim6010.discovery.questions import Asking, CanopenFacts, ProbeFrame, SimpleFacts

EVERY_NODE = range(256)  # node IDs of all protocols
_EPSILON = 1e-9  # s; sums of floats do not meet a time exactly
_FIRST = 0.1  # s after the first request on a silent bus, for the CAN controller to report a missing acknowledgement
_TWICE = range(48, 52)  # node IDs of CAN Simple to which CANopen requests are commands: probed twice before
_BRIEF = 0.03  # s to wait for a silent node ID; a node that answers later gets a second request at the end


class ProbeScope(Enum):
    """Which nodes get requests."""

    NOBODY = "nobody: it only listens"
    HEARD = "modules and nodes that were heard"
    ALL = "those, and every node ID that is silent"


@dataclass(frozen=True, slots=True)
class Bounds:
    """Times in s, and the maximum number of requests per module."""

    listen: float = 1.5
    answer: float = 0.06
    pace: float = 0.01
    most: int = 24

    def __post_init__(self) -> None:
        assert self.pace >= 0.01


@dataclass(slots=True)
class _Asked:
    """A running dialogue: its node, its pending request and the time of that request."""

    who: tuple[str, int]
    dialogue: Generator[ProbeFrame, CanFrame | None, object]
    brief: bool = False
    question: ProbeFrame | None = None
    since: float | None = None
    patience: float = 0.0


@dataclass(slots=True)
class Finder:
    """Finds the modules of a bus; holds the snapshot of the bus, the running dialogue and the answers.

    If ``ask`` is None, all nodes get requests; if something foreign is on the bus, only those that were heard.
    """

    ask: ProbeScope | None = None
    only: Collection[int] = EVERY_NODE  # the node IDs of interest, of each protocol
    bounds: Bounds = field(default_factory=Bounds)
    words: bool = True  # whether error words are requested
    remote: bool = True  # whether the bus carries remote frames
    picture: BusSnapshot = field(default_factory=BusSnapshot)
    simple: dict[int, SimpleFacts] = field(default_factory=dict)
    canopen: dict[int, CanopenFacts] = field(default_factory=dict)
    requests: dict[tuple[str, int], int] = field(default_factory=dict)  # number of requests per node
    answers: dict[tuple[str, int], int] = field(default_factory=dict)  # most answers to one question
    left_out: dict[str, list[int]] = field(default_factory=dict)  # reason: node IDs that got no request
    unacknowledged: str = ""
    done: bool = False
    asked: ProbeScope = ProbeScope.NOBODY  # the scope that was used
    heard_first: int = 0  # frames before the first request
    _begin: float | None = None
    _free: float = 0.0  # earliest time of the next request
    _plan: Iterator[_Asked] | None = None
    _current: _Asked | None = None
    # the last question, its node, the number of answers
    _counting: tuple[ProbeFrame, tuple[str, int], int] | None = None
    _expected: set[int] = field(default_factory=set)  # identifiers of answers to requests sent
    # nodes that missed a question: a late answer may belong to it
    _late: set[tuple[str, int]] = field(default_factory=set)
    _unasked: set[int] = field(default_factory=set)  # identifiers received without a request

    def note(self, frame: CanFrame) -> None:
        """Take a received frame; frames must come in order of time."""
        self.picture.note(frame)
        if not (frame.extended or frame.error or frame.can_id in self._expected):
            self._unasked.add(frame.can_id)
        if self._counting is not None and self._counting[0].answered_by(frame):
            self._count(frame)
        current = self._current
        if current is not None and current.question is not None and current.question.answered_by(frame):
            self._go_on(current, frame)

    def trouble(self, words: str) -> None:
        """Send no more requests: one was not acknowledged, or could not be sent."""
        if not self.done:
            self.unacknowledged = words
            self._current, self._plan = None, iter(())

    def step(self, now: float) -> Outgoing | None:
        """Advance to ``now`` (s, the clock of the frames) and return the frame to be sent now, or None."""
        if self._begin is None:
            self._begin = now
        if self.done or (self._plan is None and self._listens(now - self._begin + _EPSILON)):
            return None
        if self._plan is None:
            self._look()
        self._time_out(now)
        if now < self._free - _EPSILON:
            return None
        return self._send(now)

    @property
    def begun(self) -> bool:
        """Whether the listening phase is over."""
        return self._plan is not None

    # -- the order of requests ----------------------------------------------------------------------------------------------

    def _listens(self, passed: float) -> bool:
        """Whether the listening phase continues: it is twice as long if heartbeats are still unproven."""
        listen = self.bounds.listen
        return passed < listen or (passed < 2 * listen and self.picture.unproven)

    def _look(self) -> None:
        """End the listening phase and decide which nodes get requests."""
        self.heard_first = self.picture.listening.frames
        self.asked = self.ask or (ProbeScope.HEARD if self.picture.foreign() else ProbeScope.ALL)
        self._plan = self._everybody() if self.asked is not ProbeScope.NOBODY else iter(())

    def _everybody(self) -> Iterator[_Asked]:
        yield from self._modules(sorted(set(self.picture.speakers) - set(self.picture.twins)))
        if self.asked is ProbeScope.ALL:
            found: list[int] = []
            yield from self._silent_ones((*NODES, *_TWICE), found, brief=True)
            late = (node for node in NODES if self.picture.used([can_id(node, questions.VOLTAGE.command)]))
            yield from self._silent_ones(late, found)
            yield from self._modules(found)
        yield from self._nodes(sorted(self.picture.states))
        if self.asked is ProbeScope.ALL:
            yield from self._nodes(cob.NODE_IDS, brief=True)
            yield from self._nodes(node for node in cob.NODE_IDS if self.picture.used([cob.SDO_TX + node]))

    def _silent_ones(
        self, nodes: Iterable[int], found: list[int], *, brief: bool = False
    ) -> Iterator[_Asked]:
        for node in nodes:
            if node in self.only and node not in self.picture.simple and self._is_free(node):
                yield self._silent(node, found, brief=brief)

    def _modules(self, nodes: Collection[int]) -> Iterator[_Asked]:
        for node in nodes:
            if node in self.only and self._unclaimed(node):
                facts = self.simple.setdefault(node, SimpleFacts())
                # if error words also arrive unasked, answers cannot be distinguished from them
                words = self.words and can_id(node, 0x03) not in self._unasked
                yield _Asked(
                    ("CAN Simple", node),
                    questions.simple(node, facts, words=words, remote=self.remote),
                )

    def _silent(self, node: int, found: list[int], *, brief: bool) -> _Asked:
        facts = SimpleFacts()

        def dialogue() -> Asking:
            if (yield from questions.speaks(node, facts)):
                self.simple[node] = facts
                self.picture.proven.add(node)
                found.append(node)

        return _Asked(("CAN Simple", node), dialogue(), brief)

    def _nodes(self, nodes: Iterable[int], *, brief: bool = False) -> Iterator[_Asked]:
        for node in nodes:
            known = self.canopen.get(node, CanopenFacts())
            if node in self.only and not known.answers and self._may_upload(node):
                facts = self.canopen.setdefault(node, known)
                yield _Asked(("CANopen", node), self._upload(node, facts), brief)

    def _upload(self, node: int, facts: CanopenFacts) -> Asking:
        yield from questions.canopen(node, facts)
        if facts.answers:
            self.picture.answering.add(node)

    # -- nodes that must get no request ---------------------------------------------------------------------------------------

    def _is_free(self, node: int) -> bool:
        """Whether no identifier of a silent CAN Simple node ID is in use."""
        if not self.remote:
            self._leave_out(
                "this bus carries no remote frames, by which alone they are asked, of CAN Simple", node
            )
            return False
        mine = {can_id(node, command) for command in COMMANDS if command}
        if self._unasked.isdisjoint(mine) and self._unclaimed(node):
            return True
        self._leave_out("their identifiers are in use, of CAN Simple", node)
        return False

    def _unclaimed(self, node: int) -> bool:
        """Whether the identifiers of the requests to a module belong to no known CANopen node."""
        asked = {can_id(node, command) for command in (0x03, 0x04, 0x0A, 0x17)}
        taken = {base + other for other in self.picture.canopen for base in _OF_CANOPEN}
        if asked.isdisjoint(taken):
            return True
        self._leave_out("their identifiers belong to CANopen nodes that were heard, of CAN Simple", node)
        return False

    def _may_upload(self, node: int) -> bool:
        if split(cob.SDO_RX + node).node in self.picture.simple:
            self._leave_out("the request is a command to a module that speaks CAN Simple, CANopen", node)
            return False
        if not self._unasked.isdisjoint((cob.SDO_RX + node, cob.SDO_TX + node)):
            self._leave_out("another device sent frames on their SDO, CANopen", node)
            return False
        return True

    def _leave_out(self, why: str, node: int) -> None:
        nodes = self.left_out.setdefault(why, [])
        if node not in nodes:
            nodes.append(node)

    # -- one question after another -------------------------------------------------------------------------------------------

    def _send(self, now: float) -> Outgoing | None:
        while self._current is None:
            assert self._plan is not None
            following = next(self._plan, None)
            if following is None:
                self.done = True
                return None
            self._current = following
            self._go_on(following, None)
        current = self._current
        if current.since is not None or current.question is None:
            return None
        return self._asked_now(current, current.question, now)

    def _asked_now(self, current: _Asked, question: ProbeFrame, now: float) -> Outgoing | None:
        made = self.requests.get(current.who, 0)
        if made >= self.bounds.most:
            current.dialogue.close()
            self._current = None
            return None
        silent = not self.heard_first and not self.requests
        self.requests[current.who] = made + 1
        current.since, self._free = now, now + self.bounds.pace
        brief = current.brief and not made
        current.patience = _FIRST if silent else _BRIEF if brief else self.bounds.answer
        self._counting = question, current.who, 0
        self._expected.update(question.answers)
        return question.frame

    def _time_out(self, now: float) -> None:
        current = self._current
        if current is None or current.since is None:
            return
        if now >= current.since + current.patience - _EPSILON:
            self._late.add(current.who)
            self._go_on(current, None)

    def _go_on(self, current: _Asked, answer: CanFrame | None) -> None:
        current.since = None
        try:
            if current.question is None:
                current.question = next(current.dialogue)
            else:
                current.question = current.dialogue.send(answer)
        except StopIteration:
            self._current = None

    def _count(self, frame: CanFrame) -> None:
        """Count the answers to one question: a second answer comes from another module. Frames that arrive unasked do not count."""
        assert self._counting is not None
        question, who, count = self._counting
        if frame.can_id not in self._unasked and who not in self._late:
            self._counting = question, who, count + 1
            self.answers[who] = max(self.answers.get(who, 0), count + 1)


_OF_CANOPEN = (cob.EMCY, *cob.TPDO, *cob.RPDO, cob.SDO_TX, cob.SDO_RX, cob.HEARTBEAT)
