"""Parameters of one axis, read from its objects once and kept up to date as attributes by write hooks."""

from __future__ import annotations

from axisbus.sim.control_bits import as_int8, as_int16, as_int32
from axisbus.sim.dictionary import Dictionary

_OFF = 0xFFFF_FFFF
AXIS_SPAN = 0x800

# Attribute: (index, sub-index, value if the object does not exist).
OBJECTS: dict[str, tuple[int, int, int]] = {
    "abort_connection_option": (0x6007, 0, 1),
    "quick_stop_option": (0x605A, 0, 2),
    "shutdown_option": (0x605B, 0, 0),
    "disable_option": (0x605C, 0, 1),
    "halt_option": (0x605D, 0, 1),
    "fault_option": (0x605E, 0, 2),
    "following_window": (0x6065, 0, _OFF),
    "following_time": (0x6066, 0, 0),
    "position_window": (0x6067, 0, 0),
    "position_window_time": (0x6068, 0, 0),
    "velocity_window": (0x606D, 0, 0),
    "velocity_window_time": (0x606E, 0, 0),
    "velocity_threshold": (0x606F, 0, 0),
    "velocity_threshold_time": (0x6070, 0, 0),
    "max_torque": (0x6072, 0, 0),
    "home_offset": (0x607C, 0, 0),
    "low_limit": (0x607D, 1, 0),
    "high_limit": (0x607D, 2, 0),
    "polarity": (0x607E, 0, 0),
    "max_profile_velocity": (0x607F, 0, 0),
    "max_motor_speed": (0x6080, 0, 0),
    "profile_velocity": (0x6081, 0, 0),
    "end_velocity": (0x6082, 0, 0),
    "profile_acceleration": (0x6083, 0, 0),
    "profile_deceleration": (0x6084, 0, 0),
    "quick_stop_deceleration": (0x6085, 0, 0),
    "motion_profile_type": (0x6086, 0, 0),
    "torque_slope": (0x6087, 0, -1),
    "encoder_increments": (0x608F, 1, 0),
    "encoder_revolutions": (0x608F, 2, 0),
    "homing_method": (0x6098, 0, 0),
    "homing_speed_switch": (0x6099, 1, 0),
    "homing_speed_zero": (0x6099, 2, 0),
    "homing_acceleration": (0x609A, 0, -1),
    "profile_jerk": (0x60A4, 1, 0),
    "position_offset": (0x60B0, 0, 0),
    "velocity_offset": (0x60B1, 0, 0),
    "torque_offset": (0x60B2, 0, 0),
    "interpolation_target": (0x60C1, 1, 0),
    "interpolation_value": (0x60C2, 1, 0),
    "interpolation_index": (0x60C2, 2, -3),
    "max_acceleration": (0x60C5, 0, 0),
    "max_deceleration": (0x60C6, 0, 0),
    "positive_torque_limit": (0x60E0, 0, 0),
    "negative_torque_limit": (0x60E1, 0, 0),
    "positioning_option": (0x60F2, 0, 0),
}
# Defaults of CiA 402-2, used if a file has the object but no value for it.
STANDARD_DEFAULTS: dict[tuple[int, int], int] = {
    (0x6007, 0): 1,
    (0x605A, 0): 2,
    (0x605B, 0): 0,
    (0x605C, 0): 1,
    (0x605D, 0): 1,
    (0x605E, 0): 2,
    (0x6065, 0): _OFF,
    (0x6072, 0): 1000,
    (0x60C2, 1): 1,
    (0x60C2, 2): -3,
}
# Signed in the standard, regardless of the file; with the size in the standard.
_SIGNED = {
    **dict.fromkeys((0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007, 0x60B2), as_int16),
    **dict.fromkeys((0x607C, 0x607D, 0x60B0, 0x60B1), as_int32),
    0x6098: as_int8,
}
_SIGNED_SUBS = {(0x60C1, 1): as_int32, (0x60C2, 2): as_int8}


class Settings:
    """The attributes named in ``OBJECTS``, always equal to the dictionary's values of one axis."""

    quick_stop_option: int
    shutdown_option: int
    disable_option: int
    halt_option: int
    fault_option: int
    abort_connection_option: int
    following_window: int
    following_time: int
    position_window: int
    position_window_time: int
    velocity_window: int
    velocity_window_time: int
    velocity_threshold: int
    velocity_threshold_time: int
    max_torque: int
    home_offset: int
    low_limit: int
    high_limit: int
    polarity: int
    max_profile_velocity: int
    max_motor_speed: int
    profile_velocity: int
    end_velocity: int
    profile_acceleration: int
    profile_deceleration: int
    quick_stop_deceleration: int
    motion_profile_type: int
    torque_slope: int
    encoder_increments: int
    encoder_revolutions: int
    homing_method: int
    homing_speed_switch: int
    homing_speed_zero: int
    homing_acceleration: int
    profile_jerk: int
    position_offset: int
    velocity_offset: int
    torque_offset: int
    interpolation_target: int
    interpolation_value: int
    interpolation_index: int
    max_acceleration: int
    max_deceleration: int
    positive_torque_limit: int
    negative_torque_limit: int
    positioning_option: int

    __slots__ = (*OBJECTS, "changes")

    def __init__(self, dictionary: Dictionary, axis: int) -> None:
        """Read the objects of ``axis`` (from 0) and follow their writes; ``changes`` counts the writes."""
        self.changes = 0
        offset = axis * AXIS_SPAN
        for (index, subindex), value in STANDARD_DEFAULTS.items():
            dictionary.give_default(index + offset, subindex, value)
        for name, (index, subindex, absent) in OBJECTS.items():
            key = object_key(dictionary, index + offset, subindex)
            self._set(name, index, subindex, dictionary.get_int(key >> 8, key & 0xFF, absent))
            dictionary.on_write(key, self._hook(name, index, subindex))

    def _hook(self, name: str, index: int, subindex: int) -> _Follower:
        return _Follower(self, name, index, subindex)

    def _set(self, name: str, index: int, subindex: int, value: int) -> None:
        signed = _SIGNED.get(index) or _SIGNED_SUBS.get((index, subindex))
        setattr(self, name, signed(value) if signed else value)
        self.changes += 1


class _Follower:
    """A write hook that copies an object's value to its attribute."""

    __slots__ = ("_args", "_settings")

    def __init__(self, settings: Settings, name: str, index: int, subindex: int) -> None:
        self._settings = settings
        self._args = (name, index, subindex)

    def __call__(self, value: int) -> None:
        self._settings._set(*self._args, value)


def object_key(dictionary: Dictionary, index: int, subindex: int = 0) -> int:
    """Return the key of an object of the standard; if a file defines an array instead of a VAR, the key of its first element."""
    if subindex == 0 and dictionary.has(index, 1):
        return index << 8 | 1
    return index << 8 | subindex
