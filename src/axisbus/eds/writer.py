"""A document back to the bytes that it came from."""

from __future__ import annotations

from axisbus.eds.text import Document


def dumps(document: Document) -> bytes:
    """Return the file's bytes: those it was read from, where nothing was changed."""
    return document.bom + document.newline.join(document.lines).encode(document.encoding)
