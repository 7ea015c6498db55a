"""Settings of the site that `make docs` builds: Markdown pages and the Python reference."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]

project = "optopad"
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False

extensions = ["myst_nb", "sphinx.ext.autodoc", "docstring_sections", "offline_check"]
exclude_patterns = ["_ext"]

# Markdown. Anchors for headings, so that a link to a part of a page is checked; no formulas in dollars: they would need
# a script from another site.
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]

# Notebooks run when they or their kernel have changed; an error in one fails the build.
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build" / "docs-notebooks")
nb_execution_in_temp = True
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_ipywidgets_js: dict[str, dict[str, str]] = {}

# The Python reference. Types of other libraries have no page here, and no site of theirs is asked.
default_role = "code"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
nitpick_ignore_regex = [("py:.*", r"(?!optopad\.).*")]

# Furo takes the system's fonts, and its style and scripts lie in the site: nothing comes from elsewhere.
html_theme = "furo"
html_title = "optopad"
html_static_path = ["_static"]
html_css_files = ["site.css"]
