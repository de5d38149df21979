"""The attributes that an axis resets when its drive leaves its state, loses power, or gets a new origin: all are listed."""

from __future__ import annotations

import math

import pytest

from axisbus.motion.axis.active_command import ActiveCommand
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.axis.loss import Loss
from axisbus.motion.axis.reference import DemandTrust, ReferenceTracker
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import DemandUse
from axisbus.motion.states import AxisState
from axisbus.motion.stop.active_stop import Stopping
from axisbus.motion.stop.following_error import FollowingErrorMonitor
from axisbus.motion.stop.standstill_monitor import StandstillMonitor
from kit.motion.rig import Rig, rig

INF = math.inf
# The attributes reset with each loss, and with the greater ones: attribute -> (a value with information, the value without it).
FORGOTTEN = {
    Loss.OPERATION: {
        "running.set_point": (SetPoint(5, "x", 1.0), None),
        "image.reference_tracker.set_point": (500, None),
        "image.reference_tracker.set_point_at": (1.0, -INF),
        "image.reference_tracker.taken": (500, None),
        "image.reference_tracker.homing_since": (1.0, INF),
    },
    Loss.POWER: {
        "last_target": (500, None),
        "stopping.motion_requested_at": (1.0, -INF),
        "image.reference_tracker.target": (500, None),
        "image.reference_tracker.rate": (100, 0),
        "image.reference_tracker._targets_ended_at": (1.0, None),
        "image.reference_tracker._before": (500, None),
        "image.reference_tracker.trust._before": (500, None),
        "image.reference_tracker.trust._anchored": (True, False),
        "image.reference_tracker.trust._seen": (2, 0),
        "supervision.following._commanded_position": (500, None),
        "supervision.following.commanded_at": (1.0, -INF),
        "supervision.following._misses": (1, 0),
        "supervision.following._since": (1.0, INF),
        "supervision.following._stamp": (1.0, -INF),
        "supervision.following._bit_was_clear": (True, False),
        "supervision._resting.rest_position": (500, None),
        "supervision._resting._misses": (1, 0),
        "supervision._resting._distance": (7.0, 0.0),
    },
    Loss.COUNT: {
        "image.shown_demand": (500, None),
        "image.demand": (500, None),
        "image.lead": (500.0, None),
        "image._before_stamp": (1.0, -INF),
        "image._earlier_stamp": (1.0, -INF),
        "image._checkpoint_stamp": (1.0, -INF),
    },
}
# Begun again by a method of their own, or with other values than a fixed one (tested below).
BEGUN = {
    *(
        "image.reference_tracker.since",
        "image.reference_tracker.trust._given",
        "image.still",
        "image.still_demand",
        "image.loss",
    ),
    *("supervision.following._activity", "supervision.following._mode", "supervision.following._peak"),
}
# No state of a motion: feedback of each cycle, permanent properties of the axis, and states that end without a reset.
SHOWN = {
    *(
        "bus",
        "emcy",
        "gap",
        "had_demand",
        "lost_count",
        "mode",
        "mode_stamp",
        "nmt",
        "now",
        "operational",
        "overdue",
        "restarted",
        "since_restart",
        "duplicate",
        "lag",
        "override",
    ),
    *(
        "position",
        "position_stamp",
        "last_position",
        "_raw_position",
        "replies",
        "starvation",
        "state",
        "statusword",
    ),
    *(
        "statusword_stamp",
        "torque",
        "velocity",
        "velocity_stamp",
        "demand_stamp",
        "lead_stamp",
        "_before",
        "_checkpoint",
        "_earlier",
        "_demand_spacing",
    ),
}
FOR_GOOD = {
    *(
        "max_age",
        "_period",
        "statusword_by_event",
        "statusword_by_sdo",
        "edge_delay",
        "fastest",
        "demand_repeats",
        "velocity_transfer",
        "guarded",
    ),
    *("_demands_with_positions", "flight", "origin", "reference_tracker"),
}
KEPT = {
    "image": SHOWN | FOR_GOOD,
    # The mode is noted in each cycle; whether the drive is idle follows from the states and modes that it shows.
    "image.reference_tracker": {"trust", "_mode", "_period", "_quick", "idle"},
    "image.reference_tracker.trust": {
        "_use",
        "_window",
        "everywhere",
        "proven",
    },  # how the drive is does not change with its power
    # Running commands end by their own ticket.
    "running": {"activity", "addition", "addition_ticket", "ended", "ticket"},
    "stopping": {
        "_parameters",
        "_resets",
        "_tickets",
        "kind",
        "stop_sequence",
        "locks",
        "power_note",
        "reason",
    },  # a stop continues without power
    "supervision.following": {"_parameters", "_window"},
    # Of its next position or velocity on.
    "supervision._resting": {
        *("_allowed", "_parameters", "_per_velocity", "_pulled_at", "_since", "_stamp", "_why"),
    },
    # The parts of an axis, and attributes set by its commands: each is in one of the lists itself or ends with its command.
    "": {
        *(
            "_arrival",
            "_fault_reaction",
            "_broken",
            "_fast_path",
            "_has_restarted",
            "_sends_target_by_sync",
            "_needs_homing",
            "_confirmed_origin",  # of a drive that keeps its count: it is used when its node has been booted again
            "node_boots",
            "_stop_confirmed",
            "_fault_diagnosis",
        ),
        *(
            "_was_uneventful",
            "capabilities",
            "error",
            "forward",
            "halted",
            "history",
            "homed",
            "image",
            "order",
            "override",
        ),
        *(
            "parameters",
            "powered",
            "probes",
            "profile_type",
            "queue",
            "standstill_waiters",
            "coast_down",
            "running",
            "state",
        ),
        *("stopping", "supervision", "touched", "tripped"),
    },
}
PARTS = {
    "": AxisCore,
    "image": AxisImage,
    "image.reference_tracker": ReferenceTracker,
    "image.reference_tracker.trust": DemandTrust,
    "running": ActiveCommand,
    "stopping": Stopping,
    "supervision.following": FollowingErrorMonitor,
    "supervision._resting": StandstillMonitor,
}


