"""Error texts and remedies for a node that is lost."""

from __future__ import annotations

from axisbus.cia301 import cob
from axisbus.cia301.nmt import NmtState
from axisbus.errors import NodeStateError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.stop.diagnosis import nmt_text

# Last received NMT state of a node that is lost without any message.
SILENT = frozenset({NmtState.OPERATIONAL, NmtState.UNKNOWN})
ANEW = "close the machine and open it again, which configures and starts the node again"


def start_and_reset(node: int) -> str:
    """Return how to restart a node that still has its configuration; a node that has restarted needs ``ANEW`` instead."""
    return (
        f"start it (axisbus nmt start {node} --cell CELL; in a program: machine.node({node}).command(NmtCommand.START)), "
        "and reset the axis: axis.reset()"
    )


def when_back(node: int) -> str:
    """Return what to do when a node is present again, whether it has restarted or not."""
    return f"when the node answers again, {start_and_reset(node)}; if it has restarted, {ANEW}"


def remedy_for_silence(node: int) -> str:
    """Return what to do when a node has become silent."""
    return (
        f"check supply and cable of node {node}, then bus load and that SYNC reaches it (axisbus scan shows the nodes that "
        f"answer); {when_back(node)}"
    )


def silence_of(node: int, image: AxisImage) -> tuple[str, str]:
    """Return why a silent node counts as lost, and what was expected from it."""
    if image.guarded:
        return (
            "it does not answer node guarding",
            f"requests for its state (remote frames {cob.HEARTBEAT + node:03X}h) are not answered",
        )
    return "its heartbeat stopped", "its heartbeat did not come in time"


def not_to_be_reset(name: str, node: int, image: AxisImage, *, stopping: bool) -> NodeStateError:
    """Return why a command cannot reset an axis whose node is not operational; ``stopping``: the axis is still being stopped."""
    still = "; the axis is still being stopped" if stopping else ""
    if image.bus is not None:
        return NodeStateError(
            f"{name}: node {node} cannot be reached: {image.bus.message}",
            observed=image.bus.observed + still,
            remedy=f"{image.bus.remedy}; then reset again if the node is still operational, else {ANEW}",
        )
    if image.restarted and (image.overdue or image.nmt != NmtState.OPERATIONAL):
        return NodeStateError(
            f"{name}: node {node} has restarted, or may have, so a reset is not enough",
            observed=f"{nmt_text(image)}; whether it still has the configuration of this master is not known{still}",
            remedy=ANEW,
        )
    if image.overdue or image.nmt == NmtState.UNKNOWN:
        return NodeStateError(
            f"{name}: node {node} is lost, so there is no node to reset",
            observed=f"{nmt_text(image)}{still}",
            remedy=f"check supply and cable of node {node} until axisbus scan shows it; then {ANEW}; if it has not restarted, it "
            f"is enough to {start_and_reset(node)}",
        )
    if image.nmt == NmtState.OPERATIONAL:
        return NodeStateError(
            f"{name}: node {node} has returned, but a reset is not enough",
            observed="it has restarted, or may have: whether it still has the configuration of this master is not "
            f"known{still}",
            remedy=ANEW,
        )
    return NodeStateError(
        f"{name}: node {node} is present, but not operational, so a reset alone is not enough",
        observed=nmt_text(image) + still,
        remedy=f"its EMCY says why it left operational (axisbus monitor): clear that cause; then {start_and_reset(node)}",
    )
