"""The state of a node's program in words: as a line of the report, as plain values, and as the error of a failed boot-up."""

from __future__ import annotations

from typing import Any

from axisbus.cell.model import NodeConfig
from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia302.program import NUMBER, ProgramControl, ProgramStage, ProgramState, ProgramVersion
from axisbus.cia302.types import BootOutcome, Letter
from axisbus.errors import AxisbusError, BootError, NodeError, SdoAbort, SdoTimeout
from axisbus.wording import counted

LETTERS = frozenset({Letter.G, Letter.H, Letter.I})

_ORDERS = {
    ProgramStage.STOP: ProgramControl.STOP,
    ProgramStage.CLEAR: ProgramControl.CLEAR,
    ProgramStage.START: ProgramControl.START,
}

# The contents of the node's memory, by the stage that failed.
_STATE_AFTER = {
    ProgramStage.STOP: "the program was not cleared: after a power cycle the node runs its old program",
    ProgramStage.CLEAR: "the old program may be cleared already: do not rely on the node before a download has succeeded",
    ProgramStage.TRANSFER: "the old program is cleared, the new one incomplete: the node is useless until a download succeeds",
    ProgramStage.FLASH: "the old program is cleared, the new one is invalid: the node is useless until a download succeeds",
    ProgramStage.START: "the new program is in the node, but does not run",
    ProgramStage.RETURN: "the new program was transferred, and its start was commanded",
}
_TOOL = "if that fails too, load the program with the manufacturer's tool"
_FILE = f"check that the file is for this device and in the format that it accepts, and {{again}}; {_TOOL}"
# The first remedy, by the stage that failed; the words in braces are those of a boot-up or of a write by command.
_FIRST = {
    ProgramStage.STOP: "see the drive's manual for the state in which its program may be stopped, and {repeat}",
    ProgramStage.CLEAR: f"{{again}}; {_TOOL}",
    ProgramStage.TRANSFER: f"check supply and wiring, and {{again}}; {_TOOL}",
    ProgramStage.FLASH: _FILE,
    ProgramStage.START: f"switch the node off and on, and {{again}}; {_TOOL}",
    ProgramStage.RETURN: f"switch the node off and on, and {{result}}; if it only needs more time, {{longer}}; {_TOOL}",
}
_AT_BOOT = {
    "repeat": "boot again",
    "again": "boot again: the download restarts with stop and clear",
    "result": "boot again (the new result decides)",
    "longer": "give a longer deadline in [nodes.N.program]",
}
_BY_COMMAND = {
    "repeat": "write it again",
    "again": "write it again: this begins with stop and clear, also if the node answers only from its boot loader, as after a loss "
    "of its supply",
    "result": "look at its program again",
    "longer": "give a longer deadline",
}
_OTHER_IDENTIFICATION = (
    "compare the identification with that of the program in the file, which its manufacturer documents, and repeat the write with "
    "the right one"
)
_OTHER_PROGRAM = (
    "compare [nodes.N.program] with the program in the file (its manufacturer documents date and identification), correct the "
    "wrong one, and boot again"
)
# The other property that identifies a program, if an object is missing.
_OTHER_MARK = {
    o.VERIFY_SOFTWARE: "give identification (the value of its 1F56h:01) instead of date_time",
    o.PROGRAM_IDENTIFICATION: "give date_time (the value of its 1F52h) instead of identification",
}


def line(state: ProgramState | None) -> str:
    """Return the report's line; empty if no program is expected."""
    if state is None:
        return ""
    if state.replaced:
        return f"{state.now}: replaced, {counted(state.loaded, 'byte')}; it was {state.found}"
    if state.found == state.expected:
        return f"{state.found}, as expected"
    found = "it does not report its program" if state.found is None else str(state.found)
    return f"{found}, NOT {state.expected}; left unchanged"


def as_json(state: ProgramState | None) -> dict[str, Any] | None:
    """Return the program state as plain values; dates as ISO 8601 without a time zone, null if there is none."""
    if state is None:
        return None
    return {
        "expected": _plain(state.expected),
        "found": _plain(state.found),
        "now": _plain(state.now),
        "replaced": state.replaced,
        "bytes": state.loaded,
        "stage": state.stage.name.lower(),
        "flash": None if state.flash is None else state.flash.value,
    }


def as_error(outcome: BootOutcome, node: NodeConfig, cause: AxisbusError | None) -> BootError:
    """Return the error of a boot-up that ended with one of ``LETTERS``; ``cause`` is the error of its last failed request."""
    assert outcome.program is not None
    if outcome.letter is Letter.G:
        what, observed, remedy = _inconsistent(outcome, outcome.program)
    elif outcome.letter is Letter.H:
        what, observed, remedy = _not_allowed(
            outcome.program, node.program is not None and node.program.download
        )
    else:
        what, observed, remedy = _failed(outcome, cause, _AT_BOOT, _OTHER_PROGRAM)
    error = BootError(
        f"node {node.node_id}{what}",
        node=node.node_id,
        step=outcome.step,
        observed=observed,
        remedy=remedy.replace("[nodes.N", f"[nodes.{node.node_id}"),
    )
    error.__cause__ = cause if outcome.letter is Letter.I else None
    return error


