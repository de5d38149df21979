"""Symptoms that have to do with what was asked for: by whom, when, and how."""

from __future__ import annotations

from axisbus.symptoms.symptom import Symptom

SYMPTOMS = (
    Symptom(
        name="stopped",
        title="A command ended because something else took over",
        seen="Nothing is broken: a stop, a halt, the fault policy or a newer command ended what ran. The message "
        "says whose stop it was.",
        checks=(
            "Who stopped it? The message names it: another program, a fault of an axis of the same group, Ctrl-C, "
            "the end of the program.",
            "Another axis failed: `axisbus monitor CELL` shows which one; its own message is the cause.",
            "A newer command on the same axis replaces the one before: wait for its handle, or let it follow "
            "(`buffer`).",
            "A jog ends where nobody renews it.",
        ),
        errors=("Interrupted", "Stopped", "Replaced"),
        read_on=("stopping.md#the-ways-out", "programs.md#one-commands-all-may-stop"),
    ),
    Symptom(
        name="command-broke-off",
        title="A command broke off in its own work",
        seen="The program's part of a command raised an exception, answered too late, or did not send its next "
        "points in time. The axis was braked along the part that had come.",
        checks=(
            "The traceback of the cause says where it broke: a function of a trajectory, a controller, kinematics.",
            "It came too late: give the computer to it, let the function do less, give points earlier and with a "
            "larger buffer.",
            "`axisbus jitter CELL --for 10s` tells whether the computer keeps its cycle at all.",
        ),
        errors=("CommandError",),
        read_on=("motion.md#streams-of-points", "motion.md#a-loop-of-your-own"),
    ),
    Symptom(
        name="input-does-not-come",
        title="An input or output does not take the value that is waited for",
        seen="The program waited for a value of an input or output, and its time is over. The value that the message "
        "names is fresh: the module is there and sends it.",
        checks=(
            "Does the sensor switch? Its lamp, and the lamp of the module's terminal, show it.",
            "Is it the right terminal? `object` and `bit` of `[io.NAME]` say which one is read; the maker's manual may "
            "count from 1.",
            "What should cause the change has not happened: the part, the valve, the axis before it.",
            "A value that comes and goes within a scan period is not seen.",
        ),
        errors=("SignalTimeout",),
        read_on=("io.md",),
    ),
    Symptom(
        name="command-taken",
        title="Another program has the command",
        seen="One program commands a machine; all others may look on, halt and quick-stop. This one asked for more.",
        checks=(
            "`axisbus monitor CELL` shows which programs are at the machine, and which one commands.",
            "End that one, or let it give the command away.",
            "Take it: `axisbus move CELL AXIS=10 --take`. What moves halts first, and the other is told.",
        ),
        errors=("OwnershipError",),
        read_on=("programs.md#one-commands-all-may-stop",),
    ),
    Symptom(
        name="not-in-this-state",
        title="Not possible in this state",
        seen="The axis or the machine is in a state that does not allow what was asked: not enabled, not homed, in "
        "motion, in ErrorStop, closed. Nothing was sent.",
        checks=(
            "`axisbus monitor CELL` shows the state of each axis.",
            "In ErrorStop: see why, remove the cause, then `axisbus reset CELL`.",
            "Not homed: `axisbus home CELL AXIS`, or `--home` of a move.",
            "It moves: wait until it stands, or halt it (`axisbus halt CELL AXIS` where a machine runs).",
            "No machine runs, or one runs already: `axisbus run CELL` keeps one for all terminals.",
        ),
        errors=("StateError",),
        read_on=("programs.md", "api/axisbus.md#axisstate"),
    ),
    Symptom(
        name="unknown-name",
        title="The cell does not have this name",
        seen="An axis, a group, a gantry, a node, an input or an output was named that the cell does not have. Nothing was "
        "sent.",
        checks=(
            "The message lists the names that the cell has. Capital and small letters are different.",
            "The cell file that was given: does it belong to this machine?",
            "Axes are in `[axes.NAME]`, groups in `[groups.NAME]`, inputs and outputs in `[io.NAME]` of the cell file.",
            "A machine that runs already has the names of the file that it was started with: end it and start it again "
            "after a change of the file.",
        ),
        errors=("UnknownNameError",),
        read_on=("cell-file.md",),
    ),
    Symptom(
        name="cannot-be",
        title="What was written or asked for cannot be",
        seen="A value, an option or a file is not one that can be used. Nothing was sent, and nothing was written.",
        checks=(
            "The message names the value, what is wrong with it, and what would be right.",
            "`axisbus COMMAND --help` tells the arguments and units of a command.",
            "A file that cannot be written or read: its path, its folder, its permissions.",
            "A package that is missing: the message has the line that installs it.",
            "Not homed: `axisbus home CELL AXIS`, or `--home` of a move.",
        ),
        errors=("AxisbusError", "UserError", "ArgumentError"),
        read_on=("api/errors.md", "commissioning.md#what-holds-for-every-command"),
    ),
)
