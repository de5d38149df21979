"""Decode a message of a browser as a JSON object."""

from __future__ import annotations

import json
from typing import Any


def as_object(text: str) -> dict[str, Any] | None:
    """Return the object in a text; None if it is not a JSON object."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
