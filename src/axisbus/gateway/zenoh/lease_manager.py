"""Manage the lease of a cell: take control of the machine for its holder, and release it as soon as the lease is over.

Theory of operation
-------------------
The holder of the lease has a client of its own at the machine, with control; the lease ends with this client. So if a client on the
network is lost, or this bridge is killed, the core reacts as it does to the loss of any program with control: it halts the moving
axes. A thread that does nothing else checks whether the lease has expired; it never waits for the network. With each check the
client promises to report again in time (``hold_to_run``): if this process is suspended, hangs or starves, the core halts the axes.
"""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable

from axisbus.errors import AxisbusError, OwnershipError
from axisbus.gateway.machine_events import Severity
from axisbus.gateway.zenoh.lease import CellLease, LeasePhase
from axisbus.gateway.zenoh.publishing import BridgeEvent
from axisbus.machine.machine import Machine

log = logging.getLogger("axisbus")
_RELEASED = "released the lease"
_CHECK_PERIOD = 0.1  # seconds between two checks of the thread if nothing wakes it
_MARGIN = 0.25  # seconds after the end of the lease at which the core halts the axes automatically
_CONTINUOUS = 0.3  # seconds without a report of this process after which the core halts an axis in a motion without an end
Attach = Callable[[bool], Machine]
Answer = Callable[[AxisbusError | None], None]


