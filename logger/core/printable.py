"""Untrusted text on a terminal: runs, modems and file names may contain control sequences.

Control characters (ESC clears the screen and renames windows), direction marks (which change the
order of a text) and halves of surrogates become escapes as in JSON, so that JSON stays JSON.
"""

import re
import sys
from codecs import lookup, register_error
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO, TextIOWrapper
from typing import Any, TextIO
from unicodedata import category

_CONTROLS = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode: control, format, surrogate, and the separators of lines and paragraphs."""
_LAYOUT = "\n\t"
# of our own characters, where a terminal has none: "4.8 km?" would be a doubt
_INSTEAD = {"±": "+-", "²": "2", "\N{NARROW NO-BREAK SPACE}": " "}
# printable ASCII, which nearly all text is, needs no escape
_SUSPECT = re.compile(r"[^ -~]")


def printable(text: str, keep: str = "") -> str:
    """The text on one line without anything that controls a terminal; `keep` characters stay."""
    return _SUSPECT.sub(lambda match: match[0] if match[0] in keep else _escape(match[0]), text)


def _escape(character: str) -> str:
    if category(character) not in _CONTROLS:
        return character
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i]:02x}{units[i + 1]:02x}" for i in range(0, len(units), 2))


class PlainStream:
    """A text stream that passes no control characters but ends of lines and tabs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.rich_proxied_file = (
            stream  # rich styles its own text: it looks for this name, and writes there
        )

    def write(self, text: str) -> int:
        self._stream.write(printable(text, _LAYOUT))
        return len(text)

    def writelines(self, lines: Iterator[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Print everything within the context through a `PlainStream`."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (PlainStream(_writable(stream)) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _writable(stream: TextIO | None) -> TextIO:
    if stream is None:  # closed
        return StringIO()
    if isinstance(stream, TextIOWrapper) and lookup(stream.encoding).name != "utf-8":
        stream.reconfigure(errors=_replace.__name__)
    return stream


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_INSTEAD.get(character, "?") for character in lacking), error.end


register_error(_replace.__name__, _replace)
