"""The documentation site: ``sphinx-build -W --keep-going -n -c docs . site``, without a network.

Pages are the Markdown files where they are, so links lead to the same texts in the repository and
on the site. What only the site can show stands in a comment: ``<!-- on the site`` … ``-->``. What
it need not show stands between ``<!-- in the repository -->`` and
``<!-- in the repository and on the site -->``.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import sys
import tempfile
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

from sblcosim.fmus.build.formulas import FONTS
from sphinx import addnodes

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "extensions"))
os.environ.setdefault("MPLBACKEND", "Agg")

project = "sblcosim"
author = "The sblcosim developers"
project_copyright = author
version = release = version_of("sblcosim")

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery",
    "explorer", "keys", "literals", "tables", "typeset",
]
root_doc = "docs/index"
ROOMS = ("models", "fmus", "orchestrator", "tests", "tools")
PAGES = {"docs", *ROOMS, "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"}
include_patterns = [
    *(page for page in PAGES if page.endswith(".md")), "docs/**", "models/*.md", "models/*/*.md",
    *(f"{room}/{inner}README.md" for room in ROOMS for inner in ("", "**/")),
    "fmus/conformance/FOREIGN.md",
]
exclude_patterns = [
    *(path.name for path in ROOT.iterdir() if path.name not in PAGES),
    "docs/extensions", "docs/gallery", "docs/made/**/*.ipynb", "docs/made/**/*.py", "**/.*",
    "**/__pycache__",
]
default_role = "literal"  # docstrings name much that has no page of its own
smartquotes_action = "qe"  # no dashes: --json is an option
nitpick_ignore_regex = [("py:.*", r"(?!sblcosim).*")]  # no network: nobody else's names

html_theme = "furo"
html_title = "sblcosim"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["filter.js"]
html_theme_options = {"light_css_variables": {"font-stack--math": FONTS}}
html_copy_source = html_show_sourcelink = False
html_additional_pages = {"index": "to-the-first-page.html"}
templates_path = ["_templates"]

html_math_renderer = "mathml"
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False

# The pages of the gallery run in a copy of their folder: what they write is not in the sources, and
# the first page that needs a study makes it for all.
DRAWN = Path(tempfile.mkdtemp(prefix="sblcosim-"))
atexit.register(shutil.rmtree, DRAWN, ignore_errors=True)
shutil.copytree(HERE / "gallery", DRAWN / "gallery")
sphinx_gallery_conf = {
    "examples_dirs": str(DRAWN / "gallery"),
    "gallery_dirs": "docs/made/gallery",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("figures.scraper",),
    "reset_modules": (),
    "capture_repr": (),
    "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True,
    "min_reported_time": 1_000_000,
    "thumbnail_size": (680, 480),
    "show_signature": False,
    "write_computation_times": False,
    "abort_on_example_error": True,
    "parallel": False,
}


def attributes_in_one_line(app: Any, what: str, name: str, obj: Any, options: Any,
                           lines: list[str]) -> None:
    """Attributes that share a description: Sphinx takes what stands before a space for a type."""
    for i, line in enumerate(lines):
        if line.startswith(":ivar "):
            names, colon, text = line.removeprefix(":ivar ").partition(":")
            lines[i] = f":ivar {names.replace(', ', ',')}{colon}{text}"


def colons(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Sentences with a colon: Sphinx takes what stands before it for the type of a property."""
    if what in ("attribute", "data", "property"):
        for line in [it for it in lines if it.startswith(":type: ")]:
            lines.remove(line)
            lines[0] = f"{line.removeprefix(':type: ')}: {lines[0]}"


def without_long_values(app: Any, doctree: Any) -> None:
    """Leave out the values of attributes that are declarations of columns, some pages long."""
    for signature in list(doctree.findall(addnodes.desc_signature)):
        for part in list(signature.findall(addnodes.desc_annotation)):
            if len(part.astext()) > 100:
                part.parent.remove(part)


def on_the_site(app: Any, page: str, source: list[str]) -> None:
    """Show what stands in a comment because only the site can show it, instead of what it has."""
    only = r"<!-- in the repository -->.*?<!-- in the repository and on the site -->"
    source[0] = re.sub(only, "", source[0], flags=re.DOTALL)
    source[0] = re.sub(r"<!-- on the site\n(.*?)-->", r"\1", source[0], flags=re.DOTALL)


def setup(app: Any) -> None:
    """Connect the functions above, those for docstrings after napoleon has made fields of them."""
    app.connect("autodoc-process-docstring", attributes_in_one_line, priority=900)
    app.connect("autodoc-process-docstring", colons, priority=900)
    app.connect("doctree-read", without_long_values)
    app.connect("source-read", on_the_site)