def part(core: AxisCore, path: str):
    for name in path.split(".") if path else ():
        core = getattr(core, name)
    return core


def attributes(thing) -> set[str]:
    slots = {name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())}
    return slots | set(getattr(thing, "__dict__", {}))


@pytest.mark.parametrize("path", PARTS)
def test_each_attribute_is_reset_or_kept_for_a_reason(path):
    """An attribute that is new has to be put into one of the lists: state of a motion must not outlive it."""
    thing = part(rig().core, path)
    assert type(thing) is PARTS[path]
    listed = set(BEGUN).union(*FORGOTTEN.values())
    mine = {name.rpartition(".")[2] for name in listed if name.rpartition(".")[0] == path}
    assert not mine & KEPT[path]
    assert attributes(thing) == mine | KEPT[path]


@pytest.mark.parametrize("loss", list(Loss))
def test_a_loss_resets_its_list_and_those_of_the_smaller_losses(loss):
    core = rig().core
    values = {name: each for kind in Loss for name, each in FORGOTTEN[kind].items()}
    for name, (dirty, _) in values.items():
        path, _, attribute = name.rpartition(".")
        setattr(part(core, path), attribute, dirty)
    core.forget(loss)
    void = {name for kind in Loss if kind <= loss for name in FORGOTTEN[kind]}
    for name, (dirty, clean) in values.items():
        path, _, attribute = name.rpartition(".")
        assert getattr(part(core, path), attribute) == (clean if name in void else dirty), name


def test_a_loss_of_power_restarts_each_watch_and_a_loss_of_the_count_each_position_window():
    core = rig().core
    core.image.reference_tracker.trust.add_set_point(500)
    core.supervision.following._mode = 1
    for stamp in range(100):
        core.image.still.feed(0.0, float(stamp))
        core.image.still_demand.feed(0.0, float(stamp))
    core.forget(Loss.POWER)
    assert core.image.reference_tracker.since == core.image.now
    assert core.supervision.following._mode is None
    assert core.image.still.still
    assert core.image.reference_tracker.trust._given
    core.forget(Loss.COUNT)
    assert not core.image.still.still
    assert not core.image.still_demand.still
    assert not core.image.reference_tracker.trust._given


def unseen(option: int) -> Rig:
    """An axis whose 6062h does not count, as on a drive without it; ``option``: 605Ah."""
    r = rig(demand=DemandUse.IGNORE, quick_stop_holds=option > 4)
    r.device.write(0x605A, 0, option)
    return r.enabled()


@pytest.mark.parametrize(
    ("how", "option"), [("disable", 2), ("fault", 2), ("quick stop", 2), ("quick stop", 6)]
)
def test_after_an_interrupted_move_an_axis_at_standstill_can_be_halted(how, option):
    """No state of the move remains, although no 6062h shows that the drive has no demand elsewhere."""
    r = unseen(option)
    axis = r.axis
    axis.move_absolute(300.0)
    r.run(0.5)
    if how == "disable":
        axis.disable().wait(5)
    elif how == "quick stop":
        axis.quick_stop().wait(5)
    else:
        r.drive.fault(0x3220)
        r.run(1.0)
        axis.reset().wait(5)
    axis.enable().wait(5)
    r.run(1.0)
    axis.halt().wait(5)
    assert axis.state is AxisState.STANDSTILL
    assert axis.error is None
