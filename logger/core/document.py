"""What a command or a page says: values for JSON; lines and tables for a terminal, HTML, Markdown.

Nothing else pads or aligns text or writes cells of a table. Text of others, from runs and modems,
cannot steer a terminal and is escaped in HTML.
"""

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby, zip_longest
from os import fspath
from typing import Any, NamedTuple
from unicodedata import category, combining, east_asian_width

import msgspec

from logger.core.certainty import metres
from logger.core.printable import printable

DASH = "–"
"""A value that is not known."""
_GAP = "  "
_NARROWEST = 20
"""Columns that are left to a text beside its bullet, in however narrow a terminal."""
_WORD = re.compile("[^ ]+")
_KEPT_TOGETHER = "\N{NO-BREAK SPACE}"
"""A blank at which no line is broken; it is printed as any other."""
_CODES = {"bold": 1, "dim": 2, "red": 31, "green": 32, "yellow": 33, "magenta": 35}
"""Of ECMA-48, `select graphic rendition`."""
_MARKUP = re.compile(r"[\\`*\[\]<>#|]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown; `_` within a word has none."""
_STYLE = re.compile(r"\x1b\[[\d;]*m")


_LOOKS = {
    "located": ("green", "●"),
    "ambiguous": ("yellow", "◐"),
    "cannot tell": ("dim", "○"),
    "consistent": ("green", "●"),
    "rejected": ("red", "✕"),
    "suspicious": ("bold red", "✕"),
    "unusual": ("yellow", "◆"),
    "holds": ("green", "●"),
    "does not hold": ("yellow", "◐"),
    "claim is wrong": ("magenta", "○"),
    "fails": ("bold red", "✕"),
    "warning": ("yellow", "△"),
    "error": ("red", "✕"),
}
"""Style in a terminal and symbol on a page of each word of a verdict."""


class Word(NamedTuple):
    """A text in a style, such as `bold red`; without one a verdict has its own."""

    text: str
    style: str = ""

    @property
    def terminal_style(self) -> str:
        """Names of `_CODES`."""
        return self.style or _LOOKS.get(self.text, ("", ""))[0]

    @property
    def symbol(self) -> str:
        """On a page."""
        return _LOOKS.get(self.text, ("", ""))[1]


class Measured(NamedTuple):
    """A value with its standard deviation; None for either where it is not known."""

    value: float | None
    sigma: float | None


class Degrees(NamedTuple):
    """A position (WGS 84)."""

    lat_deg: float
    lon_deg: float
    decimals: int = 5


LENGTH = "length"
"""Form of lengths in m, each with its unit."""
Text = str | Word
Value = Text | float | Measured | Degrees | None


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its title with the unit, and the format of its numbers, which end at one line.

    `is_right` is for text that stands for numbers, `is_long` for sentences, which wrap on a page.
    """

    title: str
    form: str = ""
    unit: str = ""
    is_right: bool = False
    is_long: bool = False

    @property
    def heading(self) -> str:
        """Title and unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    @property
    def ends_at_one_line(self) -> bool:
        """Numbers, and text that stands for them."""
        return self.is_right or bool(self.form)

    def text(self, value: Value) -> Word:
        """A value as a terminal shows it."""
        match value:
            case None:
                return Word(DASH)
            case Word():
                return Word(printable(value.text), value.terminal_style)
            case Degrees():
                return Word(degrees_text(*value))
            case Measured():
                sigma = "" if value.sigma is None else f" ± {self._sigma(value.sigma)}"
                return Word(f"{self.text(value.value).text}{sigma}")
            case str():
                return Word(printable(value))
        return Word(self._number(value))

    def _number(self, value: float) -> str:
        return metres(value) if self.form == LENGTH else format(value, self.form)

    def _sigma(self, sigma: float) -> str:
        return format(sigma, self.form.replace("+", ""))

    def html(self, value: Value) -> str:
        """A value in HTML; a program can read all digits of numbers."""
        match value:
            case Word():
                if value.text not in _LOOKS:
                    return html_text(value.text)
                symbol = f'<span aria-hidden="true">{value.symbol}</span>'
                kind = value.text.replace(" ", "-")
                return f'<span class="badge {kind}">{symbol} {value.text}</span>'
            case Degrees():
                return " ".join(_data(one, f"{one:.{value.decimals}f}") for one in value[:2])
            case Measured(float() | int() as mean, float() | int() as sigma):
                beside = f'<span class="sigma">± {_data(sigma, self._sigma(sigma))}</span>'
                return f"{_data(mean, format(mean, self.form))} {beside}"
            case float() | int():
                return _data(value, self._number(value))
        return html_text(self.text(value).text if not isinstance(value, str) else value)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values; the values of column `name_column` name the rows.

    A row may end early. Blanks before its name mark a row that belongs to the one above. `label`
    says on a page what the table is; a long one that `scrolls` has a height of its own there.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Value]]
    label: str = ""
    name_column: int = 0
    scrolls: bool = False


