"""A message of a browser as an object of JSON, before anybody looks at what it asks."""

from __future__ import annotations

import json
from typing import Any


def as_object(text: str) -> dict[str, Any] | None:
    """Return the object that a text is; None where it is none."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
