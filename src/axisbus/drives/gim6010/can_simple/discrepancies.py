"""Where the manual, owners and the maker's own programs say different things: what each says, what is taken, and what is sent."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ManualDiscrepancy:
    """One contradiction, in words for a person; ``commands`` are the messages that it is about (none: the module as a whole)."""

    subject: str
    manual: str
    field: str
    taken: str
    sent: str
    commands: tuple[int, ...] = ()


NOTES = (
    ManualDiscrepancy(
        "number of messages",
        "30 commands, from 01h to 1Fh without 15h",
        "the same",
        "15h is no command",
        "never 15h",
    ),
    ManualDiscrepancy(
        "length",
        "8 data bytes in every frame",
        "answers with fewer, or padded",
        "any length that holds the fields",
        "8 bytes, filled up with 0",
    ),
    ManualDiscrepancy(
        "asking for a message",
        "not said how",
        "remote frames for 09h, 0Ah, 14h, 17h; the maker's program: 8 bytes of 0",
        "8 bytes of 0 may be a request or an answer",
        "a remote frame, or on demand 8 bytes of 0",
        (0x09, 0x0A, 0x14, 0x17),
    ),
    ManualDiscrepancy(
        "Get_Error",
        "a type in the request",
        "no answer to a remote or an empty frame; with 8 bytes not tried",
        "4 or 8 bytes; the answer does not say its type",
        "8 bytes, one request at a time",
        (0x03,),
    ),
    ManualDiscrepancy(
        "direction of RxSdo",
        "overview: from the module; detail: to the module",
        "to the module",
        "both",
        "to the module",
        (0x04,),
    ),
    ManualDiscrepancy(
        "where endpoints answer",
        'RxSdo reads, TxSdo "as RxSdo when it writes"',
        "the maker's program writes on 05h and takes answers on 04h; owners got no answer at all",
        "answers on 04h and on 05h",
        "requests on 04h only",
        (0x04, 0x05),
    ),
    ManualDiscrepancy(
        "heartbeat, trajectory done",
        "first layout: bit 7 of byte 7",
        "bit 3 of byte 7",
        "either; unknown where layouts disagree",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "heartbeat, flag of 1",
        'first layout: 1 is a fault; later ones: "whether the error is 0"',
        "two owners: 1 is a fault; one: 1 is no error",
        "1 is a fault",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "heartbeat, byte 6", "reserved", "a temperature, on a sibling", "any value", "nothing", (0x01,)
    ),
    ManualDiscrepancy(
        "position in idle",
        "not said",
        "09h is 0 or invalid until closed loop was seen; 0Ah is alive",
        "as it comes: who uses it looks at the state",
        "nothing",
        (0x09, 0x0A),
    ),
    ManualDiscrepancy(
        "shadow count",
        "the encoder's multi-turn count",
        "does not convert to turns; Count_In_Cpr/16384 is a part of a rotor turn",
        "both as they come",
        "nothing",
        (0x0A,),
    ),
    ManualDiscrepancy(
        "torque of Set_Input_Vel", "float32 in 4.1.2", "float32 too", "float32", "float32", (0x0D,)
    ),
    ManualDiscrepancy(
        "highest current",
        "50 A in 3.1.3, 100 A in 3.1.8",
        "factory settings of 45 A and 60 A",
        "as it comes",
        "at most 50 A",
        (0x0F,),
    ),
    ManualDiscrepancy(
        "torque constant",
        "0.47 N·m/A in 1.2, about 0.67 in 3.1.3 and 3.1.7",
        "0.097 N·m/A read from five modules",
        "torques as the module tells them",
        "torques as they are asked for: what they come to depends on the module's setting",
        (0x0D, 0x0E, 0x1C),
    ),
    ManualDiscrepancy(
        "node ID of the factory",
        "0",
        "0 or 1, and 0 to 11 on twelve modules",
        "all from 0 to 63",
        "0 to 63",
        (0x06,),
    ),
    ManualDiscrepancy(
        "MIT, range",
        "±12.5 rad, ±65 rad/s, 500, 5, ±50 N·m",
        "from 0.6.0 on five parameters mit_max_* change it",
        "by the ranges that are given",
        "by the ranges that are given",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, beyond the range",
        "not said",
        "the firmware wraps: +12.625 rad is -12.376 rad; feedback too",
        "values at an end are named; a wrapped one cannot be seen",
        "brought to the range, which is told",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, all bytes 0",
        "not said",
        "full negative torque",
        "as a command, in a recording",
        "never",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, gains",
        "N·m per turn for USB, no unit for CAN",
        "taken for turns of the rotor, unscaled (another joint's code)",
        "as the firmware has them",
        "as they are asked for",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, length of the answer",
        "6 bytes",
        "8 bytes, of which 6 are used",
        "6 to 8 bytes",
        "nothing",
        (0x08,),
    ),
    ManualDiscrepancy(
        "axis error 0x40",
        "MOTOR_FAILED",
        "one owner reads MISSING_INPUT, by another maker's table",
        "MOTOR_FAILED",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "axis error, bit 20",
        "not there",
        "CAN_BUS_FAILED, latched (another joint of the maker)",
        "CAN_BUS_FAILED",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "break_timeout",
        "not there",
        "0 is off; older firmware took 0 for 100 ms; another value arms it at once",
        "as it comes",
        "only where it is named by itself",
    ),
    ManualDiscrepancy(
        "watchdog_timeout",
        "not there",
        "the maker: without effect in new firmware",
        "as it comes",
        "nobody may count on it",
    ),
    ManualDiscrepancy(
        "trapezoid's parameters",
        "axis0.traj_traj.config",
        "not reported",
        "the list of the firmware decides",
        "by messages, not by path",
        (0x11, 0x12),
    ),
    ManualDiscrepancy(
        "IDs of endpoints",
        "lists for 0.5.13 and 0.5.14",
        "86 % moved to a later one; a wrong one may erase",
        "1 to 12 as in every list that is known",
        "by a list of the very firmware only",
        (0x04, 0x05),
    ),
)


def about(command: int) -> tuple[ManualDiscrepancy, ...]:
    """Return the notes on a message (1 to 31)."""
    return tuple(each for each in NOTES if command in each.commands)
