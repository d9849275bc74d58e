"""How `make docs` builds these pages: MyST and numpydoc text, executed commands, no network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from pendpipe.version import __version__

project = "pendpipe"
author = "the pendpipe maintainers"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "executed",
    "mathml",
]
myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["wrap.css"]
html_title = "pendpipe"
exclude_patterns = ["_build", "_ext"]

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
# Docstrings write `name` for a name of the code; it need not be a link.
default_role = "code"
nitpicky = False
# A changed parser or schema changes a page that holds no text of its own.
suppress_warnings = ["config.cache"]


def _escape_bars(app, what, name, thing, options, lines):
    """In docstrings `|y|` is an absolute value and no substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Connect what Sphinx asks for here."""
    app.connect("autodoc-process-docstring", _escape_bars)
