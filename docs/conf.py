"""Settings of the documentation site: `make docs` builds it into docs/_build/html.

Sphinx, because API pages come from the docstrings that the package has, and because it
checks every reference between pages. MyST, because the pages are Markdown that a code
host shows as well, and because MyST-NB runs those that are notebooks. Furo, because
Gymnasium's site is built on it, so that its readers find their way; it needs neither a
network nor fonts of its own, follows the reader's choice of light or dark, and fits a
phone.

Nothing is loaded from elsewhere, neither when the site is built nor when it is read:
equations are MathML, which browsers draw themselves (`_extensions/mathml.py`).
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE / "_extensions"))

import acl_gym  # noqa: E402

project = "acl-gym"
author = "The acl-gym developers"
project_copyright = f"2026, {author}"
version = release = acl_gym.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "myst_nb",
    "sphinx_copybutton",
    "docstrings",
    "environment_pages",
    "guides",
    "mathml",
    "page_meta",
    "pictures",
    "public_names",
    "repository_links",
    "signatures",
    "tables",
]
exclude_patterns = ["_build", "_extensions", "environments/generated/table.txt"]

# A name in single backquotes becomes a link where it is a public name.
default_role = "py:obj"
nitpicky = True
nitpick_ignore_regex = [
    ("py:obj", "(?s).*"),  # any code may stand in single backquotes
    ("py:exc", r"\w+"),  # named in words, often those of Gymnasium
    ("py:class", r"acl_gym\..*"),  # bases that are not public
    (
        "py:class",
        r"\w+|archives\.Target|(list\[)?dict\[str",
    ),  # in signatures, as the source has them
    # Other packages: their inventories would have to come from the network.
    (
        "py:.*",
        r"(gym|gymnasium|spaces|matplotlib|np|npt|numpy|pd|pandas|numba|control)\..*",
    ),
    ("py:.*", r"(stable_baselines3|collections|typing|pathlib|concurrent|enum|os)\..*"),
    ("py:.*", r"(scipy|torch|networkx|pettingzoo|minari|ray|PIL|IPython)\..*"),
]

# Pages
myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
html_math_renderer = "mathml"
html_baseurl = "https://acl-gym.github.io/acl-gym/"
repository_url = "https://github.com/acl-gym/acl-gym"

# Guides, which are notebooks; `_extensions/guides.py` chooses the cache.
nb_execution_mode = "cache"
nb_execution_in_temp = True
nb_execution_show_tb = True  # an error is a warning, which stops `make docs`
nb_execution_timeout = 600  # seconds, of a cell
nb_merge_streams = True
nb_output_stderr = "warn"  # a cell that warns stops the build

# API pages
autosummary_generate = False
autodoc_default_options = {
    "members": True,
    "member-order": "bysource",
    # What agents and environments have from classes of this package, and no further.
    "inherited-members": (
        "ActionWrapper, Env, Exception, ObservationWrapper, VecEnv, VectorActionWrapper, "
        "VectorEnv, VectorObservationWrapper, VectorWrapper, Warning, Wrapper, ndarray, "
        "object, tuple"
    ),
}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autoclass_content = "class"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80
napoleon_google_docstring = napoleon_numpy_docstring = False  # `docstrings` calls it
napoleon_use_ivar = True
napoleon_use_rtype = False

# Looks
html_theme = "furo"
html_title = "acl-gym"
html_favicon = "_static/favicon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
page_picture = "_images/hero.gif"  # on the first page, so it is there
page_description = (
    "acl-gym: colonies of ants learn control policies for Gymnasium environments."
)
html_copy_source = False
html_domain_indices = False  # of modules: the reference has them by subject
html_show_sourcelink = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
