"""What the manual leaves open about Modbus, or says in two ways: what is said, and what is done here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OpenPoint:
    """One open point, in words for a person."""

    subject: str
    said: str
    done: str


NOTES = (
    OpenPoint(
        "a dead master",
        "no register of 4.3 watches the master",
        "NOTHING in the module is known to notice that nobody commands it any more over Modbus: "
        "a velocity or a torque goes on, a position is held. It is said whenever a module is opened to be moved",
    ),
    OpenPoint(
        "example 2 of 4.3.4",
        "writes 3.1416 turns to 68h, as its target position; by 4.3.3 that is the velocity",
        "a position is written to 66h only; the example's frame would be a velocity of 3.1416 turns/s",
    ),
    OpenPoint(
        "side of the gear, and units",
        "not said in 4.3 but for the examples' turn and turn/s",
        "those of the same parameters over USB and CAN Simple: turns of the rotor, of which 8 are one of the output",
    ),
    OpenPoint(
        "position in idle",
        "not said; over CAN the same estimate is 0 or invalid until closed loop was seen",
        "no motion counts on a position or velocity that was not read in closed loop",
    ),
    OpenPoint(
        "parity and stop bits",
        "not said; 115200 bit/s from the factory, and no more than that",
        "no parity and one stop bit, unless told otherwise",
    ),
    OpenPoint(
        "a module of node ID 0",
        "the factory's node ID; in Modbus it is everybody's address, and nobody answers",
        "never sent to: give it another ID over USB or CAN first",
    ),
    OpenPoint(
        "when a new node ID holds",
        "not said",
        "both the new and the old one are asked after it was written",
    ),
    OpenPoint(
        "reading what 4.3.3 only writes",
        "holding registers support reading and writing; of 63h, A1h and A2h no read is shown",
        "63h is judged by 01h, A2h by 31h; A1h is read back where it can be",
    ),
    OpenPoint(
        "saving",
        "80h saves; by 3.1.6 saving restarts the module, of which 4.3 says nothing",
        "a restart is waited for, and it is said where none came; refused unless the module is idle",
    ),
    OpenPoint(
        "zero",
        "there is no register for it",
        "by the parameters index_offset and use_index_offset, with the list of endpoints of the very firmware",
    ),
    OpenPoint(
        "ramps of velocity and torque",
        "input modes 2 and 6 have a rate each, which has no register",
        "the ramp that was asked for is made here, in steps; the module's own may make it slower, and brakes alone on the way out",
    ),
    OpenPoint(
        "values of fewer than 32 bits at 31h and A2h",
        "16-bit integers, 32-bit integers or floats, highest byte first",
        "the value stands in the lowest bits; 64 bits do not travel",
    ),
)
