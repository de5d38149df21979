"""The stop sequence on a wire: its requests are sent and read back."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.drives.gim6010.can_simple.states import IDLE
from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.module import ModbusModule, StatusRead, look
from axisbus.drives.gim6010.modbus.motion.ladder import ModbusStopSequence, Send, StopOutcome
from axisbus.drives.gim6010.modbus.motion.signals import ModbusSignalHandlers
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.errors import AdapterError, DriveError, NodeError

PERIOD = 0.03  # s between two readings
# In this order, each write alone brakes or changes nothing; a torque set-point may be added to the output of the velocity loop.
BRAKE = (("velocity_setpoint", 0.0), ("control_mode", 2), ("input_mode", 2), ("torque_setpoint", 0.0))


def descend(module: ModbusModule, ladder: ModbusStopSequence, impatience: Callable[[], int]) -> StopOutcome:
    """Run a stop sequence to its outcome; blocks. Each time that ``impatience()`` grows, the next step begins."""
    seen, held, patience = None, False, impatience()
    while ladder.outcome is None:
        if impatience() > patience:
            patience = impatience()
            ladder.escalate()
        send = ladder.step(module.wire.now(), seen, held)
        if send is not Send.NOTHING:
            held = _carry_out(module, send, ladder)
        if ladder.outcome is None:
            module.wire.sleep(PERIOD)
            seen = _glance(module)
    return ladder.outcome


def _carry_out(module: ModbusModule, send: Send, ladder: ModbusStopSequence) -> bool:
    """Send the request of the stop sequence; return whether its effect was read back."""
    try:
        if send is Send.IDLE:
            return module.dialogue.shout(requests.write(named("state_control"), IDLE))
        if send is Send.ESTOP:
            return module.dialogue.shout(requests.write(named("emergency_stop"), 1))
        if send is Send.SETPOINT:
            register = "" if ladder.halting is None else ladder.halting.register
            return _held(module, ((register, ladder.value or 0.0),))
        return _held(module, BRAKE)
    except (NodeError, AdapterError):
        return False


def _held(module: ModbusModule, values: tuple[tuple[str, float], ...]) -> bool:
    """Write values whether the writes are answered or not, then read all of them back."""
    written = [requests.write(named(name), value) for name, value in values]
    answered = [module.dialogue.shout(request) for request in written]
    return any(answered) and all(
        module.dialogue.read(requests.read(each.register), tries=1) == each.words for each in written
    )


def _glance(module: ModbusModule) -> StatusRead | None:
    try:
        return look(module, tries=1)
    except (NodeError, AdapterError):
        return None


def is_idle(module: ModbusModule) -> bool:
    """Whether a module is certainly in idle; False if it does not answer. Sends one request."""
    try:
        return module.dialogue.read(requests.read(named("motor_state")), tries=1) == (IDLE,)
    except (NodeError, AdapterError):
        return False


def not_stopped(module: ModbusModule, outcome: StopOutcome) -> DriveError:
    """Return the error of a module that is not confirmed as stopped."""
    return DriveError(
        f"module {module.device}: {outcome.text}",
        remedy="first look at the machine; if it turns, switch its supply off",
    )


# -- Stop a module that this program has not enabled, or that does not answer ------------------------------------------


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
