"""Bring the power stage to a state, transition by transition, with a time limit for each."""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import statusword
from axisbus.cia402.state import PowerState
from axisbus.errors import DriveError, StaleError, TransitionError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import unknown_statusword
from axisbus.motion.parameters import AxisParameters


class StateWalk:
    """Brings the power stage to a goal and checks that every transition is in time; holds the present deadline.

    Only a state that was not seen before starts a new deadline: a drive that repeatedly falls back is given up.
    """

    __slots__ = ("_deadline", "_last", "_parameters", "path")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._deadline = 0.0
        self._last: PowerState | None = None
        self.path: list[PowerState] = []

    def step(self, image: AxisImage, order: CycleOutputs, goal: PowerState) -> bool:
        """Return True when ``goal`` is seen.

        Raises:
            TransitionError: the drive stays in one state past the deadline.
        """
        order.goal = goal
        if image.state is goal:
            return True
        if image.state is not self._last:
            if image.state not in self.path:
                self._deadline = image.now + self._parameters.timing.transition
            self._last = image.state
            self.path.append(image.state)
        if image.now > self._deadline:
            raise self._stuck(image, order, goal)
        return False

    def hold(self, image: AxisImage) -> None:
        """Restart the present time limit: the walk waits for something else."""
        self._deadline = image.now + self._parameters.timing.transition

    def _stuck(self, image: AxisImage, order: CycleOutputs, goal: PowerState) -> DriveError:
        if image.statusword is None:
            return _statusword_unknown(image, self._parameters, goal)
        name, word = self._parameters.name, image.statusword
        sent = order.controlword(image.state)
        command = (
            "nothing was sent" if sent is None else f"controlword 0x{sent:04X} ({cw.words(sent)}) was sent"
        )
        return TransitionError(
            f"{name}: the drive does not change from {image.state.value!r} to {goal.value!r}",
            axis=name,
            observed=f"{command}, statusword 0x{word:04X} for {self._parameters.timing.transition:g} s; "
            f"path: {' > '.join(state.value for state in self.path[-8:])}",
            remedy=_stuck_remedy(image.state, word, name),
        )


def _stuck_remedy(state: PowerState, word: int, name: str) -> str:
    if state is PowerState.NOT_READY_TO_SWITCH_ON:  # the other bits of the statusword have no meaning yet
        return (
            "the drive initialises or tests itself, and takes no command meanwhile: wait and enable the axis again; if it always "
            f"needs longer, raise transition_time in [axes.{name}]; if it never ends, read the drive's errors (axisbus monitor)"
        )
    return "; ".join(statusword.hints(word)) or (
        "check enable inputs, safe torque off and supply of the drive; some drives need longer to release a brake "
        f"(raise transition_time in [axes.{name}])"
    )


def _statusword_unknown(image: AxisImage, parameters: AxisParameters, goal: PowerState) -> StaleError:
    return unknown_statusword(
        image,
        parameters.name,
        f"{parameters.name}: the drive cannot be brought to {goal.value!r}: its statusword (6041h) is unknown",
        f"no fresh statusword for {parameters.timing.transition:g} s, so nothing was sent",
        f"check the cable, and that node {parameters.node} is operational and sends its TPDO (axisbus monitor)",
    )


def word_text(image: AxisImage) -> str:
    """Return the statusword as text for an error."""
    return "no fresh statusword" if image.statusword is None else f"statusword 0x{image.statusword:04X}"
