"""One module behind a relay: carries out commands first, then answers requests, then polls the module's registers in turn.

Theory of operation
-------------------
There is no thread: ``work`` does one step of a few exchanges on the line, and returns the messages that the module would have sent.

- **Stops have priority** and cancel all other waiting commands. A stop is written whether or not the module answers; the sender
  repeats it.
- **Values are read back.** A value that was lost on the line is written again. If the module stores another value, this is an
  error:
  the sender would otherwise believe that its value is in effect.
- **Modes are set only in idle.** They are two registers, and the behaviour of a module between the two writes is unknown. A command
  that would change the modes under power is an error. The brake is the exception: each of its steps brakes, or changes nothing.
- **Closed loop is requested once, and only in idle**, after the requested modes were read back: a module already in closed loop
  would remove power for a moment.
- **Set-points of a ramp alternate with readings**, and the newest one replaces the waiting one: otherwise a slow line would carry
  set-points only. So does a stop that the module has confirmed and that is requested again.
- **Calibrations are passed on only if the owner of the line asks for them.**
- If a command may not have been carried out, all waiting commands except stops are discarded.
- In idle no register contains the position of the rotor: the encoder's count is read by its endpoint. Without a list of endpoints
  the position is not sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import cycle

from axisbus.drives.gim6010.calibration import CalibrationKind
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage, MessageRequest, decode, pack_places
from axisbus.drives.gim6010.can_simple.endpoint_messages import RX_SDO
from axisbus.drives.gim6010.can_simple.endpoints import (
    SERIAL_ENDPOINT,
    VERSION_ENDPOINTS,
    EndpointList,
    Firmware,
)
from axisbus.drives.gim6010.can_simple.error_query import GET_ERROR, ErrorType
from axisbus.drives.gim6010.can_simple.fields import MessageField, Number
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, HEARTBEAT_FIELDS, IDLE, Message
from axisbus.drives.gim6010.can_simple.messages import named as message_named
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.registers import ERROR_FLAGS, OTHER_FLAGS, REGISTERS, named
from axisbus.drives.gim6010.modbus.requests import ModbusRequest, Wire
from axisbus.errors import AxisbusError, DriveError, NodeError, NodeTimeout, UncommandedMotion

# -- Translates each CAN Simple command for a serial line: registers and values, in the order of writing ----------------


Writes = tuple[tuple[str, Number], ...]
# In this order, each write alone brakes or changes nothing; a torque set-point may be added to the output of the velocity loop.
BRAKE: Writes = (("velocity_setpoint", 0.0), ("control_mode", 2), ("input_mode", 2), ("torque_setpoint", 0.0))
_BRAKED = (2, 2)  # velocity control by ramp
_STREAMED = ("Set_Input_Vel", "Set_Input_Torque")  # sent in every cycle of a ramp
_STORED = ("Set_Limits", "Set_Traj_Vel_Limit", "Set_Traj_Accel_Limits", "Set_Input_Pos")
_FED_FORWARD = ("Vel_FF", "Torque_FF")  # feed-forward has no register, and must be 0
_ACT_REGISTERS = {"Estop": "emergency_stop", "Clear_Errors": "clear_errors"}
_CALIBRATIONS = frozenset(kind.value for kind in CalibrationKind)


class RegisterCommandKind(Enum):
    """Execution of a command; stops come before all others, and cancel waiting commands."""

    STOP = "written at once, whether it is answered or not"
    MODES = "written in idle only, and read back"
    VALUES = "written and read back"
    SETPOINT = "as a value, in turn with the readings; a newer one replaces it"
    ACT = "written once more if no answer came"
    POWER = "written once, in idle only, after its modes were read back"
    CALIBRATION = "written once, in idle only"


@dataclass(frozen=True, slots=True)
class RegisterCommand:
    """One command: its registers with their values."""

    kind: RegisterCommandKind
    writes: Writes


def order(told: DecodedMessage, *, calibrates: bool = False) -> RegisterCommand | None:
    """Return the register command for a message to a module; None if the relay does not support the message.

    ``calibrates``: calibrations are supported too, which may turn the motor.
    """
    name, values = told.message.name, told.values
    if name == "Set_Controller_Mode":
        return _modes(int(values["Control_Mode"]), int(values["Input_Mode"]))
    if name == "Set_Axis_State":
        return _state(int(values["Axis_Requested_State"]), calibrates)
    if name in _ACT_REGISTERS:
        kind = RegisterCommandKind.STOP if name == "Estop" else RegisterCommandKind.ACT
        return RegisterCommand(kind, ((_ACT_REGISTERS[name], 1),))
    if name not in (*_STREAMED, *_STORED) or any(values.get(each) for each in _FED_FORWARD):
        return None
    kind = RegisterCommandKind.SETPOINT if name in _STREAMED else RegisterCommandKind.VALUES
    places = _registers(told.message.sent)
    return RegisterCommand(kind, tuple((register, values[field]) for field, register in places.items()))


def _registers(fields: Iterable[MessageField]) -> dict[str, str]:
    """Return the register of each field of a message: of the same parameter, whose path both tables have."""
    return {
        each.name: _BY_PATH[each.path]
        for each in fields
        if each.path in _BY_PATH and each.name not in _FED_FORWARD
    }


def _modes(control: int, inputs: int) -> RegisterCommand:
    if (control, inputs) == _BRAKED:
        return RegisterCommand(RegisterCommandKind.STOP, BRAKE)
    return RegisterCommand(RegisterCommandKind.MODES, (("control_mode", control), ("input_mode", inputs)))


def _state(state: int, calibrates: bool) -> RegisterCommand | None:
    """Return the command for idle, closed loop or a supported calibration; None for all other states, which may move it."""
    kinds = {IDLE: RegisterCommandKind.STOP, CLOSED_LOOP: RegisterCommandKind.POWER}
    if calibrates:
        kinds |= dict.fromkeys(_CALIBRATIONS, RegisterCommandKind.CALIBRATION)
    return RegisterCommand(kinds[state], (("state_control", state),)) if state in kinds else None


# -- What the emulation needs to know of the registers, and its limits -------------------------------------------------


COUNT = "axis0.encoder.count_in_cpr"
_BY_PATH = {each.field.path: each.name for each in REGISTERS if each.field.path}
_VOLTAGE = message_named("Get_Bus_Voltage_Current")
_AXIS_FLAG = 1 << next(bit for bit, (_, category) in ERROR_FLAGS.items() if category == "axis")
_WORDS = {category: name for name, category in ERROR_FLAGS.values()}
_ACTS = 3  # attempts to write an action such as clearing errors, if no answer comes
_REST = 1.0  # s of pause after ``_PATIENCE`` missing answers: the other modules need the line
_PATIENCE = 3
_LIVES = 256
_TORQUE_CONTROL, _POSITION_CONTROL = ("control_mode", 1), ("control_mode", 3)
_PLACE = 0.25  # turns of the rotor: allowed deviation of a held position
_MOST = 100  # waiting commands; more only arise if the line does not work


# -- Converts register values of a module on a serial line into the CAN frames that it would send on a bus -------------


Told = tuple[int, bytes]
Listed = tuple[EndpointList, Firmware]  # a list of endpoints, and the firmware that it was made for
FIRST_LIFE = 0x10  # a life counter from here on cannot be mistaken for the flags of older firmware
_FAULTS = {"motor": "Motor_Fault", "encoder": "Encoder_Fault", "controller": "Controller_Fault"}


def heartbeat(node: int, state: int, flags: int, axis_error: int, life: int) -> Told:
    """Return a heartbeat in the newest firmware's layout; flags that the manual reserves count as a system fault."""
    parts = {category for bit, (_, category) in ERROR_FLAGS.items() if flags >> bit & 1}
    system = "system" in parts or bool(flags & OTHER_FLAGS)
    # the axis's flag is a fault even if its word is 0
    system = system or ("axis" in parts and not axis_error)
    values: dict[str, Number] = {
        "Axis_Error": axis_error,
        "Axis_State": state & 0xFF,
        "System_Fault": int(system),
        "Traj_Done": 0,
        "Life": life,
        **{field: int(part in parts) for part, field in _FAULTS.items()},
    }
    return can_id(node, COMMAND), pack_places(each.place(values[each.name]) for each in HEARTBEAT_FIELDS)


