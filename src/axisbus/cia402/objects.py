"""The objects of CiA 402: their indices by name, and all objects that act at once when written."""

from __future__ import annotations

from axisbus.cia301 import objects as c301
from axisbus.cia402.axes import first_axis

ABORT_CONNECTION_OPTION = 0x6007
ERROR_CODE = 0x603F
CONTROLWORD = 0x6040
STATUSWORD = 0x6041
QUICK_STOP_OPTION = 0x605A
SHUTDOWN_OPTION = 0x605B
DISABLE_OPERATION_OPTION = 0x605C
HALT_OPTION = 0x605D
FAULT_REACTION_OPTION = 0x605E
MODES_OF_OPERATION = 0x6060
MODES_OF_OPERATION_DISPLAY = 0x6061
POSITION_DEMAND = 0x6062
POSITION_ACTUAL = 0x6064
FOLLOWING_ERROR_WINDOW = 0x6065
FOLLOWING_ERROR_TIME_OUT = 0x6066
POSITION_WINDOW = 0x6067
POSITION_WINDOW_TIME = 0x6068
VELOCITY_DEMAND = 0x606B
VELOCITY_ACTUAL = 0x606C
VELOCITY_WINDOW = 0x606D
VELOCITY_WINDOW_TIME = 0x606E
VELOCITY_THRESHOLD = 0x606F
VELOCITY_THRESHOLD_TIME = 0x6070
TARGET_TORQUE = 0x6071
MAX_TORQUE = 0x6072
TORQUE_DEMAND = 0x6074
RATED_CURRENT = 0x6075
RATED_TORQUE = 0x6076
TORQUE_ACTUAL = 0x6077
TARGET_POSITION = 0x607A
POSITION_RANGE_LIMIT = 0x607B
HOME_OFFSET = 0x607C
SOFTWARE_POSITION_LIMIT = 0x607D
POLARITY = 0x607E
MAX_PROFILE_VELOCITY = 0x607F
MAX_MOTOR_SPEED = 0x6080
PROFILE_VELOCITY = 0x6081
END_VELOCITY = 0x6082
PROFILE_ACCELERATION = 0x6083
PROFILE_DECELERATION = 0x6084
QUICK_STOP_DECELERATION = 0x6085
MOTION_PROFILE_TYPE = 0x6086
PROFILE_JERK = 0x60A4
TORQUE_SLOPE = 0x6087
VELOCITY_NOTATION = 0x608B
VELOCITY_DIMENSION = 0x608C
ACCELERATION_NOTATION = 0x608D
ACCELERATION_DIMENSION = 0x608E
ENCODER_RESOLUTION = 0x608F
VELOCITY_ENCODER_RESOLUTION = 0x6090
GEAR_RATIO = 0x6091
FEED_CONSTANT = 0x6092
VELOCITY_FACTOR = 0x6096
HOMING_METHOD = 0x6098
HOMING_SPEEDS = 0x6099
HOMING_ACCELERATION = 0x609A
SI_UNIT_POSITION = 0x60A8
SI_UNIT_VELOCITY = 0x60A9
SI_UNIT_ACCELERATION = 0x60AA
POSITION_OFFSET = 0x60B0
VELOCITY_OFFSET = 0x60B1
TORQUE_OFFSET = 0x60B2
TOUCH_PROBE_FUNCTION = 0x60B8
TOUCH_PROBE_STATUS = 0x60B9
INTERPOLATION_SUB_MODE = 0x60C0
INTERPOLATION_DATA = 0x60C1
INTERPOLATION_TIME_PERIOD = 0x60C2
MAX_ACCELERATION = 0x60C5
MAX_DECELERATION = 0x60C6
POSITIONING_OPTION = 0x60F2
FOLLOWING_ERROR_ACTUAL = 0x60F4
DIGITAL_INPUTS = 0x60FD
TARGET_VELOCITY = 0x60FF
SUPPORTED_DRIVE_MODES = 0x6502

# Low word of the device type 1000h of a drive.
PROFILE_NUMBER = 402

# First-axis objects that make a drive move, permit it to move, or release its load: the controlword, modes, targets and offsets of
# every mode, and the digital outputs, which release brakes (CiA 402-2).
MOVING = frozenset(
    {
        *(CONTROLWORD, MODES_OF_OPERATION, TARGET_TORQUE, TARGET_POSITION, TARGET_VELOCITY),
        *(POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET, 0x6042, 0x60C1, 0x60FE),
    }
)

_COMMANDED = "it commands the drive: it could energise or move it, or let its load go"

# Communication objects -> effect of writing them (CiA 301 7.5.2, CiA 302-2, -3).
_COMMUNICATION: tuple[tuple[range, str], ...] = (
    (range(c301.PREDEFINED_ERROR_FIELD, c301.PREDEFINED_ERROR_FIELD + 1), "it clears the error history"),
    (range(c301.STORE_PARAMETERS, c301.STORE_PARAMETERS + 1), "it stores parameters"),
    (range(c301.RESTORE_DEFAULTS, c301.RESTORE_DEFAULTS + 1), "it restores the factory's parameters"),
    (range(0x1013, 0x1014), "it sets the clock"),
    (range(0x1023, 0x1027), "it is a command to the device's operating system"),
    (range(0x1F50, 0x1F60), "it loads, starts or stops the device's program"),
    (range(0x1F82, 0x1F84), "it commands other nodes"),
)


def order(index: int) -> str:
    """Return the immediate effect of writing an object of any axis as text; empty for a setting.

    Objects with an immediate effect cannot be configured, backed up or restored.
    """
    if first_axis(index) in MOVING:
        return _COMMANDED
    return next((what for indices, what in _COMMUNICATION if index in indices), "")
