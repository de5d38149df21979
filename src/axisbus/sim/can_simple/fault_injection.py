"""What a stand-in of a module is made to do wrong, or does as some owners saw and others did not; turned at any time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class ModuleDials:
    """Switches of one module; the defaults are the manual's, or what two owners measured where that differs.

    ``dead``: silent and deaf. ``blocked``: the rotor is held. ``bus_voltage`` in V, ``temperature`` of the drive board in °C.
    ``line_bitrate``: of the wire in bit/s; a module with another ``baud_rate`` says and hears nothing (None: any will do).

    ``endpoints``: RxSdo is obeyed and answered; many modules do neither. ``endpoint_answer``: command on which the answer comes,
    0x04 or 0x05. ``protocol_by_usb``: ``can.config.protocol`` cannot be written over CAN. ``protocol_at_once``: it takes effect
    when it is written, else with the restart after it was saved. ``restart_time`` in s: for how long a restart silences it.

    ``get_error_answered``: Get_Error with its type byte has an answer. ``dead_in_idle``: 0x09 says 0 but for closed loop.
    ``shadow_offset``: counts by which Shadow_Count is off the position. ``branch``: rotor turns by which the position is off
    after every other restart. ``done_bit``: of *trajectory done* in the heartbeat of 0.5.11, 7 by the manual, 3 elsewhere.
    ``flags_inverted``: a 1 in the heartbeat's flags means no fault. ``heartbeat_stops``, ``estimates_stop``: it sends none.

    ``runaway_after``: seconds without a set-point, in input mode 1 with ``break_timeout`` 0, after which it runs off to the highest
    negative speed (None: it holds). ``watchdog_works``: None asks the firmware, where 0.6.0 and later have none.
    ``break_when_zero``: seconds that a ``break_timeout`` of 0 means; 0: off.

    ``calibration_time``: by what its calibrations last longer than some seconds. ``calibration_motor_error`` and
    ``calibration_encoder_error``: bits with which that of the motor or encoder ends. ``calibration_one_way``: the rotor turns
    forward and does not come back.

    ``encoder_error`` and ``motor_error``: bits that appear and persist. ``encoder_frozen``: the position no longer changes.
    ``wont_start``: closed loop is refused in silence.
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
