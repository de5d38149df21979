"""Contradictions between the manual, owners and the maker's programs: each statement, and the data accepted and sent."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ManualDiscrepancy:
    """One contradiction, as text for the user; ``commands`` are the messages concerned (empty: the whole module)."""

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
        "15h is not a command",
        "15h is never sent",
    ),
    ManualDiscrepancy(
        "length",
        "8 data bytes in every frame",
        "answers with fewer bytes, or padded",
        "any length that contains the fields",
        "8 bytes, padded with 0",
    ),
    ManualDiscrepancy(
        "request for a message",
        "not described",
        "remote frames for 09h, 0Ah, 14h, 17h; the manufacturer's program sends 8 bytes of 0",
        "8 bytes of 0 may be a request or an answer",
        "a remote frame, or 8 bytes of 0",
        (0x09, 0x0A, 0x14, 0x17),
    ),
    ManualDiscrepancy(
        "Get_Error",
        "the request contains a type",
        "no answer to a remote frame or an empty frame; 8 bytes were not tried",
        "4 or 8 bytes; the answer does not contain its type",
        "8 bytes, one request at a time",
        (0x03,),
    ),
    ManualDiscrepancy(
        "direction of RxSdo",
        "overview: from the module; detailed description: to the module",
        "to the module",
        "both",
        "to the module",
        (0x04,),
    ),
    ManualDiscrepancy(
        "identifier of the answers of endpoints",
        'RxSdo reads; TxSdo is "as RxSdo when it writes"',
        "the manufacturer's program writes on 05h and takes answers on 04h; owners got no answer at all",
        "answers on 04h and on 05h",
        "requests on 04h only",
        (0x04, 0x05),
    ),
    ManualDiscrepancy(
        "heartbeat, trajectory done",
        "first layout: bit 7 of byte 7",
        "bit 3 of byte 7",
        "either bit; unknown if the possible layouts disagree",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "heartbeat, flag of 1",
        'first layout: 1 is a fault; later layouts: "whether the error is 0"',
        "two owners: 1 is a fault; one owner: 1 is no error",
        "1 is a fault",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "heartbeat, byte 6",
        "reserved",
        "a temperature, on a sibling module",
        "any value",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "position in idle",
        "not described",
        "09h is 0 or invalid until the module has been in closed-loop control; 0Ah is valid",
        "the value as received; its user must check the state",
        "nothing",
        (0x09, 0x0A),
    ),
    ManualDiscrepancy(
        "shadow count",
        "the encoder's multi-turn count",
        "cannot be converted to turns; Count_In_Cpr/16384 is a fraction of a rotor turn",
        "both values as received",
        "nothing",
        (0x0A,),
    ),
    ManualDiscrepancy(
        "torque of Set_Input_Vel", "float32 in 4.1.2", "float32", "float32", "float32", (0x0D,)
    ),
    ManualDiscrepancy(
        "highest current",
        "50 A in 3.1.3, 100 A in 3.1.8",
        "factory settings of 45 A and 60 A",
        "the value as received",
        "at most 50 A",
        (0x0F,),
    ),
    ManualDiscrepancy(
        "torque constant",
        "0.47 N·m/A in 1.2, about 0.67 in 3.1.3 and 3.1.7",
        "0.097 N·m/A, read from five modules",
        "torques as the module reports them",
        "torques as requested: the real torque depends on the module's setting",
        (0x0D, 0x0E, 0x1C),
    ),
    ManualDiscrepancy(
        "node ID at delivery",
        "0",
        "0 or 1; 0 to 11 on twelve modules",
        "0 to 63",
        "0 to 63",
        (0x06,),
    ),
    ManualDiscrepancy(
        "MIT, range",
        "±12.5 rad, ±65 rad/s, 500, 5, ±50 N·m",
        "from firmware 0.6.0 on, five parameters mit_max_* change it",
        "values by the ranges that the program gives",
        "values by the ranges that the program gives",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, beyond the range",
        "not described",
        "the firmware wraps: +12.625 rad becomes -12.376 rad; feedback wraps too",
        "values at an end of the range are named; a wrapped value cannot be recognised",
        "the value limited to the range, and the change is reported",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, all bytes 0",
        "not described",
        "full negative torque",
        "as a command, in a recording",
        "never",
        (0x08,),
    ),
    ManualDiscrepancy(
        "MIT, gains",
        "N·m per turn for USB, no unit for CAN",
        "applied to turns of the rotor, unscaled (read in the code of another joint module)",
        "in the units of the firmware",
        "as requested",
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
        "one owner reads MISSING_INPUT, from the table of another manufacturer",
        "MOTOR_FAILED",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "axis error, bit 20",
        "not listed",
        "CAN_BUS_FAILED, latched (on another joint module of the manufacturer)",
        "CAN_BUS_FAILED",
        "nothing",
        (0x01,),
    ),
    ManualDiscrepancy(
        "break_timeout",
        "not listed",
        "0 is off; older firmware took 0 as 100 ms; any other value arms it at once",
        "the value as received",
        "only if the user names it",
    ),
    ManualDiscrepancy(
        "watchdog_timeout",
        "not listed",
        "the manufacturer: no effect in new firmware",
        "the value as received",
        "only on request; do not rely on it",
    ),
    ManualDiscrepancy(
        "parameters of the trapezoid",
        "axis0.traj_traj.config",
        "not reported",
        "the names in the endpoint list of the firmware",
        "messages, not parameters by name",
        (0x11, 0x12),
    ),
    ManualDiscrepancy(
        "numbers of endpoints",
        "lists for 0.5.13 and 0.5.14",
        "86 % of them differ in a later version; a wrong number may erase the module",
        "1 to 12 as in every known list",
        "other numbers only from the endpoint list of exactly this firmware",
        (0x04, 0x05),
    ),
)


def about(command: int) -> tuple[ManualDiscrepancy, ...]:
    """Return the notes on a message (1 to 31)."""
    return tuple(each for each in NOTES if command in each.commands)
