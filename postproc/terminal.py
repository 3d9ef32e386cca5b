"""Text in a terminal: sentences that wrap at blanks, and tables that never cut a number."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from logger.core.printable import printable

Cell = str | Text

_GAP = 2
_NARROWEST = 20
_WORD = re.compile("[^ ]+")
_KEPT_TOGETHER = "\N{NO-BREAK SPACE}"
"""A blank at which no line is broken; it is printed as any other."""


def screen() -> Console:
    """Standard output; a file or a pipe takes lines of any length."""
    # text of a run is text: no markup, no emoji codes
    plain: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}
    console = Console(**plain)
    return console if console.is_terminal else Console(**plain, soft_wrap=True)


def styled_text(*parts: tuple[str, str]) -> Text:
    """Texts with their styles, one after the other; text from a run never controls the terminal."""
    return Text.assemble(*((printable(text, "\n"), style) for text, style in parts))


def print_text(console: Console, text: Cell, style: str = "", *, bullet: str = "") -> None:
    """A paragraph; what follows its first line is indented as far as the bullet is long."""
    sentence = styled_text((text, style)) if isinstance(text, str) else text
    bullet = printable(bullet)
    if not console.is_terminal:
        console.print(Text(bullet) + sentence)
        return
    width = max(console.width - cell_len(bullet), _NARROWEST)
    lines = [line for part in sentence.split("\n", allow_blank=True) for line in _wrap(part, width)]
    for i, line in enumerate(lines):
        console.print(
            Text(" " * cell_len(bullet) if i else bullet) + line,
            no_wrap=True,
            overflow="ignore",
            crop=False,
        )


def _wrap(text: Text, width: int) -> list[Text]:
    """Lines broken at blanks only: a word longer than a line is not broken."""
    ends, start, end = [0], 0, 0
    for word in _WORD.finditer(text.plain):
        if end > start and cell_len(text.plain[start : word.end()]) > width:
            start = word.start()
            ends.append(start)
        end = word.end()
    lines = text.divide(ends[1:])
    for line in lines:
        line.plain = line.plain.rstrip().replace(_KEPT_TOGETHER, " ")
    return list(lines)


def table(
    console: Console,
    titles: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    right: Sequence[str] = (),
) -> None:
    """Columns side by side where they fit, else each row as a list of its values.

    `right` names the columns that end at one line. The first column names a row.
    """
    cells = [
        [styled_text((cell, "")) if isinstance(cell, str) else cell for cell in row] for row in rows
    ]
    if not cells:
        return
    if not fits(console, titles, cells):
        print_text(console, f"{titles[0]}:", "bold")
        for row in cells:
            _list(console, titles, row)
        return
    widths = _widths(titles, cells)
    align = ["right" if title in right else "left" for title in titles]
    for row in [[Text(title, "bold") for title in titles], *cells]:
        console.print(_line(row, widths, align), no_wrap=True, overflow="ignore", crop=False)


def fits(console: Console, titles: Sequence[str], rows: Sequence[Sequence[Cell]]) -> bool:
    """Whether a table is no wider than the terminal; a pipe takes any."""
    widths = _widths(titles, rows)
    return not console.is_terminal or sum(widths) + _GAP * (len(widths) - 1) <= console.width


def _widths(titles: Sequence[str], rows: Sequence[Sequence[Cell]]) -> list[int]:
    return [
        max(cell_len(title), *(cell_len(str(row[i])) for row in rows if i < len(row)))
        for i, title in enumerate(titles)
    ]


def _line(row: Sequence[Text], widths: Sequence[int], align: Sequence[str]) -> Text:
    line = Text()
    for cell, width, side in zip(row, widths, align, strict=False):
        blank = " " * (width - cell.cell_len)
        line.append(blank if side == "right" else "").append_text(cell).append(
            blank if side == "left" else ""
        )
        line.append(" " * _GAP)
    line.rstrip()
    return line


def _list(console: Console, titles: Sequence[str], row: Sequence[Text]) -> None:
    """Name of a row, then `title value` for each value that it has."""
    sentence = Text()
    for title, cell in zip(titles[1:], row[1:], strict=False):
        if cell.plain:
            value = Text(f"{title} ").append_text(cell)
            value.plain = value.plain.replace(" ", _KEPT_TOGETHER)
            sentence.append(", " if sentence else "").append_text(value)
    name = row[0].plain.lstrip()
    indent = "  " + " " * (row[0].cell_len - len(name))
    print_text(console, sentence, bullet=f"{indent}{name}: ")
