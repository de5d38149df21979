"""Symptoms of a drive: its power stage, its modes, its faults."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

_SHOWS_FAULT = (
    "`axisbus monitor CELL` shows the fault in words, with the emergency messages that came with it. "
    "`axisbus reset CELL` shows the fault and resets it."
)
_STOPS = ("stopping.md#automatic-stops",)

SYMPTOMS = (
    Symptom(
        name="does-not-enable",
        title="The drive cannot be enabled",
        seen="The drive does not follow the controlword. It remains in a CiA 402 state below operation enabled, or its "
        "fault cannot be reset. The motor has no torque.",
        checks=(
            "Bit 4 of the statusword is 0: the supply of the motor is off, or not ready. Measure it at the drive.",
            "Safe torque off, an enable input or an emergency stop: close the circuit. `axisbus od read --cell CELL "
            "NODE:60FD` shows the inputs.",
            "Bit 9 of the statusword is 0: the drive is under local control (keypad, the manufacturer's tool), and "
            "ignores the bus.",
            "Bit 11 of the statusword is 1: a limit switch, a software limit or a torque limit is active.",
            "The drive is in fault: `axisbus reset CELL` shows the fault, and resets it if its cause is removed. For "
            "some faults the supply must be switched off and on.",
            "A brake releases slowly: raise `transition_time` in `[axes.NAME]`.",
            "The drive is not calibrated, or has no parameters of its motor: see the drive's manual.",
        ),
        errors=("TransitionError",),
        read_on=("cell-file.md#axesname", "commissioning.md#7-motion"),
    ),
    Symptom(
        name="not-as-asked",
        title="The drive does something else than commanded",
        seen="The drive answers, but does not behave as commanded: it left operation enabled without a command, did not "
        "stop by the commanded step of the stop sequence, was enabled by another sender, or does not answer the "
        "objects of a command. If the message says TREAT THE AXIS AS MOVING or AS ENERGISED, do so.",
        checks=(
            "The stop could not be confirmed: use the emergency stop, and cut the supply. Only then continue with the "
            "next checks.",
            "The drive left operation enabled without a command: safe torque off, an enable input, a supply that "
            "dropped, or another tool that stopped it.",
            "The drive was enabled, but not by this program: look for another master. `axisbus trace CELL --seconds 5` "
            "shows which frames are sent.",
            "The drive stopped by a harder stop than commanded: its ramp takes longer than `halt_time` or "
            "`quick_stop_time` permits. `axisbus boot CELL` prints the stop sequence with its times.",
            "The drive does not answer requests for its objects: `axisbus load CELL` shows the load of the bus.",
        ),
        errors=("DriveError",),
        read_on=("stopping.md#the-stop-sequence", "stopping.md#automatic-stops"),
    ),
    Symptom(
        name="mode-not-taken",
        title="The drive does not change to the mode of operation",
        seen="6061h does not follow 6060h, or the drive left its mode without a command. If the axis was moving, the "
        "master has stopped it.",
        checks=(
            "Does the drive have the mode? `axisbus check CELL` lists the modes that each axis can use. 6502h contains "
            "the modes that the drive claims.",
            "Some modes can be set only while the drive is enabled, others only while it is disabled. Some need a "
            "licence, an encoder or a homing run: see the drive's manual.",
            "Some drives take no mode while the halt bit is set. If the message says that the halt bit must stay set, "
            "disable and enable the axis first.",
            "Does another tool write 6060h? `axisbus trace CELL --seconds 5` shows it.",
            "`modes` in `[axes.NAME]` lists the modes that axisbus uses.",
            "In ip (7) a drive may require its buffer (60C4h), its sub mode (60C0h) and SYNC.",
        ),
        errors=("ModeError",),
        read_on=(
            "cell-file.md#axesname",
            "motion.md#drives-without-csp",
            "stopping.md#stop-reactions-of-the-drive",
        ),
    ),
    Symptom(
        name="drive-fault",
        title="The drive is in fault",
        seen="The drive has detected an error and has performed its fault reaction (605Eh): it brakes or coasts, and "
        "then its power is off. 603Fh and the emergency messages contain the cause.",
        checks=(
            _SHOWS_FAULT,
            "`axisbus explain CODE` prints the page of a code, such as 0x7305. FF00h and above are "
            "manufacturer-specific: see the drive's manual.",
            "`axisbus od read --cell CELL NODE:1003:1` reads the newest entry in the drive's own list of errors.",
            "Remove the cause, then reset the fault. The reset enables nothing.",
            "`axisbus record faults CELL` records all axes around each fault, for the next time.",
        ),
        errors=("DriveFault",),
        faults=(
            "0xxx",
            "1xxx",
            "5xxx",
            "6xxx",
            "7xxx",
            "8xxx",
            "9xxx",
            "Axxx",
            "Bxxx",
            "Cxxx",
            "Dxxx",
            "Exxx",
            "Fxxx",
        ),
        read_on=_STOPS,
    ),
    Symptom(
        name="over-current",
        title="The drive is in fault: current, short circuit, overload",
        seen="The current was too high: for a moment (short circuit, earth leakage, gains that are too high), or for too "
        "long (I²t). The power stage is off.",
        checks=(
            _SHOWS_FAULT,
            "The fault occurs as soon as the drive is enabled, or at random: switch the supply off, and check the "
            "motor's cable and phases for a short circuit.",
            "The fault occurs while the axis accelerates or brakes: lower acceleration and deceleration, or the torque "
            "limit (6072h).",
            "The fault occurs after some time: the load is too heavy, a brake drags, or the axis presses against an "
            "obstacle. `axisbus monitor CELL` shows torques.",
            "The axis oscillates or hums: lower the gains of the drive's control loops.",
        ),
        faults=("2xxx", "83xx"),
        read_on=_STOPS,
    ),
    Symptom(
        name="supply-voltage",
        title="The drive is in fault: its supply voltage is too high or too low",
        seen="The voltage left its limits. It drops under load, and rises when an axis brakes and feeds energy back.",
        checks=(
            _SHOWS_FAULT,
            "Too low: measure the voltage at the drive under load. Use a stronger supply or a thicker cable, or "
            "accelerate fewer axes at the same time.",
            "Too high: the voltage rises when an axis brakes. Use a brake resistor, lower decelerations, or a supply "
            "that can absorb the energy.",
            "A phase is missing, or a fuse has blown.",
        ),
        faults=("3xxx", "51xx"),
        read_on=_STOPS,
    ),
    Symptom(
        name="too-hot",
        title="The drive is in fault: its temperature is too high or too low",
        seen="A temperature of the drive, its motor or its surroundings left its limits.",
        checks=(
            _SHOWS_FAULT,
            "If it is too hot, let it cool down before the reset. It heats up again from its present temperature.",
            "Check load and duty cycle: `axisbus record start CELL -o run.mcap`, then `axisbus plot run.mcap -o "
            "run.png` shows torques over time.",
            "Check ventilation, mounting surface and ambient temperature.",
        ),
        faults=("4xxx",),
        read_on=_STOPS,
    ),
    Symptom(
        name="encoder-fault",
        title="The drive is in fault: encoder or other sensor",
        seen="The sensor of the motor or of the load is silent, or reports an impossible value. The drive does not know "
        "the position of its rotor. Do not enable it before the cause is removed.",
        checks=(
            _SHOWS_FAULT,
            "Check plug and cable of the encoder, its shield, and motor cables near it.",
            "After a motor or an encoder was replaced: check the drive's settings of encoder type, counts per turn and "
            "pole pairs.",
            "An absolute encoder may need a moment after power-up: reset the fault again.",
        ),
        faults=("72xx", "73xx"),
        read_on=_STOPS,
    ),
)
