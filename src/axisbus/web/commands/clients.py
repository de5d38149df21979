"""The open pages at a machine: their seats, the controls, the jog that each holds, and the results of their commands."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from axisbus.client_support.dead_man import DeadMan
from axisbus.client_support.merged_stops import MergedStops
from axisbus.errors import AxisbusError, Interrupted, OwnershipError, Replaced, seen_of
from axisbus.ipc.rate import Bucket
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.access.lease import PageIdentity, PageLease, Refusal
from axisbus.web.access.tokens import PageSession, Role
from axisbus.web.commands.acts import direction_of, jog, perform, stop, take_command
from axisbus.web.commands.authorize import PageAction, decide
from axisbus.web.commands.node_boots import NodeBoots
from axisbus.web.commands.object_requests import VERBS as OBJECT_VERBS
from axisbus.web.commands.object_requests import ObjectRequests
from axisbus.web.commands.request import PageRequest, read
from axisbus.web.commands.verbs import STOPS, VERBS, PageVerb
from axisbus.web.config import report as config
from axisbus.web.objects.verifying import VerifyProgress
from axisbus.web.tuning import trials
from axisbus.web.tuning.trials import Trials
from axisbus.web.view import in_page_terms

_TOO_MANY_MESSAGES = Refusal(
    "this page sends too many messages", "halt and stop are still accepted; wait a moment for everything else"
)
_OBSERVES_ONLY = Refusal(
    "the server serves observer pages only: it cannot take control", "start axisbus web without --look"
)
_REPEAT_TIME = 2.0  # seconds after which the same message is sent again
_MOST_RUNNING = 64  # the most running commands of a page whose ends are reported


@dataclass(frozen=True, slots=True)
class PageMessage:
    """A message for one page: ``kind`` is refused, failed, note or link."""

    kind: str
    text: str
    remedy: str = ""


@dataclass(slots=True)
class PageClient:
    """An open page; holds state: its jog, the rest of its message rate, and the messages to send to it."""

    identity: PageIdentity
    bucket: Bucket = field(default_factory=Bucket)
    deadman: DeadMan = field(default_factory=DeadMan)
    running: list[Handle] = field(default_factory=list)
    jogs: list[Handle] = field(default_factory=list)
    messages: list[PageMessage] = field(default_factory=list)
    last: tuple[str, float] = ("", 0.0)
    session: int = 0  # the session of its browser
    verified: VerifyProgress | None = None  # the last progress of a verification sent to it
    configured: config.ConfigProgress | None = None  # the last progress of a configuration job sent to it
    last_sent: float | None = None  # when it sent its last received message, in seconds of its clock
    seen: float | None = None  # when the server sent the values shown then, in seconds of the server's clock
    moving: bool = False  # whether the axis that it jogs has been seen to move

    def queue_message(self, message: PageMessage, now: float) -> None:
        """Queue a message, unless the same one was queued within the last 2 s."""
        if self.last[0] == message.text and now - self.last[1] < _REPEAT_TIME:
            return
        self.last = (message.text, now)
        self.messages.append(message)

    def refuse(self, refused: Refusal, now: float) -> None:
        """Queue the message that a request is refused."""
        self.queue_message(PageMessage("refused", refused.text, refused.remedy), now)


class PageClients:
    """Hold all pages and the lease of the controls; used by one thread. Times are seconds of one clock, read by the caller."""

    def __init__(self, machine: Machine, link: Callable[[], str], *, observes_only: bool = False) -> None:
        """``link`` makes a link for one more page that only observes; ``observes_only``: no page may take control."""
        self._machine = machine
        self._link = link
        self.observes_only = observes_only
        self._count = 0
        self.lease = PageLease()
        self.objects = ObjectRequests()
        self.trials = Trials(machine)
        self.boots = NodeBoots(machine)
        self._stops = MergedStops(machine)
        self.clients: dict[int, PageClient] = {}

    def admit(self, session: PageSession, peer: str) -> PageClient:
        """Register a page that has been opened, and return its client."""
        self._count += 1
        client = PageClient(
            PageIdentity(self._count, f"page {self._count} at {peer}", session.role), session=session.number
        )
        self.clients[client.identity.number] = client
        return client

    def remove(self, client: PageClient) -> None:
        """Remove a closed page: halt its jog or trial, and free the controls. Harmless when repeated."""
        self.clients.pop(client.identity.number, None)
        self.lease = self.lease.after_release_by(client.identity)
        self.objects.remove_page(client.identity.number)
        self._end_jog(client)
        self.trials.remove_page(client.identity.number)
        for handle in (*client.running, *client.jogs):
            mark_end_as_read(handle)  # no page is left to report the end to

    def receive(self, client: PageClient, text: str, now: float) -> None:
        """Process a message of a page. Beyond the page's message rate, only halts and stops are processed."""
        is_permitted = client.bucket.take(now)
        request = read(text)
        if isinstance(request, PageRequest) and (is_permitted or request.verb in STOPS):
            self._process(client, request, now)
        elif isinstance(request, Refusal) and is_permitted:
            client.refuse(request, now)
        elif not is_permitted:
            client.refuse(_TOO_MANY_MESSAGES, now)

    def poll(self, now: float) -> None:
        """End jogs that are no longer held, and collect the ends of commands; to be called at least every 50 ms."""
        for client in list(self.clients.values()):
            if client.deadman.silent(now) or self._broken_off(client):
                self._end_jog(client)
            self._gather(client, now)
        self.trials.poll(now)

    def stop_all(self) -> None:
        """Quick-stop every axis, for a page whose socket does not work.

        Raises:
            AxisbusError: as ``stop``.
        """
        self.end_jogs()
        for handle in stop(self._stops, PageAction(PageVerb.QUICK_STOP_ALL, tuple(self._machine.axes))):
            mark_end_as_read(handle)  # the axes show the result

    def end_jogs(self, axes: Collection[str] | None = None) -> None:
        """End the jogs, and the trial, of these axes (None: all) after a stop; a jog needs a new press to start again."""
        self.trials.end_stopped(axes, trials.STOPPED)
        for client in self.clients.values():
            if axes is None or client.deadman.axis in axes:
                client.deadman = client.deadman.ended()

    def _process(self, client: PageClient, request: PageRequest, now: float) -> None:
        if request.verb not in STOPS:
            client.deadman = client.deadman.updated(request.sent, now)
            client.last_sent, client.seen = request.sent, request.seen
        decision = too_late(client.deadman, request, now) or decide(
            client.identity, self.lease, request, tuple(self._machine.axes)
        )
        if isinstance(decision, Refusal):
            self._end_jog(client)
            client.refuse(decision, now)
            return
        try:
            self._do(client, decision, request, now)
        except AxisbusError as error:
            self._end_jog_for(client, error)
            client.queue_message(_of_error("refused", error), now)

    def _do(self, client: PageClient, action: PageAction, request: PageRequest, now: float) -> None:
        number = client.identity.number
        if action.verb is PageVerb.JOG:
            self._jog(client, action, request, now)
        elif action.verb is PageVerb.JOG_END:
            self._end_jog(client)
        elif action.verb in (PageVerb.TAKE, PageVerb.TAKE_OVER):
            self._take(client, action.verb is PageVerb.TAKE_OVER, now)
        elif action.verb is PageVerb.GIVE_BACK:
            self._end_jog(client)
            self.lease = self.lease.after_release_by(client.identity)
            self._without_controls(number, now)
        elif action.verb is PageVerb.LINK:
            self._give_link(client, now)
        elif action.verb is PageVerb.TAKE_COMMAND:
            self._take_command(client, now)
        elif action.verb is PageVerb.BOOT:
            client.running.append(self.boots.begin(request.node))
        elif action.verb in OBJECT_VERBS:
            self._of_objects(client, request, now)
        elif action.verb in (PageVerb.STEP_POSITION, PageVerb.STEP_VELOCITY):
            self.trials.request(number, action, request, client.deadman, now)
        elif action.verb is PageVerb.TRIAL_BEAT:
            self.trials.supervise(number, request, now)
        elif action.verb is PageVerb.TRIAL_END:
            self.trials.end(number, trials.ENDED)
        elif action.verb is not PageVerb.BEAT:
            self._perform(client, action)

    def _of_objects(self, client: PageClient, request: PageRequest, now: float) -> None:
        refused = self.objects.do(
            client.identity.number, request, controls=self.lease.held_by(client.identity)
        )
        if refused is not None:
            client.refuse(refused, now)

    def _perform(self, client: PageClient, action: PageAction) -> None:
        if action.verb in STOPS:
            self.end_jogs(action.axes)
            client.running += [each for each in stop(self._stops, action) if each not in client.running]
        else:
            self.trials.end_of(action.axes, action.verb.value)
            self._stops.overtake(action.axes)
            client.running += perform(self._machine, action)
        del client.running[:-_MOST_RUNNING]

    def _jog(self, client: PageClient, action: PageAction, request: PageRequest, now: float) -> None:
        if self._broken_off(client):  # a jog that was stopped meanwhile must not continue
            self._end_jog(client)
        before = client.deadman
        direction = direction_of(action)
        client.deadman = before.beaten(request.press, action.axes[0], direction, request.sent, now)
        if client.deadman.held:
            self.trials.end_of(action.axes, action.verb.value)
            self._stops.overtake(action.axes)
            client.jogs.append(jog(self._machine, action, renews=before.is_held_by(request.press)))
        elif before.held:
            self._halt(client, before.axis)

    def _broken_off(self, client: PageClient) -> bool:
        """Return whether the held jog was moving and no longer moves: halted by any client, in fault, or at a limit."""
        state = self._machine[client.deadman.axis].snapshot.state if client.deadman.held else None
        broken = client.moving and state not in (None, AxisState.CONTINUOUS_MOTION)
        client.moving = state is AxisState.CONTINUOUS_MOTION
        return broken

    def _end_jog(self, client: PageClient) -> None:
        axis, client.deadman = client.deadman.axis, client.deadman.ended()
        if axis:
            self._halt(client, axis)

    def _end_jog_for(self, client: PageClient, error: AxisbusError) -> None:
        """End the jog for an error. Without control of the machine, any motion is that of another program, and is not halted."""
        if isinstance(error, OwnershipError):
            client.deadman = client.deadman.ended()
        else:
            self._end_jog(client)

    def _halt(self, client: PageClient, axis: str) -> None:
        client.running.append(self._machine[axis].halt())

    def _take(self, client: PageClient, over: bool, now: float) -> None:
        lease = self.lease.granted_to(client.identity, over=over)
        if isinstance(lease, Refusal):
            client.refuse(lease, now)
            return
        before, self.lease = self.lease.holder, lease
        if (
            before is not None
            and before != client.identity
            and (other := self.clients.get(before.number)) is not None
        ):
            self._end_jog(other)
            self._without_controls(other.identity.number, now)
            other.queue_message(
                PageMessage("note", f"{client.identity.page_name} has taken over the controls"), now
            )

    def _without_controls(self, number: int, now: float) -> None:
        self.objects.without_controls(number, now)
        self.trials.end(number, trials.CONTROLS_LOST)

    def _take_command(self, client: PageClient, now: float) -> None:
        if self.observes_only:
            client.refuse(_OBSERVES_ONLY, now)
        else:
            client.running.append(take_command(self._machine))

    def _give_link(self, client: PageClient, now: float) -> None:
        if client.identity.role is Role.OPERATOR:
            client.queue_message(PageMessage("link", self._link()), now)
        else:
            client.refuse(Refusal("this is an observer page: it makes no links", "ask an operator"), now)

    def _gather(self, client: PageClient, now: float) -> None:
        for handles in (client.running, client.jogs):
            ended = [handle for handle in handles if not handle.busy]
            handles[:] = [handle for handle in handles if handle.busy]
            for error in (handle.exception() for handle in ended):
                if error is None or isinstance(error, Replaced):
                    continue
                if handles is client.jogs:
                    self._end_jog_for(client, error)
                if not isinstance(error, Interrupted):
                    client.queue_message(_of_error("failed", error), now)
                elif handles is client.running:
                    client.queue_message(_of_error("note", error), now)


