"""Points about Modbus that the manual leaves open or contradicts: its statement, and the solution used here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OpenPoint:
    """One open point, as text for the user."""

    subject: str
    said: str
    done: str


NOTES = (
    OpenPoint(
        "the loss of the master",
        "no register of 4.3 monitors the master",
        "NOTHING in the module is known to detect the loss of the master over Modbus: a velocity or a torque continues, a position "
        "is held. `axisbus check` and `axisbus boot` report this",
    ),
    OpenPoint(
        "example 2 of 4.3.4",
        "writes 3.1416 turns to 68h as its target position; by 4.3.3, 68h is the velocity",
        "a position is written to 66h only; the frame of the example would command a velocity of 3.1416 turns/s",
    ),
    OpenPoint(
        "side of the gear, and units",
        "4.3 has only turn and turn/s in its examples",
        "as for the same parameters over USB and CAN Simple: turns of the rotor; 8 of them are one turn of the output",
    ),
    OpenPoint(
        "position in idle",
        "not described; over CAN the same estimate is 0 or invalid until the module has been in closed-loop control",
        "no motion relies on a position or velocity that was not read in closed loop",
    ),
    OpenPoint(
        "parity and stop bits",
        "not described; 115200 bit/s at delivery, which is also the highest rate",
        "no parity and one stop bit, unless the user sets a parity",
    ),
    OpenPoint(
        "a module with node ID 0",
        "the node ID at delivery; in Modbus it is the broadcast address, which is not answered",
        "nothing is sent to it: give the module another ID over USB or CAN first",
    ),
    OpenPoint(
        "when a new node ID takes effect",
        "not described",
        "after the write, both the new and the old ID are asked",
    ),
    OpenPoint(
        "reading registers that 4.3.3 only writes",
        "holding registers can be read and written; for 63h, A1h and A2h no read is shown",
        "63h is checked by 01h, A2h by 31h; A1h is read back if the firmware allows it",
    ),
    OpenPoint(
        "saving",
        "80h saves; by 3.1.6 saving restarts the module, which 4.3 does not mention",
        "axisbus waits for a restart, and reports if none was seen; saving is refused unless the module is idle",
    ),
    OpenPoint(
        "zero",
        "there is no register for it",
        "the parameters index_offset and use_index_offset, with the endpoint list of exactly this firmware",
    ),
    OpenPoint(
        "ramps of velocity and torque",
        "input modes 2 and 6 have one rate each, without a register",
        "axisbus makes the requested ramp in steps; the module's own ramp may make it slower. A stop outside "
        "the machine brakes on that ramp alone",
    ),
    OpenPoint(
        "values of fewer than 32 bits at 31h and A2h",
        "16-bit integers, 32-bit integers or floats, highest byte first",
        "the value is in the lowest bits; 64-bit values cannot be transferred",
    ),
)
