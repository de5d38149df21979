"""One request and its own answer: which requests are repeated, and which replies are never accepted as an answer.

Theory of operation
-------------------
A reply names neither its request nor, in a read, the register. After a time-out, a late answer would therefore be accepted as the
answer to the next request of the same shape, and its value would be attributed to another register or treated as new. For this
reason no request follows a time-out directly. The client waits until the line is silent, then sends a *probe* of another shape
until the probe's own answer arrives. A module answers in order, so by then every late answer has arrived and was discarded. An
answer that is later than ``TIMEOUT`` and ``QUIET`` together, and does not arrive during a probe, cannot be distinguished; no wire
may delay an answer that long.

Reads are repeated. Writes are not: the caller must read back the result (``module``).
"""

from __future__ import annotations

from axisbus.drives.gim6010.modbus.registers import HIGHEST_DEVICE, named
from axisbus.drives.gim6010.modbus.requests import (
    ModbusRequest,
    ModbusTimeout,
    Reply,
    Wire,
    exception_words,
    fits,
    read,
)
from axisbus.errors import ArgumentError, NodeError, NodeTimeout
from axisbus.wording import counted

TRIES = 3  # attempts to read, including the first
QUIET = 0.3  # s in which a late answer comes
_PROBE = (read(named("motor_state")), read(named("node_id")))  # two shapes
WHAT_TO_CHECK = (
    "check its supply, A and B not swapped, the adapter's port and its bit rate and parity (115200 from the factory), "
    "that the module has this node ID and none other on the line has it, and that RS485 is its interface (config.comm_intf_mux = 1)"
)


class ModbusRefused(NodeError):
    """The module answered with an exception; ``code`` is the Modbus exception code."""

    def __init__(self, message: str, *, node: int, code: int, observed: str = "", remedy: str = "") -> None:
        super().__init__(message, node=node, observed=observed, remedy=remedy)
        self.code = code


class ModbusClient:
    """Sends requests to one device on a wire; knows whether a late answer may still arrive. Use it from one thread only."""

    def __init__(self, wire: Wire, device: int) -> None:
        """``device`` 1 to 247. Raises ArgumentError: the address is invalid; 0 is broadcast, which no device answers."""
        if not 1 <= device <= HIGHEST_DEVICE:
            raise ArgumentError(
                f"{device} is not an address of a module on Modbus",
                remedy=f"give one from 1 to {HIGHEST_DEVICE}; a module of node ID 0 must get another over USB or CAN first",
            )
        self.wire = wire
        self.device = device
        self._owed: ModbusRequest | None = None

    def read(self, request: ModbusRequest, tries: int = TRIES) -> tuple[int, ...]:
        """Return the contents of the registers; send up to ``tries`` requests, each of which blocks for at most about 0.7 s.

        Raises:
            NodeTimeout: no answer. ModbusRefused: an exception. AdapterError: the line is gone.
        """
        for _ in range(tries):
            try:
                return self._once(request).words
            except ModbusTimeout:
                continue
        raise self.silent(request, tries)

    def write(self, request: ModbusRequest) -> bool:
        """Write once; return whether the module confirmed it. False: it is unknown whether the module accepted the value.

        Raises:
            ModbusRefused: an exception. AdapterError: the line is gone.
        """
        try:
            self._once(request)
        except ModbusTimeout:
            return False
        return True

    def shout(self, request: ModbusRequest) -> bool:
        """Write at once, even if a late answer may still arrive: for stopping a motor. A reply that does not fit is no answer.

        Raises:
            AdapterError: the line is gone.
        """
        try:
            reply = self.wire.exchange(self.device, request)
        except ModbusTimeout:
            self._owed = request
            return False
        if not fits(request, reply):
            self._owed = request
        return fits(request, reply) and not reply.exception

    def silent(self, request: ModbusRequest, tries: int = 1) -> NodeTimeout:
        return NodeTimeout(
            f"module {self.device} does not answer for {request.register.name}",
            node=self.device,
            observed=f"{request.frame(self.device).hex(' ').upper()} was sent, and in {counted(tries, 'try', 'tries')} nothing "
            "that can be read came back",
            remedy=WHAT_TO_CHECK,
        )

    def _once(self, request: ModbusRequest) -> Reply:
        if self._owed is not None:
            self._settle(self._owed)
        try:
            reply = self.wire.exchange(self.device, request)
        except BaseException:
            self._owed = request  # also after Ctrl-C: its answer may still arrive
            raise
        if not fits(request, reply):
            self._owed = request
            raise ModbusTimeout
        if reply.exception:
            raise self._refused(request, reply.exception)
        return reply

    def _settle(self, owed: ModbusRequest) -> None:
        """Wait until late answers have arrived: until a request of another shape has its own answer.

        Raises:
            ModbusTimeout: that request has no answer either.
        """
        probe = next(each for each in _PROBE if each.shape != owed.shape)
        self.wire.drain(QUIET)
        reply = self.wire.exchange(self.device, probe)
        if not fits(probe, reply):
            raise ModbusTimeout
        self._owed = None

    def _refused(self, request: ModbusRequest, code: int) -> ModbusRefused:
        what = "written" if request.writes else "read"
        return ModbusRefused(
            f"module {self.device} refuses the request: {request.register.name} ({request.address:02X}h) is not {what}",
            node=self.device,
            code=code,
            observed=exception_words(code),
            remedy="the firmware does not have this register, or does not accept the value: see the manufacturer's notes on "
            "this firmware",
        )