def _of_error(kind: str, error: AxisbusError) -> PageMessage:
    seen = seen_of(error)
    text = f"{error.message} ({seen})" if seen else error.message
    return PageMessage(kind, in_page_terms(text), in_page_terms(error.remedy))


# -- Reject requests that are too old: those that arrive late, and those from a page that showed old values ------------
#
# Theory of operation
# If a message takes longer than the promptest ones, the network has become slow. If the network is always slow, the age of the
# values that the page shows reveals it: each message says when the server sent those values, by the server's own clock. A user
# who sees old values, and whose input arrives late, must not move anything.


_MAX_DELAY = 1.0  # seconds by which a message may take longer than the promptest ones
_OLD = 1.5  # seconds, the highest age of the values that a page showed when a request of it arrives
_OLD_JOG = 0.6  # the same for a jog, which continues only while it is held
AHEAD = 1.0  # seconds by which the values sent to a page may be newer than those it shows, so that they do not queue up


def too_late(deadman: DeadMan, request: PageRequest, now: float) -> Refusal | None:
    """Return why a request is rejected as too old, None if it is not; ``now`` as of ``DeadMan``."""
    if not VERBS[request.verb].controls:
        return None
    delay = deadman.lateness(request.sent, now)
    if delay > _MAX_DELAY:
        return Refusal(
            f"{request.verb.value} came {delay:.1f} s late, and was not executed",
            "check the state of the axes, and try again",
        )
    old = 0.0 if request.seen is None else now - request.seen
    if old > (_OLD_JOG if request.verb is PageVerb.JOG else _OLD):
        return Refusal(
            f"the connection is slow, {old:.1f} s there and back: {request.verb.value} was not executed",
            "use a faster connection, or command from the terminal",
        )
    return None


def is_ahead(sent: float, seen: float | None) -> bool:
    """Return whether a page lags too far: it shows the values sent at ``seen``, and the newest were sent at ``sent``."""
    return seen is not None and sent - seen > AHEAD
