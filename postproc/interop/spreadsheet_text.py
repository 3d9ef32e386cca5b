"""Text in CSV cells that a spreadsheet opens: what looks like a formula is marked as text.

`=cmd|...` in a cell's name would be run by whoever opens the file (OWASP, CSV Injection). The mark
is an apostrophe, which spreadsheets do not show. Numbers stay as they are: a minus before a level
is no formula.
"""

import re
from collections.abc import Iterable

_FORMULA = re.compile("'*[=+\\-@\t\r\n]")
_TO_QUOTE = re.compile('[,"\r\n]')
_MARKED = re.compile("'+[=+\\-@\t\r\n]")


def escape(text: str) -> str:
    """Text for a cell, with a mark where it looks like a formula or like marked text."""
    return f"'{text}" if _FORMULA.match(text) else text


def unescape(text: str) -> str:
    """The text that was marked."""
    return text[1:] if _MARKED.match(text) else text


def line(values: Iterable[str]) -> str:
    """A line of CSV (RFC 4180); the csv module leaves a lone CR unquoted and reads two lines."""
    return ",".join(_quote(value) for value in values) + "\n"


def _quote(value: str) -> str:
    doubled = value.replace('"', '""')
    return f'"{doubled}"' if _TO_QUOTE.search(value) else value
