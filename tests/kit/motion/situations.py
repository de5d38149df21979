"""The situations that an axis can be in when a command comes, by name."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import DriveError
from axisbus.motion.parameters import HoldsLoad, HomingParameters
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.rig import Rig, rig


def _disabled() -> Rig:
    r = rig()
    r.run(0.1)
    return r


def _standing() -> Rig:
    return rig().enabled()


def _turning() -> Rig:
    r = _standing()
    r.axis.move_velocity(50.0).wait(3)
    return r


def _moving() -> Rig:
    r = _standing()
    r.axis.move_relative(50.0)
    r.run(0.3)
    return r


def _pushed() -> Rig:
    r = _standing()
    r.axis.torque_control(0.5)
    r.run(0.3)
    return r


def _halting() -> Rig:
    r = _turning()
    r.axis.halt()
    r.run(0.05)
    return r


def _halted() -> Rig:
    r = _moving()
    r.axis.halt().wait(3)
    return r


def _stopping() -> Rig:
    r = _turning()
    r.axis.stop()
    r.run(0.05)
    return r


def _stopped() -> Rig:
    r = _turning()
    r.axis.stop().wait(3)
    return r


def _quick_stopping() -> Rig:
    r = _turning()
    r.axis.quick_stop()
    r.run(0.05)
    return r


def _enabling() -> Rig:
    r = rig()
    r.run(0.1)
    r.axis.enable()
    r.run(0.03)
    return r


def _disabling() -> Rig:
    r = _turning()
    r.axis.disable()
    r.run(0.05)
    return r


def _coasting() -> Rig:
    r = _turning()
    r.axis.disable(coast=True)
    r.run(0.05)
    return r


def _found_turning() -> Rig:
    r = rig()
    r.drive.target_velocity = 50_000
    r.drive.start_enabled(3)
    r.run(0.5)
    return r


def _homing() -> Rig:
    switches = MotorParams(limit_switches=(-40_000.0, 30_000.0), increments_per_turn=16_384)
    search = HomingParameters(method=37, speed_switch=30.0, speed_zero=5.0, acceleration=100.0)
    r = rig(motor=switches, homing=search).enabled()
    r.axis.home(17)
    r.run(0.3)
    return r


def _following() -> Rig:
    r = _standing()
    r.axis.follow(TrapezoidalTrajectory(0.0, 40.0, 50.0, 200.0))
    r.run(0.3)
    return r


def _jogging() -> Rig:
    r = _standing()
    r.axis.jog(30.0)
    r.run(0.1)
    return r


def _resetting() -> Rig:
    r = _in_fault()
    r.drive.dials.fault_persists = True
    r.axis.reset()
    r.run(0.02)
    return r


def _in_fault() -> Rig:
    r = _turning()
    r.drive.fault(0x2310)
    r.run(1.5)
    return r


def _error_stop() -> Rig:
    r = _turning()
    r.scan.axes[r.axis.name].fail(DriveError("made by hand"))
    r.run(1.5)
    return r


def _found_enabled() -> Rig:
    r = rig()
    r.drive.start_enabled(1)
    r.run(0.3)
    return r


def _held() -> Rig:
    """In quick stop active, if its option code leaves it there."""
    r = rig(quick_stop_holds=True)
    r.device.write(0x605A, 0, 6)
    r.enabled()
    r.axis.quick_stop().wait(3)
    return r


def _loaded() -> Rig:
    return rig(holds_load=HoldsLoad.TORQUE).enabled()


def _led() -> Rig:
    r = _standing()
    r.axis.cyclic_velocity(50.0).wait(3)
    return r


def _pushed_in_each_cycle() -> Rig:
    r = _standing()
    r.axis.cyclic_torque(0.5, slope=5.0).wait(3)
    return r


SITUATIONS: dict[str, Callable[[], Rig]] = {
    "disabled": _disabled,
    "standing": _standing,
    "turning": _turning,
    "moving": _moving,
    "pushed": _pushed,
    "halting": _halting,
    "halted": _halted,
    "stopping": _stopping,
    "stopped": _stopped,
    "quick stopping": _quick_stopping,
    "enabling": _enabling,
    "in fault": _in_fault,
    "error stop": _error_stop,
    "loaded": _loaded,
    "found enabled": _found_enabled,
    "held": _held,
    "disabling": _disabling,
    "coasting": _coasting,
    "found turning": _found_turning,
    "homing": _homing,
    "following": _following,
    "jogging": _jogging,
    "resetting": _resetting,
    "led at a velocity": _led,
    "led by a torque": _pushed_in_each_cycle,
}
