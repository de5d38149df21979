"""Parse a trigger: ``part = true`` of an input, ``x.probe`` of a touch probe, otherwise a condition on values of axes."""

from __future__ import annotations

import re
from collections.abc import Mapping

from axisbus.cia401.signal import IoPoint
from axisbus.errors import ArgumentError
from axisbus.motion.numbers import told
from axisbus.record.columns import AxisForm
from axisbus.record.condition import Condition, comparison
from axisbus.record.events import Watched
from axisbus.record.object_selection import wanted_object
from axisbus.record.pdo_objects import MappedSignal
from axisbus.record.trigger import EXAMPLES, Trigger
from axisbus.record.triggers.base import RecordingTrigger
from axisbus.record.triggers.io import IoMoment
from axisbus.record.triggers.probe import ProbeMoment

_IO = re.compile(r"(?P<bar>\|?)\s*(?P<name>[^\s.|<>=!]+)\s*\|?\s*(?P<sign>[<>]=?|!=|==?)\s*(?P<value>.+)")
_PROBE = re.compile(r"(?P<axis>[^\s.|]+)\.probe")


def moment_of(when: str | Condition, machine: Watched, forms: Mapping[str, AxisForm]) -> RecordingTrigger:
    """Return the trigger for ``when``; ``forms``: those of the observed axes.

    Raises:
        ArgumentError: the text is invalid, or names an unknown axis, value, input or output.
        StateError: the node of the input or output is absent.
    """
    if callable(when):
        return Trigger(when, forms)
    if not isinstance(when, str):
        raise ArgumentError(
            f"{told(when)} is not a moment",
            remedy='give a text such as "x.velocity > 100" or "fault", or a function of the axes\' values',
        )
    text = when.strip()
    if probe := _PROBE.fullmatch(text):
        return ProbeMoment(_axis(text, probe["axis"], forms))
    found = _IO.fullmatch(text)
    if found is None:
        return Trigger(text, forms)
    return _of_io(text, found, machine)


def _axis(text: str, name: str, forms: Mapping[str, AxisForm]) -> str:
    if name not in forms:
        raise ArgumentError(f"{text!r}: there is no axis {name!r}", observed=f"there are {', '.join(forms)}")
    return name


def _of_io(text: str, found: re.Match[str], machine: Watched) -> RecordingTrigger:
    name = found["name"]
    if name not in machine.cell.io:
        there = ", ".join(machine.cell.io) or "none"
        raise ArgumentError(
            f"{text!r} is no condition: there is no input or output {name!r}",
            observed=f"the cell has {there}",
            remedy=EXAMPLES,
        )
    wanted = wanted_object(machine, name)
    assert wanted.point is not None
    met = comparison(text, found, _kind(wanted.point), EXAMPLES)
    carried = machine.node(wanted.node).mapped_in(wanted.index, wanted.subindex)
    return IoMoment(machine.session, wanted, None if carried is None else MappedSignal(wanted, carried), met)


def _kind(point: IoPoint) -> str:
    """Return the JSON type of its values."""
    if point.bit is not None:
        return "boolean"
    return "integer" if point.scale is None else "number"
