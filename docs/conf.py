"""Configuration of the documentation; `bash docs/build.sh` builds it."""

import logging
import os
import sys
from pathlib import Path

import hpcsweep

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

import from_code  # noqa: E402
import links  # noqa: E402
import pictures  # noqa: E402

project = "hpcsweep"
author = "the hpcsweep authors"
copyright = author
version = release = hpcsweep.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",
]
exclude_patterns = ["_build", "gallery", "examples", "auto_gallery/*.ipynb", "auto_gallery/*.py"]
suppress_warnings = ["config.cache"]  # functions among the settings of the gallery

html_theme = "furo"
html_title = "hpcsweep"
html_show_sphinx = False
html_copy_source = False

autosummary_generate = False
autodoc_typehints = "none"
numpydoc_show_class_members = False

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

nb_execution_mode = "cache"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True

# notebooks: errors only, not that a kernel is started nor how it is reached
os.environ["JUPYTER_PATH"] = str(DOCS / "jupyter")
logging.getLogger("traitlets").setLevel(logging.WARNING)

copybutton_prompt_text = "$ "

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"/\d\d_",
    "ignore_pattern": r"(?:^|/)shell\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib", pictures.written),
    "abort_on_example_error": True,
    "write_computation_times": False,
    "capture_repr": (),
    "download_all_examples": False,
    "remove_config_comments": True,
}


def setup(app):
    """Write the pages that are made from the code, and follow links that leave the pages."""
    from_code.write(DOCS / "generated")
    app.connect("doctree-read", links.leave_pages)
    app.connect("autodoc-process-docstring", links.escape_bars, priority=900)
