"""Sphinx: pages in Markdown, executed; scripts of examples/ as a gallery; nothing is loaded from a
network.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs/_ext")]
os.environ["PYTHONPATH"] = os.pathsep.join(
    [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
)
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["COLUMNS"] = "110"  # of the tables that commands print

STARTUP = ROOT / "build/ipython/profile_default/startup"
STARTUP.mkdir(parents=True, exist_ok=True)
shutil.copy(ROOT / "docs/_ext/shell_cells.py", STARTUP)
os.environ["IPYTHONDIR"] = str(ROOT / "build/ipython")

import flexfem  # noqa: E402

project = "flexfem"
author = "the authors of flexfem"
project_copyright = "GPL-3.0-or-later"
version = release = flexfem.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "outside",
]
extensions += [path.stem for path in sorted((ROOT / "docs/_ext").glob("generate_*.py"))]
exclude_patterns = [
    "_ext",
    "jupyter_execute",
    *(f"gallery/*.{end}" for end in ("ipynb", "py", "zip", "json", "md5")),
]
suppress_warnings = ["config.cache", "ref.python"]  # attributes of several classes have one name

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
nb_render_markdown_format = "myst"

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "exclude-members": "model_config, model_copy, kind"}
napoleon_google_docstring = False
napoleon_use_rtype = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"claims\.py$",  # two minutes, see `make claims`
    "abort_on_example_error": True,
    "plot_gallery": True,
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "remove_config_comments": True,
    "within_subsection_order": "FileNameSortKey",
    "copyfile_regex": "",
}

html_theme = "furo"
html_title = f"flexfem {release}"
html_static_path = ["_static"]
html_css_files = ["flexfem.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"sidebar_hide_name": False}
copybutton_exclude = ".linenos, .gp, .go"
