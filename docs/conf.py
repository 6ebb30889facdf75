"""Sphinx: `python3 bootstrap.py docs` builds the pages into `out/docs`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

project = "consensus-certify"
author = "consensus-certify contributors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton"]
myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "consensus-certify"
html_static_path = ["_static"]
html_css_files = ["wide-tables.css"]
html_show_sphinx = False
html_show_copyright = False
exclude_patterns = ["_build"]
copybutton_prompt_text = "$ "
autodoc_member_order = "bysource"
suppress_warnings = ["misc.highlighting_failure"]  # evidence in JSON is shown with an ellipsis
