"""A complete, printable reference of a device from its EDS, with its output as HTML and Markdown."""

from axisbus.eds.device_doc.content import DeviceReference, reference
from axisbus.eds.device_doc.html import html
from axisbus.eds.device_doc.markdown import markdown

__all__ = ["DeviceReference", "html", "markdown", "reference"]
