"""The communication objects of CiA 301: their indices by name."""

from __future__ import annotations

DEVICE_TYPE = 0x1000
ERROR_REGISTER = 0x1001
PREDEFINED_ERROR_FIELD = 0x1003
COB_ID_SYNC = 0x1005
CYCLE_PERIOD = 0x1006
SYNC_WINDOW = 0x1007
DEVICE_NAME = 0x1008
HARDWARE_VERSION = 0x1009
SOFTWARE_VERSION = 0x100A
GUARD_TIME = 0x100C
LIFE_TIME_FACTOR = 0x100D
STORE_PARAMETERS = 0x1010
RESTORE_DEFAULTS = 0x1011
COB_ID_TIME = 0x1012
COB_ID_EMCY = 0x1014
CONSUMER_HEARTBEAT = 0x1016
PRODUCER_HEARTBEAT = 0x1017
IDENTITY = 0x1018
SYNC_COUNTER_OVERFLOW = 0x1019
VERIFY_CONFIGURATION = 0x1020
ERROR_BEHAVIOR = 0x1029
SDO_SERVER = 0x1200  # 1200h is the predefined channel, 1201h to 127Fh are additional ones
SDO_CLIENT = 0x1280
RPDO_COMMUNICATION = 0x1400
RPDO_MAPPING = 0x1600
TPDO_COMMUNICATION = 0x1800
TPDO_MAPPING = 0x1A00
PROGRAM_DATA = 0x1F50  # this one and those below: CiA 302-3, one sub-index for each program, counted from 1
PROGRAM_CONTROL = 0x1F51
VERIFY_SOFTWARE = 0x1F52  # date in sub-index 1, time in 2
PROGRAM_IDENTIFICATION = 0x1F56
FLASH_STATUS = 0x1F57

# Sub-indices of 1018h.
VENDOR_ID, PRODUCT_CODE, REVISION_NUMBER, SERIAL_NUMBER = 1, 2, 3, 4

# Sub-indices of 14xxh and 18xxh.
PDO_COB_ID, PDO_TRANSMISSION_TYPE, PDO_INHIBIT_TIME, PDO_EVENT_TIMER, PDO_SYNC_START = 1, 2, 3, 5, 6

# Device profiles by the low word of 1000h (CiA 301 7.5.2.1).
DEVICE_PROFILES = {
    0: "no standard profile",
    401: "I/O module",
    402: "drive",
    404: "measuring device",
    405: "programmable controller",
    406: "encoder",
    408: "hydraulic drive",
    410: "inclinometer",
    418: "battery",
    419: "charger",
}


# Parameters of one kind, such as 1400h to 15FFh: the maximum number of PDOs of one direction.
PDOS_OF_A_KIND = 0x200


def is_pdo_parameter(index: int) -> bool:
    """Whether an object is a communication or mapping parameter of a PDO."""
    return RPDO_COMMUNICATION <= index < TPDO_MAPPING + PDOS_OF_A_KIND


def is_pdo_mapping(index: int) -> bool:
    """Whether an object is the mapping parameter of a PDO, whose sub-indices above 0 name the mapped objects."""
    return any(first <= index < first + PDOS_OF_A_KIND for first in (RPDO_MAPPING, TPDO_MAPPING))


def is_pdo_communication(index: int) -> bool:
    """Whether an object is the communication parameter of a PDO."""
    return any(first <= index < first + PDOS_OF_A_KIND for first in (RPDO_COMMUNICATION, TPDO_COMMUNICATION))


def pdo_of(index: int) -> int | None:
    """Return the communication parameter of the PDO to which an object belongs, None if it belongs to no PDO."""
    mapped = index - RPDO_MAPPING + RPDO_COMMUNICATION
    return next((first for first in (index, mapped) if is_pdo_communication(first)), None)
