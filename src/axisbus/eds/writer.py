"""A document or a model back to bytes: a file that was read to those that it came from, a model made by hand to a new EDS."""

from __future__ import annotations

from axisbus.eds.io.lazy_objects import FileObjects
from axisbus.eds.io.new_file import compose
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText
from axisbus.eds.model import Eds


def dumps(source: EdsText | EdsParseResult | Eds) -> bytes:
    """Return the bytes of an EDS or DCF.

    A document, a reading, and an ``Eds`` as ``load`` returned it give the bytes they were read from; a document that
    ``edit.apply`` changed gives those with the changed lines. An ``Eds`` whose objects or information sections are no file's (made
    in a program, or replaced) is written anew in ASCII by ``compose``.

    Raises:
        ArgumentError: a text of a model made in a program cannot stand in an EDS.
    """
    if isinstance(source, Eds):
        objects = source.objects
        if not isinstance(objects, FileObjects) or source.info is not objects.parts.info:
            return compose(source).encode("ascii")
        source = objects.document
    document = source.document if isinstance(source, EdsParseResult) else source
    return document.bom + document.newline.join(document.lines).encode(document.encoding)
