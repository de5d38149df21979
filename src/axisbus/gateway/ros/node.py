"""The joints of a machine in the graph of ROS 2: a broadcaster of their states, and a controller that follows trajectories."""

from __future__ import annotations

import itertools
import logging
import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

import zenoh

from axisbus.errors import AxisbusError, said_of
from axisbus.gateway.ros.messages import (
    JOINT_STATE,
    JOINT_TRAJECTORY,
    Attachment,
    JointState,
    state_message,
    too_large,
    topic_of,
)
from axisbus.gateway.ros.names import PUBLISHER, SUBSCRIPTION, RosNode, Topic, gid_of
from axisbus.gateway.ros.trajectory_executor import Commander
from axisbus.gateway.ros.units import JointUnit, joints_of
from axisbus.ipc.rate import Bucket
from axisbus.machine.machine import Machine
from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot

log = logging.getLogger("axisbus")
BROADCASTER, CONTROLLER = "joint_state_broadcaster", "joint_trajectory_controller"


class RosOptions(NamedTuple):
    """``rate`` in messages per second; ``command``: follow trajectories; ``namespace`` as returned by ``namespace_of``."""

    domain: int = 0
    namespace: str = "/"
    rate: float = 50.0
    command: bool = False


class RosNodes:
    """Hold the declarations for a machine, until ``close``."""

    def __init__(
        self,
        session: zenoh.Session,
        machine: Machine,
        file: Path,
        options: RosOptions,
        say: Callable[[str], None],
    ) -> None:
        """Join the graph; ``say`` reports to people what happens to trajectories."""
        self._machine = machine
        self._options = options
        self._say = say
        self._log_thread = RosLogThread(say)
        self._closing = threading.Event()
        self._image = -1.0
        self._commander: Commander | None = None
        self._stack = ExitStack()
        with ExitStack() as stack:
            stack.callback(self._log_thread.close)
            self._broadcast(session, stack)
            if options.command:
                self._listen(session, stack, file)
            self._stack = stack.pop_all()
        self._report_joints()

    def close(self) -> None:
        """Leave the graph; blocks until the axes that it has moved are at standstill."""
        self._stack.close()

    @property
    def commands(self) -> bool:
        """Whether a trajectory has control of the machine now."""
        return self._commander is not None and self._commander.commands

    def joints(self) -> Mapping[str, JointUnit]:
        """Return the axes that are joints."""
        return joints_of({axis.name: axis.unit for axis in self._machine})

    # -- joint states --------------------------------------------------------------------------------------------------

    def _broadcast(self, session: zenoh.Session, stack: ExitStack) -> None:
        topic = topic_of(self._options.namespace, "joint_states", JOINT_STATE)
        token = self._declare(session, stack, BROADCASTER, 0, PUBLISHER, topic)
        publisher = session.declare_publisher(
            topic.key(self._options.domain), congestion_control=zenoh.CongestionControl.DROP
        )
        stack.callback(publisher.undeclare)
        thread = threading.Thread(
            target=self._publish, args=(publisher, gid_of(token)), name="joint states", daemon=True
        )
        stack.callback(thread.join, 2.0)
        stack.callback(self._closing.set)
        thread.start()

    def _publish(self, publisher: zenoh.Publisher, gid: bytes) -> None:
        numbers, period, due = itertools.count(1), 1.0 / self._options.rate, time.monotonic()
        while not self._closing.wait(max(0.0, due - time.monotonic())):
            due = max(due + period, time.monotonic())  # missed messages are not made up for in a burst
            try:
                message = self._message()
                if message is not None:
                    attachment = Attachment(next(numbers), time.time_ns(), gid)
                    publisher.put(message, attachment=attachment.packed())
            except Exception as error:  # noqa: BLE001  # the machine or the session ends: both are reported elsewhere
                log.debug("joint states could not be published: %s", error)

    def _message(self) -> bytes | None:
        """Return the joints from the newest process image; None if it was sent already, or is out of date."""
        session, joints = self._machine.session, self.joints()
        snapshots = session.snapshots
        image = max((snapshots[name].now for name in joints), default=self._image)
        if image <= self._image or session.silent is not None:
            return None
        self._image = image
        units = {name: session.axes[name].parameters.units for name in joints}
        stamp = time.time_ns() - round((time.monotonic() - image) * 1e9)
        return state_message(stamp, states_of(snapshots, units, joints))

    # -- trajectories --------------------------------------------------------------------------------------------------

    def _listen(self, session: zenoh.Session, stack: ExitStack, file: Path) -> None:
        topic = topic_of(self._options.namespace, f"{CONTROLLER}/joint_trajectory", JOINT_TRAJECTORY)
        key = topic.key(self._options.domain)
        commander = self._commander = Commander(
            self._machine, lambda: Machine.attach(file, command=True), self.joints, self._log_thread.report
        )
        commander.start()
        stack.callback(commander.close)

        def receive(sample: zenoh.Sample) -> None:
            try:
                self._process_sample(commander, sample, key)
            except Exception:
                log.exception("a trajectory could not be received")

        subscriber = session.declare_subscriber(key, receive)
        stack.callback(subscriber.undeclare)
        self._declare(session, stack, CONTROLLER, 2, SUBSCRIPTION, topic)

    def _process_sample(self, commander: Commander, sample: zenoh.Sample, key: str) -> None:
        if sample.kind != zenoh.SampleKind.PUT or str(sample.key_expr) != key:
            return
        refused = too_large(len(sample.payload))
        if refused is not None:
            self._log_thread.report("a trajectory was refused", refused)
            return
        attached = sample.attachment
        commander.receive(sample.payload.to_bytes(), None if attached is None else attached.to_bytes())

    # -- the graph -----------------------------------------------------------------------------------------------------

    def _declare(
        self, session: zenoh.Session, stack: ExitStack, name: str, number: int, kind: str, topic: Topic
    ) -> str:
        """Declare a node and its publisher or subscription in the graph; return the token of the latter."""
        options = self._options
        node = RosNode(options.domain, str(session.info.zid()), number, options.namespace, name)
        tokens = node.token, node.token_of(kind, number + 1, topic)
        for token in tokens:
            stack.callback(session.liveliness().declare_token(token).undeclare)
        return tokens[1]

    # -- people --------------------------------------------------------------------------------------------------------

    def _report_joints(self) -> None:
        joints = self.joints()
        named = ", ".join(f"{name} ({joint.name})" for name, joint in joints.items()) or "none"
        self._say(f"joints in ROS 2: {named}")
        for axis in self._machine:
            if axis.name not in joints:
                self._say(
                    f"{axis.name} is not a joint in ROS 2: {axis.unit} is not a unit of an angle or a length"
                )


