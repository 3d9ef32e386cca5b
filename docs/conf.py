"""Sphinx configuration of the documentation; `make docs` builds it without a network."""

project = "cellwalk"
extensions = ["myst_parser"]
html_theme = "alabaster"
html_theme_options = {"description": "Where a base station stands", "page_width": "1100px"}
html_sidebars = {"**": ["about.html", "navigation.html", "searchbox.html"]}
html_copy_source = False
html_show_sphinx = False
# anchors of headings down to this level can be the target of a link
myst_heading_anchors = 3
suppress_warnings = [
    # pages that are included from the root link to files that are not part of the site
    "myst.xref_missing",
]
