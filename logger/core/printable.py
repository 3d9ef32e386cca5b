"""Text from elsewhere on a terminal: a run, a modem or a file name may hold characters that steer
the terminal.

Control characters (ESC clears the screen and renames windows), marks of direction (which show a
text in another order than it has) and halves of surrogates become escapes as JSON writes them, so
that JSON stays JSON.
"""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO
from unicodedata import category

_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode: control, format, surrogate, and the separators of lines and paragraphs."""
_KEPT_BY_STREAMS = "\n\t"
# what is plain ASCII, which nearly all text is, is not looked at letter by letter
_SUSPECT = re.compile(r"[^ -~]")


def printable(text: str, keep: str = "") -> str:
    """The text on one line, with nothing in it that steers a terminal; characters in `keep`
    stay.
    """
    return _SUSPECT.sub(lambda found: found[0] if found[0] in keep else _escaped(found[0]), text)


def _escaped(character: str) -> str:
    if category(character) not in _STEERING:
        return character
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i]:02x}{units[i + 1]:02x}" for i in range(0, len(units), 2))


class PlainStream:
    """A text stream that lets no steering character pass but ends of lines and tabs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.rich_proxied_file = (
            stream  # rich styles its own text: it looks for this name, and writes there
        )

    def write(self, text: str) -> int:
        self._stream.write(printable(text, _KEPT_BY_STREAMS))
        return len(text)

    def writelines(self, lines: Iterator[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Let everything that is printed meanwhile go through a `PlainStream`."""
    out, errors = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = PlainStream(out), PlainStream(errors)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = out, errors
