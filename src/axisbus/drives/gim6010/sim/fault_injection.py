"""Fault settings of a simulated module, and behaviour on which owners' reports differ; may be changed at any time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class ModuleFaults:
    """Fault settings of one module; the defaults are the manual's, or two owners' measurements if these differ.

    ``dead``: neither sends nor receives. ``blocked``: the rotor is held. ``bus_voltage`` in V, ``temperature`` of the drive board
    in °C. ``line_bitrate``: bit rate of the wire in bit/s; a module with another ``baud_rate`` neither sends nor receives (None:
    any fits).

    ``endpoints``: RxSdo is executed and answered; many modules do neither. ``endpoint_answer``: command of the answer, 0x04 or
    0x05. ``protocol_by_usb``: ``can.config.protocol`` cannot be written over CAN. ``protocol_at_once``: it takes effect when it is
    written, otherwise with the restart after it was saved. ``restart_time`` in s: duration of silence during a restart.

    ``get_error_answered``: Get_Error with its type byte is answered. ``dead_in_idle``: 0x09 contains 0 except in closed loop.
    ``shadow_offset``: counts between Shadow_Count and the position. ``branch``: deviation of the position in rotor turns after
    every other restart. ``done_bit``: bit of *trajectory done* in the heartbeat of 0.5.11, 7 by the manual, 3 by owners.
    ``flags_inverted``: a 1 in the heartbeat's flags means no fault. ``heartbeat_stops``, ``estimates_stop``: none are sent.

    ``runaway_after``: seconds without a set-point, in input mode 1 with ``break_timeout`` 0, after which the motor accelerates to
    the highest negative speed (None: it holds). ``watchdog_works``: None: as in the firmware; 0.6.0 and later have none.
    ``break_when_zero``: seconds that a ``break_timeout`` of 0 means; 0: off.

    ``calibration_time``: factor on the durations of the calibrations. ``calibration_motor_error`` and
    ``calibration_encoder_error``: error bits with which the motor's or encoder's calibration ends. ``calibration_one_way``: the
    rotor turns forward and not back.

    ``encoder_error`` and ``motor_error``: error bits that appear and persist. ``encoder_frozen``: the position does not change any
    more. ``wont_start``: a request for closed loop is ignored.
    """

    dead: bool = False
    blocked: bool = False
    bus_voltage: float = 24.0
    temperature: float = 30.0
    line_bitrate: int | None = None
    endpoints: bool = True
    endpoint_answer: int = 0x04
    protocol_by_usb: bool = False
    protocol_at_once: bool = False
    restart_time: float = 1.5
    get_error_answered: bool = True
    dead_in_idle: bool = True
    shadow_offset: int = 5000
    branch: float = 0.0
    done_bit: int = 7
    flags_inverted: bool = False
    heartbeat_stops: bool = False
    estimates_stop: bool = False
    runaway_after: float | None = 0.5
    watchdog_works: bool | None = None
    break_when_zero: float = 0.0
    calibration_time: float = 1.0
    calibration_motor_error: int = 0
    calibration_encoder_error: int = 0
    calibration_one_way: bool = False
    encoder_error: int = 0
    motor_error: int = 0
    encoder_frozen: bool = False
    wont_start: bool = False
