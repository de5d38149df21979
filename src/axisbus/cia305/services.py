"""Layer setting services (CiA 305): services, frames, bit rates and error codes as tables."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from enum import IntEnum

from axisbus.errors import ArgumentError

UNCONFIGURED = 255  # the node-ID of a slave that has none
ALL_BITS = 0x80  # BitCheck of the first request of fast scan, which every slave without a node-ID answers
MAKERS_OWN = 255  # error code: the next byte is a manufacturer-specific error
STANDARD_TABLE = 0  # table selector of the bit timings below
LONGEST_DELAY = 65.535  # s, of activate bit timing


class LssService(IntEnum):
    """Command specifiers of both directions, the first byte of every frame (an answer mostly repeats that of its request)."""

    SWITCH_STATE_GLOBAL = 0x04
    CONFIGURE_NODE_ID = 0x11
    CONFIGURE_BIT_TIMING = 0x13
    ACTIVATE_BIT_TIMING = 0x15
    STORE_CONFIGURATION = 0x17
    SWITCH_STATE_SELECTIVE_VENDOR_ID = 0x40
    SWITCH_STATE_SELECTIVE_PRODUCT_CODE = 0x41
    SWITCH_STATE_SELECTIVE_REVISION_NUMBER = 0x42
    SWITCH_STATE_SELECTIVE_SERIAL_NUMBER = 0x43
    SWITCH_STATE_SELECTIVE = 0x44
    IDENTIFY_REMOTE_SLAVE_VENDOR_ID = 0x46
    IDENTIFY_REMOTE_SLAVE_PRODUCT_CODE = 0x47
    IDENTIFY_REMOTE_SLAVE_REVISION_NUMBER_LOW = 0x48
    IDENTIFY_REMOTE_SLAVE_REVISION_NUMBER_HIGH = 0x49
    IDENTIFY_REMOTE_SLAVE_SERIAL_NUMBER_LOW = 0x4A
    IDENTIFY_REMOTE_SLAVE_SERIAL_NUMBER_HIGH = 0x4B
    IDENTIFY_NON_CONFIGURED_REMOTE_SLAVE = 0x4C
    IDENTIFY_SLAVE = 0x4F
    IDENTIFY_NON_CONFIGURED_SLAVE = 0x50
    FASTSCAN = 0x51
    INQUIRE_VENDOR_ID = 0x5A
    INQUIRE_PRODUCT_CODE = 0x5B
    INQUIRE_REVISION_NUMBER = 0x5C
    INQUIRE_SERIAL_NUMBER = 0x5D
    INQUIRE_NODE_ID = 0x5E

    @property
    def text(self) -> str:
        """The standard's name, such as ``configure node-ID``."""
        return self.name.lower().replace("_", " ").replace(" id", "-ID")


class LssState(IntEnum):
    """State requested by *switch state global*."""

    WAITING = 0
    CONFIGURATION = 1


# Answer to each request; requests that are not listed have no answer.
ANSWERS: dict[LssService, LssService] = {
    LssService.SWITCH_STATE_SELECTIVE_SERIAL_NUMBER: LssService.SWITCH_STATE_SELECTIVE,
    LssService.IDENTIFY_REMOTE_SLAVE_SERIAL_NUMBER_HIGH: LssService.IDENTIFY_SLAVE,
    LssService.IDENTIFY_NON_CONFIGURED_REMOTE_SLAVE: LssService.IDENTIFY_NON_CONFIGURED_SLAVE,
    LssService.FASTSCAN: LssService.IDENTIFY_SLAVE,
    **{
        service: service
        for service in (
            LssService.CONFIGURE_NODE_ID,
            LssService.CONFIGURE_BIT_TIMING,
            LssService.STORE_CONFIGURATION,
            LssService.INQUIRE_VENDOR_ID,
            LssService.INQUIRE_PRODUCT_CODE,
            LssService.INQUIRE_REVISION_NUMBER,
            LssService.INQUIRE_SERIAL_NUMBER,
            LssService.INQUIRE_NODE_ID,
        )
    },
}

