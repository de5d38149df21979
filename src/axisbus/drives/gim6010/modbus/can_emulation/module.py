"""One module behind a relay: orders are carried out before anything is asked, questions are answered, and it is looked at in turn.

Theory of operation
-------------------
Nothing of it runs by itself: ``work`` does one piece, of a few exchanges on the line, and returns what the module tells by that.

- **What stops comes first**, and ends all that waits. It is written whether it is answered or not: whoever wants it repeats it.
- **Values are read back.** One that the line lost is written again; one that the module holds otherwise is an error, since whoever
  gave it would take it for taken.
- **Modes are set in idle alone**: they are two registers, and nobody knows what a module does between the write of one and of the
  other. An order that would change them under power is an error; but for the brake, whose every step brakes or leaves it as it is.
- **Closed loop is asked for once, in idle**: asked of a module that is in it, it would let go for a moment.
- What was not surely carried out ends all that waits behind it, but for what stops it.
- In idle no register tells where the rotor is: its encoder's count is read by its endpoint.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from axisbus.drives.gim6010.can_simple.decoded_message import DecodedMessage, MessageRequest
from axisbus.drives.gim6010.can_simple.endpoint_messages import RX_SDO
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList
from axisbus.drives.gim6010.can_simple.error_query import GET_ERROR, ErrorType
from axisbus.drives.gim6010.can_simple.messages import Message
from axisbus.drives.gim6010.can_simple.messages import named as message_named
from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP, IDLE
from axisbus.drives.gim6010.can_simple.verified_endpoints import SERIAL_ENDPOINT, VERSION_ENDPOINTS, Firmware
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.can_emulation import status_frames
from axisbus.drives.gim6010.modbus.can_emulation.command_table import (
    RegisterCommand,
    RegisterCommandKind,
    Writes,
    order,
)
from axisbus.drives.gim6010.modbus.can_emulation.status_frames import Told
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.registers import ERROR_FLAGS, named
from axisbus.drives.gim6010.modbus.wire import Wire
from axisbus.errors import AxisbusError, DriveError, NodeError, NodeTimeout

COUNT = "axis0.encoder.count_in_cpr"
_VOLTAGE = message_named("Get_Bus_Voltage_Current")
_AXIS_FLAG = 1 << next(bit for bit, (_, category) in ERROR_FLAGS.items() if category == "axis")
_WORDS = {category: name for name, category in ERROR_FLAGS.values()}
_ACTS = 3  # times that what clears is written, where no answer comes
_REST = 1.0  # s after which a module is asked again that has not answered so many times: the line is needed for the others
_PATIENCE = 3
_LIVES = 256
_MOST = 100  # orders that wait: more are of a line that carries nothing


class RelayedModule:
    """Holds what was told to a module and not carried out yet, and how far it was looked at."""

    def __init__(self, wire: Wire, node: int, listed: EndpointList, made_for: Firmware) -> None:
        """``node`` 1 to 63; ``listed`` and ``made_for``: its list of endpoints, which is shown to fit before it is used."""
        self.node = node
        self._wire = wire
        self._module = ModbusModule(wire, node)
        self._parameters = ModbusParameters(self._module)
        self._list = listed, made_for
        self._fits = False
        self._orders: deque[RegisterCommand] = deque(maxlen=_MOST)
        self._questions: deque[Callable[[], Told | None]] = deque(maxlen=_MOST)
        self._looking: Iterator[Told] = iter(())
        self._life = status_frames.FIRST_LIFE
        self._resting_until = 0.0
        self._silences = 0

    # What is told to it.

    def hear(self, told: DecodedMessage | MessageRequest) -> None:
        """Take a message to the module."""
        question = self._question(told)
        if question is not None:
            if len(self._questions) < _MOST:
                self._questions.append(question)
        elif isinstance(told, DecodedMessage):
            self._take(order(told))

    def _take(self, wanted: RegisterCommand | None) -> None:
        if wanted is None:
            return
        if wanted.kind is RegisterCommandKind.STOP:  # whatever waits is of before
            waiting = [
                each for each in self._orders if each.kind is RegisterCommandKind.STOP and each != wanted
            ]
            self._orders.clear()
            self._orders.extend(waiting)
        if not self._orders or self._orders[-1] != wanted:
            self._orders.append(wanted)

    @property
    def is_stopped(self) -> bool:
        """Whether something that stops it waits to be carried out."""
        return any(each.kind is RegisterCommandKind.STOP for each in self._orders)

    @property
    def has_orders(self) -> bool:
        """Whether any order waits."""
        return bool(self._orders)

    @property
    def is_due(self) -> bool:
        """Whether there is something to be done for it now."""
        return bool(self._orders) or self._wire.now() >= self._resting_until

    # What is done for it.

    def work(self) -> list[Told]:
        """Do one piece, and return what it tells; blocks for a few exchanges, and longer where it does not answer.

        Raises:
            AdapterError: the line is gone. ArgumentError: its list of endpoints does not fit. NodeError: it refuses what is asked.
            DriveError: it holds another value than was written, or its modes would be changed under power.
        """
        if self._orders:
            self._attempt(self._orders.popleft())
            return []
        try:
            if self._questions:
                answer = self._questions.popleft()()
                return [] if answer is None else [answer]
            return self._look_on()
        except NodeTimeout:
            self._questions.clear()
            self._looking = iter(())
            self._silences += 1
            if self._silences >= _PATIENCE:
                self._resting_until = self._wire.now() + _REST
            return []

    def _attempt(self, wanted: RegisterCommand) -> None:
        """Carry an order out; where it was lost, all that is built on it is forgotten: what stops it goes out all the same."""
        try:
            _CARRIED_OUT[wanted.kind](self, wanted.writes)
        except AxisbusError as error:
            waiting = [each for each in self._orders if each.kind is RegisterCommandKind.STOP]
            self._orders.clear()
            self._orders.extend(waiting)
            if not isinstance(error, NodeTimeout):
                raise

    # Orders.

    def _stop(self, writes: Writes) -> None:
        self._resting_until = 0.0
        for name, value in writes:
            self._module.dialogue.shout(requests.write(named(name), value))

    def _put(self, writes: Writes) -> None:
        for name, value in writes:
            try:
                self._module.put(requests.write(named(name), value))
            except NodeTimeout:
                raise
            except NodeError as error:
                raise DriveError(error.message, observed=error.observed, remedy=error.remedy) from error

    def _set_modes(self, writes: Writes) -> None:
        if self._module.state == IDLE:
            self._put(writes)
            return
        if any(self._module.read(name) != value for name, value in writes):
            raise DriveError(
                f"module {self.node}: its modes were to be changed under power, which over RS485 nobody knows to be safe",
                remedy="disable the axis and enable it again: modes are set in idle",
            )

    def _act(self, writes: Writes) -> None:
        for name, _ in writes:
            if not any(self._module.act(name) for _ in range(_ACTS)):
                raise self._module.dialogue.silent(requests.write(named(name), 1), _ACTS)

    def _power(self, writes: Writes) -> None:
        if self._module.state == IDLE:
            for name, value in writes:
                self._module.dialogue.write(requests.write(named(name), value))

    # Questions.

    def _question(self, told: DecodedMessage | MessageRequest) -> Callable[[], Told | None] | None:
        """Return what answers a message; None where it is none that is answered."""
        found = told.message
        if isinstance(told, MessageRequest):
            return self._answer_voltage if found.name == _VOLTAGE.name else _nothing
        if found.name == GET_ERROR.name:
            which = int(told.values["Error_Type"])
            return lambda: self._answer_error(which)
        if found.name == RX_SDO.name:
            return lambda: self._answer_endpoint(found, told)
        return None

    def _answer_voltage(self) -> Told:
        volts, amperes = (float(self._module.read(name)) for name in ("bus_voltage", "bus_current"))
        return status_frames.message(self.node, _VOLTAGE.name, {"Bus_Voltage": volts, "Bus_Current": amperes})

    def _answer_error(self, which: int) -> Told | None:
        if which not in list(ErrorType):
            return None
        return status_frames.error_word(self.node, int(self._module.read(_WORDS[ErrorType(which).category])))

    def _answer_endpoint(self, found: Message, told: DecodedMessage) -> Told | None:
        """Read an endpoint; over the line nothing is written by its number, and none is read whose list is not shown to fit."""
        number, writes = int(told.values["Endpoint_ID"]), bool(told.values["opcode"])
        known = number in (*VERSION_ENDPOINTS.values(), SERIAL_ENDPOINT)
        if writes or not (known or self._is_for_reading(number)):
            return None
        value = int.from_bytes(self._parameters.fetch(number), "little")
        return status_frames.message(
            self.node, found.name, {"opcode": 0, "Endpoint_ID": number, "Value": value}
        )

    def _is_for_reading(self, number: int) -> bool:
        return self._fits and any(
            each.id == number and each.readable for each in self._parameters.listed.endpoints.values()
        )

    # What it tells by itself.

    def _look_on(self) -> list[Told]:
        """Go on looking at it, from one thing that it tells to the next."""
        told = next(self._looking, None)
        if told is None:
            self._looking = self._look()
            told = next(self._looking)
        return [told]

    def _look(self) -> Iterator[Told]:
        state, flags = self._ask("motor_state"), self._ask("error_flags")
        word = self._ask("driver_error") if int(flags) & _AXIS_FLAG else 0
        self._life = (self._life + 1) % _LIVES
        yield status_frames.heartbeat(self.node, int(state), int(flags), int(word), self._life)
        yield self._estimates() if state == CLOSED_LOOP else self._count()

    def _estimates(self) -> Told:
        values = {
            "Pos_Estimate": self._ask("position_feedback"),
            "Vel_Estimate": self._ask("velocity_feedback"),
        }
        return status_frames.message(self.node, "Get_Encoder_Estimates", values)

    def _count(self) -> Told:
        if not self._fits:
            self._parameters.open(*self._list)
            self._fits = True
        count = int(self._parameters.read(COUNT))
        return status_frames.message(
            self.node, "Get_Encoder_Count", {"Shadow_Count": 0, "Count_In_Cpr": count}
        )

    def _ask(self, name: str) -> float:
        register = named(name)
        found = register.value(self._module.dialogue.read(requests.read(register), 1))
        self._silences = 0
        return found


def _nothing() -> None:
    """Answer nothing: what it is about is told all the time, or not at all."""


_CARRIED_OUT: dict[RegisterCommandKind, Callable[[RelayedModule, Writes], None]] = {
    RegisterCommandKind.STOP: RelayedModule._stop,
    RegisterCommandKind.MODES: RelayedModule._set_modes,
    RegisterCommandKind.VALUES: RelayedModule._put,
    RegisterCommandKind.ACT: RelayedModule._act,
    RegisterCommandKind.POWER: RelayedModule._power,
}
