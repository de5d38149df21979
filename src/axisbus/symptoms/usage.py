"""Symptoms of requests: which program makes them, when, and with which values."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="stopped",
        title="A command was ended by a stop or a newer command",
        seen="There is no defect: a stop, a halt, the fault policy or a newer command ended the running command. The "
        "message names the origin of the stop.",
        checks=(
            "What stopped the command? The message names it: another program, a fault of an axis of the same group, "
            "Ctrl-C, or the end of the program.",
            "Another axis failed: `axisbus monitor CELL` shows which one. The message of that axis contains the cause.",
            "A newer command for the same axis replaces the previous one. Wait for the handle of the previous command, "
            "or buffer the newer one (`buffer`).",
            "A jog ends if the program does not renew it in time.",
        ),
        errors=("Interrupted", "Stopped", "Replaced"),
        read_on=("stopping.md#end-of-the-program-and-signals", "programs.md#control-of-the-machine"),
    ),
    Symptom(
        name="command-broke-off",
        title="A command was aborted by an error in its own code",
        seen="The program's part of a command raised an exception, answered too late, or did not send its next "
        "points in time. The master has braked the axis along the part that it had received.",
        checks=(
            "The traceback of the cause shows the location: a function of a trajectory, a controller, or kinematics.",
            "The answer or the points were late: keep the computer free, let the function do less, and send points "
            "earlier and with a larger buffer.",
            "`axisbus jitter CELL --for 10s` shows whether the computer can keep its cycle.",
        ),
        errors=("CommandError",),
        read_on=("motion.md#streams-of-points", "motion.md#user-defined-control-loops"),
    ),
    Symptom(
        name="input-does-not-come",
        title="An input or output does not reach the expected value",
        seen="The program waited for a value of an input or output, and the timeout expired. The value in the message is "
        "fresh: the module is present and sends it.",
        checks=(
            "Does the sensor switch? Its lamp, and the lamp of the module's terminal, show it.",
            "Is it the correct terminal? `object` and `bit` of `[io.NAME]` define which one is read. The manufacturer's "
            "manual may count from 1.",
            "The event that causes the change has not occurred: check the part, the valve, and the previous axis.",
            "A value that changes and changes back within a scan period is not detected.",
        ),
        errors=("SignalTimeout",),
        read_on=("io.md",),
    ),
    Symptom(
        name="command-taken",
        title="Another program has control of the machine",
        seen="One program has control of a machine. All other clients may only observe, halt and quick-stop. This program "
        "requested more.",
        checks=(
            "`axisbus monitor CELL` shows the connected programs, and which one has control.",
            "End that program, or let it release control.",
            "Take control: `axisbus move CELL AXIS=10 --take`. Moving axes halt first, and the other program is "
            "notified.",
        ),
        errors=("OwnershipError",),
        read_on=("programs.md#control-of-the-machine",),
    ),
    Symptom(
        name="not-in-this-state",
        title="Not possible in this state",
        seen="The state of the axis or the machine does not permit the request: not enabled, not homed, in motion, in "
        "ErrorStop, or closed. Nothing was sent.",
        checks=(
            "`axisbus monitor CELL` shows the state of each axis.",
            "In ErrorStop: find and remove the cause, then `axisbus reset CELL`.",
            "Not homed: `axisbus home CELL AXIS`, or `--home` of a move.",
            "In motion: wait until the axis is at standstill, or halt it (`axisbus halt CELL AXIS` if a machine runs).",
            "No machine runs, or a machine runs already: `axisbus run CELL` keeps one machine open for all terminals.",
        ),
        errors=("StateError",),
        read_on=("programs.md", "api/axisbus.md#axisstate"),
    ),
    Symptom(
        name="not-on-this-system",
        title="Not possible on this operating system",
        seen="The request needs something that only Linux has, or that Windows does not have. Nothing was sent.",
        checks=(
            "The message names what is missing, and what works instead.",
            'On Windows and macOS the core of a machine runs in a thread of the program (`process = "thread"` in `[bus]`). '
            "Other programs cannot join that machine: let one program do all of the work.",
            "For a machine that other programs join, or for cycles of 1 ms, use Linux.",
            "SocketCAN is part of Linux. Elsewhere, write the interface of python-can for your adapter in `[bus]`.",
        ),
        errors=("PlatformError",),
        read_on=("guide.md#operating-systems",),
    ),
    Symptom(
        name="unknown-name",
        title="The cell does not have this name",
        seen="The request names an axis, a group, a gantry, a node, an input or an output that the cell does not have. "
        "Nothing was sent.",
        checks=(
            "The message lists the names that the cell has. Names are case-sensitive.",
            "Does the given cell file belong to this machine?",
            "Axes are in `[axes.NAME]`, groups in `[groups.NAME]`, inputs and outputs in `[io.NAME]` of the cell file.",
            "A running machine has the names of the file with which it was started: end it and start it again after a "
            "change of the file.",
        ),
        errors=("UnknownNameError",),
        read_on=("cell-file.md",),
    ),
    Symptom(
        name="cannot-be",
        title="A value, an option or a file is not valid",
        seen="A value, an option or a file cannot be used. Nothing was sent, and nothing was written.",
        checks=(
            "The message names the value, the error in it, and the valid values.",
            "`axisbus COMMAND --help` prints the arguments and units of a command.",
            "A file cannot be written or read: check its path, its folder and its permissions.",
            "A package is missing: the message contains the command that installs it.",
            "Not homed: `axisbus home CELL AXIS`, or `--home` of a move.",
        ),
        errors=("AxisbusError", "UserError", "ArgumentError"),
        read_on=("api/errors.md", "commissioning.md#rules-for-all-commands"),
    ),
)
