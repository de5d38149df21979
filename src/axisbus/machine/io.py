"""The public inputs and outputs: values that are fresh or reported as unknown, and commands for outputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from numbers import Real
from typing import TYPE_CHECKING

from axisbus.cia401.port import SignalValidity
from axisbus.cia401.signal import IoPoint, Value
from axisbus.errors import ArgumentError, SignalTimeout, StaleError, UnknownNameError
from axisbus.machine.handle import Handle, timeout_seconds
from axisbus.motion.io import IoReading, SetOutputs, remedy_for
from axisbus.motion.numbers import short_repr
from axisbus.session import IO

if TYPE_CHECKING:
    from axisbus.machine.command_dispatch import CommandDispatcher
    from axisbus.session import MachineSession

_CHECK_INTERVAL = 0.005  # seconds between two checks, in real time


class Signal:
    """One input or output of ``[io.NAME]``. A bit is True or False, a number is in its ``unit``."""

    def __init__(self, point: IoPoint, session: MachineSession, commanding: CommandDispatcher) -> None:
        self.name = point.name
        self._point = point
        self._session = session
        self._commanding = commanding

    def __repr__(self) -> str:
        try:
            return f"<Signal {self.name}: {self.value}{self._in_unit}>"
        except StaleError:
            return f"<Signal {self.name}: unknown>"

    @property
    def unit(self) -> str:
        """The unit of a number; empty if it has none."""
        return self._point.unit

    @property
    def is_output(self) -> bool:
        """Whether it can be set."""
        return self._point.output

    @property
    def safe_value(self) -> Value | None:
        """Value of an output after the loss of its node, the program or the master, and at the end; None for an input."""
        return self._point.shown(self._point.safe) if self._point.output else None

    @property
    def value(self) -> Value:
        """The last received value of an input, or the last sent value of an output; before its first set, the value found at boot.

        Raises:
            StaleError: it is unknown, with the reason: its node is lost, it is too old, or the scan has ended.
        """
        return self._shown(self._known())

    @property
    def age(self) -> float:
        """Seconds from the reception or sending of ``value`` to the last cycle; raises as ``value``."""
        reading = self._known()
        return max(0.0, reading.now - reading.stamp)

    def set(self, value: Value) -> Handle:
        """Set an output. Does not block.

        The handle is done after the frame and the SYNC that makes it effective have been sent, and the node was heard afterwards.
        If the node is lost before that, the handle fails with a NodeError.

        If the node has no heartbeat and no inputs, done means sent. Only an input can show whether the wired device has reacted.
        The output keeps the value until it is set again, its node is lost (it is then safe, and must be set again), or the machine
        is closed.

        Raises:
            ArgumentError: it is an input, or cannot have this value.
        """
        return set_outputs(self._commanding, {self: value})

    def wait(self, value: Value | Callable[[Value], bool] = True, timeout: float | None = None) -> Value:
        """Block until it has ``value``, or until a function of its value returns true; return the value.

        The value is checked at most once per cycle, in real time every 5 ms; shorter changes are not seen.

        Raises:
            SignalTimeout: the value has not come within ``timeout`` seconds.
            StaleError: it is unknown, or becomes unknown.
        """
        if not callable(value) and not isinstance(value, Real):
            raise ArgumentError(
                f"{self.name}.wait: {short_repr(value)} is not a possible value",
                remedy="give a number, True, False, or a function of its value",
            )
        done: Callable[[Value], bool] = value if callable(value) else (lambda found: found == value)
        reading = self._known()
        limit = timeout_seconds(f"{self.name}.wait", timeout)
        until = math.inf if limit is None else reading.now + limit
        while not done(found := self._shown(reading)):
            if reading.now >= until:
                raise self._not_in_time(value, found, timeout)
            self._session.waiter.wait(lambda: False, _CHECK_INTERVAL)
            reading = self._known()
        return found

    @property
    def point(self) -> IoPoint:
        """Location and scaling of its raw value."""
        return self._point

    @property
    def _in_unit(self) -> str:
        return f" {self.unit}" if self.unit else ""

    def _shown(self, reading: IoReading) -> Value:
        return self._point.shown(reading.value or 0)

    def _known(self) -> IoReading:
        silent = self._session.silent
        reading = self._session.readings.get(self.name)
        known = SignalValidity.NOT_BOOTED if reading is None else reading.known
        if silent is None and reading is not None and known is SignalValidity.YES:
            return reading
        raise StaleError(
            f"{self.name} ({self._point.object_text} of node {self._point.node}) is unknown",
            observed=silent or known.value,
            remedy=f"{remedy_for(known, self._point.node)}; the machine's events say more about the node",
        )

    def _not_in_time(
        self, value: Value | Callable[[Value], bool], found: Value, timeout: float | None
    ) -> SignalTimeout:
        wanted = "the expected value" if callable(value) else f"{short_repr(value)}{self._in_unit}"
        return SignalTimeout(
            f"{self.name} did not become {wanted} within {timeout:g} s",
            signal=self.name,
            observed=f"it is {found}{self._in_unit}",
            remedy="check the wiring of this signal, and whether the event that should change it has happened",
        )


class InputsOutputs(Mapping[str, Signal]):
    """The inputs and outputs of a machine by name, in the order of cell.toml."""

    def __init__(
        self, points: Mapping[str, IoPoint], session: MachineSession, commanding: CommandDispatcher
    ) -> None:
        self._signals = {name: Signal(point, session, commanding) for name, point in points.items()}
        self._commanding = commanding

    def __getitem__(self, name: str) -> Signal:
        """Return an input or output; raises StateError if the cell has none of this name."""
        if not isinstance(name, str) or name not in self._signals:
            raise UnknownNameError(
                f"the cell has no input or output {short_repr(name)}",
                observed=f"it has {', '.join(self._signals) or 'none'}",
                remedy=f"add [io.{name if isinstance(name, str) else 'NAME'}], or correct the name",
            )
        return self._signals[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._signals

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals)

    def __len__(self) -> int:
        return len(self._signals)

    def set(self, values: Mapping[str, Value]) -> Handle:
        """Set several outputs in one cycle, all or none of them; otherwise as ``Signal.set``."""
        if not isinstance(values, Mapping) or not values:
            raise ArgumentError(
                f"io.set: {short_repr(values)} does not name an output",
                remedy='give a value for each output, such as {"lamp": True}',
            )
        return set_outputs(self._commanding, {self[name]: value for name, value in values.items()})


def set_outputs(commanding: CommandDispatcher, values: Mapping[Signal, Value]) -> Handle:
    """Submit a command that sets outputs; raises ArgumentError if one of them cannot have its value."""
    given = tuple((signal.name, _raw(signal, value)) for signal, value in values.items())
    name = ", ".join(f"{signal.name} = {value}" for signal, value in values.items())
    return commanding.submit(IO, SetOutputs(given), name)


def _raw(signal: Signal, value: Value) -> int:
    if not signal.is_output:
        raise ArgumentError(
            f"{signal.name} cannot be set", observed="it is an input", remedy="name an output of the cell"
        )
    return signal.point.raw(value)