# -- The joints of a machine by the process image of its last cycle; values that are not fresh are NaN -----------------


def states_of(
    snapshots: Mapping[str, Snapshot], units: Mapping[str, Units], joints: Mapping[str, JointUnit]
) -> list[JointState]:
    """Return the present joints; the position of a continuous joint continues beyond one turn."""
    return [_state(name, snapshots[name], units[name], joint) for name, joint in joints.items()]


def _state(name: str, snapshot: Snapshot, units: Units, joint: JointUnit) -> JointState:
    position = velocity = effort = math.nan
    if snapshot.position is not None:
        position = units.position.to_units(snapshot.position - snapshot.origin) * joint.factor
    if snapshot.velocity is not None and units.ratio_known:
        velocity = units.velocity.to_units(snapshot.velocity) * joint.factor
    if snapshot.torque is not None and units.rated_torque is not None and joint.turns:
        effort = units.torque(snapshot.torque)
    return JointState(name, position, velocity, effort)


# -- Report trajectories to people in a thread of its own, so that a blocked terminal does not delay a halt ------------


_REFUSALS = 2.0  # lines per second at most about refused trajectories
_MAX_LINES = 64  # the most waiting lines
_END = 1.0  # seconds for which ``close`` waits for the output


class RosLogThread:
    """Hold the waiting lines; ``report`` is for any thread."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._bucket = Bucket(_REFUSALS, 2 * _REFUSALS)
        self._waiting: queue.Queue[str | None] = queue.Queue(_MAX_LINES)
        self._thread = threading.Thread(target=self._run, name="ROS lines", daemon=True)
        self._thread.start()

    def report(self, text: str, error: AxisbusError | None) -> None:
        """Report a line; excess lines are dropped. Does not block."""
        if error is not None:
            if not self._bucket.take(time.monotonic()):
                return
            text = f"{text}: {said_of(error)}"
        self._put(f"ROS 2: {text}")

    def close(self) -> None:
        """Write the waiting lines, and end; blocks briefly."""
        self._put(None)
        self._thread.join(_END)

    def _put(self, line: str | None) -> None:
        with suppress(queue.Full):
            self._waiting.put_nowait(line)

    def _run(self) -> None:
        while (line := self._waiting.get()) is not None:
            self._say(line)
