"""Symptoms of motion: an axis that does not move as commanded, moves elsewhere, or moves without a command."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="moves-the-wrong-way",
        title="The axis moves in the wrong direction, or too far",
        seen="No message reports this, unless the drive itself detects it. The direction is inverted, or 90 degrees "
        "become 9. Stop the axis, keep clear, and correct this before anything else: limits, homing and stops are "
        "also wrong.",
        checks=(
            "Stop the axis: `axisbus stop CELL`.",
            "The distance is wrong: `scale` in `[axes.NAME]` is increments per unit, at the output of the gear. "
            "`axisbus boot CELL` prints it together with the value that the drive's objects suggest (608Fh, 6091h).",
            "The direction is wrong: use a negative `scale`, or 607Eh (polarity) in the drive, but not both.",
            "Test it in small steps, with free travel: `axisbus move CELL AXIS=1 --relative --velocity 1`.",
            "The axis runs away at full torque when it is enabled: encoder and motor phases do not match. Switch the "
            "power off. See the drive's manual for its commutation and its calibration.",
            "After a change, all positions, limits and homing directions have another meaning: check each of them.",
        ),
        faults=("7122", "7302"),
        read_on=("cell-file.md#axesname", "commissioning.md#7-motion"),
    ),
    Symptom(
        name="does-not-arrive",
        title="The axis does not reach its target, or does not come to rest",
        seen="The motion took longer than permitted. The master has halted the axis, and the axis is still enabled.",
        checks=(
            "Is the axis blocked, or too weak? `axisbus monitor CELL` shows position, torque, and the bits of its "
            "statusword.",
            "The axis stops slightly short: the drive's own window (6067h), or `position_window` in `[axes.NAME]`, is "
            "narrower than the axis can hold.",
            "The drive limits velocity, acceleration or torque (607Fh, 6080h, 6072h): the motion takes longer than "
            "calculated.",
            "The axis oscillates about its target: adjust the gains. A load on a spring or a belt needs lower gains.",
            "The timeout of the command is too short: give the command more time.",
        ),
        errors=("MotionTimeout",),
        faults=("7121", "8312"),
        read_on=("stopping.md#how-standstill-is-detected", "cell-file.md#axesname"),
    ),
    Symptom(
        name="set-point-not-taken",
        title="The drive does not accept the set-point",
        seen="In profile position mode master and drive exchange each new target by a handshake of bit 4 (controlword) "
        "and bit 12 (statusword). The drive did not acknowledge the target, or no value shows that it moves there.",
        checks=(
            "Does the target lie within the drive's own limits (607Dh)?",
            "Profile velocity and acceleration (6081h, 6083h) must not be 0: `axisbus od read --cell CELL NODE:6081 "
            "NODE:6083`.",
            "Is the drive in profile position mode, and not held by bit 8 (halt)? `axisbus monitor CELL` shows mode and "
            "bits.",
            "If the drive acknowledges slowly, use a longer `scan_period`.",
        ),
        errors=("SetPointError",),
        read_on=("cell-file.md#axesname",),
    ),
    Symptom(
        name="following-error",
        title="The axis lags behind: following error",
        seen="The distance between the axis and its set-point is larger than a normal lag. The master has stopped the "
        "axis by a quick stop. A blocked axis may leap when it comes free.",
        checks=(
            "KEEP CLEAR, then check: is the axis obstructed, does a brake drag, is the load too heavy?",
            "Does the axis move in the wrong direction? Then see `axisbus explain moves-the-wrong-way`.",
            "Does the drive limit torque or velocity (6072h, 607Fh, 6080h)?",
            "Velocity or acceleration may be too high for the axis: `axisbus record start CELL -o run.mcap`, then "
            "`axisbus plot run.mcap -o run.png` shows how it fell behind.",
            "The control loops of the drive are too soft: raise the gains, or use `[axes.NAME.feed_forward]`. The drive "
            "has a limit of its own (6065h); the limit of axisbus is `following_error` in `[axes.NAME]`.",
            'The axis moves correctly and its 6062h is wrong: `demand = "ignore"` in `[axes.NAME]` makes axisbus ignore '
            "6062h.",
        ),
        errors=("FollowingError",),
        faults=("84xx", "85xx", "86xx"),
        read_on=("stopping.md#automatic-stops", "motion.md#feed-forward"),
    ),
    Symptom(
        name="moves-by-itself",
        title="The axis moves without a command, or is pulled",
        seen="The axis is enabled and no command runs. It moves, or its drive pulls it towards another position. The "
        "master has stopped it by a quick stop.",
        checks=(
            "KEEP CLEAR: a blocked axis leaps when it comes free.",
            "Does another master or tool command the axis? `axisbus trace CELL --seconds 5` shows which frames are "
            "sent.",
            "The drive continues with an old target, or its mode differs from the reported one: `axisbus od dump NODE "
            "--cell CELL`.",
            "The motor cannot hold the load, or a spring or a hand moves the axis: `axisbus monitor CELL` shows the "
            "torque. A vertical axis needs `holds_load` in `[axes.NAME]`.",
            "The axis only moves slightly around its position: `standstill_velocity` and `standstill_window` in "
            "`[axes.NAME]` define what counts as standstill.",
        ),
        errors=("UncommandedMotion",),
        read_on=("stopping.md#how-standstill-is-detected", "cell-file.md#axesname"),
    ),
    Symptom(
        name="homing-failed",
        title="Homing fails",
        seen="The drive reports a homing error, or its homing was interrupted or did not finish. The master has halted "
        "the axis. Its position has no meaning.",
        checks=(
            "Does the signal of the switch reach the drive? `axisbus od read --cell CELL NODE:60FD` shows the inputs: "
            "press the switch by hand.",
            "Is the method correct, and its direction? `[axes.NAME.homing]` contains it, and the message describes what "
            "the method searches for.",
            "Speeds (6099h) and acceleration (609Ah) must not be 0. The search must be slow enough to detect the switch "
            "or the index.",
            "The time expires during the search: set a longer `timeout` in `[axes.NAME.homing]`.",
            "The switches of a gantry pair do not agree: check both switches, and the beam.",
            "There is no switch: method 35 or 37 uses the present position.",
        ),
        errors=("HomingError",),
        read_on=("cell-file.md#axesnamehoming", "motion.md#homing"),
    ),
    Symptom(
        name="beyond-a-limit",
        title="The axis, or a command, is beyond a limit",
        seen="A command, or the expected motion of the axis, exceeds its limits of position, velocity, acceleration or "
        "torque, or the range of an object. Either nothing was sent, or the master has braked the axis so that it "
        "comes to rest within its limits.",
        checks=(
            "The message states the requested value and the permitted one: request less.",
            "Is the limit correct? `position_limits`, `max_velocity` and `max_acceleration` in `[axes.NAME]` are in the "
            "axis's unit.",
            "Is the zero position correct? `axisbus home CELL AXIS` determines it again.",
            "A value does not fit its object: check `scale`.",
            "The axis is at standstill beyond its limits: move it back into them. Only that direction is permitted.",
            "8612h: a limit switch of the drive itself. Check the switch and its polarity.",
        ),
        errors=("LimitError",),
        faults=("8612",),
        read_on=("cell-file.md#axesname",),
    ),
    Symptom(
        name="touch-probe",
        title="The touch probe does not detect its edge",
        seen="A touch probe is not armed as requested, was switched off by another sender, or an axis reached its target "
        "without an edge.",
        checks=(
            "Does the signal of the sensor reach the drive? `axisbus od read --cell CELL NODE:60FD` shows the inputs: "
            "press the sensor by hand.",
            "Which edge, which input? 60B8h contains both. Another program or tool, or an RPDO that contains 60B8h, "
            "overwrites it.",
            "Search over a longer distance, or more slowly.",
            "Does the drive support the requested function? Its manual lists the functions of its touch probe.",
        ),
        errors=("ProbeError",),
        read_on=("motion.md#touch-probe",),
    ),
    Symptom(
        name="beam-not-square",
        title="The beam of a gantry pair is not square",
        seen="The skew of the beam exceeds `max_skew`, or is unknown. The master has stopped both axes of the pair "
        "together.",
        checks=(
            "Check the beam before any axis moves: a side that jams bends it.",
            "A position is unknown: both positions must arrive in each cycle (`axisbus monitor CELL`).",
            "Which side lags? `axisbus record start CELL -o run.mcap`, then `axisbus plot run.mcap -o run.png`.",
            "The beam is skewed: a program can square it slowly, with a wider limit. The documentation of gantry pairs "
            "describes how.",
            "Then home the pair.",
        ),
        errors=("SkewError",),
        read_on=("motion.md#gantry-pairs", "motion.md#skew-monitoring"),
    ),
    Symptom(
        name="stale-values",
        title="A value is too old, or was never received",
        seen="A value that a command needs (position, statusword, an input) is unknown. The master never uses a stale "
        "value as a fresh one. It has stopped an axis that depends on the value.",
        checks=(
            "Does the drive send the value? `axisbus boot CELL` shows the PDO of each value, and `axisbus monitor CELL` "
            "its age.",
            "Is the node operational? `axisbus scan CELL`.",
            "The message says that this program did not run: a debugger, a suspended computer, or a long call that "
            "blocks all threads.",
            "The bus is full or disturbed: `axisbus load CELL`, `axisbus trace CELL --errors-only`.",
            "A value that is requested by SDO arrives less often than a mapped one: map the object into a TPDO.",
        ),
        errors=("StaleError",),
        read_on=("stopping.md#how-standstill-is-detected",),
    ),
)
