"""What is told of a node that is lost, and what to do about it."""

from __future__ import annotations

from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtState
from axisbus.errors import StateError
from axisbus.motion.axis.image import Image
from axisbus.motion.stop.diagnosis import nmt_text

# What was heard last of a node that is lost without a word.
SILENT = frozenset({NmtState.OPERATIONAL, NmtState.UNKNOWN})
ANEW = "close the machine and open it again, which configures and starts the node anew"


def remedy_for_silence(node: int) -> str:
    """Return what to do where nothing is heard of a node any more."""
    return (
        f"check supply and cable of node {node}, then bus load and that SYNC reaches it (axisbus scan shows who answers); close "
        "the machine and open it again"
    )


def silence_of(node: int, image: Image) -> tuple[str, str]:
    """Return what makes a node count as lost that has fallen silent, and what was expected of it."""
    if image.guarded:
        return (
            "it does not answer node guarding",
            f"requests for its state (remote frames {cob.HEARTBEAT + node:03X}h) stay without an answer",
        )
    return "its heartbeat stopped", "no heartbeat of it came in time"


def not_to_be_reset(name: str, node: int, image: Image, *, stopping: bool) -> StateError:
    """Return why a command cannot reset an axis whose node is not operational; ``stopping``: the axis is still being stopped."""
    still = "; the axis is still being stopped" if stopping else ""
    if image.bus is not None:
        return StateError(
            f"{name}: node {node} cannot be reached: {image.bus.message}",
            observed=image.bus.observed + still,
            remedy=f"{image.bus.remedy}; then reset again where the node is still operational, else {ANEW}",
        )
    if image.overdue or image.nmt == NmtState.UNKNOWN:
        return StateError(
            f"{name}: node {node} is lost, so there is nobody to reset",
            observed=f"{nmt_text(image)}{still}",
            remedy=f"check supply and cable of node {node} until axisbus scan shows it; then {ANEW}",
        )
    if image.nmt == NmtState.OPERATIONAL:
        return StateError(
            f"{name}: node {node} is there again, and cannot be reset into service",
            observed=f"it has restarted, or may have: its configuration is not known to be ours{still}",
            remedy=ANEW,
        )
    return StateError(
        f"{name}: node {node} is there, and not operational, so a reset is of no use",
        observed=nmt_text(image) + still,
        remedy=f"see its EMCY why it left operational (axisbus monitor), and mend that; then {ANEW}",
    )
