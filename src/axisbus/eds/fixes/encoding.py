"""Fixes of a whole file: its encoding and its line ends."""

from __future__ import annotations

from axisbus.eds.io import text
from axisbus.eds.io.text import EdsText


def plain_encoding(document: EdsText) -> EdsText | None:
    """Fix S002: return the document without byte order mark, in ASCII if possible, else in UTF-8; None if nothing changes."""
    if not document.bom and not document.encoding.startswith("utf-16"):
        return None
    whole = document.newline.join(document.lines)
    encoding = "ascii" if whole.isascii() else "utf-8"
    try:
        again = text.decode(whole.encode(encoding))
    except UnicodeEncodeError:
        return None  # half a surrogate pair of UTF-16
    if again.text != whole:
        return None
    return text.document(document.lines, document.newline, again.encoding, again.bom)


def line_ends(document: EdsText) -> EdsText | None:
    """Fix S014: return the document with LF if its lines end in CR only, else None."""
    if document.newline != "\r" or len(document.lines) == 1:
        return None
    return text.document(document.lines, "\n", document.encoding, document.bom)


WHOLE = {
    "S002": (plain_encoding, "written without byte order mark, one byte for each ASCII letter"),
    "S014": (line_ends, "lines end in LF"),
}