# The parts of an LSS address in the order in which fast scan numbers them (LSSSub 0 to 3).
INQUIRIES = (
    LssService.INQUIRE_VENDOR_ID,
    LssService.INQUIRE_PRODUCT_CODE,
    LssService.INQUIRE_REVISION_NUMBER,
    LssService.INQUIRE_SERIAL_NUMBER,
)
SELECTIVE = (
    LssService.SWITCH_STATE_SELECTIVE_VENDOR_ID,
    LssService.SWITCH_STATE_SELECTIVE_PRODUCT_CODE,
    LssService.SWITCH_STATE_SELECTIVE_REVISION_NUMBER,
    LssService.SWITCH_STATE_SELECTIVE_SERIAL_NUMBER,
)
IDENTIFY = (
    LssService.IDENTIFY_REMOTE_SLAVE_VENDOR_ID,
    LssService.IDENTIFY_REMOTE_SLAVE_PRODUCT_CODE,
    LssService.IDENTIFY_REMOTE_SLAVE_REVISION_NUMBER_LOW,
    LssService.IDENTIFY_REMOTE_SLAVE_REVISION_NUMBER_HIGH,
    LssService.IDENTIFY_REMOTE_SLAVE_SERIAL_NUMBER_LOW,
    LssService.IDENTIFY_REMOTE_SLAVE_SERIAL_NUMBER_HIGH,
)

AUTOMATIC_RATE = 9  # index in the table of bit timings: the slave detects the rate automatically
# Index in the standard's table of bit timings, by bit/s (index 5, once 100 kbit/s, is reserved).
BIT_TIMINGS: dict[int, int] = {
    1_000_000: 0,
    800_000: 1,
    500_000: 2,
    250_000: 3,
    125_000: 4,
    50_000: 6,
    20_000: 7,
    10_000: 8,
}

# Meaning of an error code, and first remedy.
REFUSALS: dict[LssService, dict[int, tuple[str, str]]] = {
    LssService.CONFIGURE_NODE_ID: {1: ("the node-ID is out of range", "give a node-ID from 1 to 127")},
    LssService.CONFIGURE_BIT_TIMING: {
        1: ("the slave does not support this bit rate", "choose a rate that its EDS lists under [DeviceInfo]")
    },
    LssService.STORE_CONFIGURATION: {
        1: (
            "the slave cannot store its configuration",
            "set it again after every power-up, or set it by the device's switches or its own tool",
        ),
        2: (
            "the slave could not write to its memory",
            "try again; if it persists, its memory is worn or locked",
        ),
    },
}


@dataclass(frozen=True, slots=True, order=True)
class LssAddress:
    """The four 32-bit numbers of the identity object 1018h, which identify one slave among all devices."""

    vendor_id: int
    product_code: int
    revision_number: int
    serial_number: int

    def __post_init__(self) -> None:
        """Check the range of each number.

        Raises:
            ArgumentError: one does not fit 32 bits.
        """
        for name, value in zip(PARTS, astuple(self), strict=True):
            if not 0 <= value <= 0xFFFF_FFFF:
                raise ArgumentError(f"the {name} {value} of an LSS address is not a number of 32 bits")

    @property
    def parts(self) -> tuple[int, int, int, int]:
        """The four numbers in the order of the standard."""
        return self.vendor_id, self.product_code, self.revision_number, self.serial_number

    def __str__(self) -> str:
        return " ".join(f"0x{part:X}" for part in self.parts)


PARTS = ("vendor-ID", "product code", "revision number", "serial number")


def switch_global(state: LssState) -> bytes:
    """Return the frame that switches every slave to *waiting* or *configuration*; it has no answer."""
    return _frame(LssService.SWITCH_STATE_GLOBAL, bytes((state,)))


def switch_selective(address: LssAddress) -> tuple[bytes, ...]:
    """Return the four frames that switch one slave from *waiting* to *configuration*; the slave answers the last."""
    return tuple(_number(service, part) for service, part in zip(SELECTIVE, address.parts, strict=True))


