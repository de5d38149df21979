"""Parse a message of a page into a request, or into the reason why it is invalid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from axisbus.web.access.lease import Refusal
from axisbus.web.access.limits import MESSAGE, as_object
from axisbus.web.commands.verbs import STOPS, VERBS, PageVerb
from axisbus.web.objects import transfer_queue
from axisbus.web.objects.transfer_queue import ObjectKey

_LONGEST_NAME, _LONGEST_NUMBER, _LONGEST_TEXT = 64, 200, 1024  # characters
_MAX_VALUES = 8
_NOT_OF_THIS_PAGE = Refusal(
    "the server received a message that does not belong to this page", "load the page again"
)


@dataclass(frozen=True, slots=True)
class PageRequest:
    """A request of a page. ``values`` are numbers as typed; ``press`` counts the presses of held buttons.

    ``sent`` is when the page sent it, in seconds of the page's clock; ``seen`` is when the server sent the values that the page
    showed then, in seconds of the server's clock. ``objects`` are the objects of the request, ``node`` is its node if it concerns a
    whole node; ``text`` is the value of an object as typed.
    """

    verb: PageVerb
    axis: str = ""
    values: Mapping[str, str] = field(default_factory=dict)
    sure: bool = False
    press: int = 0
    sent: float = 0.0
    seen: float | None = None
    objects: tuple[ObjectKey, ...] = ()
    node: int = 0
    text: str = ""


def read(text: str) -> PageRequest | Refusal:
    """Return the request in a message; of a stop, only the verb and the axis are read, so that no other field can invalidate it."""
    if len(text) > MESSAGE:
        return Refusal("a message was too long", f"at most {MESSAGE} characters are allowed")
    found = as_object(text)
    if found is None or (verb := _verb(found.get("do"))) is None:
        return _NOT_OF_THIS_PAGE
    axis = found.get("axis", "")
    if not isinstance(axis, str) or len(axis) > _LONGEST_NAME:
        return _NOT_OF_THIS_PAGE
    return PageRequest(verb, axis) if verb in STOPS else _complete(verb, axis, found)


def _verb(name: object) -> PageVerb | None:
    return next((verb for verb in VERBS if verb.value == name), None)


def _complete(verb: PageVerb, axis: str, found: dict[str, Any]) -> PageRequest | Refusal:
    values, press, sent = found.get("values", {}), found.get("press", 0), found.get("sent", 0.0)
    if not isinstance(values, dict) or len(values) > _MAX_VALUES or not all(map(_is_value, values.values())):
        return _NOT_OF_THIS_PAGE
    seen = found.get("seen")
    if type(press) is not int or not _is_time(sent) or not (seen is None or _is_time(seen)):
        return _NOT_OF_THIS_PAGE
    objects = _objects(found.get("objects", []), VERBS[verb].objects)
    node, text = found.get("node", 0), found.get("text", "")
    if objects is None or type(node) is not int or not 0 <= node < 128:
        return _NOT_OF_THIS_PAGE
    if not isinstance(text, str) or len(text) > _LONGEST_TEXT:
        return _NOT_OF_THIS_PAGE
    return PageRequest(
        verb, axis, values, found.get("sure") is True, press, float(sent), seen, objects, node, text
    )


def _objects(named: object, counts: range) -> tuple[ObjectKey, ...] | None:
    """Return the named objects, None if one is invalid, or if there are more or fewer than the verb takes."""
    if not isinstance(named, list) or len(named) not in counts:
        return None
    found = tuple(each for each in map(transfer_queue.read, named) if each is not None)
    return found if len(found) == len(named) else None


def _is_time(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12


def _is_value(value: object) -> bool:
    return isinstance(value, str) and len(value) <= _LONGEST_NUMBER
