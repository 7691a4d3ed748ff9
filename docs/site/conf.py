"""Settings of the documentation site for Sphinx. `scripts/site` builds it.

The source folder is the whole repository, so that a link means the same on the site and where somebody reads the
Markdown files as they are.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sphinx.addnodes import pending_xref

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
sys.path.insert(0, str(HERE))

project = "Lightpath"
author = "the Lightpath contributors"
project_copyright = "the Lightpath contributors"
version = release = re.search(r'^version = "(.*)"', (REPOSITORY / "Cargo.toml").read_text(), re.MULTILINE)[1]  # type: ignore[index]

extensions = ["myst_parser"]
root_doc = "docs/README"
include_patterns = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**.md"]
include_patterns += ["client/python/README.md", "firmware/c/README.md", "bench/README.md"]
exclude_patterns = ["docs/site", "target", "lightpath-*", "**/node_modules", "**/.*"]

# Pages of the navigation that need not exist.
OPTIONAL = {"reference/command-line"}

myst_heading_anchors = 4
myst_links_external_new_tab = False
# Shell blocks hold things that a highlighter does not know, such as `…`.
pygments_style, pygments_dark_style = "friendly", "github-dark"

html_theme = "furo"
html_title = "Lightpath"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "search_order.js")
html_copy_source = html_show_sourcelink = False
html_show_sphinx = False
html_theme_options: dict[str, list[str]] = {"top_of_page_buttons": []}


def add_navigation(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Give pages their tables of contents, which would be noise where they are read as files."""
    if docname == root_doc:
        lines = (HERE / "navigation.md").read_text(encoding="utf-8").splitlines()
        missing = [page for page in OPTIONAL if not (REPOSITORY / "docs" / f"{page}.md").exists()]
        source[0] += "\n" + "\n".join(line for line in lines if line not in missing)
    if docname == "docs/decisions/README":
        source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n0*\n```\n"


def unlink_folders(app: Sphinx, doctree: nodes.document) -> None:
    """Make links to folders of the repository plain text: the site has no page for a folder."""
    page = REPOSITORY / app.env.docname
    for link in list(doctree.findall(pending_xref)):
        if (page.parent / link["reftarget"]).is_dir():
            link.replace_self(link.children)


def setup(app: Sphinx) -> None:
    """Connect the changes above."""
    app.connect("source-read", add_navigation)
    # The navigation depends on which pages exist, so it is read again in each build.
    app.connect("env-get-outdated", lambda *_: [root_doc, "docs/decisions/README"])
    app.connect("doctree-read", unlink_folders)
