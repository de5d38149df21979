"""Give a CAN Simple module another node ID: set it, see it under the new ID, save, and see it there again.

Theory of operation. The module uses the new ID in RAM as soon as it accepts it, so its heartbeats then come under the new ID.
Saving writes the ID to flash and restarts the module. Each step is verified before the next. If the procedure breaks off before the
save, the module has the new ID until it is switched off, and the old one after that. In both cases its heartbeats show where it is.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine, several
from axisbus.drives.gim6010.can_simple.codec import encode
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.errors import NodeError, NodeTimeout, StateError

_SET, _SAVE = named("Set_Axis_Node_ID"), named("Save_Configuration")
_TAKEN = 2.0  # s in which a heartbeat must come under the new ID
_QUIET = 0.5  # s after that, in which no heartbeat may come under the old ID
_RESTARTS = 3.0  # s within which the restart after a save must begin
_BACK = 25.0  # s for a restart, from the experience of owners
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
        if after.last_beat is not None:
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
    if not after.wait(lambda: after.last_beat is not None, _TAKEN):
        raise NodeError(
            f"module {before.node} does not accept the node ID {after.node}",
            node=before.node,
            observed=f"no heartbeat with it came in {_TAKEN:g} s",
            remedy="set it over USB: odrv0.axis0.config.can.node_id, then save",
        )
    changed = after.last_beat or 0.0
    before.clock.sleep(_QUIET)
    if (before.last_beat or 0.0) > changed:
        raise several(before.node)


def _save(before: SimpleLine, after: SimpleLine) -> None:
    restarts, told = after.beats.restarts, after.clock.now()
    if after.state != IDLE:
        raise StateError(
            f"module {after.node} is no longer idle, and is not saved", remedy="stop and disable it"
        )
    after.send(encode(after.node, _SAVE))
    while after.beats.restarts == restarts and after.state is not None:
        if after.clock.now() > told + _RESTARTS:
            raise NodeError(
                f"module {after.node} got the command to save, and does not restart",
                node=after.node,
                remedy="its node ID is in RAM only: save it over USB, or it has the old one after its next start",
            )
        after.clock.sleep(_LOOK)
    _back(before, after, after.clock.now())


def _back(before: SimpleLine, after: SimpleLine, gone: float) -> None:
    """Wait for the first heartbeat after the restart, under either ID."""
    while after.clock.now() < gone + _BACK:
        if (before.last_beat or 0.0) > gone:
            raise NodeError(
                f"the module came back with the node ID {before.node}: the new one was not saved",
                node=before.node,
                remedy="set and save it over USB",
            )
        if (after.last_beat or 0.0) > gone:
            return
        after.clock.sleep(_LOOK)
    raise NodeTimeout(
        f"module {after.node} does not come back after saving",
        node=after.node,
        observed=f"no sign of it in {_BACK:g} s",
        remedy="search for it: axisbus gim6010 find",
    )
