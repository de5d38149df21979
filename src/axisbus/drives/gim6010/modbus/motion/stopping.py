"""Stop a module that this program has not enabled, or that does not answer."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.motion.driver import descend, is_idle, not_stopped
from axisbus.drives.gim6010.modbus.motion.ladder import ModbusStopSequence
from axisbus.drives.gim6010.modbus.motion.signals import ModbusSignalHandlers


def stop(module: ModbusModule, *, tell: Callable[[str], None]) -> None:
    """Run the stop sequence, beginning with velocity 0; each signal starts the next step. Blocks; ``tell`` gets the outcome.

    A module in idle gets nothing; a module that does not answer gets the requests of every step.

    Raises:
        DriveError: it is not confirmed as stopped.
    """
    signals = ModbusSignalHandlers()
    signals.install()
    try:
        with signals.sheltered():
            if is_idle(module):
                tell(f"module {module.device}: it is in idle: there is no power to be stopped")
                return
            outcome = descend(module, ModbusStopSequence(None), lambda: signals.count)
    finally:
        signals.restore()
    if not outcome.ok:
        raise not_stopped(module, outcome)
    tell(f"module {module.device}: {outcome.text}")
