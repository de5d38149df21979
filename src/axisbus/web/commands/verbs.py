"""The table of all requests that a page may make."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class PageVerb(Enum):
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
    BOOT = "boot"
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
class VerbRequirements:
    """The requirements of a verb: the controls, an axis, a confirmed question, numbers by name, and a number of objects."""

    controls: bool = True
    axis: bool = True
    sure: bool = False
    needs: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    objects: range = range(1)


MAX_CYCLIC = 8  # the most objects that a page may read cyclically
MAX_OBJECTS = 32  # the most objects in one request
_ANY_PAGE = VerbRequirements(controls=False)
_PAGE = VerbRequirements(controls=False, axis=False)
_RAMPS = ("velocity", "acceleration")
_STEP = (*_RAMPS, "seconds")
VERBS = {
    PageVerb.BEAT: _PAGE,
    PageVerb.TAKE: _PAGE,
    PageVerb.TAKE_OVER: _PAGE,
    PageVerb.GIVE_BACK: _PAGE,
    PageVerb.LINK: _PAGE,
    PageVerb.TAKE_COMMAND: VerbRequirements(axis=False, sure=True),
    PageVerb.QUICK_STOP_ALL: _PAGE,
    PageVerb.HALT_ALL: _PAGE,
    PageVerb.QUICK_STOP: _ANY_PAGE,
    PageVerb.HALT: _ANY_PAGE,
    PageVerb.JOG_END: _PAGE,
    PageVerb.ENABLE: VerbRequirements(sure=True),
    PageVerb.DISABLE: VerbRequirements(),
    PageVerb.RESET: VerbRequirements(),
    PageVerb.RELEASE: VerbRequirements(),
    PageVerb.HOME: VerbRequirements(sure=True),
    PageVerb.MOVE_ABSOLUTE: VerbRequirements(needs=("position",), optional=_RAMPS),
    PageVerb.MOVE_RELATIVE: VerbRequirements(needs=("distance",), optional=_RAMPS),
    PageVerb.MOVE_VELOCITY: VerbRequirements(needs=("velocity",), optional=("acceleration",)),
    PageVerb.TORQUE_CONTROL: VerbRequirements(sure=True, needs=("torque",), optional=("slope",)),
    PageVerb.JOG: VerbRequirements(needs=("direction",), optional=_RAMPS),
    PageVerb.BOOT: VerbRequirements(axis=False),
    PageVerb.READ_OBJECTS: VerbRequirements(controls=False, axis=False, objects=range(1, MAX_OBJECTS + 1)),
    PageVerb.KEEP_READING: VerbRequirements(controls=False, axis=False, objects=range(MAX_CYCLIC + 1)),
    PageVerb.WRITE_OBJECT: VerbRequirements(axis=False, objects=range(1, 2)),
    PageVerb.VERIFY: VerbRequirements(axis=False),
    PageVerb.VERIFY_END: VerbRequirements(axis=False),
    PageVerb.BACKUP: _PAGE,
    PageVerb.COMPARE: _PAGE,
    PageVerb.WOULD_RESTORE: _PAGE,
    PageVerb.RESTORE: VerbRequirements(axis=False, sure=True),
    PageVerb.JOB_END: _PAGE,
    PageVerb.STEP_POSITION: VerbRequirements(needs=("distance", *_STEP)),
    PageVerb.STEP_VELOCITY: VerbRequirements(needs=_STEP),
    PageVerb.TRIAL_BEAT: _PAGE,
    PageVerb.TRIAL_END: _PAGE,
}
# Accepted at any message rate of a page, whatever the other fields of the message.
STOPS = frozenset(
    {
        PageVerb.QUICK_STOP_ALL,
        PageVerb.HALT_ALL,
        PageVerb.QUICK_STOP,
        PageVerb.HALT,
        PageVerb.JOG_END,
        PageVerb.TRIAL_END,
    }
)