def message(node: int, name: str, values: Mapping[str, Number]) -> Told:
    found = message_named(name)
    return can_id(node, found.command), pack_places(each.place(values[each.name]) for each in found.answer)


# -- module ------------------------------------------------------------------------------------------------------------


class RelayedModule:
    """Commands and requests to a module that are not carried out yet, and the progress of polling it."""

    def __init__(
        self,
        wire: Wire,
        node: int,
        listed: Listed | None,
        *,
        device: int | None = None,
        calibrates: bool = False,
    ) -> None:
        """``node`` 1 to 63; ``listed``: the list of endpoints of its firmware, which is verified before it is used.

        ``device``: its address on the line, if that is not ``node``. ``calibrates``: requests for a calibration are carried out.
        """
        self.node = node
        self._calibrates = calibrates
        self._wire = wire
        self._module = ModbusModule(wire, node if device is None else device)
        self._parameters = ModbusParameters(self._module)
        self._list = listed
        self._fits = False
        self._orders: deque[RegisterCommand] = deque(maxlen=_MOST)
        self._questions: deque[Callable[[], Told | None]] = deque(maxlen=_MOST)
        self._looking: Iterator[Told] = iter(())
        self._owes_reading = False  # a set-point or a confirmed stop was carried out after the last reading
        self._stopped_by: RegisterCommand | None = None  # the last command, if it was a confirmed stop
        self._modes: Writes = ()  # as requested last
        self._enabling = False  # closed loop was requested, and not seen yet
        self._life = FIRST_LIFE
        self._resting_until = 0.0
        self._silences = 0

    # Messages to the module.

    def hear(self, told: DecodedMessage | MessageRequest) -> None:
        question = self._question(told)
        if question is not None:
            if len(self._questions) < _MOST:
                self._questions.append(question)
        elif isinstance(told, DecodedMessage):
            self._take(order(told, calibrates=self._calibrates))

    def _take(self, wanted: RegisterCommand | None) -> None:
        if wanted is None:
            return
        if wanted.kind is RegisterCommandKind.STOP:  # waiting commands are older
            waiting = [
                each for each in self._orders if each.kind is RegisterCommandKind.STOP and each != wanted
            ]
            self._orders.clear()
            self._orders.extend(waiting)
        if self._orders and _replaces(wanted, self._orders[-1]):
            self._orders[-1] = wanted
        else:
            self._orders.append(wanted)

    @property
    def is_stopped(self) -> bool:
        """Whether a stop waits to be carried out before all else."""
        return any(
            each.kind is RegisterCommandKind.STOP and not self._comes_after_reading(each)
            for each in self._orders
        )

    @property
    def is_urgent(self) -> bool:
        """Whether a command waits to be carried out before the next reading."""
        return not all(self._comes_after_reading(each) for each in self._orders)

    def _comes_after_reading(self, waiting: RegisterCommand) -> bool:
        return self._owes_reading and (
            waiting.kind is RegisterCommandKind.SETPOINT or waiting == self._stopped_by
        )

    @property
    def has_orders(self) -> bool:
        return bool(self._orders)

    @property
    def is_due(self) -> bool:
        """Whether ``work`` has something to do now."""
        return bool(self._orders) or self._wire.now() >= self._resting_until

    # Work on the line.

    def work(self) -> list[Told]:
        """Do one step and return the resulting messages; blocks for a few exchanges, and longer if the module does not answer.

        Raises:
            AdapterError: the line is gone. ArgumentError: its list of endpoints does not fit. NodeError: it rejects a request.
            DriveError: it stores a value other than the written one, or its modes would be changed under power.
        """
        if self.is_urgent:
            self._attempt(self._orders.popleft())
            return []
        self._owes_reading = False
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
        """Carry out a command; if it fails, discard all waiting commands except stops."""
        self._stopped_by = None  # the next stop is a new one
        try:
            _CARRIED_OUT[wanted.kind](self, wanted.writes)
        except AxisbusError as error:
            waiting = [each for each in self._orders if each.kind is RegisterCommandKind.STOP]
            self._orders.clear()
            self._orders.extend(waiting)
            if not isinstance(error, NodeTimeout):
                raise

    # Commands.

    def _stop(self, writes: Writes) -> None:
        self._resting_until = 0.0
        answered = [self._module.dialogue.shout(requests.write(named(name), value)) for name, value in writes]
        if writes == BRAKE:
            self._modes = writes
        self._owes_reading = all(answered)
        self._stopped_by = RegisterCommand(RegisterCommandKind.STOP, writes) if all(answered) else None

    def _set_point(self, writes: Writes) -> None:
        self._put(writes)
        self._owes_reading = True

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
            self._modes = writes
            return
        if any(self._module.read(name) != value for name, value in writes):
            raise DriveError(
                f"module {self.node}: a change of mode under power was requested, which is not known to be safe over RS485",
                remedy="disable the axis and enable it again: modes are set in idle",
            )

    def _act(self, writes: Writes) -> None:
        for name, _ in writes:
            if not any(self._module.act(name) for _ in range(_ACTS)):
                raise self._module.dialogue.silent(requests.write(named(name), 1), _ACTS)

    def _power(self, writes: Writes) -> None:
        if self._module.state == IDLE:
            # a brake is not read back, and a stop of another program may have changed them
            self._put(self._modes)
            self._enabling = True
            for name, value in writes:
                self._module.dialogue.write(requests.write(named(name), value))

    def _calibrate(self, writes: Writes) -> None:
        if self._module.state == IDLE:
            for name, value in writes:
                # past the table, which does not allow a calibration as a value
                self._module.dialogue.write(ModbusRequest(named(name), (int(value),)))

    # Requests.

    def _question(self, told: DecodedMessage | MessageRequest) -> Callable[[], Told | None] | None:
        """Return the function that answers a message, or None if the message has no answer."""
        found = told.message
        if isinstance(told, MessageRequest):
            return partial(self._values, found.name, self._module.read) if found is _VOLTAGE else _nothing
        if found.name == GET_ERROR.name:
            which = int(told.values["Error_Type"])
            return lambda: self._answer_error(which)
        if found.name == RX_SDO.name:
            return lambda: self._answer_endpoint(found, told)
        return None

    def _values(self, name: str, read: Callable[[str], Number]) -> Told:
        """Return a message of the module, with the contents of the registers that its fields report."""
        places = _registers(message_named(name).answer)
        return message(self.node, name, {field: read(register) for field, register in places.items()})

    def _answer_error(self, which: int) -> Told | None:
        if which not in list(ErrorType):
            return None
        word = int(self._module.read(_WORDS[ErrorType(which).category]))
        return can_id(self.node, GET_ERROR.command), word.to_bytes(8, "little")

    def _answer_endpoint(self, found: Message, told: DecodedMessage) -> Told | None:
        """Read an endpoint. Never write one by its number; read no endpoint of a list that is not verified."""
        number, writes = int(told.values["Endpoint_ID"]), bool(told.values["opcode"])
        known = number in (*VERSION_ENDPOINTS.values(), SERIAL_ENDPOINT)
        if writes or not (known or self._is_for_reading(number)):
            return None
        value = int.from_bytes(self._parameters.fetch(number), "little")
        return message(self.node, found.name, {"opcode": 0, "Endpoint_ID": number, "Value": value})

    def _is_for_reading(self, number: int) -> bool:
        return self._fits and any(
            each.id == number and each.readable for each in self._parameters.listed.endpoints.values()
        )

    # Cyclic messages.

    def _look_on(self) -> list[Told]:
        """Continue polling: return the next message of the module."""
        told = next(self._looking, None)
        if told is None:
            self._looking = self._look()
            told = next(self._looking)
        return [told]

    def _look(self) -> Iterator[Told]:
        state, flags = self._ask("motor_state"), self._ask("error_flags")
        word = self._ask("driver_error") if int(flags) & _AXIS_FLAG else 0
        self._life = (self._life + 1) % _LIVES
        yield heartbeat(self.node, int(state), int(flags), int(word), self._life)
        if state != CLOSED_LOOP:
            if self._list is not None:
                yield self._count(*self._list)
            return
        if self._enabling:
            self._enabling = False
            self._require_new_target()
        yield self._values("Get_Encoder_Estimates", self._ask)
        if _TORQUE_CONTROL in self._modes:
            yield self._values("Get_Iq", self._ask)

    def _require_new_target(self) -> None:
        """Check that a module in position control was enabled with its position as set-point.

        Raises:
            UncommandedMotion: it has another set-point, to which it would move.
        """
        if _POSITION_CONTROL not in self._modes:
            return
        place, target = self._ask("position_feedback"), self._ask("position_setpoint")
        if not abs(target - place) <= _PLACE:
            raise UncommandedMotion(
                f"module {self.node} was enabled in a position other than its set-point",
                observed=f"in turns of the rotor, its position is {place:.4f} and its set-point {target:.4f}",
                remedy="its firmware stores an old set-point, to which it would move: do not use positions over Modbus with it",
            )

    def _count(self, listed: EndpointList, made_for: Firmware) -> Told:
        if not self._fits:
            self._parameters.open(listed, made_for)
            self._fits = True
        count = int(self._parameters.read(COUNT))
        return message(self.node, "Get_Encoder_Count", {"Shadow_Count": 0, "Count_In_Cpr": count})

    def _ask(self, name: str) -> float:
        found = self._module.read(name, 1)
        self._silences = 0
        return found


