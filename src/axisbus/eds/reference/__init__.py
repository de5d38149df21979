"""A complete, printable reference of a device from its EDS: what it holds, and how it is written as HTML and Markdown."""

from axisbus.eds.reference.content import Reference, reference
from axisbus.eds.reference.html import html
from axisbus.eds.reference.markdown import markdown

__all__ = ["Reference", "html", "markdown", "reference"]
