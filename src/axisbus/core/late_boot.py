"""Nodes that are booted while the machine runs: optional ones that were absent, and nodes that have returned.

An optional node that was absent is polled periodically, and booted when it answers (``LateBoot``), unless a call has booted it. A
node that was lost is booted by a call (``Core.boot_node``), or periodically as well if its table says ``rejoin = "automatic"``.
Neither enables a drive.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from axisbus.boot.failure import OTHER_DEVICE
from axisbus.cia302.types import Address
from axisbus.clock import Clock
from axisbus.errors import (
    AdapterError,
    AxisbusError,
    BootError,
    BusOff,
    NodeError,
    NodeStateError,
    ScanError,
    StateError,
    TransmitQueueFull,
)
from axisbus.motion.stop.diagnosis import boot_and_reset, boot_node

if TYPE_CHECKING:
    from axisbus.boot.report import Booted

log = logging.getLogger("axisbus")

MAX_REJOINS = 3  # automatic boot-ups of a node in a row
_STEADY_TIME = 60.0  # seconds after a boot-up from which the next one does not count as in a row with it
_ANOTHER_DEVICE = frozenset(letter.name for letter in OTHER_DEVICE)
POLL_PERIOD = 1.0  # seconds
LEAVE_TIME = 6.0  # seconds that closing waits for a boot-up in progress


@dataclass(slots=True)
class ReturningNode:
    """A node that is booted automatically when it has returned; holds its last boot-ups.

    ``needs_boot``: whether it has restarted, or left operational, and answers; ``boot`` boots it if it is the same device as
    before. Both block for their transfers. Another device is left alone until it is gone again, or was booted by a command.
    """

    node_id: int
    needs_boot: Callable[[], bool]
    boot: Callable[[], object]
    tries: int = 0  # boot-ups in a row, each within ``_STEADY_TIME`` after the one before
    tried_at: float = -math.inf
    is_other_device: bool = False  # another device has answered

    def step(self, now: float) -> None:
        """Boot the node if necessary; ``now`` in seconds. Errors are logged, and the axes of the node show them."""
        if self.tries >= MAX_REJOINS and now - self.tried_at < _STEADY_TIME:
            return
        if not self.needs_boot():
            self.is_other_device = False
            return
        if self.is_other_device:
            return
        self.tries = 1 if now - self.tried_at >= _STEADY_TIME else self.tries + 1
        self.tried_at = now
        try:
            self.boot()
        except StateError as error:  # such as an axis that is being stopped
            log.info("%s", error)
        except BootError as error:
            self.is_other_device = error.letter in _ANOTHER_DEVICE
            log.warning("node %d was not booted again: %s", self.node_id, error)
        else:
            log.warning("node %d was booted again; its axes wait for a reset", self.node_id)
        if self.tries >= MAX_REJOINS:
            log.warning(
                "node %d: no further automatic boot-up for %g s, after %d in a row; boot it by a command: "
                "axisbus boot CELL --node %d",
                self.node_id,
                _STEADY_TIME,
                self.tries,
                self.node_id,
            )


class LateBoot:
    """Waits for nodes in a thread of its own; holds the optional nodes that are still absent, and the nodes that may return."""

    def __init__(
        self,
        clock: Clock,
        absent: Iterable[int],
        boot: Callable[[int], bool],
        returning: Sequence[ReturningNode] = (),
    ) -> None:
        """``boot`` is called for the node-IDs in ``absent`` in the polling thread, until it returns that the node has been booted.

        It blocks for its SDO transfers.
        """
        self._clock = clock
        self._absent = list(absent)
        self._boot = boot
        self._returning = returning
        self._stop = clock.event()
        self._thread = clock.thread(self._run, "axisbus optional nodes")

    def restart(self) -> None:
        """Begin to poll again, after the adapter had failed."""
        self.stop()
        self._stop = self._clock.event()
        self._thread = self._clock.thread(self._run, "axisbus optional nodes")
        self.start()

    def start(self) -> None:
        """Begin to poll, if any node is absent, or is to be booted when it returns."""
        if self._absent or self._returning:
            self._thread.start()

    def stop(self) -> None:
        """End polling; blocks until a boot-up in progress has ended, at most some seconds."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(LEAVE_TIME)

    def _run(self) -> None:
        while (self._absent or self._returning) and not self._stop.wait(POLL_PERIOD):
            self._poll_all()

    def _poll_all(self) -> None:
        for node_id in list(self._absent):
            if self._stop.is_set():
                return
            self._guarded(node_id, partial(self._boot_absent, node_id))
        for returning in self._returning:
            if self._stop.is_set():
                return
            self._guarded(returning.node_id, partial(returning.step, self._clock.now()))

    def _guarded(self, node_id: int, work: Callable[[], None]) -> None:
        """Do something with a node; whatever the error, the nodes are polled again, unless the channel has failed."""
        try:
            work()
        except (BusOff, TransmitQueueFull):  # the bus may come back, and the node with it
            pass
        except (AdapterError, ScanError):  # the scan reports it
            self._stop.set()
        except AxisbusError as error:
            log.warning("node %d was not booted: %s", node_id, error)

    def _boot_absent(self, node_id: int) -> None:
        if self._boot(node_id):
            self._absent.remove(node_id)


