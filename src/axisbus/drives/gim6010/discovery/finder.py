"""Finding modules as a pure state machine: frames with their times in, at most one request at a time out, findings in the end.

Theory of operation
-------------------
It listens first, and asks only afterwards, in this order:

1. modules whose heartbeats prove CAN Simple: supply voltage, version, error words;
2. the other node IDs of CAN Simple, by a remote frame for the supply voltage, which commands nothing whoever it reaches; one that
   answers has to answer another message too before it is taken for a module;
3. CANopen nodes that were heard, then the other CANopen node IDs, by an upload of 1000h. Its identifier is a command to a module
   with node ID 48 to 51 of CAN Simple, which is why it comes last, and why no such ID is asked where one was found.

Nobody is asked on an identifier that somebody else was heard on; nor where several modules have one node ID, since their answers
destroy each other; and the silent are left alone where anything foreign was heard (``ProbeScope``), and of CAN Simple where no
remote frames can be sent: a data frame might be somebody's command. One request is on its way at a time, ``pace`` lies between two,
a module gets at most ``most``; the first sign that nobody acknowledges (``trouble``) ends all asking.
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

_EPSILON = 1e-9  # s; sums of floats do not meet a time exactly
_FIRST = (
    0.1  # s after the first request on a silent bus, in which a controller tells that nobody acknowledges
)
_TWICE = range(48, 52)  # node IDs of CAN Simple to which requests of CANopen are commands: asked twice before
_BRIEF = 0.03  # s that a silent node ID is waited for; who answers later is asked again in the end


class ProbeScope(Enum):
    """Who is asked."""

    NOBODY = "nobody: it only listens"
    HEARD = "modules and nodes that were heard"
    ALL = "those, and every node ID that is silent"


@dataclass(frozen=True, slots=True)
class Bounds:
    """Times in s, and how many requests one module gets at most."""

    listen: float = 1.5
    answer: float = 0.06
    pace: float = 0.01
    most: int = 24

    def __post_init__(self) -> None:
        assert self.pace >= 0.01


@dataclass(frozen=True, slots=True)
class Only:
    """The node IDs that are of interest, of each protocol; None: all."""

    nodes: frozenset[int] | None = None

    def has(self, node: int) -> bool:
        """Whether a node ID is one of them."""
        return self.nodes is None or node in self.nodes


@dataclass(slots=True)
class _Asked:
    """A dialogue that runs: whom it asks, what it waits for, since when, and how many requests it has made."""

    who: tuple[str, int]
    dialogue: Generator[ProbeFrame, CanFrame | None, object]
    brief: bool = False
    question: ProbeFrame | None = None
    since: float | None = None
    patience: float = 0.0


@dataclass(slots=True)
class Finder:
    """Finds the modules of a bus; holds state: the picture of it, the dialogue that runs, and what was answered.

    ``ask`` None: everybody, but only those that were heard where something foreign is on the bus.
    """

    ask: ProbeScope | None = None
    only: Only = field(default_factory=Only)
    bounds: Bounds = field(default_factory=Bounds)
    words: bool = True  # whether error words are asked for
    remote: bool = True  # whether the bus carries remote frames
    picture: BusSnapshot = field(default_factory=BusSnapshot)
    simple: dict[int, SimpleFacts] = field(default_factory=dict)
    canopen: dict[int, CanopenFacts] = field(default_factory=dict)
    requests: dict[tuple[str, int], int] = field(default_factory=dict)  # how many each got
    answers: dict[tuple[str, int], int] = field(default_factory=dict)  # the most that one question had
    left_out: dict[str, list[int]] = field(default_factory=dict)  # why node IDs were not asked
    unacknowledged: str = ""
    done: bool = False
    asked: ProbeScope = ProbeScope.NOBODY  # who was asked in the end
    heard_first: int = 0  # frames before the first request
    _begin: float | None = None
    _free: float = 0.0  # when the next request may leave
    _plan: Iterator[_Asked] | None = None
    _current: _Asked | None = None
    _counting: tuple[ProbeFrame, tuple[str, int], int] | None = (
        None  # the last question, to whom, its answers
    )
    _expected: set[int] = field(default_factory=set)  # identifiers of answers to what was asked
    _late: set[tuple[str, int]] = field(
        default_factory=set
    )  # who let a question pass: an answer may be to that
    _unasked: set[int] = field(default_factory=set)  # identifiers that came without having been asked for

    def note(self, frame: CanFrame) -> None:
        """Take a frame that was heard, in the order of time."""
        self.picture.note(frame)
        if not (frame.extended or frame.error or frame.can_id in self._expected):
            self._unasked.add(frame.can_id)
        if self._counting is not None and self._counting[0].answered_by(frame):
            self._count(frame)
        current = self._current
        if current is not None and current.question is not None and current.question.answered_by(frame):
            self._go_on(current, frame)

    def trouble(self, words: str) -> None:
        """Ask nobody any more: a request was not acknowledged, or could not be sent."""
        if not self.done:
            self.unacknowledged = words
            self._current, self._plan = None, iter(())

    def step(self, now: float) -> Outgoing | None:
        """Let time pass until ``now`` (s, the clock of the frames); return the frame to be sent now, None for none."""
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
        """Whether listening is over."""
        return self._plan is not None

    # -- the order of asking ------------------------------------------------------------------------------------------------

    def _listens(self, passed: float) -> bool:
        """Whether it goes on listening: twice as long where heartbeats may still prove what they are."""
        listen = self.bounds.listen
        return passed < listen or (passed < 2 * listen and self.picture.unproven)

    def _look(self) -> None:
        """End listening: decide who is to be asked."""
        self.heard_first = self.picture.listening.frames
        self.asked = self.ask or (ProbeScope.HEARD if self.picture.foreign() else ProbeScope.ALL)
        self._plan = self._everybody() if self.asked is not ProbeScope.NOBODY else iter(())

    def _everybody(self) -> Iterator[_Asked]:
        yield from self._modules(sorted(set(self.picture.speakers) - set(self.picture.twins)))
        if self.asked is ProbeScope.ALL:
            found: list[int] = []
            yield from self._silent_ones((*NODES, *_TWICE), found, brief=True)
            yield from self._silent_ones((node for node in NODES if self._is_late(node)), found)
            yield from self._modules(found)
        yield from self._nodes(sorted(self.picture.states))
        if self.asked is ProbeScope.ALL:
            yield from self._nodes(cob.NODE_IDS, brief=True)
            yield from self._nodes(node for node in cob.NODE_IDS if self.picture.used([cob.SDO_TX + node]))

    def _silent_ones(
        self, nodes: Iterable[int], found: list[int], *, brief: bool = False
    ) -> Iterator[_Asked]:
        for node in nodes:
            if self.only.has(node) and node not in self.picture.simple and self._is_free(node):
                yield self._silent(node, found, brief=brief)

    def _is_late(self, node: int) -> bool:
        return self.picture.used([can_id(node, questions.VOLTAGE.command)])

    def _modules(self, nodes: Collection[int]) -> Iterator[_Asked]:
        for node in nodes:
            if self.only.has(node) and self._unclaimed(node):
                facts = self.simple.setdefault(node, SimpleFacts())
                yield _Asked(
                    ("CAN Simple", node),
                    questions.simple(node, facts, words=self._may_ask_words(node), remote=self.remote),
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
            if self.only.has(node) and not known.answers and self._may_upload(node):
                facts = self.canopen.setdefault(node, known)
                yield _Asked(("CANopen", node), self._upload(node, facts), brief)

    def _upload(self, node: int, facts: CanopenFacts) -> Asking:
        yield from questions.canopen(node, facts)
        if facts.answers:
            self.picture.answering.add(node)

    # -- who must not be asked ------------------------------------------------------------------------------------------------

    def _is_free(self, node: int) -> bool:
        """Whether a silent node ID of CAN Simple has no identifier that somebody uses."""
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
        """Whether what it is asked by belongs to no CANopen node that is known."""
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
            self._leave_out("somebody else was heard on their SDO, CANopen", node)
            return False
        return True

    def _may_ask_words(self, node: int) -> bool:
        """Error words that come by themselves do not say which they are: an answer could not be told from one."""
        return self.words and can_id(node, 0x03) not in self._unasked

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
        """Count the answers to one question: of two one is another module's. What comes by itself does not count."""
        assert self._counting is not None
        question, who, count = self._counting
        if frame.can_id not in self._unasked and who not in self._late:
            self._counting = question, who, count + 1
            self.answers[who] = max(self.answers.get(who, 0), count + 1)


_OF_CANOPEN = (cob.EMCY, *cob.TPDO, *cob.RPDO, cob.SDO_TX, cob.SDO_RX, cob.HEARTBEAT)
