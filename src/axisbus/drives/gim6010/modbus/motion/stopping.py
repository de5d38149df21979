"""Stopping a module that this program has not enabled, or does not hear."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.motion.driver import descend, is_idle, not_stopped
from axisbus.drives.gim6010.modbus.motion.ladder import ModbusStopSequence
from axisbus.drives.gim6010.modbus.motion.signals import ModbusSignalHandlers


def stop(module: ModbusModule, *, tell: Callable[[str], None]) -> None:
    """Go down the stop ladder from velocity 0 on; each signal goes a rung further. Blocks; ``tell`` gets how it ended.

    A module that is in idle is left alone; one that is not heard is sent every rung.

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
