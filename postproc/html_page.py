"""Pages of HTML that need no network."""

import re
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from logger.core.document import DASH, Table, Word, html_table, html_value, plain_text

# spaces before a unit or a longitude, where a line must not end
_WITHIN_A_VALUE = re.compile(r"(?<=\d) (?=(?:km?|m|dBm?|s|h|min|%)(?!\w)|-?\d+\.\d\d)")


def page_environment(package: str) -> Environment:
    """Templates of a package, and `head.html`; all text is escaped, except markup of our own.

    The filter `table` writes a table, `word` a verdict.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader("postproc")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_printable,
    )
    environment.filters |= {"table": _table, "word": _word}
    return environment


def _table(table: Table) -> Markup:
    return Markup(_with_whole_values(html_table(table)))  # noqa: S704 (it escapes all text)


def _word(verdict: str) -> Markup:
    return Markup(html_value(Word(verdict)))  # noqa: S704 (it escapes all text)


def _printable(value: Any) -> Any:
    """With a dash for None, and without control characters and lone surrogates."""
    if value is None:
        return DASH
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return _with_whole_values(plain_text(value))


def _with_whole_values(text: str) -> str:
    return _WITHIN_A_VALUE.sub("\N{NO-BREAK SPACE}", text)