@dataclass(frozen=True, slots=True)
class Line:
    """A paragraph; what follows its first line is indented as far as the bullet is long."""

    text: Text | Sequence[Text]
    style: str = ""
    bullet: Text = ""


Part = Text | Line | Table


@dataclass(frozen=True, slots=True)
class Document:
    """What a command says.

    `content` becomes its JSON: a struct, a dataclass or a mapping. The other parts are for readers:
    title, warnings, and the body in its order. `remarks` go to the standard error, as they do not
    belong to the result.
    """

    content: Any
    title: Text = ""
    warnings: Sequence[str] = ()
    body: Iterable[Part] = ()
    remarks: Sequence[str] = field(default=())


def json_text(content: Any) -> str:
    """JSON; NaN and infinity become null."""
    try:
        encoded = msgspec.json.encode(content, enc_hook=_plain)
    except UnicodeEncodeError:  # halves of surrogates, in the name of a file
        return json.dumps(msgspec.to_builtins(content, enc_hook=_plain), indent=2)
    return msgspec.json.format(encoded, indent=2).decode()


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # an array or a scalar of numpy
        return value.tolist()
    if isinstance(value, int):  # with its text, as modems print numbers
        return int(value)
    if hasattr(value, "__fspath__"):
        return fspath(value)
    raise TypeError(f"no JSON for {type(value).__name__}")


def facts(named: Iterable[tuple[Text, Text]], width: int = 0) -> Iterator[Line]:
    """Names and what there is to say of each, side by side.

    With a width of the names each line is made when it is asked for; without one the longest name
    decides.
    """
    if not width:
        named = list(named)
        width = max((width_of(_text(name)) for name, _ in named), default=0)
    for name, text in named:
        bullet = _text(name)
        bullet += " " * (width - width_of(bullet)) + _GAP
        yield Line(text, bullet=Word(bullet, _style(name)))


def number_of(count: int, noun: str) -> str:
    """A number with its noun."""
    plural = "es" if noun.endswith("x") else "s"
    return f"{count} {noun}{plural * (count != 1)}"


def degrees_text(lat_deg: float, lon_deg: float, decimals: int = 5) -> str:
    """Latitude and longitude."""
    return f"{lat_deg:.{decimals}f} {lon_deg:.{decimals}f}"


def terminal_lines(
    document: Document, columns: int | None = None, *, is_styled: bool = False
) -> Iterator[str]:
    """Lines of a terminal that is so wide; a file or a pipe (None) takes lines of any length.

    No word and no number is cut: a table that does not fit becomes a list of its rows.
    """
    for line in _styled_lines(document, columns):
        yield line if is_styled else _STYLE.sub("", line)


def _styled_lines(document: Document, columns: int | None) -> Iterator[str]:
    if document.title:
        yield from _paragraph(Line(document.title, "bold"), columns)
    for warning in document.warnings:
        yield from _paragraph(Line(warning, "yellow"), columns)
    for part in document.body:
        if isinstance(part, Table):
            yield from _table(part, columns)
        else:
            yield from _paragraph(part if isinstance(part, Line) else Line(part), columns)


def _paragraph(line: Line, columns: int | None) -> Iterator[str]:
    """Wrapped at blanks only; a word longer than a line stays whole."""
    parts = [line.text] if isinstance(line.text, str | Word) else line.text
    words = [
        Word(printable(_text(part), "\n"), _style(part) or line.style or "plain") for part in parts
    ]
    text = "".join(word.text for word in words)
    styles = [word.style for word in words for _ in word.text]
    bullet = Word(printable(_text(line.bullet)), _style(line.bullet) or "plain")
    indent = width_of(bullet.text)
    shown_bullet = _with_codes(bullet.text, [bullet.style] * len(bullet.text))
    start = 0
    for one in text.split("\n"):
        for begin, end in _line_bounds(one, None if columns is None else columns - indent):
            shown = one[begin:end].rstrip().replace(_KEPT_TOGETHER, " ")
            yield shown_bullet + _with_codes(shown, styles[start + begin :])
            shown_bullet = " " * indent
        start += len(one) + 1


def _line_bounds(text: str, width: int | None) -> list[tuple[int, int]]:
    if width is None:
        return [(0, len(text))]
    starts, start, end = [0], 0, 0
    for word in _WORD.finditer(text):
        if end > start and width_of(text[start : word.end()]) > max(width, _NARROWEST):
            start = word.start()
            starts.append(start)
        end = word.end()
    return list(zip(starts, [*starts[1:], len(text)], strict=True))


