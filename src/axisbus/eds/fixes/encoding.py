"""Mends of a file as a whole: its encoding and its line ends."""

from __future__ import annotations

from axisbus.eds.io import text
from axisbus.eds.io.text import EdsText


def plain_encoding(document: EdsText) -> EdsText | None:
    """S002: return the document without byte order mark, in ASCII or, where it has other letters, in UTF-8; None if it is so."""
    if not document.bom and not document.encoding.startswith("utf-16"):
        return None
    whole = document.newline.join(document.lines)
    encoding = "ascii" if whole.isascii() else "utf-8"
    try:
        again = text.decode(whole.encode(encoding))
    except UnicodeEncodeError:
        return None  # half a pair of UTF-16
    if again.text != whole:
        return None
    return text.document(document.lines, document.newline, again.encoding, again.bom)


def line_ends(document: EdsText) -> EdsText | None:
    """S014: return the document with LF where its lines end in CR alone, None if they do not."""
    if document.newline != "\r" or len(document.lines) == 1:
        return None
    return text.document(document.lines, "\n", document.encoding, document.bom)


WHOLE = {
    "S002": (plain_encoding, "written without byte order mark, one byte for each ASCII letter"),
    "S014": (line_ends, "lines end in LF"),
}
