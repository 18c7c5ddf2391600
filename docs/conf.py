"""The documentation site: ``sphinx-build -W --keep-going -n docs site``, without a network."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "extensions"))
os.environ.setdefault("MPLBACKEND", "Agg")

project = "sblcosim"
author = "The sblcosim developers"
project_copyright = author
version = release = version_of("sblcosim")

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery",
    "declarations",
]
exclude_patterns = ["extensions", "gallery", "made/**/*.ipynb", "made/**/*.py", "**/.*"]
default_role = "literal"  # docstrings name much that has no page of its own
smartquotes_action = "qe"  # no dashes: --json is an option
nitpick_ignore_regex = [("py:.*", r"(?!sblcosim).*")]  # no network: nobody else's names

html_theme = "furo"
html_title = "sblcosim"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False

myst_enable_extensions = ["colon_fence", "deflist", "fieldlist"]
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
    "gallery_dirs": "made/gallery",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("figures.scraper",),
    "reset_modules": (),
    "capture_repr": (),
    "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True,
    "min_reported_time": 1_000_000,
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


def setup(app: Any) -> None:
    """After napoleon has made fields of the docstrings."""
    app.connect("autodoc-process-docstring", attributes_in_one_line, priority=900)