def absent_axis(name: str, booted: Booted) -> StateError:
    """Return the error of an axis whose optional node is absent."""
    node, error = booted.report.node_id, booted.report.error
    if booted.report.absent:
        return StateError(
            f"axis {name} cannot be used: node {node} is optional and is not present",
            observed="it has not answered since the machine was opened",
            remedy="switch it on: it is booted within seconds after it answers, and the axis can then be used",
        )
    return StateError(
        f"axis {name} cannot be used: node {node} is optional and did not boot",
        observed="" if error is None else error.message,
        remedy=f"remove that cause, and {boot_node(node)}"
        if error is None or not error.remedy
        else f"{error.remedy}; then {boot_node(node)}",
    )


def identity_of(booted: Booted) -> Mapping[Address, int] | None:
    """Return the identity of a node at its last boot-up (1000h, 1018h), as far as it reported one."""
    return None if booted.report.outcome is None else booted.report.outcome.identity


def same_device(before: Booted, now: Booted) -> bool:
    """Whether the node has the same identity (1018h) as when it was booted before, as far as it reports one."""
    first, second = identity_of(before), identity_of(now)
    return first is not None and first == second


def not_booted(node_id: int, observed: str, remedy: str) -> StateError:
    """Return the error of a node that cannot be booted now."""
    return StateError(f"node {node_id} cannot be booted now", observed=observed, remedy=remedy)


def not_written(node_id: int, observed: str, remedy: str) -> StateError:
    """Return the error of a node whose program cannot be written now."""
    return StateError(
        f"the program of node {node_id} cannot be written now", observed=observed, remedy=remedy
    )


def being_written(node_id: int) -> NodeStateError:
    """Return the error of the axes of a node while its program is being written."""
    return NodeStateError(
        f"the program of node {node_id} is being written",
        remedy=f"wait for the end of the write; then {boot_and_reset(node_id)}",
    )


def program_was_written(node_id: int) -> NodeStateError:
    """Return the error of the axes of a node whose program was written."""
    return NodeStateError(f"node {node_id} has a new program", remedy=boot_and_reset(node_id))


def program_not_written(node_id: int) -> NodeStateError:
    """Return the error of the axes of a node whose program could not be written."""
    return NodeStateError(
        f"the program of node {node_id} could not be written",
        remedy=f"write it again; then {boot_and_reset(node_id)}",
    )


def being_booted(node_id: int) -> NodeStateError:
    """Return the error of the axes of a node while it is being booted."""
    return NodeStateError(
        f"node {node_id} is being booted",
        remedy="wait for the end of the boot-up; then reset the axis: axis.reset()",
    )


def boot_interrupted(node_id: int) -> NodeStateError:
    """Return the error of the axes of a node whose boot-up was aborted, as by Ctrl-C."""
    return NodeStateError(
        f"the boot-up of node {node_id} was aborted",
        remedy=boot_and_reset(node_id),
    )


def adapter_reopened(name: str, node_id: int) -> NodeStateError:
    """Return the error of an axis after the adapter was opened again, whose node must be booted."""
    return NodeStateError(
        f"{name}: the adapter was lost, and has been opened again",
        observed="what the drive did meanwhile is not known; nothing is enabled",
        remedy=boot_and_reset(node_id),
    )


def adapter_reopened_without_boot(name: str, node_id: int) -> NodeError:
    """Return the same error for an axis whose node needs no boot-up, or that has no node."""
    return NodeError(
        f"{name}: the adapter was lost, and has been opened again",
        node=node_id,
        observed="every motion has ended; nothing is enabled",
        remedy="reset it: axis.reset()",
    )


def booted_again(name: str, node_id: int, *, confirmed: bool) -> NodeError:
    """Return the error with which an axis begins again; ``confirmed``: its position is still confirmed if it was before."""
    homing = (
        "its position is still confirmed if it was before" if confirmed else "its position is not confirmed"
    )
    return NodeError(
        f"{name}: node {node_id} was booted again",
        node=node_id,
        observed=f"nothing is enabled; {homing}; overrides, couplings and queued commands have ended",
        remedy="reset it: axis.reset(); then enable it" + ("" if confirmed else ", and home it if necessary"),
    )
