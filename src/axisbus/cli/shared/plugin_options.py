"""Options of drive plug-ins for ``axisbus trace`` and ``axisbus sim``: the ``parts`` of their ``Extension`` with these names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from axisbus.drives import registry
from axisbus.sim.node.network import ForeignNode

TRACE, SIM = "trace_options", "sim_options"
_ABOUT = "{plugins}"  # in the docstring of a command: where the texts about the options are
_F = TypeVar("_F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class TraceOption:
    """An option ``name`` of ``axisbus trace`` for the nodes of a ``protocol``, whose frames do not contain their protocol.

    ``nodes`` reads its text. ``about`` is a sentence or two for the help of the command.
    """

    name: str
    protocol: str
    help: str
    about: str
    nodes: Callable[[str], Sequence[int]]

    @property
    def parameter(self) -> str:
        """The name of its value."""
        return _parameter(self.name)

    def decorate(self, function: _F) -> _F:
        """Add it to a command."""
        return click.option(self.name, default="", metavar="N,N,...", help=self.help)(function)


def _no_nodes(values: Sequence[Any]) -> list[ForeignNode]:  # noqa: ARG001
    return []


def _no_text(values: Sequence[Any]) -> str:  # noqa: ARG001
    return ""


def _not_served(values: Sequence[Any]) -> AbstractContextManager[None]:  # noqa: ARG001
    return nullcontext()


@dataclass(frozen=True, slots=True)
class SimOption:
    """An option ``name`` of ``axisbus sim`` that may be repeated: simulated nodes in addition to those of the cell file.

    ``foreign_nodes`` makes those on the bus, ``text`` tells the user about them, ``serve`` serves others during its block.
    ``about`` is a sentence or two for the help of the command.
    """

    name: str
    type: click.ParamType  # type: ignore[type-arg,unused-ignore]
    help: str
    about: str = ""
    foreign_nodes: Callable[[Sequence[Any]], Sequence[ForeignNode]] = _no_nodes
    text: Callable[[Sequence[Any]], str] = _no_text
    serve: Callable[[Sequence[Any]], AbstractContextManager[None]] = _not_served

    @property
    def parameter(self) -> str:
        """The name of its values."""
        return _parameter(self.name)

    def decorate(self, function: _F) -> _F:
        """Add it to a command."""
        return click.option(self.name, type=self.type, multiple=True, help=self.help)(function)


def trace_options() -> list[TraceOption]:
    """Return the options of all plug-ins for ``axisbus trace``. Blocks while they are imported."""
    return [option for options in registry.parts(TRACE) for option in options]


def sim_options() -> list[SimOption]:
    """Return the options of all plug-ins for ``axisbus sim``. Blocks while they are imported."""
    return [option for options in registry.parts(SIM) for option in options]


def adding(options: Sequence[TraceOption | SimOption], about: str) -> Callable[[_F], _F]:
    """Return a decorator that adds options to a command, and the text ``about`` them to its docstring."""

    def decorate(function: _F) -> _F:
        function.__doc__ = (function.__doc__ or "").replace(_ABOUT, about)
        for option in reversed(options):
            function = option.decorate(function)
        return function

    return decorate


def _parameter(name: str) -> str:
    return name.removeprefix("--").replace("-", "_")
