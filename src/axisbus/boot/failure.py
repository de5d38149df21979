"""The outcome of a failed boot-up as an error."""

from __future__ import annotations

from axisbus.boot import identity, program_text
from axisbus.cell.model import NodeConfig
from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia302.types import IDENTITY, BootOutcome, Letter
from axisbus.errors import AxisbusError, BootError, SdoAbort
from axisbus.wording import counted

_OTHER_DEVICE = {letter for _, _, letter in IDENTITY}
# Letters of failures that the node's own errors do not explain: the node does not answer, or is another device.
SILENT_OR_STRANGE = {Letter.A, Letter.B, *_OTHER_DEVICE}

_OTHER_VALUE = "give a value that the drive accepts (its manual lists them), or leave the line out"
NAMES_NO_ERROR = (
    "it reports no error: see its manual for reasons not to start (a PDO mapping that it does not accept, a missing "
    "signal); check whether another NMT master is on the bus"
)
# Letter -> message after "node N", and the first remedy.
_ERROR_CONTROL = {
    Letter.E: (
        "it sends no heartbeat, although its 1017h is not 0",
        "check the bus load and the path from the node: its SDO answers come, its heartbeats do not",
    ),
    Letter.F: (
        "it does not answer node guarding, and has no heartbeat",
        "check that the CAN adapter passes remote frames on; without error control a lost node is noticed by its PDOs only "
        '(heartbeat = "off" in [bus] does without)',
    ),
    Letter.K: (
        "it sends no heartbeat after 1017h was set",
        "check the bus load and the path from the node: its SDO answers come, its heartbeats do not",
    ),
}


def as_error(outcome: BootOutcome, node: NodeConfig, cause: AxisbusError | None) -> AxisbusError:
    """Return the error of a failed boot-up; ``cause`` is the error of its last request that failed, None if there is none."""
    if outcome.letter in _OTHER_DEVICE:
        error = identity.another_device(outcome, node)
    elif outcome.letter is Letter.J:
        error = _configuration(outcome, cause)
    elif outcome.letter in program_text.LETTERS:
        error = program_text.as_error(outcome, node, cause)
    elif outcome.letter in _ERROR_CONTROL:
        error = _error_control(outcome)
    elif cause is not None:
        error = at_step(node.node_id, outcome.step, cause)
    else:
        error = BootError(
            f"node {node.node_id}, step {outcome.step}: {outcome.sentence}",
            node=node.node_id,
            step=outcome.step,
        )
    return with_facts(error, outcome)


def with_facts(error: BootError, outcome: BootOutcome) -> BootError:
    """Add the letter, tries and time of the failed boot-up to its error."""
    error.letter = outcome.letter.name if outcome.letter is not None else ""
    if error.index is None and outcome.address is not None:
        error.index, error.subindex = outcome.address
    error.abort, error.tries, error.elapsed = outcome.abort, outcome.tries, outcome.elapsed
    return error


def at_step(node_id: int, step: str, error: AxisbusError) -> BootError:
    """Return the error of a step as a BootError that names node and step."""
    if isinstance(error, BootError):
        return error
    failed = BootError(
        f"node {node_id}, step {step}: {error.message}",
        node=node_id,
        step=step,
        index=getattr(error, "index", None),
        subindex=getattr(error, "subindex", 0),
        observed=error.observed,
        remedy=error.remedy,
    )
    failed.__cause__ = error
    return failed


def _configuration(outcome: BootOutcome, cause: AxisbusError | None) -> BootError:
    what, observed, remedy = _what_went_wrong(outcome, cause)
    index, subindex = outcome.address or (o.VERIFY_CONFIGURATION, 0)
    setting = outcome.setting
    wish = f"cannot be set to {setting.value!r} ({setting.source})" if setting else "cannot be set"
    error = BootError(
        f"node {outcome.node}: {index:04X}h:{subindex:02X} {wish}: {what}",
        node=outcome.node,
        step=outcome.step,
        index=index,
        subindex=subindex,
        observed=observed,
        remedy=remedy or _OTHER_VALUE,
    )
    error.__cause__ = cause
    return error


def _what_went_wrong(outcome: BootOutcome, cause: AxisbusError | None) -> tuple[str, str, str]:
    if outcome.expected is not None and outcome.setting is not None and outcome.setting.fixed:
        return (
            "the EDS has it read-only, and the drive has another value",
            f"expected {outcome.expected!r}, got {outcome.got!r}",
            f"command the behaviour that {outcome.got!r} means, set it with the manufacturer's tool, or correct its access in the "
            "EDS",
        )
    if outcome.expected is not None:
        return (
            "reads back another value",
            f"expected {outcome.expected!r}, got {outcome.got!r}",
            "the drive limits or rounds this value: write one that it accepts (its manual lists the range)",
        )
    if isinstance(cause, SdoAbort):
        refused = cause.code in abort.VALUE_REFUSED
        return (
            "the drive refuses it",
            cause.observed,
            _OTHER_VALUE if refused else cause.remedy or abort.explain(cause.code).hint,
        )
    if cause is None:
        return "no answer", "", ""
    return cause.message, cause.observed, cause.remedy


def _error_control(outcome: BootOutcome) -> BootError:
    assert outcome.letter is not None
    what, remedy = _ERROR_CONTROL[outcome.letter]
    return BootError(
        f"node {outcome.node}, step {outcome.step}: {what}",
        node=outcome.node,
        step=outcome.step,
        index=None if outcome.address is None else outcome.address[0],
        observed=f"no answer in {counted(outcome.tries, 'attempt')}; {outcome.elapsed:.1f} s since its boot-up began",
        remedy=remedy,
    )
