"""Read a JSON document that axisbus has written: its kind and its format are those expected, and every error names its file."""

from __future__ import annotations

import json
from typing import Any

from axisbus.errors import ArgumentError


def read_document(
    text: str, source: str, *, kind: str, version: int, what: str, remedy: str, key: str = "format"
) -> dict[str, Any]:
    """Return the document in ``text``; messages name ``source`` (its file), ``what`` it should be, and the ``remedy``.

    ``kind`` is the value of its key *kind*, and ``version`` that of ``key``.

    Raises:
        ArgumentError: it is not JSON, not a document of this kind, or of another version.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"{source}: not JSON: {error}", remedy=remedy) from None
    if not isinstance(found, dict) or found.get("kind") != kind:
        raise ArgumentError(f"{source}: not {what}", remedy=remedy)
    if found.get(key) != version:
        raise ArgumentError(f"{source}: its format {found.get(key)!r} is not supported", remedy=remedy)
    return found
