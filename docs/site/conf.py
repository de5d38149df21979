"""Sphinx's settings of the site, which ``make docs`` makes; its sources are put together by ``build.py``."""

from axisbus.version import __version__

project = "axisbus"
release = version = __version__
copyright = "the authors of axisbus"  # noqa: A001  # Sphinx's name

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
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
napoleon_numpy_docstring = False
napoleon_use_ivar = True
default_role = "code"

html_theme = "furo"
html_title = f"axisbus {__version__}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
highlight_language = "text"
pygments_style = "tango"
pygments_dark_style = "github-dark"
html_theme_options = {"navigation_with_keys": True}
