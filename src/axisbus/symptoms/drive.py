"""Symptoms of a drive: its power stage, its modes, its faults."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

_TELLS = (
    "`axisbus monitor CELL` tells the fault in words, with the emergency messages that came with it; "
    "`axisbus reset CELL` tells and resets it."
)
_MANUAL = ("gim6010-8.md#error-bits", "stopping.md#what-axisbus-stops-by-itself")

SYMPTOMS = (
    Symptom(
        name="does-not-enable",
        title="It does not enable",
        seen="The drive does not follow the controlword: it stays in a state of CiA 402 before operation enabled, "
        "or its fault does not go away. The motor has no torque.",
        checks=(
            "Bit 4 of the statusword is 0: the supply of the motor is off, or not ready. Measure it at the drive.",
            "Safe torque off, an enable input, an emergency stop: close the circuit. `axisbus od read --cell CELL "
            "NODE:60FD` shows the inputs.",
            "Bit 9 is 0: the drive is under local control (keypad, the maker's tool), and ignores the bus.",
            "Bit 11 is 1: a limit switch, a software limit or a torque limit holds it.",
            "It is in fault: `axisbus reset CELL` tells which one, and resets it once its cause is gone. Some "
            "faults need the supply switched off and on.",
            "A brake that is slow to release: raise `transition_time` in `[axes.NAME]`.",
            "Not calibrated, or without parameters of its motor: see the drive's manual. `axisbus gim6010 errors -i "
            "socketcan -c can0 --node NODE` tells it of a GIM6010-8.",
        ),
        errors=("TransitionError",),
        read_on=("cell-file.md#axesname", "commissioning.md#7-motion"),
    ),
    Symptom(
        name="not-as-asked",
        title="The drive does something else than it was told",
        seen="The drive answers, and left operation enabled by itself, did not stop by the rung of the ladder that "
        "it was asked for, was enabled by somebody else, or does not answer the objects of a command. Where "
        "the message says TREAT THE AXIS AS MOVING or AS ENERGISED, do so.",
        checks=(
            "Could not be confirmed as stopped: use the emergency stop, and cut the supply. Only then look further.",
            "It left operation enabled by itself: safe torque off, an enable input, a supply that dropped, or "
            "another tool that stopped it.",
            "It was enabled, and nobody asked this program for it: look for another master; `axisbus trace CELL "
            "--seconds 5` shows who sends.",
            "It stopped by a harder stop than was asked for: its ramp takes longer than `halt_time` or "
            "`quick_stop_time` allow. `axisbus boot CELL` prints the ladder, with its times.",
            "It does not answer its objects: `axisbus load CELL` says how full the bus is.",
        ),
        errors=("DriveError",),
        read_on=("stopping.md#the-stop-ladder", "stopping.md#what-axisbus-stops-by-itself"),
    ),
    Symptom(
        name="mode-not-taken",
        title="It does not take the mode of operation",
        seen="6061h does not follow 6060h, or the drive left its mode by itself. An axis that moved was stopped.",
        checks=(
            "Has the drive the mode? `axisbus check CELL` lists the modes that each axis can run; 6502h is what the "
            "drive claims.",
            "Some modes are taken only while the drive is enabled, or not while it is; some need a licence, an "
            "encoder or a reference run: see its manual.",
            "Another tool writes 6060h: `axisbus trace CELL --seconds 5`.",
            "`modes` in `[axes.NAME]` names the modes that are to be used.",
            "In ip (7) a drive may want its buffer (60C4h), its sub mode (60C0h) and SYNC.",
        ),
        errors=("ModeError",),
        read_on=("cell-file.md#axesname", "motion.md#a-drive-without-csp"),
    ),
    Symptom(
        name="drive-fault",
        title="The drive is in fault",
        seen="The drive itself has found something and did its fault reaction (605Eh): it brakes, or coasts, and "
        "its power is off. 603Fh and the emergency messages say what.",
        checks=(
            _TELLS,
            "`axisbus explain CODE` finds the page of a code, such as 0x7305; FF00h and above are the maker's own: "
            "see its manual.",
            "`axisbus od read --cell CELL NODE:1003:1` is the newest of the drive's own list of errors.",
            "A GIM6010-8 tells more in bits of its own: `axisbus gim6010 errors -i socketcan -c can0 --node NODE`.",
            "Remove the cause, then reset: nothing is enabled by that.",
            "`axisbus record faults CELL` keeps what all axes did around a fault, for next time.",
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
        read_on=_MANUAL,
    ),
    Symptom(
        name="over-current",
        title="The drive is in fault: current, short circuit, overload",
        seen="The current was too high: for a moment (short circuit, earth leakage, gains that are too high), or "
        "for too long (I²t). The power stage is off.",
        checks=(
            _TELLS,
            "At once when it is enabled, or at random: switch the supply off, and look at the motor's cable and "
            "phases for a short.",
            "When it accelerates or brakes: lower acceleration and deceleration, or the limit of torque (6072h).",
            "After a while: the load is too heavy, a brake drags, or the axis presses against something. `axisbus "
            "monitor CELL` shows torques.",
            "It oscillates or hums: lower the gains of the drive's loops.",
        ),
        faults=("2xxx", "83xx"),
        read_on=_MANUAL,
    ),
    Symptom(
        name="supply-voltage",
        title="The drive is in fault: its supply is too high or too low",
        seen="The voltage left its limits: low under load, high when an axis brakes and feeds back.",
        checks=(
            _TELLS,
            "Too low: measure it at the drive under load. Stronger supply, thicker cable, fewer axes that "
            "accelerate at the same time.",
            "Too high: it rises when an axis brakes. A brake resistor, gentler decelerations, a supply that takes "
            "back.",
            "A phase is missing, or a fuse has blown.",
            "On a GIM6010-8 the limits are parameters: 200Ah:09 and 200Ah:0A.",
        ),
        faults=("3xxx", "51xx"),
        read_on=_MANUAL,
    ),
    Symptom(
        name="too-hot",
        title="The drive is in fault: too hot, or too cold",
        seen="A temperature of the drive, its motor or its surroundings left its limits.",
        checks=(
            _TELLS,
            "Let it cool down before it is reset; it goes on heating up from where it is.",
            "Load and duty: `axisbus record start CELL -o run.mcap`, then `axisbus plot run.mcap -o run.png` shows "
            "torques over time.",
            "Ventilation, mounting surface, ambient temperature.",
        ),
        faults=("4xxx",),
        read_on=_MANUAL,
    ),
    Symptom(
        name="encoder-fault",
        title="The drive is in fault: encoder or other sensor",
        seen="The sensor of the motor or of the load is silent, or says what cannot be. The drive does not know "
        "where its rotor is: it must not be enabled before that is mended.",
        checks=(
            _TELLS,
            "Plug and cable of the encoder, its shield, and motor cables beside it.",
            "After a motor or an encoder was exchanged: the drive's settings of type, counts per turn and pole "
            "pairs.",
            "An absolute encoder that has just got power may need a moment: reset again.",
            "Calibration: on a GIM6010-8 without load and on purpose only.",
        ),
        faults=("72xx", "73xx"),
        read_on=_MANUAL,
    ),
)