def identify_remote(low: LssAddress, high: LssAddress) -> tuple[bytes, ...]:
    """Return the six frames that ask for slaves with this vendor-ID and product code, and revision and serial in these ranges.

    All matching slaves answer the last frame, in either state.
    """
    numbers = (*low.parts[:3], high.revision_number, low.serial_number, high.serial_number)
    return tuple(_number(service, number) for service, number in zip(IDENTIFY, numbers, strict=True))


def identify_non_configured() -> bytes:
    """Return the frame that asks whether any slave has no node-ID."""
    return _frame(LssService.IDENTIFY_NON_CONFIGURED_REMOTE_SLAVE)


def fastscan(id_number: int, bit_check: int, lss_sub: int, lss_next: int) -> bytes:
    """Return the frame that asks whether a slave's part ``lss_sub`` agrees with ``id_number`` from bit 31 down to ``bit_check``."""
    data = id_number.to_bytes(4, "little") + bytes((bit_check, lss_sub, lss_next))
    return _frame(LssService.FASTSCAN, data)


def inquire(service: LssService) -> bytes:
    """Return the frame that asks the slave in *configuration* for one number of its address, or for its node-ID."""
    return _frame(service)


def configure_node_id(node_id: int) -> bytes:
    """Return the frame that gives the slave in *configuration* a node-ID: 1 to 127, or 255 for none."""
    return _frame(LssService.CONFIGURE_NODE_ID, bytes((node_id,)))


def configure_bit_timing(index: int, table: int = STANDARD_TABLE) -> bytes:
    """Return the frame that sets the bit rate of the slaves in *configuration* after activation."""
    return _frame(LssService.CONFIGURE_BIT_TIMING, bytes((table, index)))


def activate_bit_timing(delay: float) -> bytes:
    """Return the frame that makes slaves in *configuration* change the rate after ``delay`` s and then be silent for ``delay`` s.

    The frame has no answer.
    """
    return _frame(LssService.ACTIVATE_BIT_TIMING, round(delay * 1000).to_bytes(2, "little"))


def store_configuration() -> bytes:
    """Return the frame that makes the slave in *configuration* store node-ID and bit rate in non-volatile memory."""
    return _frame(LssService.STORE_CONFIGURATION)


def number_in(answer: bytes) -> int:
    """Return the 32-bit number in the answer to an inquiry."""
    return int.from_bytes(answer[1:5], "little")


def require_node_id(node_id: int) -> None:
    """Check a node-ID to be assigned.

    Raises:
        ArgumentError: it is neither 1 to 127 nor 255 (none).
    """
    if not 1 <= node_id <= 127 and node_id != UNCONFIGURED:
        raise ArgumentError(
            f"node-ID {node_id} cannot be assigned",
            remedy="give one from 1 to 127 (255 takes the slave's node-ID away)",
        )


def bit_timing_index(bitrate: int) -> int:
    """Return the index of a bit rate (bit/s) in the standard's table.

    Raises:
        ArgumentError: the table has no such rate.
    """
    if bitrate not in BIT_TIMINGS:
        rates = ", ".join(f"{rate:_}" for rate in BIT_TIMINGS)
        raise ArgumentError(f"CiA 305 has no bit rate of {bitrate} bit/s", remedy=f"choose one of {rates}")
    return BIT_TIMINGS[bitrate]


def refusal(service: LssService, code: int, specific: int) -> tuple[str, str]:
    """Return the meaning of an error code and the first remedy; an unknown code is described by its number."""
    if code == MAKERS_OWN:
        return (
            f"manufacturer-specific error {specific} (0x{specific:02X})",
            "see the device's manual for this LSS error",
        )
    known = REFUSALS.get(service, {}).get(code)
    return known or (f"error {code}, which CiA 305 reserves", "see the device's manual for this LSS error")


def _frame(service: LssService, data: bytes = b"") -> bytes:
    return (bytes((service,)) + data).ljust(8, b"\0")


def _number(service: LssService, value: int) -> bytes:
    return _frame(service, value.to_bytes(4, "little"))
