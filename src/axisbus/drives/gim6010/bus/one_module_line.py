"""A serial line with one module, outside any cell: open it as a channel, stop the module, and a watchdog process that stops it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple, Self

from axisbus.bus.link.channel import Channel
from axisbus.drives.gim6010.bus.stop_modules import stop_modules
from axisbus.drives.gim6010.can_simple.port.settings import HEARTBEAT_BY_LINE, ModuleSettings
from axisbus.drives.gim6010.modbus.can_emulation import Listed
from axisbus.drives.gim6010.modbus.serial_wire import libraries
from axisbus.errors import AdapterError, AxisbusError, DriveError, StateError
from axisbus.system.signals import OWN_GROUP, present

_INTERFACE = "modbus"
_HIGHEST = 63  # node ID of CAN Simple
_FASTEST = 1000.0  # turns/s, which no rotor reaches
_ANY = 1.0  # limits and ramps, which a stop does not send


def channel_node(device: int) -> int:
    """Return the node ID of a device (1 to 247) on its channel: its own one if CAN Simple has it."""
    return device if device <= _HIGHEST else _HIGHEST


class OneModuleLine(NamedTuple):
    """A serial port with one module: its node ID (1 to 247), the rate in bit/s, and the parity: none, even or odd."""

    port: str
    device: int
    rate: int
    parity: str

    def open(self, listed: Listed | None = None, *, calibrates: bool = False) -> Channel:
        """Open the port as the channel of the module; ``listed`` and ``calibrates`` as for ``Relay``.

        Raises:
            UserError: the extra is not installed. AdapterError: the port cannot be opened.
        """
        node, options = channel_node(self.device), {"parity": self.parity, "calibrates": calibrates}
        modules, devices = {node: listed}, {node: self.device}
        return Channel.open(_INTERFACE, self.port, self.rate, modules=modules, devices=devices, **options)


def stop_on_line(
    channel: Channel, device: int, *, tell: Callable[[str], None], impatience: Callable[[], int]
) -> None:
    """Stop the module: velocity 0 on its own ramp, idle, emergency stop, until standstill without power was seen; blocks.

    A module in idle gets nothing; a module that does not answer gets the requests of every step. Each time that ``impatience()``
    grows, the next step begins. ``tell`` is called with the outcome. Raises DriveError: it is not confirmed as stopped.
    """
    settings = ModuleSettings(
        channel_node(device), _FASTEST, _ANY, _ANY, _ANY, _ANY, heartbeat=HEARTBEAT_BY_LINE, relayed=True
    )
    (found,) = stop_modules(channel, {"module": settings}, alone=True, impatience=impatience)
    if not found.ok:
        raise DriveError(
            f"module {device}: {found.text}",
            remedy="first look at the machine; if it turns, switch its supply off",
        )
    tell(f"module {device}: {found.text}")


# -- The watchdog process that stops a module if the program that calibrates it outside a cell is killed --------------
#
# Theory of operation. No function of a module detects the loss of the master, so another process must. The watchdog process is
# started, and ready, before anything is requested. It holds one end of a pipe. If the other end closes without a message, the
# program is dead, and its port is free. Then the watchdog process opens the port and stops the module as ``axisbus gim6010 modbus
# stop`` does. Signals of the terminal do not reach it. It does not help if the computer, the adapter or the cable fails, or if the
# program hangs.


_READY, _OVER = b"ready\n", b"over\n"
_PATIENCE = 5.0  # s until the port of a dead program is free
_AGAIN = 0.02


class ModbusWatchdogProcess:
    """The watchdog process for one module on a port."""

    def __init__(self, line: OneModuleLine) -> None:
        """Nothing is started before ``with``."""
        self._arguments = list(map(str, line))
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Start it; blocks until it is ready. Raises StateError: it cannot be started."""
        command = [sys.executable, "-m", __name__, *self._arguments]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            creationflags=OWN_GROUP,
        )
        if self._process.stdout is None or self._process.stdout.readline() != _READY:
            self._end(b"")
            raise StateError(
                "the watchdog process that stops the module if this program is killed could not be started; nothing was enabled",
                remedy="see its messages above",
            )
        return self

    def __exit__(self, *_: object) -> None:
        """End the process: the program has stopped the module itself, or has reported that it could not."""
        self._end(_OVER)

    @property
    def is_there(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def _end(self, word: bytes) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.communicate(word)


def main(arguments: list[str]) -> int:
    """Wait for the end of the program; stop the module if no message came before. Return the exit code."""
    port, device, rate, parity = arguments
    line = OneModuleLine(port, int(device), int(rate), parity)
    for number in present("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        signal.signal(number, signal.SIG_IGN)
    libraries()
    sys.stdout.buffer.write(_READY)
    sys.stdout.buffer.flush()
    if sys.stdin.buffer.read() == _OVER:
        return 0
    _say(f"module {device}: the program that moved it is dead: it is stopped now")
    try:
        with _free(line) as channel:
            stop_on_line(channel, line.device, tell=_say, impatience=lambda: 0)
    except AxisbusError as error:
        _say(str(error))
        return 3
    return 0


def _free(line: OneModuleLine) -> Channel:
    """Open the port as soon as it is free."""
    end = time.monotonic() + _PATIENCE
    while True:
        try:
            return line.open()
        except AdapterError:
            if time.monotonic() > end:
                raise
            time.sleep(_AGAIN)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
