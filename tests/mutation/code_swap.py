"""A mutant put into modules that are loaded already, by changing the code of the functions that it is in."""

from __future__ import annotations

import gc
import warnings
from types import CodeType, FunctionType

Key = tuple[str, str, int]


class Functions:
    """The functions that exist now, by where they come from."""

    def __init__(self, folder: str) -> None:
        self._by_key: dict[Key, list[FunctionType]] = {}
        for thing in gc.get_objects():
            if type(thing) is FunctionType and thing.__code__.co_filename.startswith(folder):
                self._by_key.setdefault(_key(thing.__code__), []).append(thing)

    def changes(self, path: str, text: str, mutated: str) -> list[tuple[FunctionType, CodeType]] | None:
        """Return the functions of the file at ``path`` that differ under ``mutated``; None if only a new import shows it."""
        pairs = _changes(compile_quietly(text, path), compile_quietly(mutated, path)) or []
        found = [(function, new) for old, new in pairs for function in self._by_key.get(_key(old), [])]
        everywhere = all(_key(old) in self._by_key for old, _ in pairs)
        fits = all(len(function.__code__.co_freevars) == len(new.co_freevars) for function, new in found)
        return found if found and everywhere and fits else None


def compile_quietly(text: str, path: str) -> CodeType:
    """Compile source that may look odd."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return compile(text, path, "exec", dont_inherit=True)


def _changes(
    old: CodeType, new: CodeType, *, in_function: bool = False
) -> list[tuple[CodeType, CodeType]] | None:
    """Return the functions whose own or inner code differs; None where code outside the functions does."""
    inner_old, inner_new = _inner(old), _inner(new)
    own_differs = _own(old) != _own(new) or len(inner_old) != len(inner_new)
    if in_function:
        pairs = zip(inner_old, inner_new, strict=False)
        differs = own_differs or any(_changes(a, b, in_function=True) for a, b in pairs)
        return [(old, new)] if differs else []
    if own_differs:
        return None
    changes: list[tuple[CodeType, CodeType]] = []
    for a, b in zip(inner_old, inner_new, strict=True):
        found = _changes(
            a, b, in_function=bool(a.co_flags & 0x02)
        )  # CO_NEWLOCALS: neither a module nor a class body
        if found is None:
            return None
        changes += found
    return changes


def _inner(code: CodeType) -> list[CodeType]:
    return [constant for constant in code.co_consts if isinstance(constant, CodeType)]


def _own(code: CodeType) -> tuple[object, ...]:
    constants = [repr(constant) for constant in code.co_consts if not isinstance(constant, CodeType)]
    return code.co_code, constants, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars


def _key(code: CodeType) -> Key:
    return code.co_filename, code.co_qualname, code.co_firstlineno
