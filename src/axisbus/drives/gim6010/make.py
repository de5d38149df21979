"""Identity, scale and quirks of the GIM6010-8 joint module (manual v2.2; facts that users published)."""

from __future__ import annotations

from axisbus.drives.gim6010 import faults
from axisbus.drives.plugin import Behaviour, DrivePlugin, MeasuredObject

VENDOR_ID = 0x000C0B00  # CyberBeast

COUNTS_PER_ROTOR_TURN = 16384  # 14-bit absolute encoder on the rotor (manual 1.3)
GEAR_RATIO = 8  # turns of the rotor per turn of the output (manual 1.2)
RESTART_BEGINS = 3.0  # s after a save until the restart must begin (owners' reports)
RESTART_TIME = 25.0  # s after a save for the whole restart (owners' reports)
COUNTS_PER_OUTPUT_TURN = COUNTS_PER_ROTOR_TURN * GEAR_RATIO

# Product codes are not published: every drive of this vendor gets this plug-in.
GIM6010 = DrivePlugin(
    name="GIM6010-8",
    vendor_id=VENDOR_ID,
    fault_objects=faults.OBJECTS,
    explain=faults.explain,
    behaviour=Behaviour(
        lists_modes=False,  # 0x761 would be pp, hm, ip, csv, cst and cstca, without pv and csp
        store_restarts=True,  # manual 3.1.6: it reboots, and unsaved communication settings are lost
    ),
    calibration_objects=(),  # not published: no known object starts a calibration over CANopen
    scale_proposal=(
        f"GIM6010-8: {COUNTS_PER_ROTOR_TURN} counts per turn of the rotor, gear {GEAR_RATIO}:1; if 6064h counts the rotor, "
        f"{COUNTS_PER_OUTPUT_TURN} per turn of the output, {COUNTS_PER_OUTPUT_TURN / 360:.4f} per degree"
    ),
    unread_watchdog=(
        "its break_timeout cannot be read over CANopen, and it is not known what feeds it there: the master sends nothing for it. "
        "If it is armed, switch it off (axisbus gim6010 watchdog --off, over USB or CAN Simple)"
    ),
    measured={"temperature": MeasuredObject(0x200B, 2, 0.1)},  # the motor's, in 0.1 °C
    notes=(
        "its 6502h (0x761) does not agree with CiA 402: judge a mode by 6061h",
        "its protection against the loss of the master is off from the factory",
        "its multi-turn position may be off by a part of a turn after power-up: home it, or confirm the position",
    ),
)

PLUGIN = GIM6010