class Holding:
    """Hold the lease, and the client that has control under it; for any thread."""

    def __init__(self, attach: Attach, publish: Callable[[BridgeEvent], None]) -> None:
        """``attach`` joins the machine with control (True: take it from its holder)."""
        self._attach = attach
        self._publish = publish
        self._changed = threading.Condition()
        self._lease = CellLease()
        self._controlled: Machine | None = None
        self._request: tuple[bool, Answer] | None = None
        self._next = "", ""  # the client that requests it, and its name
        self._why = ""
        self._closing = False
        self._take_thread = threading.Thread(target=self._serve_requests, name="lease taking", daemon=True)
        self._watch_thread = threading.Thread(target=self._watch, name="lease", daemon=True)

    def start(self) -> None:
        """Start the threads."""
        self._take_thread.start()
        self._watch_thread.start()

    def close(self) -> None:
        """End the lease and the threads; blocks until the axes moved under it are halted, or known not to be."""
        with self._changed:
            self._closing = True
            self._end("the bridge was ended")
            self._changed.notify_all()
        self._take_thread.join()
        self._watch_thread.join()

    @property
    def lease(self) -> CellLease:
        """The present lease."""
        return self._lease

    @property
    def controlled(self) -> Machine | None:
        """The machine with control for the holder; None while no client has the lease."""
        return self._controlled if self._lease.phase is LeasePhase.HELD else None

    # -- requests of clients -------------------------------------------------------------------------------------------

    def take(self, client: str, client_name: str, force: bool, answer: Answer) -> None:
        """Give a client the lease; ``answer`` is called when it has it, or with the refusal, in any thread. Does not block."""
        with self._changed:
            refused = self._lease.refusal(client, force=force)
            if refused is None and (self._closing or self._request is not None):
                refused = OwnershipError("the lease is changing its holder", remedy="try again in a moment")
            if refused is None:
                if self._lease.phase is LeasePhase.HELD:
                    self._end(f"{client_name or client} took over the lease")
                self._next = client, client_name
                self._request = force, answer
                if self._lease.phase is LeasePhase.FREE:
                    self._lease = CellLease().taking(client, client_name)
                self._changed.notify_all()
        if refused is not None:
            answer(refused)

    def renew(self, client: str, token: str) -> AxisbusError | None:
        """Renew the lease of its holder; return the error if the client does not hold it."""
        with self._changed:
            now = time.monotonic()
            if not self._lease.holds(client, token, now):
                return self._lease.why_not(client, token, now)
            self._lease = self._lease.renewed(now)
            self._hold_to_run()
            return None

    def release(self, client: str, token: str) -> AxisbusError | None:
        """Release the lease of its holder: the axes that it has moved halt. Return the error if it is not held; does not block."""
        with self._changed:
            now = time.monotonic()
            if not self._lease.holds(client, token, now):
                return self._lease.why_not(client, token, now)
            self._end(f"{self._lease.client_name} {_RELEASED}")
            return None

    def lost(self, why: str) -> None:
        """End the lease: another program has control of the machine, or the machine is gone; harmless if no client has it."""
        with self._changed:
            self._end(why)

    # -- the threads ---------------------------------------------------------------------------------------------------

    def _end(self, why: str) -> None:
        """Begin to end the lease (with the lock): its commands are refused from now on, and the core halts their axes."""
        if self._lease.phase is not LeasePhase.HELD:
            return
        self._why = why
        self._lease = self._lease.ending()
        if self._controlled is not None:
            self._controlled.session.request_stop(why)  # does not block
        self._changed.notify_all()

    def _hold_to_run(self) -> None:
        """Make the core halt automatically if this process does not handle the end of the lease (with the lock)."""
        if self._controlled is not None:
            left = self._lease.seconds(time.monotonic())
            self._controlled.hold_to_run(max(0.0, left) + _MARGIN, _CONTINUOUS)  # does not block

    def _watch(self) -> None:
        """End the lease when it expires; this thread waits only for the lock."""
        while True:
            with self._changed:
                held = self._lease.phase is LeasePhase.HELD
                if held and self._lease.expired(time.monotonic()):
                    self._end(f"the lease of {self._lease.client_name} was not renewed")
                elif held:
                    self._hold_to_run()
                if self._closing and self._lease.phase is LeasePhase.FREE:
                    break
                wait = min(_CHECK_PERIOD, self._lease.seconds(time.monotonic())) if held else _CHECK_PERIOD
                self._changed.wait(max(0.001, wait))

    def _serve_requests(self) -> None:
        """Release control when the lease ends, and take it when it is requested: both may block for long."""
        while True:
            with self._changed:
                self._changed.wait_for(self._due)
                ending, request = self._lease.phase is LeasePhase.ENDING, self._request
                if not ending and request is None:
                    return
            if ending:
                self._release_control()
            elif request is not None:
                self._take_control(*request)

    def _due(self) -> bool:
        phase = self._lease.phase
        return (
            phase is LeasePhase.ENDING
            or self._request is not None
            or (self._closing and phase is LeasePhase.FREE)
        )

    def _release_control(self) -> None:
        controlled, why, client_name = self._controlled, self._why, self._lease.client_name
        severity: Severity = (
            "info" if why.endswith(_RELEASED) else "warning"
        )  # a release is normal, other ends are not
        self._publish(
            BridgeEvent("lease", f"{client_name} no longer has the lease: {why}", severity=severity)
        )
        try:
            if controlled is not None:
                controlled.close()
        except BaseException as error:  # noqa: BLE001  # the machine may be gone: then there is nothing to release
            log.info("while control was released: %s", error)
        with self._changed:
            self._controlled = None
            request = self._request
            self._lease = CellLease() if request is None else CellLease().taking(*self._next)
            self._changed.notify_all()

    def _take_control(self, force: bool, answer: Answer) -> None:
        client, client_name = self._next
        error: AxisbusError | None = None
        controlled: Machine | None = None
        try:
            controlled = self._attach(force)
        except AxisbusError as refused:
            error = refused
        except Exception as unforeseen:
            log.exception("control could not be obtained")
            error = AxisbusError("control could not be obtained", observed=str(unforeseen))
        with self._changed:
            self._request = None
            self._controlled = controlled
            self._lease = CellLease().taking(client, client_name)
            if controlled is None:
                self._lease = CellLease()
            else:
                self._lease = self._lease.taken(secrets.token_hex(8), time.monotonic())
                self._hold_to_run()
            if self._closing:
                self._end("the bridge was ended")
            self._changed.notify_all()
        if error is None:
            self._publish(BridgeEvent("lease", f"{client_name or client} has the lease"))
        answer(error)
