"""How Sphinx makes the documentation; `make docs` calls it."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "extensions")]

import carillon  # noqa: E402 - found by the path above

project = "Carillon"
author = "The Carillon developers"
project_copyright = author
release = version = carillon.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "generated_parts", "mathml"]
exclude_patterns = ["extensions"]
nitpicky = False

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

# In docstrings `name` is code.
default_role = "literal"
autodoc_member_order = "bysource"
# Docstrings tell shapes and units, which types do not.
autodoc_typehints = "none"
autodoc_preserve_defaults = True
maximum_signature_line_length = 70
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"Carillon {release}"
html_static_path = ["style"]
html_css_files = ["carillon.css"]
html_show_sourcelink = False
html_copy_source = False
html_math_renderer = "mathml"
html_theme_options = {"navigation_with_keys": True}

# Commands stand in descriptions, too: -- stays what it is.
smartquotes_action = "qe"
