"""One module on Modbus: its values by name, verified writes, its errors, saving and restarting."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from axisbus.drives.gim6010 import faults
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE, state_words
from axisbus.drives.gim6010.make import RESTART_BEGINS, RESTART_TIME
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.dialogue import TRIES, ModbusClient
from axisbus.drives.gim6010.modbus.registers import ERROR_FLAGS, OTHER_FLAGS, Register, RegisterKind, named
from axisbus.drives.gim6010.modbus.requests import Wire
from axisbus.errors import ArgumentError, NodeError, NodeTimeout, StateError

_ANY = 1  # written if the value does not matter
_WRITES = 3  # attempts to write a setting, each read back
_SAVES = 2  # attempts without an answer and a restart: saving twice does no harm
_LOOK = 0.1
_SETTINGS = (RegisterKind.SETTING, RegisterKind.MODE)
_ELSEWHERE = {
    RegisterKind.ADDRESS: "set_node_id changes it (axisbus gim6010 modbus write node_id=5)",
    RegisterKind.TARGET: "a set-point is given with a motion of an axis in a cell file (axisbus move)",
    RegisterKind.STATE: "an axis of a cell file enables it (axisbus move), and axisbus gim6010 modbus stop ends it",
    RegisterKind.ACT: "axisbus gim6010 modbus stop stops it, errors --clear clears, write --save saves",
    RegisterKind.ENDPOINT: "parameters are written by their names, with --list",
}


@dataclass(frozen=True, slots=True)
class ErrorWords:
    """Error words of a module by category of the fault table; ``flags`` is register 02h, which shows which are not 0."""

    flags: int
    words: Mapping[str, int]

    @property
    def lines(self) -> list[str]:
        """A sentence for each bit: its meaning and the remedy."""
        told = [line for category, word in self.words.items() for line in faults.words(category, word)]
        for bit, (_, category) in ERROR_FLAGS.items():
            if self.flags >> bit & 1 and not self.words[category]:
                told.append(f"{category}: its flag is up, and its error word is 0: read it again")
        if self.flags & OTHER_FLAGS:
            told.append(
                f"error flags 0x{self.flags & OTHER_FLAGS:04X} are reserved by the manual: ask the manufacturer"
            )
        return told


def require_setting(register: Register) -> None:
    """Check that a register is a setting or a mode, which are written by name. Raises ArgumentError: it is not."""
    if register.kind not in _SETTINGS:
        raise ArgumentError(
            f"{register.name} is not written by name: it {register.kind.value}",
            remedy=_ELSEWHERE.get(register.kind, "it can be read only"),
        )


class ModbusModule:
    """Reads and writes one module. Use it from one thread only; every method blocks until the answer arrives."""

    def __init__(self, wire: Wire, device: int) -> None:
        """``device``: its node ID, 1 to 247. Sends nothing. Raises ArgumentError: the node ID is invalid."""
        self.dialogue = ModbusClient(wire, device)
        self.wire = wire
        self.device = device

    def read(self, name: str, tries: int = TRIES) -> Number:
        """Return a value by its name, in the unit of the table; a float may be NaN or infinite, if the module reports that.

        Blocks for at most about 0.7 s for each try.

        Raises:
            ArgumentError: no register has this name, or it is not readable. NodeError: no answer, or an exception.
        """
        register = named(name)
        if not register.readable:
            raise ArgumentError(f"{name} cannot be read", remedy="it is write-only")
        return register.value(self.dialogue.read(requests.read(register), tries))

    def write(self, name: str, value: Number) -> Number:
        """Write a setting or a mode into RAM, read it back and return the stored value; a mode only in idle.

        Raises:
            ArgumentError, LimitError: it is neither, or the value is invalid.
            StateError: a mode, and the module is not idle. NodeError: no answer, an exception, or it stores another value.
        """
        register = named(name)
        require_setting(register)
        request = requests.write(register, value)
        if register.kind is RegisterKind.MODE:
            self.require_idle(f"{name} is written")
        return self.put(request)

    def put(self, request: requests.ModbusRequest, tries: int = _WRITES) -> Number:
        """Send the write of a value that can be read back, and return the value then stored.

        If a write was not confirmed, the value is read before it is written again.

        Raises:
            NodeError: no answer, an exception, or it stores another value.
        """
        register = request.register
        held: tuple[int, ...] = ()
        for _ in range(tries):
            taken = self.dialogue.write(request)
            held = self.dialogue.read(requests.read(register))
            if held == request.words:
                return register.value(held)
            if taken:
                break
        raise NodeError(
            f"module {self.device}: {register.name} holds {_show(register, held)} "
            f"after {_show(register, request.words)} was written",
            node=self.device,
            remedy="the module limits this value, does not accept it now, or another master also writes it",
        )

    @property
    def state(self) -> int:
        """State of the axis: 1 is idle, 8 closed loop."""
        return int(self.read("motor_state"))

    @property
    def stop_remedy(self) -> str:
        return f"stop it first: axisbus gim6010 modbus stop --node {self.device} ..."

    def require_idle(self, what: str) -> None:
        """Check that there is no power on its motor; ``what`` names the action that is only allowed then.

        Raises:
            StateError: it is in another state. NodeError: it does not answer.
        """
        state = self.state
        if state != IDLE:
            raise StateError(
                f"module {self.device} is in {state_words(state)}, and {what} only in idle",
                remedy=self.stop_remedy,
            )

    def errors(self) -> ErrorWords:
        """Return its error words; all are read, regardless of the flags."""
        flags = int(self.read("error_flags"))
        return ErrorWords(flags, {category: int(self.read(name)) for name, category in ERROR_FLAGS.values()})

    def clear_errors(self) -> ErrorWords:
        """Clear its errors and return the remaining ones; rejected unless it is idle.

        Raises:
            StateError: it is not idle. NodeError: no answer.
        """
        self.require_idle("errors are cleared")
        self.act("clear_errors")
        return self.errors()

    def act(self, name: str) -> bool:
        """Write to a register that starts an action with any value; return whether the module confirmed the write.

        Raises:
            ModbusRefused: an exception.
        """
        return self.dialogue.write(requests.write(named(name), _ANY))

    def save(self) -> bool:
        """Save RAM to flash, and return whether the module restarted, as it does over USB; blocks until it answers again.

        Raises:
            StateError: it is not idle. NodeTimeout: it no longer answers. ModbusRefused: an exception.
        """
        restarted = self.save_and_leave()
        self.wait_back()
        return restarted

    def save_and_leave(self) -> bool:
        """Save like ``save``, but do not wait for the restart: the module may then have another node ID."""
        for _ in range(_SAVES):
            self.require_idle("it is saved")
            taken = self.act("save_configuration")
            if self._goes_silent():
                return True
            if taken:
                return False
        return True  # no answer each time, yet never silent: it restarts in less than a second

    def wait_back(self) -> None:
        """Wait until it answers; blocks for at most about 25 s. Raises NodeTimeout: it does not."""
        end = self.wire.now() + RESTART_TIME
        while not self.answers():
            if self.wire.now() > end:
                raise NodeTimeout(
                    f"module {self.device} does not come back",
                    node=self.device,
                    observed=f"no answer within {RESTART_TIME:g} s",
                    remedy="switch it off and on; a node ID, protocol or interface that was saved applies from now on",
                )
            self.wire.sleep(_LOOK)

    def answers(self) -> bool:
        """Return whether a module answers to this node ID; sends one request."""
        try:
            self.read("motor_state", tries=1)
        except NodeTimeout:
            return False
        return True

    def _goes_silent(self) -> bool:
        end = self.wire.now() + RESTART_BEGINS
        while self.wire.now() < end:
            if not self.answers():
                return True
            self.wire.sleep(_LOOK)
        return False


def _show(register: Register, words: tuple[int, ...]) -> str:
    return f"{register.value(words):.7g}"


# -- Change the node ID: the new ID must be unused, and the module must answer under it before it is saved -------------


_NODE_ID = named("node_id")


def set_node_id(module: ModbusModule, new: int, *, save: bool = True) -> ModbusModule:
    """Change a module's node ID to ``new`` (1 to 63), and return the module under its new address; blocks.

    If this is interrupted before saving, the module has the new ID until it is switched off, and the old one afterwards.

    Raises:
        ArgumentError, LimitError: the ID is invalid. StateError: the module is not idle, or a module already answers to ``new``.
        NodeError: no answer, or it does not accept the ID.
    """
    request = requests.write(_NODE_ID, new)
    moved = ModbusModule(module.wire, new)
    if new == module.device:
        raise StateError(f"the module already has the node ID {new}", remedy="give another one")
    module.require_idle("its node ID is written")
    if moved.answers():
        raise StateError(
            f"another module on this line already answers to node ID {new}; nothing was written",
            remedy="give an ID that is free",
        )
    module.dialogue.write(request)
    found = _found(module, moved, new)
    if not save:
        return found
    found.save_and_leave()
    return _saved(module, moved, new)


def _found(module: ModbusModule, moved: ModbusModule, new: int) -> ModbusModule:
    """Return the module under the address at which it answers with the new ID in its register."""
    for each in (moved, module):
        if each.answers() and int(each.read(_NODE_ID.name)) == new:
            return each
    raise NodeError(
        f"module {module.device} does not accept node ID {new}",
        node=module.device,
        observed="no module confirms the new ID, neither under the new ID nor under the old one",
        remedy="try both IDs: axisbus gim6010 modbus state --node ...; a restart restores the old ID",
    )


def _saved(module: ModbusModule, moved: ModbusModule, new: int) -> ModbusModule:
    """Return the module under its new address once it answers there."""
    try:
        moved.wait_back()
    except NodeTimeout as error:
        raise NodeTimeout(
            f"module {module.device} does not answer to node ID {new} after it was saved",
            node=new,
            observed=f"a module answers with {module.device}" if module.answers() else error.observed,
            remedy="switch it off and on, and try both IDs",
        ) from error
    return moved


# -- Find the modules on a line: one request to each node ID, and the state of those that answer; nothing is written ---


@dataclass(frozen=True, slots=True)
class Present:
    """A module that answers: its node ID, state and supply voltage (V); ``trouble``: its errors, or why its data are incomplete."""

    device: int
    state: int | None = None
    voltage: float | None = None
    trouble: str = ""

    def __str__(self) -> str:
        state = "its state is not known" if self.state is None else state_words(self.state)
        supply = "" if self.voltage is None else f", {self.voltage:.1f} V"
        return f"node {self.device}: {state}{supply}" + (f"; {self.trouble}" if self.trouble else "")


def present(wire: Wire, devices: Iterable[int]) -> Iterator[Present | int]:
    """Send a request to each of ``devices`` (1 to 247); yield the modules found, and the number of each that does not answer.

    Blocks for the wire's ``timeout`` for each that does not answer. Raises AdapterError: the line is gone.
    """
    for device in devices:
        module = ModbusModule(wire, device)
        try:
            answers = module.answers()
        except NodeError as error:  # an exception is an answer, too
            yield Present(device, trouble=error.message)
            continue
        yield _look(module) if answers else device


def _look(module: ModbusModule) -> Present:
    try:
        state, voltage, errors = module.state, float(module.read("bus_voltage")), module.errors()
    except NodeError as error:
        return Present(module.device, trouble=error.message)
    return Present(module.device, state, voltage, "; ".join(errors.lines))


# -- One reading of the state; values that are not valid in idle are unknown -------------------------------------------


@dataclass(frozen=True, slots=True)
class StatusRead:
    """One reading. Turns and turns/s are those of the rotor.

    ``position`` and ``velocity`` are None if they are not valid: in any state except closed loop, or if they are not numbers.
    """

    state: int
    flags: int
    position: float | None = None
    velocity: float | None = None


def look(module: ModbusModule, tries: int) -> StatusRead:
    """Read the state of a module; blocks for at most about 0.7 s for each try.

    Raises:
        NodeError: no answer, or an exception. AdapterError: the line is gone.
    """
    state, flags = (int(module.read(name, tries)) for name in ("motor_state", "error_flags"))
    if state != CLOSED_LOOP:
        return StatusRead(state, flags)
    place = [float(module.read(name, tries)) for name in ("position_feedback", "velocity_feedback")]
    return StatusRead(state, flags, *(each if math.isfinite(each) else None for each in place))