def _with_codes(text: str, styles: Sequence[str]) -> str:
    out = ""
    for style, group in groupby(zip(text, styles, strict=False), key=lambda pair: pair[1]):
        part = "".join(character for character, _ in group)
        codes = ";".join(str(_CODES[name]) for name in style.split() if name in _CODES)
        out += f"\x1b[{codes}m{part}\x1b[0m" if codes else part
    return out


def _table(table: Table, columns: int | None) -> Iterator[str]:
    rows = [
        [column.text(value) for column, value in zip(table.columns, row, strict=False)]
        for row in table.rows
    ]
    if not rows:
        return
    titles = [Word(column.heading, "bold") for column in table.columns]
    widths = [
        max(width_of(word.text) for word in column if word) for column in zip_longest(titles, *rows)
    ]
    gap, n_gaps = _GAP, len(widths) - 1
    if columns is not None and sum(widths) + len(gap) * n_gaps > columns:
        gap = " "
    if columns is not None and sum(widths) + n_gaps > columns:
        yield from _paragraph(Line(titles[table.name_column]), columns)
        for row in rows:
            name = row[table.name_column]
            values = [
                f"{title.text} {word.text}".replace(" ", _KEPT_TOGETHER)
                for title, word in zip(titles, row, strict=False)
                if word is not name and word.text
            ]
            yield from _paragraph(Line(", ".join(values), bullet=f"{_GAP}{name.text}: "), columns)
        return
    for row in [titles, *rows]:
        cells = []
        for column, word, width in zip(table.columns, row, widths, strict=False):
            blank = " " * (width - width_of(word.text))
            shown = _with_codes(word.text, [word.terminal_style] * len(word.text))
            cells.append(blank + shown if column.ends_at_one_line else shown + blank)
        yield gap.join(cells).rstrip()


def _text(text: Text) -> str:
    return text.text if isinstance(text, Word) else text


def _style(text: Text) -> str:
    return text.terminal_style if isinstance(text, Word) else ""


def width_of(text: str) -> int:
    """Columns that a text takes in a terminal; a wide character of East Asia takes two."""
    if text.isascii():
        return len(text)
    return sum(
        0 if combining(c) or category(c) in {"Mn", "Me"} else 1 + (east_asian_width(c) in "WF")
        for c in text
    )


def plain_text(text: str) -> str:
    """Text without control characters and halves of surrogates."""
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c).startswith("C") and c not in "\n\t" else c
        for c in text
    )


def html_text(text: str) -> str:
    """Text in HTML."""
    return escape(plain_text(text))


def html_value(value: Value) -> str:
    """A value in HTML outside a table."""
    return Column("").html(value)


def html_table(table: Table) -> str:
    """A table in a region that scrolls by itself, also by keys."""
    scroll = "scroll tall" if table.scrolls else "scroll"
    lines = [
        f'<div class="{scroll}" role="region" tabindex="0" aria-label="{html_text(table.label)}">',
        "<table>",
        f"<thead><tr>{''.join(map(_head, table.columns))}</tr></thead>",
        "<tbody>",
        *(f"<tr>{''.join(_cells(table, row))}</tr>" for row in table.rows),
        "</tbody>",
        "</table>",
        "</div>",
    ]
    return "\n".join(lines)


def _head(column: Column) -> str:
    return f'<th scope="col"{_class(column)}>{html_text(column.heading)}</th>'


def _class(column: Column) -> str:
    kind = "number" if column.ends_at_one_line else "text" if column.is_long else ""
    return f' class="{kind}"' if kind else ""


def _cells(table: Table, row: Sequence[Value]) -> Iterator[str]:
    values = [*row, *[""] * (len(table.columns) - len(row))]
    for i, (column, value) in enumerate(zip(table.columns, values, strict=True)):
        if i != table.name_column:
            yield f"<td{_class(column)}>{column.html(value)}</td>"
            continue
        name = column.text(value).text
        sub = ' class="sub"' if name.startswith(" ") else ""
        yield f'<th scope="row"{sub}><bdi>{html_text(name.strip())}</bdi></th>'


def _data(value: float, text: str) -> str:
    return f'<data value="{value}">{text}</data>'


def markdown_text(text: str) -> str:
    """Text in Markdown in which nothing is markup."""
    return _MARKUP.sub(r"\\\g<0>", plain_text(text))


def markdown_table(table: Table) -> str:
    """A table in Markdown, words in bold; nothing without rows."""
    if not table.rows:
        return ""
    titles = [markdown_text(column.heading) for column in table.columns]
    rows = [list(map(_markdown_value, table.columns, row)) for row in table.rows]
    lines = (titles, ["---"] * len(titles), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _markdown_value(column: Column, value: Value) -> str:
    text = markdown_text(column.text(value).text)
    return f"**{text}**" if isinstance(value, Word) else text
