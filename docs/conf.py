"""Sphinx configuration of the documentation; `make docs` builds it without a network."""

from collections.abc import Iterator
from pathlib import Path

import click
from sphinx.application import Sphinx

from logger.cli import program as fieldlogger
from logger.core.document import Table, markdown_table
from logger.core.schema import tables_text
from postproc.cli import program as postproc
from postproc.suspicion.run_assessment import table_of_sources

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
    "<pre>": '<pre tabindex="0">',  # a wide block is scrolled by keys as well, and so is a table
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
}
"""What axe-core misses in the pages of Sphinx and its theme, and what stands there instead."""


GENERATED = Path(__file__).with_name("generated")
"""Pages that the programs print; they are made anew by each build and not committed."""


def setup(app: Sphinx) -> None:
    """Let Sphinx call `write_generated` at its start and `make_accessible` at its end."""
    app.connect("builder-inited", write_generated)
    app.connect("build-finished", make_accessible)


def write_generated(_: Sphinx) -> None:
    """Write the columns of a run file, the help of every command, and the rules by modem."""
    GENERATED.mkdir(exist_ok=True)
    tables = f"# Tables of the run file\n\n{tables_text()}\n"
    (GENERATED / "tables.md").write_text(tables, "utf-8")
    pages = [*help_pages("fieldlogger", fieldlogger), *help_pages("postproc", postproc)]
    commands = "\n\n".join(["# Commands", *pages])
    (GENERATED / "commands.md").write_text(f"{commands}\n", "utf-8")
    rules = [markdown_table(one) if isinstance(one, Table) else one for one in table_of_sources()]
    (GENERATED / "rules.md").write_text("\n\n".join(["# Rules by modem", *rules, ""]), "utf-8")


def help_pages(name: str, command: click.Command) -> Iterator[str]:
    """The help of a command and of all below it, each under its name."""
    context = click.Context(command, info_name=name)
    yield f"## {name}\n\n```text\n{command.get_help(context)}\n```"
    if isinstance(command, click.Group):
        for part in command.list_commands(context):
            yield from help_pages(f"{name} {part}", command.get_command(context, part))


def make_accessible(app: Sphinx, error: Exception | None) -> None:
    """Correct all pages that were written."""
    if error or app.builder.name != "html":
        return
    for page in Path(app.outdir).rglob("*.html"):
        text = page.read_text("utf-8")
        for old, new in ACCESSIBLE.items():
            text = text.replace(old, new)
        page.write_text(text, "utf-8")
