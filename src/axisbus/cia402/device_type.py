"""The device type 1000h as text: the device profile, and the kind of a drive (CiA 301 7.5.2.1, CiA 402-1)."""

from __future__ import annotations

from axisbus.cia301.objects import DEVICE_PROFILES
from axisbus.cia402.objects import PROFILE_NUMBER

# Bits 16 to 18 of 1000h of a drive; one may set several.
DRIVES = {16: "frequency converter", 17: "servo drive", 18: "stepper drive"}
_MULTIPLE = 0xFFFF  # the high word: several logical devices, each with its own at 67FFh + n * 800h


def device_kind(device_type: int | None) -> str:
    """Return the device type 1000h as text, such as ``servo drive (CiA 402)``; empty if it is unknown.

    A profile without a name here is a ``device`` with its number.
    """
    if device_type is None:
        return ""
    profile = device_type & 0xFFFF
    if profile == 0:
        return DEVICE_PROFILES[0]
    kind = DEVICE_PROFILES.get(profile, "device")
    if profile == PROFILE_NUMBER and device_type >> 16 == _MULTIPLE:
        kind = "drive with several axes"
    elif profile == PROFILE_NUMBER:
        kind = " and ".join(text for bit, text in DRIVES.items() if device_type >> bit & 1) or kind
    return f"{kind} (CiA {profile})"
