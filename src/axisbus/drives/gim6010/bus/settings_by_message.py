"""Settings of a CAN Simple module that have messages of their own and need no endpoints: limits, count, errors, and its node ID."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import ExitStack

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.can_simple_client import LISTEN, SimpleLine, several
from axisbus.drives.gim6010.can_simple.codec import encode, request
from axisbus.drives.gim6010.can_simple.messages import IDLE, named, state_words
from axisbus.drives.gim6010.can_simple.orders import Orders
from axisbus.drives.gim6010.make import RESTART_TIME
from axisbus.drives.gim6010.parameters import rules
from axisbus.errors import NodeError, NodeTimeout, StateError

_LINEAR, _COUNT = named("Set_Linear_Count"), named("Get_Encoder_Count")
_AFTER = 0.4  # s during which the client listens to heartbeats after a command
_ANSWER = 0.2  # s
_NEAR = 8  # counts by which an encoder at standstill may flicker


class ModuleByMessage:
    """A module on an open line; holds its last reported counts: over turns, and within one turn."""

    def __init__(self, line: SimpleLine) -> None:
        """``line`` must not be open yet."""
        self.line = line
        self._counts: tuple[int, int] | None = None
        line.hear(_COUNT.command, self._count)

    def require_idle(self, seconds: float = LISTEN) -> None:
        """Listen, and check that exactly one module has this node ID and that it is idle; blocks.

        Raises:
            StateError: it is not idle, or sends no heartbeat. NodeError: several modules have this node ID.
        """
        self.line.listen(seconds)
        state = self.line.state
        if state != IDLE:
            known = "sends no heartbeat" if state is None else f"is in {state_words(state)}"
            raise StateError(
                f"module {self.line.node} {known}: it is possibly not idle",
                remedy="stop and disable it first; set a module without heartbeats over USB",
            )

    def set_limits(self, velocity: float, current: float) -> None:
        """Set the limits: turns/s of the rotor and A (50 at most). They cannot be read back: no message reports them. Blocks.

        Raises:
            LimitError: a value that cannot be sent. StateError, NodeError: as ``require_idle``, or the module restarted or left.
        """
        frame = Orders(self.line.node).limits(velocity, current)
        self.require_idle()
        self.line.send(frame)
        self.require_idle(_AFTER)
        self.line.require_there()

    def set_zero(self) -> None:
        """Set the count over turns to 0 at the present position, until the next start, and read it back. Blocks.

        Raises:
            StateError, NodeError: as ``require_idle``. Also if the output turns, the module does not report its count,
                or the count is not 0 afterwards.
        """
        self.require_idle()
        before = self._ask()
        self.line.wait(lambda: False, _ANSWER)
        if abs((self._ask()[1] - before[1] + 8192) % 16384 - 8192) > _NEAR:
            raise StateError(
                "the output turns, so its zero would be at a random position", remedy="hold it still"
            )
        self.line.require_there()
        self.line.send(encode(self.line.node, _LINEAR, {"Linear_Count": 0}))
        self.require_idle(_AFTER)
        self.line.require_there()
        found = self._ask()[0]
        if abs(found) > _NEAR:
            raise NodeError(
                f"module {self.line.node} has the count {found} after the command to set 0",
                node=self.line.node,
                observed=f"the count before was {before[0]}",
                remedy="set the zero by parameters (--list), or over USB",
            )

    def clear(self) -> None:
        """Clear the errors, which enables nothing, and check by heartbeat that the axis's error word is 0. Blocks.

        Raises:
            StateError, NodeError: as ``require_idle``; the error remains.
        """
        self.require_idle(_AFTER)
        self.line.send(Orders(self.line.node).clear())
        self.require_idle(_AFTER)
        last = self.line.pulse.last
        word = None if last is None else last.axis_error
        if word != 0:
            raise rules.not_cleared(f"module {self.line.node}", self.line.node, word)

    def _ask(self) -> tuple[int, int]:
        """Return the counts; the request is a data frame of eight zeros (works without remote frames), then a remote frame."""
        self._counts = None
        for remote in (False, True):
            self.line.send(request(self.line.node, _COUNT, remote=remote))
            if self.line.wait(lambda: self._counts is not None, _ANSWER):
                break
        if self._counts is None:
            raise NodeError(
                f"module {self.line.node} does not report its encoder count",
                node=self.line.node,
                remedy="check its protocol: axisbus gim6010 find",
            )
        return self._counts

    def _count(self, data: bytes, _: float) -> None:
        if len(data) >= struct.calcsize("<ii"):
            self._counts = struct.unpack_from("<ii", data)
            self.line.notify()


# -- Give a module another node ID: set it, see it under the new ID, save, and see it there again ----------------------
#
# Theory of operation. The module uses the new ID in RAM as soon as it accepts it, so its heartbeats then come under the new ID.
# Saving writes the ID to flash and restarts the module. Each step is verified before the next. If the procedure breaks off before
# the save, the module has the new ID until it is switched off, and the old one after that. In both cases its heartbeats show where
# it is.


_SET = named("Set_Axis_Node_ID")
_TAKEN = 2.0  # s in which a heartbeat must come under the new ID
_QUIET = 0.5  # s after that, in which no heartbeat may come under the old ID
_LOOK = 0.05


def set_node_id(channel: Channel, old: int, new: int, *, save: bool, tell: Callable[[str], None]) -> None:
    """Give the module with node ID ``old`` the ID ``new`` (both 0 to 63); ``tell`` reports each step. Blocks up to 30 s.

    The caller must have checked that ``new`` is free (``node_id_preconditions.require_free``).

    Raises:
        StateError: the module is not idle, or another module sends heartbeats under the new ID.
        NodeError: the module does not accept the ID, does not restart, or comes back with the old ID.
    """
    with ExitStack() as stack:
        before, after = (stack.enter_context(SimpleLine(channel, node)) for node in (old, new))
        before.listen()
        if before.state != IDLE:
            known = "not heard" if before.state is None else f"in {state_words(before.state)}"
            raise StateError(f"module {old} is {known}, and not idle", remedy="stop and disable it first")
        if after.pulse.stamps:
            raise StateError(
                f"another module sends heartbeats with node ID {new}", remedy="give a free node ID"
            )
        before.send(encode(old, _SET, {"Axis_Node_ID": new}))
        _taken(before, after)
        tell(f"it answers with {new}, stored in RAM only: the next start would undo it")
        if save:
            _save(before, after)
            tell(f"saved: it restarted, and is node {new}")


def _taken(before: SimpleLine, after: SimpleLine) -> None:
    if not after.wait(lambda: bool(after.pulse.stamps), _TAKEN):
        raise NodeError(
            f"module {before.node} does not accept the node ID {after.node}",
            node=before.node,
            observed=f"no heartbeat with it came in {_TAKEN:g} s",
            remedy="set it over USB: odrv0.axis0.config.can.node_id, then save",
        )
    changed = after.pulse.at
    before.clock.sleep(_QUIET)
    if before.pulse.at > changed:
        raise several(before.node)


def _save(before: SimpleLine, after: SimpleLine) -> None:
    if after.state != IDLE:
        raise StateError(
            f"module {after.node} is no longer idle, and is not saved", remedy="stop and disable it"
        )
    after.save(
        "its node ID is in RAM only: save it over USB, or it has the old one after its next start",
        lambda: after.state is None,
    )
    _back(before, after, after.clock.now())


def _back(before: SimpleLine, after: SimpleLine, gone: float) -> None:
    """Wait for the first heartbeat after the restart, under either ID."""
    while after.clock.now() < gone + RESTART_TIME:
        if before.pulse.at > gone:
            raise NodeError(
                f"the module came back with the node ID {before.node}: the new one was not saved",
                node=before.node,
                remedy="set and save it over USB",
            )
        if after.pulse.at > gone:
            return
        after.clock.sleep(_LOOK)
    raise NodeTimeout(
        f"module {after.node} does not come back after saving",
        node=after.node,
        observed=f"it did not answer within {RESTART_TIME:g} s",
        remedy="search for it: axisbus gim6010 find",
    )
