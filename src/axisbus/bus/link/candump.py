"""Parse the output of can-utils' ``candump`` line by line: its log format (-L, -l) and its screen format."""

from __future__ import annotations

import re
from datetime import datetime

from axisbus.cia301.frame import CanFrame

_ERROR_FLAG = 0x2000_0000  # CAN_ERR_FLAG of linux/can.h, in the identifier of an error frame
_MASK = 0x1FFF_FFFF
_STANDARD = 0x7FF

# (1436509052.249713) vcan0 044#2A366C2BBA    optionally followed by a flag R or T, or more
_LOG = re.compile(
    r"\((?P<time>\d{1,20}\.\d{1,20})\)\s+(?P<channel>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?P<data>R\d?|[0-9A-Fa-f.]*)(?:\s.*)?"
)
#  (1436509052.249713)  vcan0  RX - -  123   [3]  11 22 33    time, direction and flags may be missing
_SCREEN = re.compile(
    r"\s*(?:\((?P<time>[\d.]{1,40}|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+)\)\s+)?(?P<channel>\S+)\s+(?:(?:RX|TX)\s+[-B]\s+[-E]\s+)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<count>\d)\]\s*"
    r"(?P<data>remote request|ERRORFRAME|(?:[0-9A-Fa-f]{2}(?:\s|$)\s*)*)"
    r"(?P<rest>.*)"
)


def parse(line: str) -> CanFrame | None:
    """Return the frame of a line; None if it is not a line of ``candump`` with a classic CAN frame.

    Without a time stamp the time is 0. A relative time stamp (-t d, -t z) is returned unchanged.
    """
    found = _LOG.fullmatch(line.strip())
    if found is not None:
        return _frame(found, found["data"].replace(".", ""))
    found = _SCREEN.fullmatch(line.rstrip())
    return None if found is None else _of_screen(found)


def _of_screen(found: re.Match[str]) -> CanFrame | None:
    data, count = found["data"].strip(), int(found["count"])
    digits = "R" if data == "remote request" else "".join(data.split())
    if data == "ERRORFRAME":
        octets = re.match(r"\s*((?:[0-9A-Fa-f]{2}\s*)*)", found["rest"])
        digits = "".join(octets[1].split())[: 2 * count] if octets is not None else ""
        return _frame(found, digits, error=True)
    if digits != "R" and len(digits) != 2 * count:
        return None
    return _frame(found, digits)


def _time(text: str | None) -> float:
    if not text:
        return 0.0
    try:
        return float(text) if "-" not in text else datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError, OSError):  # the last on Windows, before 1970
        return 0.0


def _frame(found: re.Match[str], digits: str, error: bool = False) -> CanFrame | None:
    identifier, time = found["id"], _time(found["time"])
    number = int(identifier, 16)
    remote = digits[:1] == "R"
    if not remote and (len(digits) % 2 or len(digits) > 16):
        return None
    if len(identifier) == 3 and number > _STANDARD:
        return None
    data = b"" if remote else bytes.fromhex(digits)
    error = error or bool(number & _ERROR_FLAG and len(identifier) == 8)
    return CanFrame(
        time, number & _MASK, data, len(identifier) == 8 and not error, remote, error, found["channel"]
    )
