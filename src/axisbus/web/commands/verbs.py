"""What a page may ask for, as one table."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verb(Enum):
    """The verbs of the page; those of an axis are the library's."""

    BEAT = "beat"
    TAKE = "take"
    TAKE_OVER = "take_over"
    GIVE_BACK = "give_back"
    LINK = "link"
    TAKE_COMMAND = "take_command"
    QUICK_STOP_ALL = "quick_stop_all"
    HALT_ALL = "halt_all"
    QUICK_STOP = "quick_stop"
    HALT = "halt"
    JOG_END = "jog_end"
    ENABLE = "enable"
    DISABLE = "disable"
    RESET = "reset"
    RELEASE = "release"
    HOME = "home"
    MOVE_ABSOLUTE = "move_absolute"
    MOVE_RELATIVE = "move_relative"
    MOVE_VELOCITY = "move_velocity"
    TORQUE_CONTROL = "torque_control"
    JOG = "jog"
    READ_OBJECTS = "read_objects"
    KEEP_READING = "keep_reading"
    WRITE_OBJECT = "write_object"
    VERIFY = "verify"
    VERIFY_END = "verify_end"
    BACKUP = "backup"
    COMPARE = "compare"
    WOULD_RESTORE = "would_restore"
    RESTORE = "restore"
    JOB_END = "job_end"
    STEP_POSITION = "step_position"
    STEP_VELOCITY = "step_velocity"
    TRIAL_BEAT = "trial_beat"
    TRIAL_END = "trial_end"


@dataclass(frozen=True, slots=True)
class Row:
    """What a verb needs: the controls, an axis, a question that was answered with yes, numbers by name, so many objects."""

    controls: bool = True
    axis: bool = True
    sure: bool = False
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    objects: range = range(1)


KEPT = 8  # objects that a page may keep reading
ASKED = 32  # objects that it may ask for at a time
_ANYBODY = Row(controls=False)
_PAGE = Row(controls=False, axis=False)
_RAMPS = ("velocity", "acceleration")
_STEP = (*_RAMPS, "seconds")
VERBS = {
    Verb.BEAT: _PAGE,
    Verb.TAKE: _PAGE,
    Verb.TAKE_OVER: _PAGE,
    Verb.GIVE_BACK: _PAGE,
    Verb.LINK: _PAGE,
    Verb.TAKE_COMMAND: Row(axis=False, sure=True),
    Verb.QUICK_STOP_ALL: _PAGE,
    Verb.HALT_ALL: _PAGE,
    Verb.QUICK_STOP: _ANYBODY,
    Verb.HALT: _ANYBODY,
    Verb.JOG_END: _PAGE,
    Verb.ENABLE: Row(sure=True),
    Verb.DISABLE: Row(),
    Verb.RESET: Row(),
    Verb.RELEASE: Row(),
    Verb.HOME: Row(sure=True),
    Verb.MOVE_ABSOLUTE: Row(needs=("position",), takes=_RAMPS),
    Verb.MOVE_RELATIVE: Row(needs=("distance",), takes=_RAMPS),
    Verb.MOVE_VELOCITY: Row(needs=("velocity",), takes=("acceleration",)),
    Verb.TORQUE_CONTROL: Row(sure=True, needs=("torque",), takes=("slope",)),
    Verb.JOG: Row(needs=("direction",), takes=_RAMPS),
    Verb.READ_OBJECTS: Row(controls=False, axis=False, objects=range(1, ASKED + 1)),
    Verb.KEEP_READING: Row(controls=False, axis=False, objects=range(KEPT + 1)),
    Verb.WRITE_OBJECT: Row(axis=False, objects=range(1, 2)),
    Verb.VERIFY: Row(axis=False),
    Verb.VERIFY_END: Row(axis=False),
    Verb.BACKUP: _PAGE,
    Verb.COMPARE: _PAGE,
    Verb.WOULD_RESTORE: _PAGE,
    Verb.RESTORE: Row(axis=False, sure=True),
    Verb.JOB_END: _PAGE,
    Verb.STEP_POSITION: Row(needs=("distance", *_STEP)),
    Verb.STEP_VELOCITY: Row(needs=_STEP),
    Verb.TRIAL_BEAT: _PAGE,
    Verb.TRIAL_END: _PAGE,
}
# Taken whatever the rate of a page is, and whatever it brings with it.
STOPS = frozenset(
    {Verb.QUICK_STOP_ALL, Verb.HALT_ALL, Verb.QUICK_STOP, Verb.HALT, Verb.JOG_END, Verb.TRIAL_END}
)
