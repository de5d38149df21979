"""Numbers of CAN Simple as printed in the manual: commands, states, modes, the bits of the error words, and firmware versions.

Copied for the simulation alone (manual 4.1.2, 5.7); the master's encoding is tested against these.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

COMMANDS_PER_NODE = 0x20
MOST_NODE_ID = 63


class Command(IntEnum):
    """``cmd_id``, the low five bits of an identifier."""

    HEARTBEAT = 0x01
    ESTOP = 0x02
    GET_ERROR = 0x03
    RX_SDO = 0x04
    TX_SDO = 0x05
    SET_AXIS_NODE_ID = 0x06
    SET_AXIS_STATE = 0x07
    MIT_CONTROL = 0x08
    GET_ENCODER_ESTIMATES = 0x09
    GET_ENCODER_COUNT = 0x0A
    SET_CONTROLLER_MODE = 0x0B
    SET_INPUT_POS = 0x0C
    SET_INPUT_VEL = 0x0D
    SET_INPUT_TORQUE = 0x0E
    SET_LIMITS = 0x0F
    START_ANTICOGGING = 0x10
    SET_TRAJ_VEL_LIMIT = 0x11
    SET_TRAJ_ACCEL_LIMITS = 0x12
    SET_TRAJ_INERTIA = 0x13
    GET_IQ = 0x14
    REBOOT = 0x16
    GET_BUS_VOLTAGE_CURRENT = 0x17
    CLEAR_ERRORS = 0x18
    SET_LINEAR_COUNT = 0x19
    SET_POS_GAIN = 0x1A
    SET_VEL_GAINS = 0x1B
    GET_TORQUES = 0x1C
    GET_POWERS = 0x1D
    DISABLE_CAN = 0x1E
    SAVE_CONFIGURATION = 0x1F


class AxisState(IntEnum):
    """``axis0.current_state``."""

    UNDEFINED = 0
    IDLE = 1
    FULL_CALIBRATION = 3
    MOTOR_CALIBRATION = 4
    ENCODER_CALIBRATION = 7
    CLOSED_LOOP = 8


class ControlMode(IntEnum):
    """``controller.config.control_mode``."""

    VOLTAGE = 0
    TORQUE = 1
    VELOCITY = 2
    POSITION = 3


class InputMode(IntEnum):
    """``controller.config.input_mode``."""

    INACTIVE = 0
    PASSTHROUGH = 1
    VELOCITY_RAMP = 2
    POSITION_FILTER = 3
    TRAPEZOID = 5
    TORQUE_RAMP = 6
    MIT = 9


class Protocol(IntEnum):
    """``can.config.protocol``; the value for the 29-bit protocol of firmware 0.6.8 is unknown: 3 is chosen here."""

    CAN_SIMPLE = 1
    CANOPEN = 2
    EXTENDED = 3


class ErrorType(IntEnum):
    """The type byte of Get_Error."""

    MOTOR = 0
    ENCODER = 1
    CONTROLLER = 3
    SYSTEM = 4


class AxisError(IntFlag):
    """``axis0.error``; bit 20 is not in the manual, but was seen by an owner."""

    INVALID_STATE = 0x1
    MOTOR_FAILED = 0x40
    ENCODER_FAILED = 0x100
    CONTROLLER_FAILED = 0x200
    WATCHDOG_TIMER_EXPIRED = 0x800
    ESTOP_REQUESTED = 0x4000
    OVER_TEMP = 0x40000
    CAN_BUS_FAILED = 0x100000


class MotorError(IntFlag):
    """``axis0.motor.error``."""

    PHASE_RESISTANCE_OUT_OF_RANGE = 0x1
    MODULATION_IS_NAN = 0x10000
    FET_THERMISTOR_OVER_TEMP = 0x40000
    SYSTEM_LEVEL = 0x1000000


class EncoderError(IntFlag):
    """``axis0.encoder.error``."""

    CPR_POLEPAIRS_MISMATCH = 0x2
    NO_RESPONSE = 0x4
    ABS_SPI_COM_FAIL = 0x80


class ControllerError(IntFlag):
    """``axis0.controller.error``."""

    OVERSPEED = 0x1
    INVALID_INPUT_MODE = 0x2


class SystemWord(IntFlag):
    """``error`` of the whole module."""

    DC_BUS_UNDER_VOLTAGE = 0x2
    DC_BUS_OVER_VOLTAGE = 0x4


# -- Versions of the firmware, and their differences -------------------------------------------------------------------


class Firmware(NamedTuple):
    """A version; versions compare as numbers."""

    major: int
    minor: int
    revision: int

    @classmethod
    def read(cls, text: str) -> Firmware:
        """Return the version in a text like ``0.5.13``. Raises ValueError: it is not a version of three numbers up to 255."""
        parts = text.split(".")
        if len(parts) != 3 or not all(
            part.isascii() and part.isdigit() and int(part) < 256 for part in parts
        ):
            raise ValueError(text)
        return cls(*(int(part) for part in parts))

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.revision}"


OLD_HEARTBEAT = Firmware(0, 5, 11)  # last version with flags in three bytes (manual 4.1.2)
SYSTEM_FLAG = Firmware(0, 5, 13)  # first version whose heartbeat has the system error flag
# First version with the ranges of MIT as parameters, and no effect of the watchdog.
MIT_RANGES = Firmware(0, 6, 0)
EXTENDED = Firmware(0, 6, 8)  # first version seen with the 29-bit protocol
FACTORY = Firmware(0, 5, 13)
