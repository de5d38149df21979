"""A serial line of modules as a python-can bus: a thread polls them in turn and presents their answers as CAN frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import can

from axisbus.bus.link.frame_queue import UnboundedQueue
from axisbus.clock import REAL
from axisbus.drives.gim6010.modbus.can_emulation import Listed, Relay
from axisbus.drives.gim6010.modbus.registers import FACTORY_RATE
from axisbus.drives.gim6010.modbus.serial_wire import Parity, SerialWire
from axisbus.errors import AdapterError, AxisbusError, one_line

_PARTING = 1.5  # s to send pending stop commands when the line is closed
_IDLE = 0.01  # s
_LATE = 0.1  # s for the answer to a request of a program that had the line before, and is dead
_LONG = 3600.0  # s of one wait for a frame, if there is no time-out
_TIMEOUT = 0.1  # s for an answer: nine bytes, which take a ms, plus the delay of an adapter


class RelayedBus(can.BusABC):
    """One line; holds its port, its thread, and the frames not fetched yet."""

    def __init__(
        self,
        channel: str,
        bitrate: int = FACTORY_RATE,
        parity: str = "none",
        modules: Mapping[int, Listed | None] | None = None,
        devices: Mapping[int, int] | None = None,
        calibrates: bool = False,
    ) -> None:
        """Open ``channel``, a serial port, and begin to poll the ``modules``; ``devices`` and ``calibrates`` as for ``Relay``.

        Raises:
            UserError: the extra is not installed. AdapterError: the port cannot be opened. ValueError: no such parity.
        """
        self.channel_info = f"modules on {channel}"
        self._protocol = can.CanProtocol.CAN_20
        try:
            bits = Parity[parity.upper()]
        except KeyError:
            raise ValueError(f"parity {parity!r}: give none, even or odd") from None
        self._wire = SerialWire(channel, rate=bitrate, parity=bits, timeout=_TIMEOUT)
        self._relay = Relay(self._wire, modules or {}, devices=devices, calibrates=calibrates)
        self._told: UnboundedQueue[can.Message | Exception] = UnboundedQueue(REAL)
        self._gone: Exception | None = None
        self._failed = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"axisbus asks {channel}", daemon=True)
        super().__init__(channel=channel)
        self._thread.start()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002  # it never waits
        """Queue a frame to be executed or answered in its turn; does not block.

        Raises:
            CanOperationError: the line has failed. After any other failure, stop commands are still executed.
        """
        if self._gone is not None:
            raise can.CanOperationError(one_line(self._gone))
        if not (msg.is_extended_id or msg.is_error_frame):
            self._relay.take(msg.arbitration_id, bytes(msg.data), msg.is_remote_frame)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        found = self._told.take(time.monotonic() + (_LONG if timeout is None else timeout))
        if found is None:
            return None, False
        if isinstance(found, Exception):
            raise can.CanOperationError(one_line(found)) from found
        return found, False

    def shutdown(self) -> None:
        """Execute the queued commands, and close the port; blocks for at most about 2 s. Harmless when repeated."""
        super().shutdown()
        self._closing.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(_PARTING + 0.5)
        self._wire.close()

    def _run(self) -> None:
        try:
            self._wire.drain(_LATE)
            while not self._closing.is_set():
                self._work()
            until = time.monotonic() + _PARTING
            while not self._relay.is_idle and time.monotonic() < until:
                self._work()
        except Exception as error:  # noqa: BLE001  # whatever the error is, nothing is executed or received any more
            self._gone = error
            self._told.put(error)

    def _work(self) -> None:
        # after a failure nothing is received any more, but stop commands can be sent
        if self._failed and self._relay.is_idle:
            self._wire.sleep(_IDLE)
            return
        try:
            told = self._relay.work()
        except AdapterError:
            raise
        except AxisbusError as error:
            if not self._failed:
                self._failed = True
                self._told.put(error)
            return
        for can_id, data in told:
            self._told.put(
                can.Message(arbitration_id=can_id, data=data, is_extended_id=False, timestamp=time.time())
            )