def write_failed(outcome: BootOutcome, cause: AxisbusError | None) -> NodeError:
    """Return the error of a write by command that has failed; ``cause`` is the error of its last failed request."""
    what, observed, remedy = _failed(outcome, cause, _BY_COMMAND, _OTHER_IDENTIFICATION)
    error = NodeError(f"node {outcome.node}{what}", node=outcome.node, observed=observed, remedy=remedy)
    error.__cause__ = cause
    return error


def _inconsistent(outcome: BootOutcome, state: ProgramState) -> tuple[str, str, str]:
    if state.found is not None:
        return (
            ": its program must be replaced, and there is no file with the new one",
            _both(state),
            'give file = "firmware.bin" in [nodes.N.program], or remove download = true',
        )
    index, subindex = outcome.address or (o.VERIFY_SOFTWARE, 1)
    why = "it is not a number" if outcome.abort is None else abort.describe(outcome.abort)
    return (
        f" does not report its program: {index:04X}h:{subindex:02X} cannot be read",
        f"{why}; the cell file expects {state.expected}",
        f"if the device has no {index:04X}h, {_OTHER_MARK[index]}, or remove [nodes.N.program]; if it has lost its program "
        "(its boot loader answers, often under another name), load one with the manufacturer's tool",
    )


def _not_allowed(state: ProgramState, download: bool) -> tuple[str, str, str]:
    if download:
        return (
            " has a program other than the expected one, which is not replaced while the machine runs",
            _both(state),
            "close the machine, and boot: axisbus boot with this cell file replaces it",
        )
    right = _toml(state.found)
    keep = f"if the node's program is right, write {right} in [nodes.N.program]; " if right else ""
    return (
        " has a program other than the expected one, and it may not be replaced",
        _both(state),
        f'{keep}to replace it by the expected one, give file = "firmware.bin" and download = true there '
        "(the node must keep its supply until that is done)",
    )


def _failed(
    outcome: BootOutcome, cause: AxisbusError | None, texts: dict[str, str], other: str
) -> tuple[str, str, str]:
    """Return message, observation and remedy; ``other``: the remedy if the node has a program other than the expected one."""
    state = outcome.program
    assert state is not None
    index, subindex = outcome.address or (o.PROGRAM_DATA, 1)
    where = f"{index:04X}h:{subindex:02X}"
    if state.stage in _ORDERS:
        where += f" = {_ORDERS[state.stage].value}"
    return (
        f": its program could not be replaced; the replacement failed while {state.stage.value} ({where})",
        f"{_reason(outcome, state, cause)}; {_STATE_AFTER.get(state.stage, '')}",
        _first(outcome, state, other).format(**texts),
    )


def _first(outcome: BootOutcome, state: ProgramState, other: str) -> str:
    if state.stage is ProgramStage.TRANSFER and outcome.abort is not None:
        return _FILE
    if state.stage is ProgramStage.STOP and outcome.abort is None:
        return _FIRST[ProgramStage.TRANSFER]  # it did not answer
    if state.stage is ProgramStage.RETURN and outcome.got is not None and state.expected.numbers:
        return other
    return _FIRST.get(state.stage, "{again}")


def _reason(outcome: BootOutcome, state: ProgramState, cause: AxisbusError | None) -> str:
    if outcome.abort is not None:
        return f"the node refuses: {abort.describe(outcome.abort)}"
    if state.flash is not None and outcome.address == (o.FLASH_STATUS, NUMBER):
        return f"its memory (1F57h) reports {state.flash}"
    if outcome.got is not None:
        return f"expected {outcome.expected!s}, got {outcome.got!s}"
    if cause is None or isinstance(cause, SdoAbort):
        return f"no answer, {outcome.elapsed:.0f} s after its boot-up began"
    broke_off = (
        outcome.address == (o.PROGRAM_DATA, NUMBER) and getattr(cause, "index", None) == o.PROGRAM_DATA
    )
    silent = isinstance(cause, SdoTimeout) and not broke_off  # then the last requested object means nothing
    reason = "the node no longer answers" if silent else cause.message
    return f"{reason} ({cause.observed})" if cause.observed else reason


def _both(state: ProgramState) -> str:
    objects = " and ".join(dict.fromkeys(f"{index:04X}h" for index, _ in state.expected.numbers))
    return f"by {objects} it is {state.found}, the cell file expects {state.expected}"


def _plain(mark: ProgramVersion | None) -> dict[str, Any] | None:
    if mark is None:
        return None
    moment = None if mark.version is None else mark.version.moment
    return {
        "date_time": None if moment is None else moment.isoformat(),
        "identification": mark.identification,
    }


def _toml(mark: ProgramVersion | None) -> str:
    """Return the lines of the cell file that expect this program; empty if the program is unknown."""
    if mark is None or mark.version == (0, 0) or (mark.version is not None and mark.version.moment is None):
        return ""
    moment = None if mark.version is None else mark.version.moment
    keys = [] if moment is None else [f"date_time = {moment.isoformat()}"]
    keys += [] if mark.identification is None else [f"identification = 0x{mark.identification:08X}"]
    return " and ".join(keys)
