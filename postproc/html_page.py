"""Pages of HTML that need no network."""

from typing import Any
from unicodedata import category

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup


def page_environment(package: str) -> Environment:
    """Templates of a package, and `head.html`; all text is escaped, except markup of our own."""
    return Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader("postproc")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_printable,
    )


def _printable(value: Any) -> Any:
    """Values with a dash for None, and without control characters and lone surrogates."""
    if value is None:
        return "–"
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c).startswith("C") and c not in "\n\t" else c
        for c in value
    )
