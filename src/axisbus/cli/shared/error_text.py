"""Error texts for the command line: calls in a remedy of the library are replaced by options and commands."""

from __future__ import annotations

import re
import sys

from axisbus.errors import AxisbusError, help_line

_WHO = re.compile(r"([A-Za-z_][\w-]*)(?:\.\w+\(|: )")  # "x.move_absolute(1 deg): ...", or "x: ..."

# How to reopen the machine: by the command itself if it has opened the machine, else by the program that it has joined.
_AGAIN = "if the machine is already running, end it (Ctrl-C in axisbus run) and start it again; then repeat the command"

# Longer patterns first: the shorter ones replace the rest.
_TABLE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(call), command)
    for call, command in (
        (r"home it \(axis\.home\(\)\) or confirm its position \(axis\.set_position\(\.\.\.\)\)", "add --home"),
        (r"read why \(axis\.error\), then reset it: axis\.reset\(\)", "reset it: axisbus reset CELL AXIS"),
        (r"see why it is in ErrorStop \(axis\.error\)", "see why it is in ErrorStop (axisbus monitor CELL)"),
        (r"\(axis\.disable\(\), axis\.reset\(\), then axis\.enable\(\)\)", "(axisbus stop CELL, then axisbus boot CELL)"),
        (r"enable it again \(axis\.enable\(\)\) or disable it \(axis\.disable\(\)\)", "stop it: axisbus stop CELL"),
        (r"take it over with axis\.enable\(\), or switch it off with axis\.disable\(\)", "switch it off: axisbus stop CELL"),
        # Pairs: only a program can square a skewed beam.
        (r"then (?=(\w+)\.disable\(\), \1\.reset\(\), \1\.enable\(skew=)", "then, in a program, "),
        (r"make the beam square first: ", "make the beam square first, in a program: "),
        (r"; then (?!axis)(\w+)\.reset\(\)", r"; then axisbus reset CELL \1"),
        (r"; or give the position of the beam: \w+\.set_position\(\.\.\.\)", ""),
        (r"axis\.reset\(\) and axis\.enable\(\)", "axisbus reset CELL AXIS"),
        (r"axis\.enable\(allow_moving=True\) catches it in motion; ", ""),
        (r"wait until it is off: axis\.disable\(coast=True\)\.wait\(\)", "wait until it is off"),
        (r"wait for standstill, then release it: axis\.release\(\)", "wait until it is at standstill"),
        (r"enable it first: axis\.enable\(\)", "repeat the command"),
        (r"axis\.reset\(\)", "axisbus reset CELL AXIS"),
        (r"axis\.home\(\)", "axisbus home CELL AXIS"),
        (r"axis\.(?:halt|stop|quick_stop|disable|release)\(\)", "axisbus stop CELL"),
        (r"axis\.enable\(\)", "axisbus move CELL AXIS=..., which enables it"),
        (r"axis\.position", "the position of the axis"),
        (r"axis\.error", "axisbus monitor CELL"),
        (r"; axis\.snapshot has the last known values, with their time", ""),
        (r"machine\.node\(ID\)\.sdo\[(0x)?(\w+)\]", r"axisbus od read ID:\2"),
        (r"Machine\.open\(\.\.\., allow_other_master=True\) or ", "or "),
        (r"--beside, or ", "--beside, or "),
        (r"open the machine with Machine\.open and .* instead of Machine\.simulated", "boot it: axisbus boot CELL"),
        (r"give (velocity|acceleration|timeout) = \.\.\.(?: \(seconds\))? in the call", r"give --\1"),
        (r"give \w+ = \.\.\.(?: \([^)]*\))? in the call, or", "write"),
        (r"the call does not give it, and", "no option gives it, and"),
        (r"(then )?close the machine,? (?:and|which)[^;]*", rf"\1{_AGAIN}"),
        (r"; in a program: \S+\(\d+\)\.command\(NmtCommand\.START\)", ""),
        (r"--cell CELL", "--cell CELL"),
        (r"(?:close it, and )?open (?:the machine|it) again(?: to continue)?", "repeat the command"),
        (r"Machine\.attach\(cell, command=True, force=True\)", "--take"),
        (r"; or open the cell in this program: Machine\.open", ""),
        (r"read it while the machine is open", "repeat the command"),
    )
)  # fmt: skip
# A bus that was given by options has no [bus] table.
_WITHOUT_CELL: tuple[tuple[re.Pattern[str], str], ...] = (
    (
        re.compile(r"write the bus's rate, such as bitrate = ([\d_]+), in \[bus\]"),
        r"give the bus's rate with -b",
    ),
    (re.compile(r"correct bitrate in \[bus\]"), "give the link's with -b"),
    (re.compile(r" \(\[bus\.options\]\)"), " (-O)"),
    (re.compile(r"interface = \"socketcan\""), "-i socketcan"),
)


def with_page(error: BaseException) -> str:
    """Return the texts of an error as ``in_commands``, and the command for the page of its symptom, if it has one."""
    page = f"\n{help_line(error)}" if isinstance(error, AxisbusError) else ""
    return in_commands(error) + page


def in_commands(error: BaseException) -> str:
    """Return the texts of an error; calls in them are replaced by commands."""
    text = str(error)
    who = _WHO.match(text)
    cell = next((each for each in sys.argv[1:] if each.endswith(".toml")), "")
    for pattern, command in (*_TABLE, *(() if cell else _WITHOUT_CELL)):
        command = command.replace("CELL", cell or "cell.toml").replace("AXIS", who[1] if who else "AXIS")
        text = pattern.sub(_literal(command), text)
    return text


def _literal(command: str) -> str:
    """Escape the backslashes of a Windows path for a regular expression's replacement."""
    return re.sub(r"\\(?!\d)", r"\\\\", command)
