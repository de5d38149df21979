"""The reference of the library, made of the docstrings of what is public."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping

_MODULES = {
    "axisbus": "machines, axes, groups, handles",
    "axisbus.eds": "EDS and DCF files",
    "axisbus.errors": "every exception",
}
_ABOUT = """# The library, by its docstrings

What is public, with units, ranges, and what is raised. [`axisbus`](../../api/axisbus.md), [`axisbus.eds`](../../api/eds.md) and
[`axisbus.errors`](../../api/errors.md) tell the same in tables, with examples.

```{toctree}
axisbus
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
    for name in names:
        what = getattr(importlib.import_module(module), name)
        parts.append(f"## `{name}`\n\n```{{eval-rst}}\n{_directive(module, name, what)}\n```\n")
    return "\n".join(parts)


def _directive(module: str, name: str, what: object) -> str:
    if inspect.isclass(what):
        return f".. autoclass:: {module}.{name}\n   :members:\n   :show-inheritance:"
    if inspect.ismodule(what):
        return f".. automodule:: {what.__name__}\n   :members:"
    return f".. autofunction:: {module}.{name}"
