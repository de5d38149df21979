"""The reference of the library, generated from the docstrings of the public names."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Mapping
from pathlib import Path

_TABLES = Path(__file__).parents[1] / "api"  # by them a test keeps what is public

_MODULES = {
    "axisbus": "machines, axes, groups, handles",
    "axisbus.drives": "makes of drives",
    "axisbus.drives.gim6010": "MIT control of a GIM6010-8",
    "axisbus.eds": "EDS and DCF files",
    "axisbus.errors": "every exception",
}
Members = Mapping[str, str]
_ABOUT = """# The library, by its docstrings

All public names, with units, ranges and errors. [`axisbus`](../../api/axisbus.md), [`axisbus.drives`](../../api/drives.md),
[`axisbus.drives.gim6010`](../../api/gim6010.md), [`axisbus.eds`](../../api/eds.md) and [`axisbus.errors`](../../api/errors.md)
contain the same in tables, with examples.

```{toctree}
axisbus
drives
gim6010
eds
errors
```
"""


def pages() -> Mapping[str, str]:
    """Return a page for each public module."""
    each = {
        f"reference/python/{name.rpartition('.')[2]}": _page(name, about) for name, about in _MODULES.items()
    }
    return {"reference/python/index": _ABOUT, **each}


def _page(module: str, about: str) -> str:
    names = importlib.import_module(module).__all__
    parts = [f"# `{module}`: {about}\n"]
    public = _public(_TABLES / f"{module.rpartition('.')[2]}.md")
    for name in names:
        what = getattr(importlib.import_module(module), name)
        parts.append(
            f"## `{name}`\n\n```{{eval-rst}}\n{_directive(module, name, what, public.get(name, {}))}\n```\n"
        )
    return "\n".join(parts)


def _public(page: Path) -> Mapping[str, Members]:
    """Return the members of each class on a page of docs/api/, with their descriptions."""
    found: dict[str, dict[str, str]] = {}
    name = ""
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            name = line.removeprefix("## ").strip("`")
        elif row := re.match(r"\| `(\w+)[`(][^|]*\|([^|]*)\|", line):
            found.setdefault(name, {})[row[1]] = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", row[2]).strip()
    return found


def _directive(module: str, name: str, what: object, members: Members) -> str:
    if inspect.isclass(what):
        bases = "\n   :show-inheritance:" if issubclass(what, BaseException) else ""
        own = {each: text for each, text in members.items() if not _is_known(what, each)}
        shown = ", ".join(each for each in members if each not in own)
        rest = "".join(
            f"\n\n   .. py:attribute:: {each}\n      :no-index:\n\n      {text}" for each, text in own.items()
        )
        return f".. autoclass:: {module}.{name}\n   :members: {shown}{bases}{rest}"
    if inspect.ismodule(what):
        return f".. automodule:: {what.__name__}\n   :members:"
    return f".. autofunction:: {module}.{name}"


def _is_known(what: type, name: str) -> bool:
    """Whether a class itself has a member; the page of docs/api/ describes attributes that only its objects have."""
    return hasattr(what, name) or any(name in getattr(each, "__annotations__", {}) for each in what.__mro__)
