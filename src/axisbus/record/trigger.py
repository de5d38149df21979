"""The trigger of a capture: a condition on the values of an axis, in its units, or a fault of any axis.

Examples: ``x.velocity > 100``, ``|x.following_error| > 0.5``, ``x.state = ErrorStop``, ``x.mode = csp``, ``fault``. The trigger
fires when the condition becomes true; a condition that is true from the beginning must first become false.
"""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.record.columns import COLUMNS, NAMES, AxisForm
from axisbus.record.condition import Condition, Values, condition
from axisbus.record.sample_packing import sample_of

_FAULT = "fault"
_KINDS = {column.name: column.type for column in COLUMNS}
EXAMPLES = (
    "write it as 'x.velocity > 100', '|x.following_error| > 0.5', 'x.state = ErrorStop', 'fault', 'x.probe', "
    "or of an input or output as 'part = true'"
)


class Trigger:
    """Evaluate each cycle; holds whether the condition was true in the previous one."""

    def __init__(self, when: str | Condition, forms: Mapping[str, AxisForm]) -> None:
        """``when``: as above, or a function of the values of all axes; ``forms``: those of the present axes.

        Raises:
            ArgumentError: the text is not a condition, or names an axis or value that is not recorded.
        """
        self._forms = forms
        self._condition = (
            _fault if when == _FAULT else when if callable(when) else condition(when, forms, _KINDS, EXAMPLES)
        )
        self._before = True

    def begin(self) -> None:
        """As ``RecordingTrigger.begin``."""

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the cycle in which the condition became true; raises the errors of a user's function."""
        values = {
            name: dict(zip(NAMES, form.values(sample_of(snapshots[name])), strict=True))
            for name, form in self._forms.items()
        }
        holds = bool(self._condition(values))
        rises, self._before = holds and not self._before, holds
        return now if rises else None


def _fault(values: Values) -> bool:
    return any(axis["state"] == AxisState.ERRORSTOP.value for axis in values.values())
