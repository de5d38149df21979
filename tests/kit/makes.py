"""Simulated drives that behave as drives of various makes do, by their manuals and by reports of their users.

Each function changes a simulated device before it is booted. The changes are particular to one make, so they are not fault settings
of the simulated drive. None of them was tried on a real drive; the docstring names the document that describes the behaviour.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.sim.axis import Axis
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.control_bits import SW_BIT_12
from axisbus.sim.device import Device
from axisbus.sim.dictionary import Refused
from axisbus.sim.drive import Drive
from axisbus.sim.modes.profile_position import ProfilePosition
from axisbus.sim.modes.velocity import ProfileVelocity
from axisbus.sim.power import PowerStage, Stage
from kit.cell import GENERIC

_RANGE = 0x0609_0030  # abort code: value out of range
_BIT_7, _BITS_14_15 = 0x80, 0xC000
_PP, _PV = 1, 3


def _become(changed: Any, **members: Any) -> None:
    """Give one object of the simulation other methods and properties."""
    kind = type(changed)
    changed.__class__ = type(f"Other{kind.__name__}", (kind,), {"__slots__": (), **members})


def _shows_always(device: Device, bits: int) -> None:
    """Let the statusword always have some bits."""

    def publish(drive: Drive) -> None:
        Drive._publish(drive)
        drive.statusword |= bits

    _become(device.drive, _publish=publish)


# -- power stage and modes ---------------------------------------------------------------------------------------------------


def technosoft_ipos(device: Device) -> None:
    """iPOS: without power, 6061h keeps its mode; it follows 6060h in *operation enabled* only.

    Technosoft: iPOS CANopen Programming (P091.063.iPOS.STO.UM.0219), 6061h; github.com/roboticslab-uc3m/yarp-devices, issue 215.
    """

    def follow(drive: Drive, dt: float) -> None:
        if drive.power.stage is Stage.ENABLED:
            Drive._follow_mode(drive, dt)

    _become(device.drive, _follow_mode=follow)


def schunk_lwa(device: Device) -> None:
    """LWA: it changes its mode only without power.

    github.com/ipa320/ipa_canopen, pull request 29; github.com/ros-industrial/ros_canopen, issue 328 and its ``switching_state``.
    """

    def follow(drive: Drive, dt: float) -> None:
        if drive.power.stage is not Stage.ENABLED:
            Drive._follow_mode(drive, dt)

    _become(device.drive, _follow_mode=follow)


def toshiba_vf_s15(device: Device) -> None:
    """VF-S15: *switched on* goes to *operation enabled* by itself.

    Toshiba: TOSVERT VF-S15 CANopen function manual, section 6.1.2.
    """

    def accept(power: PowerStage) -> None:
        PowerStage._accept_requested(power)
        if power.stage is Stage.SWITCHED_ON and power.pending is None and power._word & 0x87 == 0x07:
            power._accept(4)

    _become(device.drive.power, _accept_requested=accept)


# -- statusword --------------------------------------------------------------------------------------------------------------


def zeroerr_erob(device: Device) -> None:
    """eRob: bits 7, 9 and 12 are always set: 12D0h, 12B1h, 12B3h, 12B7h, in fault 1288h.

    github.com/ZeroErrControl/eRob_SOEM_linux, issue 12; github.com/ICube-Robotics/ethercat_driver_ros2, issue 87.
    """
    _shows_always(device, _BIT_7 | SW_BIT_12)


def kinco_fd5(device: Device) -> None:
    """FD5: bits 14 and 15 stay set (C031h, C437h); velocities and accelerations have units of its own.

    Kinco: FD5P user manual, tables 10-1 and 10-17: 512 · increments per turn / 1875 for 1/min, and 65536 · increments per turn /
    4000000 for 1 turn/s².
    """
    _shows_always(device, _BITS_14_15)
    axis = device.drive.axis
    axis.params = replace(axis.params, velocity_unit=60 * 512 / 1875, acceleration_unit=65536 / 4_000_000)


def applied_motion_st(device: Device) -> None:
    """ST10-C: bit 12 stays set while a set-point is in process, until the axis is at its target.

    Applied Motion: CANopen User Manual (920-0025 Rev K), appendix K; with the same words ESTUN: Summa Product Manual V1.01, 6041h.
    """

    def bits(mode: ProfilePosition, axis: Axis) -> int:
        value = ProfilePosition.bits(mode, axis)
        return value | SW_BIT_12 if mode._active is not None else value

    _become(device.drive._all_modes[_PP], bits=bits)


def acknowledges_at_enable(device: Device) -> None:
    """A motor of an unknown make: bit 12 is set as soon as the drive is enabled, until bit 4 falls for the first time.

    github.com/canopen-python/canopen, issue 678.
    """

    def enter(mode: ProfilePosition, axis: Axis) -> None:
        ProfilePosition.enter(mode, axis)
        mode._acknowledge = True

    _become(device.drive._all_modes[_PP], enter=enter)


# -- PDOs and SYNC -----------------------------------------------------------------------------------------------------------


def trinamic_pd42(device: Device) -> None:
    """PD42: an RPDO takes the transmission types 0, 254 and 255 only; bit 12 is never set in pv; 607Dh counts from home.

    Trinamic: PD42-1140 CANopen Firmware Manual V3.20, section 3.1.18; TMCM-1140 CANopen Manual 2.01, section 4.5.1.2; PD42-1270
    CANopen Firmware Manual V3.19, section 7.1.8.
    """

    def check(value: int) -> None:
        if value not in (0, 254, 255):
            raise Refused(_RANGE)

    for index in range(0x1400, 0x1404):
        if device.dictionary.has(index, 2):
            device.dictionary.check_write(index << 8 | 2, check)

    def bits(mode: ProfileVelocity, axis: Axis) -> int:
        return ProfileVelocity.bits(mode, axis) & ~SW_BIT_12

    def within(axis: Axis, position: float) -> float:
        settings = axis.settings
        user = axis._sign * position + axis.offset
        low, high = settings.low_limit - settings.home_offset, settings.high_limit - settings.home_offset
        inside = user if settings.low_limit >= settings.high_limit else min(max(user, low), high)
        axis.clamped = inside != user
        return axis._sign * (inside - axis.offset)

    _become(device.drive._all_modes[_PV], bits=bits)
    _become(device.drive.axis, position_within=within)


SYNC_LOST = 0x8180


def delta_asda_a2(device: Device) -> None:
    """ASDA-A2: 60FFh and 606Ch count 0.1 1/min, 6081h increments per second; SYNC is monitored with the period of 1006h.

    github.com/sittner/linuxcnc-ethercat, ``lcec_deasda.c``; github.com/gbcwbz/canfestival-rtt, issue 18 (1006h, 60C2h).
    """
    drive = device.drive
    unit = 600 / drive.params.increments_per_turn
    _become(
        drive.axis,
        user_velocity=lambda _, velocity: round(velocity * unit),
        motor_velocity=lambda _, velocity: velocity / unit,
    )

    def sync(drive: Drive) -> None:
        Drive.sync(drive)
        expected = drive.dictionary.get_int(0x1006) / 1e6
        if expected and drive._mode.cyclic and drive._sync_period > 1.5 * expected:
            drive.fault(SYNC_LOST)

    _become(drive, sync=sync)


# -- ramps -------------------------------------------------------------------------------------------------------------------


def beckhoff_ax2000(device: Device) -> None:
    """AX2000: 6083h and 6084h are times in ms, from standstill to the velocity of 6081h.

    Beckhoff: AX2000 CANopen communication profile, section 4.17.4.4.
    """

    def rate(axis: Axis, milliseconds: int) -> float:
        return axis.speed(axis.settings.profile_velocity) / max(milliseconds, 1) * 1000.0

    _become(
        device.drive.axis,
        acceleration=property(lambda axis: rate(axis, axis.settings.profile_acceleration)),
        deceleration=property(lambda axis: rate(axis, axis.settings.profile_deceleration)),
    )


@dataclass(frozen=True)
class Make:
    """A make: what it changes in a simulated device, and the lines of the cell file that its user needs.

    ``removed``: objects of the generic drive that it lacks. ``commands``: the commands that it can execute.
    """

    change: Callable[[Device], None]
    axis: str = ""
    removed: tuple[str, ...] = ()
    node: str = ""
    commands: tuple[str, ...] = ("pp", "pv", "hm", "csp")

    def eds_text(self) -> str:
        """Return the EDS of the generic drive without the objects that this make lacks."""
        text = Path(resolve(GENERIC, Path())).read_text(encoding="utf-8")
        return _without(text, self.removed) if self.removed else text

    def devices(self, count: int = 1) -> Mapping[int, Device]:
        """Return changed devices, from node 1 on."""
        return {node: self._device(node) for node in range(1, count + 1)}

    def _device(self, node: int) -> Device:
        file = eds.loads(self.eds_text().encode(), "make.eds")
        device = device_from_eds(file, node, motor_from_eds(file), seed=node)
        self.change(device)
        return device


def _without(text: str, removed: tuple[str, ...]) -> str:
    """Take objects without sub-indices out of an EDS text: their sections and their places in the lists."""
    kept = [part for part in text.split("\n[") if part.partition("]")[0] not in removed]
    return "\n[".join(_renumbered(part, removed) if "SupportedObjects=" in part else part for part in kept)


def _renumbered(section: str, removed: tuple[str, ...]) -> str:
    lines = section.splitlines()
    numbers = [line.partition("=")[2] for line in lines if line.partition("=")[0].isdigit()]
    numbers = [number for number in numbers if number.removeprefix("0x") not in removed]
    listed = [f"{place}={number}" for place, number in enumerate(numbers, start=1)]
    return "\n".join([lines[0], f"SupportedObjects={len(numbers)}", *listed, ""])


ON_CHANGE = 'handshake = "on-change"'
_PDOS = """
[nodes.{node}.pdo.rpdo1]
map = ["6040", "6060"]
transmission = 0
[nodes.{node}.pdo.rpdo2]
map = ["607A", "60FF"]
transmission = 0
[nodes.{node}.pdo.tpdo1]
map = ["6041", "6064", "6061"]
transmission = 1
[nodes.{node}.pdo.tpdo2]
map = ["606C", "6062"]
transmission = 1
"""
MAKES: Mapping[str, Make] = {
    "Technosoft iPOS": Make(technosoft_ipos),
    "Schunk LWA": Make(schunk_lwa, 'modes = ["csp"]', commands=("csp",)),
    "Toshiba VF-S15": Make(toshiba_vf_s15),
    "ZeroErr eRob": Make(zeroerr_erob, ON_CHANGE),
    "Kinco FD5": Make(
        kinco_fd5, "velocity_scale = 1638.4\nacceleration_scale = 1.6384", removed=("60A9", "60AA")
    ),
    "Applied Motion ST": Make(applied_motion_st, ON_CHANGE),
    "acknowledge at enable": Make(acknowledges_at_enable, ON_CHANGE),
    "Trinamic PD42": Make(trinamic_pd42, node=_PDOS),
    "Delta ASDA-A2": Make(
        delta_asda_a2, 'modes = ["pp", "hm", "csp"]', removed=("60A9",), commands=("pp", "hm", "csp")
    ),
    "Beckhoff AX2000": Make(
        beckhoff_ax2000,
        'modes = ["csp", "hm"]\nignored_objects = ["6083h", "6084h"]',
        commands=("hm", "csp"),
    ),
}
