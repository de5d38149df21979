"""Decide whether a page's request is carried out: by its role, by the controls, and by the request's values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from axisbus.web.access.lease import PageIdentity, PageLease, Refusal
from axisbus.web.access.tokens import Role
from axisbus.web.commands.request import PageRequest
from axisbus.web.commands.verbs import VERBS, PageVerb, VerbRequirements


@dataclass(frozen=True, slots=True)
class PageAction:
    """An authorised request: ``axes`` by name, ``values`` as numbers in the axis's units."""

    verb: PageVerb
    axes: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)


def decide(
    identity: PageIdentity, lease: PageLease, request: PageRequest, axes: Collection[str]
) -> PageAction | Refusal:
    """Return the action to carry out, or why it is refused. Every page may halt and stop, even without the controls."""
    row = VERBS[request.verb]
    if row.axis and request.axis not in axes:
        return Refusal(f"there is no axis {request.axis!r}", f"there are {', '.join(axes) or 'none'}")
    refused = _of_page(identity, lease, row) or _of_what(request, row)
    if refused is not None:
        return refused
    values = _numbers(request, row)
    if isinstance(values, Refusal):
        return values
    if request.verb in (PageVerb.QUICK_STOP_ALL, PageVerb.HALT_ALL):
        return PageAction(request.verb, tuple(axes))
    return PageAction(request.verb, (request.axis,) if row.axis else (), values)


def _of_page(identity: PageIdentity, lease: PageLease, row: VerbRequirements) -> Refusal | None:
    if not row.controls or lease.held_by(identity):
        return None
    if identity.role is not Role.OPERATOR:
        return Refusal(
            "this is an observer page: it may only halt, stop, and read objects",
            "ask an operator for a link",
        )
    if lease.holder is None:
        return Refusal("no page has the controls", "take them first (Take the controls)")
    return Refusal(
        f"{lease.holder.page_name} has the controls", "take them over (Take over), and inform that user"
    )


def _of_what(request: PageRequest, row: VerbRequirements) -> Refusal | None:
    if row.sure and not request.sure:
        command_text = f"{request.axis}.{request.verb.value}" if row.axis else request.verb.value
        return Refusal(f"{command_text}(): it has not been confirmed", "answer the page's question")
    return None


def _numbers(request: PageRequest, row: VerbRequirements) -> dict[str, float] | Refusal:
    """Return the numbers that the verb takes; an omitted number takes the default of the cell file, if there is one."""
    found: dict[str, float] = {}
    for name in (*row.needs, *row.optional):
        text = request.values.get(name, "").strip().replace(",", ".")
        if not text and name in row.needs:
            return Refusal(
                f"{request.axis}.{request.verb.value}(): no {name} given", f"give the {name} as a number"
            )
        try:
            found |= {name: _number(text)} if text else {}
        except ValueError:
            return Refusal(
                f"{request.axis}.{request.verb.value}(): {text!r} is not a valid {name}",
                "give it as a number, such as 12.5",
            )
    return found


def _number(text: str) -> float:
    """Return a text as a number; reject digits of other scripts and underscores, which float() accepts, as typing errors.

    Raises:
        ValueError: the text is not a number.
    """
    if not text.isascii() or "_" in text:
        raise ValueError(text)
    return float(text)
