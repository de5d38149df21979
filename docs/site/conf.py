"""Sphinx's settings for the site that ``make docs`` builds; ``staging.py`` collects its sources."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring

from axisbus.version import __version__

project = "axisbus"
release = version = __version__
copyright = "the authors of axisbus"  # noqa: A001  # Sphinx's name

extensions = ["myst_nb", "sphinx.ext.autodoc"]
root_doc = "index"
nitpicky = True
# Many types in signatures are not public, so missing references to them are ignored; links between pages are checked by links.py.
nitpick_ignore_regex = [("py:.*", ".*")]

myst_heading_anchors = 6  # as code hosts make them
myst_enable_extensions = ["attrs_inline", "deflist"]

nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # no widget is used, and nothing may be loaded from another host

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
autodoc_preserve_defaults = True
default_role = "code"

html_theme = "furo"
html_title = f"axisbus {__version__}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["versions.js"]
templates_path = ["_templates"]
html_copy_source = False
html_show_sourcelink = False
smartquotes = False  # it would turn the two hyphens of an option into a dash
highlight_language = "text"
pygments_style = "tango"
pygments_dark_style = "github-dark"
html_theme_options = {"navigation_with_keys": True}

# Classes whose objects axisbus creates: users do not call these classes, so their signatures are not shown.
GIVEN = {
    *(
        "Axis",
        "Gantry",
        "Group",
        "Handle",
        "AxisFeedback",
        "InputsOutputs",
        "PointStream",
        "ProbeHandle",
        "ProbeResult",
        "Signal",
    ),
    *("Eds", "EdsDifference", "EdsFinding", "Number", "Object", "Variable"),
}


def _sections(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Parse sections such as "Raises:"; a property is parsed as a method, so that no part of its first line counts as a type."""
    kind = "method" if what == "property" else what
    lines[:] = GoogleDocstring(lines, Config(napoleon_use_ivar=True), app, kind, name, obj, options).lines()


def _signature(app: Sphinx, what: str, name: str, *rest: Any) -> tuple[str, str] | None:  # noqa: ARG001  # Sphinx's shape
    return ("", "") if what == "class" and name.rpartition(".")[2] in GIVEN else None


def _dashes(app: Sphinx, doctree: nodes.document) -> None:  # noqa: ARG001  # Sphinx's shape
    """Replace the two hyphens that Sphinx writes between a name and its description by a dash."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" – "))


def setup(app: Sphinx) -> None:
    """Connect the functions of this file."""
    app.connect("autodoc-process-docstring", _sections)
    app.connect("doctree-read", _dashes)
    app.connect("autodoc-process-signature", _signature)