def _replaces(new: RegisterCommand, waiting: RegisterCommand) -> bool:
    """Whether a command makes the one before it needless: it is the same, or a newer set-point for the same register."""
    same = [name for name, _ in new.writes] == [name for name, _ in waiting.writes]
    return new == waiting or (same and new.kind is waiting.kind is RegisterCommandKind.SETPOINT)


def _nothing() -> None:
    """Send no answer: the value is sent cyclically, or not available."""


_CARRIED_OUT: dict[RegisterCommandKind, Callable[[RelayedModule, Writes], None]] = {
    RegisterCommandKind.STOP: RelayedModule._stop,
    RegisterCommandKind.MODES: RelayedModule._set_modes,
    RegisterCommandKind.VALUES: RelayedModule._put,
    RegisterCommandKind.SETPOINT: RelayedModule._set_point,
    RegisterCommandKind.ACT: RelayedModule._act,
    RegisterCommandKind.POWER: RelayedModule._power,
    RegisterCommandKind.CALIBRATION: RelayedModule._calibrate,
}


# -- All modules of a serial line behind a relay: CAN Simple frames in, one step of work at a time, frames out ---------


_NOTHING_DUE = 0.01  # s
_BUS_MOST = 1000  # waiting frames; more only arise if the line does not work


class Relay:
    """The modules of a line; ``take`` may be called from any thread, all other methods from one thread only."""

    def __init__(
        self,
        wire: Wire,
        modules: Mapping[int, Listed | None],
        *,
        devices: Mapping[int, int] | None = None,
        calibrates: bool = False,
    ) -> None:
        """``modules``: by node ID (1 to 63) the endpoint list of its firmware, and the firmware version of that list.

        ``devices``: by node ID the address on the line, if they differ. ``calibrates``: requests for a calibration are carried out.
        """
        self._wire = wire
        self._modules = {
            node: RelayedModule(wire, node, listed, device=(devices or {}).get(node), calibrates=calibrates)
            for node, listed in modules.items()
        }
        self._turns = cycle(list(self._modules.values()))
        self._came: deque[tuple[int, bytes, bool]] = deque(maxlen=_BUS_MOST)

    def take(self, can_id: int, data: bytes, remote: bool) -> None:
        """Take a frame; frames for other nodes are ignored. Does not block."""
        self._came.append((can_id, data, remote))

    def work(self) -> list[Told]:
        """Do one step of work, and return the resulting messages; blocks as ``RelayedModule.work``, and raises the same errors."""
        self._sort()
        module = self._next()
        if module is None:
            self._wire.sleep(_NOTHING_DUE)
            return []
        return module.work()

    @property
    def is_idle(self) -> bool:
        return not self._came and not any(each.has_orders for each in self._modules.values())

    def _sort(self) -> None:
        while self._came:
            can_id, data, remote = self._came.popleft()
            told = decode(can_id, data, from_module=False, remote=remote)
            if isinstance(told, DecodedMessage | MessageRequest) and told.node in self._modules:
                self._modules[told.node].hear(told)

    def _next(self) -> RelayedModule | None:
        """Return the next module: one with a stop first, then one with urgent commands, then the modules in turn."""
        modules = list(self._modules.values())
        for ahead in (
            [each for each in modules if each.is_stopped],
            [each for each in modules if each.is_urgent],
        ):
            if ahead:
                return ahead[0]
        return next((each for _ in modules if (each := next(self._turns)).is_due), None)
