"""One question, one answer that is surely its own: what is asked again, and what is never taken for an answer.

Theory of operation
-------------------
A reply names neither its request nor, in a read, the register. So after a time-out the answer that is still on its way would pass
for that to the next request of the same shape, and a value would be told as another one, or as fresh. Therefore no request follows
a time-out at once: the line is let fall silent, and then a *probe* of another shape is asked, until its own answer comes. A module
answers in order, so whatever was owed has come by then, and was thrown away. An answer that comes later than ``TIMEOUT`` and
``QUIET`` together, and not while a probe is asked, cannot be told from another one: no wire can have one so late.

Reads are asked again. Of what is written nothing is: who wrote has to read what became of it (``module``).
"""

from __future__ import annotations

from axisbus.drives.gim6010.modbus.registers import HIGHEST_DEVICE, named
from axisbus.drives.gim6010.modbus.requests import ModbusRequest, Reply, exception_words, fits, read
from axisbus.drives.gim6010.modbus.wire import ModbusTimeout, Wire
from axisbus.errors import ArgumentError, NodeError, NodeTimeout
from axisbus.wording import counted

TRIES = 3  # of a read, the first included
QUIET = 0.3  # s in which a late answer comes
_PROBE = (read(named("motor_state")), read(named("node_id")))  # two shapes
WHAT_TO_CHECK = (
    "check its supply, A and B not swapped, the adapter's port and its bit rate and parity (115200 from the factory), "
    "that the module has this node ID and none other on the line has it, and that RS485 is its interface (config.comm_intf_mux = 1)"
)


class ModbusRefused(NodeError):
    """The module answered with an exception; ``code`` is Modbus's."""

    def __init__(self, message: str, *, node: int, code: int, observed: str = "", remedy: str = "") -> None:
        super().__init__(message, node=node, observed=observed, remedy=remedy)
        self.code = code


class ModbusClient:
    """Asks one device on a wire; holds whether an answer may still be on its way. Used by one thread."""

    def __init__(self, wire: Wire, device: int) -> None:
        """``device`` 1 to 247.

        Raises:
            ArgumentError: it is none; 0 is everybody, and nobody answers.
        """
        if not 1 <= device <= HIGHEST_DEVICE:
            raise ArgumentError(
                f"{device} is no address of a module on Modbus",
                remedy=f"give one from 1 to {HIGHEST_DEVICE}; a module of node ID 0 must get another over USB or CAN first",
            )
        self.wire = wire
        self.device = device
        self._owed: ModbusRequest | None = None

    def read(self, request: ModbusRequest, tries: int = TRIES) -> tuple[int, ...]:
        """Return the registers that are read; asks up to ``tries`` times, blocks for at most some 0.7 s for each.

        Raises:
            NodeTimeout: no answer. Refused: an exception. AdapterError: the line is gone.
        """
        for _ in range(tries):
            try:
                return self._once(request).words
            except ModbusTimeout:
                continue
        raise self.silent(request, tries)

    def write(self, request: ModbusRequest) -> bool:
        """Write once; return whether the module says that it has taken it. False: nobody knows whether it has.

        Raises:
            Refused: an exception. AdapterError: the line is gone.
        """
        try:
            self._once(request)
        except ModbusTimeout:
            return False
        return True

    def shout(self, request: ModbusRequest) -> bool:
        """As ``write``, but at once, whatever is owed: for what stops a motor; an answer that does not fit is none.

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
        """Return the error of a request that nobody answered."""
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
            self._owed = request  # also where Ctrl-C came between: its answer may be on its way
            raise
        if not fits(request, reply):
            self._owed = request
            raise ModbusTimeout
        if reply.exception:
            raise self._refused(request, reply.exception)
        return reply

    def _settle(self, owed: ModbusRequest) -> None:
        """Let what is owed come, until a request of another shape has its own answer.

        Raises:
            Silence: it has none either.
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
            f"module {self.device} refuses that {request.register.name} ({request.address:02X}h) is {what}",
            node=self.device,
            code=code,
            observed=exception_words(code),
            remedy="a firmware without this register, or a value that it does not take: see what the maker says of this firmware",
        )
