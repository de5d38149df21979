"""Frozen values as MessagePack bytes: numbers, texts, collections, enums, dataclasses, named tuples, and errors of the tree.

Theory of operation
-------------------
A value that is not a plain number, text or bytes is a list that begins with its kind. The permitted classes are those in the type
hints of the roots of a ``Codec``: both sides refuse any other class. Reading executes nothing but the constructors of these
classes. Both ends have the same version of this package (``messages.OpenCell``), so fields need no versions.

A function in a field is not sent: the other end has the field's default.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from enum import Enum
from fractions import Fraction
from typing import Any

import msgspec

from axisbus.errors import AxisbusError
from axisbus.ipc.errors import ErrorFields, from_fields, to_fields

_PLAIN = (type(None), bool, int, float, str, bytes)
_PACK = msgspec.msgpack.Encoder().encode
_UNPACK = msgspec.msgpack.Decoder().decode


class NotSendable(TypeError):
    """A value must not be sent to another process, or bytes without a valid value were read."""


class Codec:
    """Converts values to bytes and back; holds the permitted classes."""

    def __init__(self, roots: Iterable[Any]) -> None:
        """``roots``: types, unions and generic aliases; the types of their fields are permitted, too."""
        self._classes: dict[str, type] = {}
        for root in roots:
            self._permit(root)

    def pack(self, value: object) -> bytes:
        """Return a value as bytes; raises NotSendable for a class that is not permitted."""
        return _PACK(self._encode(value))

    def unpack(self, data: bytes | msgspec.Raw) -> Any:
        """Return the value of ``data``; raises NotSendable if it contains none."""
        try:
            return self._decode(_UNPACK(data))
        except Exception as error:  # any kind: deep nesting, or a constructor that rejects its fields
            raise NotSendable(f"data from another process cannot be decoded: {error}") from error

    @property
    def classes(self) -> Mapping[str, type]:
        """The permitted classes, by name."""
        return self._classes

    # -- permitted classes -----------------------------------------------------------------------------------------------

    def _permit(self, kind: Any) -> None:
        if typing.get_origin(kind) is not None:
            for part in typing.get_args(kind):
                self._permit(part)
        elif isinstance(kind, type) and _is_record(kind) and _name(kind) not in self._classes:
            self._classes[_name(kind)] = kind
            for hint in () if issubclass(kind, Enum) else typing.get_type_hints(kind).values():
                self._permit(hint)

    def _known(self, kind: type) -> str:
        name = _name(kind)
        if self._classes.get(name) is not kind:
            raise NotSendable(f"{name} cannot be sent to another process")
        return name

    # -- out -------------------------------------------------------------------------------------------------------------

    def _encode(self, value: Any) -> Any:
        kind = type(value)
        if kind in _PLAIN:
            return value
        if isinstance(value, AxisbusError):
            return ["error", msgspec.to_builtins(to_fields(value))]
        if isinstance(value, Enum):
            return ["enum", self._known(kind), value.name]
        if is_dataclass(value):
            return ["record", self._known(kind), self._fields(value, _names(kind))]
        if isinstance(value, tuple) and hasattr(kind, "_fields"):
            return ["record", self._known(kind), self._fields(value, kind._fields)]
        return self._encode_many(value)

    def _fields(self, value: object, names: Iterable[str]) -> dict[str, Any]:
        found = {name: getattr(value, name) for name in names}
        return {name: self._encode(one) for name, one in found.items() if not callable(one)}

    def _encode_many(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            return ["dict", *([self._encode(key), self._encode(one)] for key, one in value.items())]
        name = next((name for many, name in _MANY.items() if isinstance(value, many)), None)
        if name is not None:
            return [name, *(self._encode(one) for one in value)]
        if isinstance(value, Fraction):
            return ["fraction", value.numerator, value.denominator]
        if isinstance(value, datetime):
            return ["time", value.isoformat()]
        if isinstance(value, _PLAIN):  # a subclass, such as of numpy
            return _plain(value)
        raise NotSendable(f"{type(value).__name__} cannot be sent to another process")

    # -- in --------------------------------------------------------------------------------------------------------------

    def _decode(self, given: Any) -> Any:
        if not isinstance(given, list):
            return given
        return _READERS[given[0]](self, given[1:])

    def _decode_record(self, given: list[Any]) -> Any:
        name, values = given
        return self._classes[name](**{key: self._decode(value) for key, value in values.items()})

    def _decode_enum(self, given: list[Any]) -> Any:
        name, member = given
        return self._classes[name][member]  # type: ignore[index]  # an Enum, else it raises

    def _decode_dict(self, given: list[Any]) -> dict[Any, Any]:
        return {self._decode(key): self._decode(value) for key, value in given}

    def _decode_error(self, given: list[Any]) -> AxisbusError:
        return from_fields(msgspec.convert(given[0], ErrorFields))


_MANY: dict[type, str] = {tuple: "tuple", list: "list", frozenset: "frozenset", set: "frozenset"}


def _of(kind: Callable[[Iterable[Any]], Any]) -> Callable[[Codec, list[Any]], Any]:
    return lambda codec, given: kind(map(codec._decode, given))


_READERS: dict[str, Callable[[Codec, list[Any]], Any]] = {
    "record": Codec._decode_record,
    "enum": Codec._decode_enum,
    "dict": Codec._decode_dict,
    "error": Codec._decode_error,
    "tuple": _of(tuple),
    "list": _of(list),
    "frozenset": _of(frozenset),
    "fraction": lambda _, given: Fraction(*given),
    "time": lambda _, given: datetime.fromisoformat(given[0]),
}


def _plain(value: Any) -> int | float | str | bytes:
    found: int | float | str | bytes = next(
        kind for kind in (int, float, str, bytes) if isinstance(value, kind)
    )(value)
    return found


def _is_record(kind: type) -> bool:
    return (
        is_dataclass(kind) or issubclass(kind, Enum) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
    )


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _names(kind: type) -> list[str]:
    """Return the fields that are arguments of the constructor; the others follow from them."""
    return [field.name for field in fields(kind) if field.init]
