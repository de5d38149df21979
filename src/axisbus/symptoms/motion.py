"""Symptoms of motion: an axis that does not go where it is told, goes elsewhere, or goes by itself."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="moves-the-wrong-way",
        title="It moves the wrong way, or too far",
        seen="No message tells of it, except where the drive itself notices: a plus is a minus, or 90 degrees are "
        "9. Stop, keep clear, and set it right before anything else: limits, homing and stops are wrong with "
        "it.",
        checks=(
            "Stop it: `axisbus stop CELL`.",
            "Too far or too near: `scale` in `[axes.NAME]` is increments per unit, at the gear's output. `axisbus "
            "boot CELL` prints it beside what the drive's objects suggest (608Fh, 6091h).",
            "The other way: a negative `scale` turns the axis round; or 607Eh (polarity) in the drive, not both.",
            "Try it in small steps, free to move: `axisbus move CELL AXIS=1 --relative --velocity 1`.",
            "It runs away at full torque when it is enabled: encoder and motor phases do not agree. Take the power "
            "off; see the drive's manual for its commutation, and calibrate a GIM6010-8.",
            "After a change all positions, limits and homing directions mean something else: look at each of them.",
        ),
        faults=("7122", "7302"),
        read_on=("cell-file.md#axesname", "commissioning.md#7-motion"),
    ),
    Symptom(
        name="does-not-arrive",
        title="It does not arrive, or does not come to rest",
        seen="The motion went on for longer than it may take. The axis was halted, and is still enabled.",
        checks=(
            "Is it blocked, or too weak? `axisbus monitor CELL` shows position, torque, and the bits of its "
            "statusword.",
            "It stops a little short: the drive's own window is narrower than it can hold (6067h), or "
            "`position_window` in `[axes.NAME]`.",
            "The drive limits velocity, acceleration or torque (607Fh, 6080h, 6072h): the way takes longer than was "
            "reckoned.",
            "It oscillates about its target: gains. A load on a spring or a belt needs lower ones.",
            "The time is short on purpose: give the command more.",
        ),
        errors=("MotionTimeout",),
        faults=("7121", "8312"),
        read_on=("stopping.md#standing-is-seen-never-inferred", "cell-file.md#axesname"),
    ),
    Symptom(
        name="set-point-not-taken",
        title="The drive does not take the set-point",
        seen="In profile position mode bits 4 and 12 shake hands over each new target; the drive did not "
        "acknowledge it, or nothing shows that it goes there.",
        checks=(
            "Does the target lie within the drive's own limits (607Dh)?",
            "Profile velocity and acceleration (6081h, 6083h) are not 0: `axisbus od read --cell CELL NODE:6081 "
            "NODE:6083`.",
            "Is it in profile position mode, and not held by bit 8 (halt)? `axisbus monitor CELL` shows mode and "
            "bits.",
            "A drive that is slow to acknowledge: a longer `scan_period`.",
        ),
        errors=("SetPointError",),
        read_on=("cell-file.md#axesname",),
    ),
    Symptom(
        name="following-error",
        title="It falls behind: following error",
        seen="The axis is farther from where it is led than a lag explains. It was stopped by a quick stop; what "
        "was held may leap when it comes free.",
        checks=(
            "KEEP CLEAR, then look: is something in its way, does a brake drag, is the load too heavy?",
            "Does it go the wrong way? Then `axisbus explain moves-the-wrong-way`.",
            "The drive limits torque or velocity (6072h, 607Fh, 6080h).",
            "Velocity or acceleration are more than it can: `axisbus record start CELL -o run.mcap`, then `axisbus "
            "plot run.mcap -o run.png` shows how it fell behind.",
            "Its loops are soft: higher gains, or `[axes.NAME.feed_forward]`. The drive has a limit of its own "
            "(6065h), axisbus another (`following_error` in `[axes.NAME]`).",
            'The axis moves well and its 6062h is wrong: `demand = "ignore"` in `[axes.NAME]` leaves 6062h out.',
        ),
        errors=("FollowingError",),
        faults=("84xx", "85xx", "86xx"),
        read_on=("stopping.md#what-axisbus-stops-by-itself", "motion.md#feed-forward"),
    ),
    Symptom(
        name="moves-by-itself",
        title="It moves by itself, or is pulled",
        seen="The axis is enabled, no command runs, and it moves, or its drive pulls it to where it is not. It was "
        "stopped by a quick stop.",
        checks=(
            "KEEP CLEAR: what is held leaps when it comes free.",
            "Another master or tool commands it: `axisbus trace CELL --seconds 5` shows who sends.",
            "The drive goes on with an old target, or has another mode than it tells: `axisbus od dump NODE --cell "
            "CELL`.",
            "A load that the motor cannot hold, a spring, a hand: `axisbus monitor CELL` shows the torque. A "
            "vertical axis has `holds_load` in `[axes.NAME]`.",
            "It only breathes a little: `standstill_velocity` and `standstill_window` in `[axes.NAME]` say what "
            "counts as standing.",
        ),
        errors=("UncommandedMotion",),
        read_on=("stopping.md#standing-is-seen-never-inferred", "cell-file.md#axesname"),
    ),
    Symptom(
        name="homing-failed",
        title="Homing fails",
        seen="The drive reports an error of its homing, was interrupted, or did not finish. The axis was halted; "
        "its position means nothing.",
        checks=(
            "Does the switch reach the drive? `axisbus od read --cell CELL NODE:60FD` shows the inputs: press it by "
            "hand.",
            "Is it the right method, in the right direction? `[axes.NAME.homing]` has it; the message says in words "
            "what it looks for.",
            "Speeds (6099h) and acceleration (609Ah) are not 0, and the search is slow enough to see the switch or "
            "the index.",
            "It times out on its way: a longer `timeout` in `[axes.NAME.homing]`.",
            "A pair whose switches do not agree: look at both, and at the beam.",
            "No switch at all: method 35 or 37 takes the place where it stands.",
        ),
        errors=("HomingError",),
        read_on=("cell-file.md#axesnamehoming", "motion.md#homing"),
    ),
    Symptom(
        name="beyond-a-limit",
        title="It is beyond a limit",
        seen="What was asked for, or what the axis was about to do, lies beyond its limits of position, velocity, "
        "acceleration or torque, or beyond what the object holds. Nothing was sent; or the axis was braked, "
        "to stand within its limits.",
        checks=(
            "The message says what was asked, and what is allowed: ask for less.",
            "Is the limit what you mean? `position_limits`, `max_velocity`, `max_acceleration` in `[axes.NAME]` are "
            "in the axis's unit.",
            "Is the zero where you think? `axisbus home CELL AXIS` finds it anew.",
            "A value that does not fit its object: look at `scale`.",
            "The axis stands beyond its limits: move back into them; only that way is allowed.",
            "8612h: a limit switch of the drive itself. Look at it, and at its polarity.",
        ),
        errors=("LimitError",),
        faults=("8612",),
        read_on=("cell-file.md#axesname",),
    ),
    Symptom(
        name="touch-probe",
        title="The touch probe does not see its edge",
        seen="A touch probe is not armed as asked, was switched off by somebody else, or an axis arrived without "
        "an edge on the way.",
        checks=(
            "Does the sensor reach the drive? `axisbus od read --cell CELL NODE:60FD` shows the inputs: press it by "
            "hand.",
            "Which edge, which input: 60B8h has them. Another program or tool, or an RPDO that carries 60B8h, "
            "writes over it.",
            "Search farther, or slower.",
            "Has the drive what is asked for? Its manual says which functions its touch probe has.",
        ),
        errors=("ProbeError",),
        read_on=("motion.md#touch-probe",),
    ),
    Symptom(
        name="beam-not-square",
        title="The beam of a gantry pair is not square",
        seen="The two axes of a pair are farther from where their beam is square than `max_skew` allows, or nobody "
        "knows how far. Both were stopped together.",
        checks=(
            "Look at the beam before anything moves: a side that jams bends it.",
            "A position is unknown: both must come in each cycle (`axisbus monitor CELL`).",
            "Which side lags? `axisbus record start CELL -o run.mcap`, then `axisbus plot run.mcap -o run.png`.",
            "It is bent: a program makes it square, slowly, with a wider bound. How stands on the page of gantry "
            "pairs.",
            "After that home the pair.",
        ),
        errors=("SkewError",),
        read_on=("motion.md#gantry-pairs", "motion.md#when-it-is-not-square"),
    ),
    Symptom(
        name="stale-values",
        title="A value is too old, or was never received",
        seen="What a command needs (position, statusword, an input) is unknown. Nothing stale is passed off as "
        "fresh: an axis that depends on it was stopped.",
        checks=(
            "Does the drive send it? `axisbus boot CELL` says by which PDO each value travels; `axisbus monitor "
            "CELL` shows its age.",
            "Is the node operational? `axisbus scan CELL`.",
            "The message says that this program did not run: a debugger, a suspended computer, a long call that "
            "lets no thread run.",
            "A full or disturbed bus: `axisbus load CELL`, `axisbus trace CELL --errors-only`.",
            "An object that is asked for by SDO comes slower than one that is mapped: map it into a TPDO.",
        ),
        errors=("StaleError",),
        read_on=("stopping.md#standing-is-seen-never-inferred",),
    ),
)
