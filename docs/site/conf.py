"""Sphinx's settings of the site, which ``make docs`` makes; its sources are put together by ``build.py``."""

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
# Types in signatures are those of the code, of which many are not public; links between pages are checked all the same.
nitpick_ignore_regex = [("py:.*", ".*")]

myst_heading_anchors = 6  # as code hosts make them
myst_enable_extensions = ["attrs_inline", "deflist"]

nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # none is used, and nothing is to be fetched

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
html_copy_source = False
html_show_sourcelink = False
smartquotes = False  # of two hyphens before an option it would make a dash
highlight_language = "text"
pygments_style = "tango"
pygments_dark_style = "github-dark"
html_theme_options = {"navigation_with_keys": True}

# What a machine hands out: nobody calls these, so that what they take is nobody's concern.
GIVEN = {
    *(
        "Axis",
        "Gantry",
        "Group",
        "Handle",
        "Io",
        "Measured",
        "PointStream",
        "ProbeHandle",
        "Probed",
        "Signal",
    ),
    *("Difference", "Eds", "Finding", "Number", "Object", "Variable"),
}


def _sections(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Read "Raises:" and the like; a property is read as a method, of whose first line nothing is taken for a type."""
    kind = "method" if what == "property" else what
    lines[:] = GoogleDocstring(lines, Config(napoleon_use_ivar=True), app, kind, name, obj, options).lines()


def _signature(app: Sphinx, what: str, name: str, *rest: Any) -> tuple[str, str] | None:  # noqa: ARG001  # Sphinx's shape
    return ("", "") if what == "class" and name.rpartition(".")[2] in GIVEN else None


def _dashes(app: Sphinx, doctree: nodes.document) -> None:  # noqa: ARG001  # Sphinx's shape
    """Put a dash where Sphinx writes two hyphens between a name and what is said of it."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" – "))


def setup(app: Sphinx) -> None:
    """Connect what is ours."""
    app.connect("autodoc-process-docstring", _sections)
    app.connect("doctree-read", _dashes)
    app.connect("autodoc-process-signature", _signature)
