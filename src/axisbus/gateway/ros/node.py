"""The joints of a machine in the graph of ROS 2: a broadcaster of their states, and a controller that follows trajectories."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import zenoh

from axisbus.gateway.ros.attachment import Attachment
from axisbus.gateway.ros.log_thread import RosLogThread
from axisbus.gateway.ros.messages import JOINT_STATE, JOINT_TRAJECTORY, state_message, too_large, topic_of
from axisbus.gateway.ros.names import PUBLISHER, SUBSCRIPTION, RosNode, Topic, gid_of
from axisbus.gateway.ros.states import states_of
from axisbus.gateway.ros.trajectory_executor import Commander
from axisbus.gateway.ros.units import JointUnit, joints_of
from axisbus.machine.machine import Machine

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
        self._saying = RosLogThread(say)
        self._over = threading.Event()
        self._image = -1.0
        self._commander: Commander | None = None
        self._stack = ExitStack()
        with ExitStack() as stack:
            stack.callback(self._saying.close)
            self._broadcast(session, stack)
            if options.command:
                self._listen(session, stack, file)
            self._stack = stack.pop_all()
        self._say_joints()

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
        token = self._be_there(session, stack, BROADCASTER, 0, PUBLISHER, topic)
        publisher = session.declare_publisher(
            topic.key(self._options.domain), congestion_control=zenoh.CongestionControl.DROP
        )
        stack.callback(publisher.undeclare)
        thread = threading.Thread(
            target=self._publish, args=(publisher, gid_of(token)), name="joint states", daemon=True
        )
        stack.callback(thread.join, 2.0)
        stack.callback(self._over.set)
        thread.start()

    def _publish(self, publisher: zenoh.Publisher, gid: bytes) -> None:
        numbers, period, due = itertools.count(1), 1.0 / self._options.rate, time.monotonic()
        while not self._over.wait(max(0.0, due - time.monotonic())):
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
            self._machine, lambda: Machine.attach(file, command=True), self.joints, self._saying.tell
        )
        commander.start()
        stack.callback(commander.close)

        def hear(sample: zenoh.Sample) -> None:
            try:
                self._heard(commander, sample, key)
            except Exception:
                log.exception("a trajectory could not be received")

        subscriber = session.declare_subscriber(key, hear)
        stack.callback(subscriber.undeclare)
        self._be_there(session, stack, CONTROLLER, 2, SUBSCRIPTION, topic)

    def _heard(self, commander: Commander, sample: zenoh.Sample, key: str) -> None:
        if sample.kind != zenoh.SampleKind.PUT or str(sample.key_expr) != key:
            return
        refused = too_large(len(sample.payload))
        if refused is not None:
            self._saying.tell("a trajectory was refused", refused)
            return
        attached = sample.attachment
        commander.hear(sample.payload.to_bytes(), None if attached is None else attached.to_bytes())

    # -- the graph -----------------------------------------------------------------------------------------------------

    def _be_there(
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

    def _say_joints(self) -> None:
        joints = self.joints()
        named = ", ".join(f"{name} ({joint.name})" for name, joint in joints.items()) or "none"
        self._say(f"joints in ROS 2: {named}")
        for axis in self._machine:
            if axis.name not in joints:
                self._say(
                    f"{axis.name} is not a joint in ROS 2: {axis.unit} is not a unit of an angle or a length"
                )
