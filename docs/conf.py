"""Sphinx configuration of the documentation; `make docs` builds it without a network."""

from pathlib import Path

from sphinx.application import Sphinx

project = "cellwalk"
extensions = ["myst_parser"]
html_theme = "furo"  # fits a phone, loads nothing from elsewhere
html_copy_source = False
html_show_sphinx = False
# anchors of headings down to this level can be the target of a link
myst_heading_anchors = 3
suppress_warnings = [
    # pages that are included from the root link to files that are not part of the site
    "myst.xref_missing",
]

ACCESSIBLE = {
    'class="caption" role="heading"': 'class="caption" role="heading" aria-level="2"',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="Pages">',
    "<pre>": '<pre tabindex="0">',  # a wide block is scrolled by keys as well
}
"""What axe-core misses in the pages of Sphinx and its theme, and what stands there instead."""


def setup(app: Sphinx) -> None:
    """Let Sphinx call `make_accessible` at its end."""
    app.connect("build-finished", make_accessible)


def make_accessible(app: Sphinx, error: Exception | None) -> None:
    """Correct all pages that were written."""
    if error or app.builder.name != "html":
        return
    for page in Path(app.outdir).rglob("*.html"):
        text = page.read_text("utf-8")
        for old, new in ACCESSIBLE.items():
            text = text.replace(old, new)
        page.write_text(text, "utf-8")
