"""Convert a document or a model to bytes: an unchanged file to the bytes that were read, a model made in a program to a new EDS."""

from __future__ import annotations

from axisbus.eds.io.lazy_objects import FileObjects
from axisbus.eds.io.new_file import compose
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText
from axisbus.eds.model import Eds


def dumps(source: EdsText | EdsParseResult | Eds) -> bytes:
    """Return the bytes of an EDS or DCF.

    A document, a parse result, and an ``Eds`` returned by ``load`` give the bytes that were read. A document changed by
    ``edit.apply`` gives the same bytes with the changed lines. If the objects or information sections of an ``Eds`` are not from a
    file (made in a program, or replaced), ``compose`` writes a new file in ASCII.

    Raises:
        ArgumentError: a text of a model made in a program is not allowed in an EDS.
    """
    if isinstance(source, Eds):
        objects = source.objects
        if not isinstance(objects, FileObjects) or source.info is not objects.parts.info:
            return compose(source).encode("ascii")
        source = objects.document
    document = source.document if isinstance(source, EdsParseResult) else source
    return document.bom + document.newline.join(document.lines).encode(document.encoding)
