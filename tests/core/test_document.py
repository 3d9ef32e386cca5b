"""What a document shows in a terminal, as JSON, in HTML and in Markdown; and that nothing else
pads text or writes tables.
"""

import ast
import json
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from logger.core.document import (
    Column,
    Degrees,
    Document,
    Line,
    Measured,
    Table,
    Word,
    facts,
    html_table,
    json_text,
    markdown_table,
    terminal_lines,
    width_of,
)

ROOT = Path(__file__).resolve().parents[2]
EVIL = "\x1b]0;evil\x07<script>\u202e\udc80"
TABLE = Table(
    [Column("cell"), Column("level", ".1f", "dBm"), Column("readings", "d"), Column("verdict")],
    [
        ["262-01-1-1", Measured(-60.04, 1.5), 12, Word("located")],
        ["  中文", None, 7],
        ["262-01-1-3", -7.0, None, Word("cannot tell")],
    ],
    "Cells",
)


def _lines(*body, columns=None, **more):
    return list(terminal_lines(Document(None, body=body), columns, **more))


def test_columns_begin_or_end_at_one_line():
    assert _lines(TABLE) == [
        "cell        level (dBm)  readings  verdict",
        "262-01-1-1  -60.0 ± 1.5        12  located",
        "  中文                –         7",
        "262-01-1-3         -7.0         –  cannot tell",
    ]


@pytest.mark.parametrize("columns", [20, 30, 40])
def test_a_table_that_does_not_fit_becomes_a_list_without_cutting_a_value(columns):
    lines = _lines(TABLE, columns=columns)
    text = " ".join(line.strip() for line in lines)
    assert all(value in text for value in ("level (dBm) -60.0 ± 1.5", "readings 12", "中文: "))
    assert max(map(width_of, lines)) <= max(columns, 40)


def test_a_paragraph_is_wrapped_at_blanks_beside_its_bullet():
    lines = _lines(Line("one two three four five six", bullet="- "), columns=12)
    assert lines == ["- one two three four", "  five six"]  # 20 columns at least
    long = "x" * 50
    assert _lines(long, columns=30) == [long]


def test_facts_are_printed_as_they_come_where_their_width_is_known():
    def checks():
        yield "ok", "first"
        raise ZeroDivisionError

    lines = terminal_lines(Document(None, body=facts(checks(), width=4)))
    assert next(lines) == "ok    first"
    assert _lines(*facts([("a", "1"), ("long", "2")])) == ["a     1", "long  2"]


def test_styles_are_those_of_verdicts_and_only_where_wanted():
    plain, styled = (_lines(TABLE, is_styled=wanted) for wanted in (False, True))
    assert "\x1b" not in "".join(plain)
    assert "\x1b[32mlocated\x1b[0m" in styled[1]
    assert [re.sub(r"\x1b\[[\d;]*m", "", line) for line in styled] == plain


def test_text_of_others_steers_no_terminal_and_is_no_markup():
    table = Table([Column("cell"), Column("why")], [[EVIL, Word(EVIL)]], EVIL)
    said = Document(
        None, EVIL, [EVIL], [EVIL, Line(EVIL, bullet=EVIL), *facts([(EVIL, EVIL)]), table]
    )
    for columns in (None, 40):
        shown = "".join(terminal_lines(said, columns))
        assert shown.count("evil") == 9
        assert not set(shown) & set("\x1b\x07\u202e\udc80")
    html = html_table(table)
    assert "<script>" not in html
    assert not set(html) & set("\x1b\x07\u202e\udc80")
    assert "\\<script\\>" in markdown_table(table)


def test_html_names_rows_and_columns_and_scrolls_by_keys():
    html = html_table(TABLE)
    assert '<div class="scroll" role="region" tabindex="0" aria-label="Cells">' in html
    assert html.count('<th scope="col"') == 4
    assert html.count('<th scope="row"') == 3
    assert '<th scope="row" class="sub"><bdi>中文</bdi></th>' in html
    assert '<data value="-60.04">-60.0</data>' in html
    assert html.count("<td") == 9  # a row that ends early is filled


def test_json_of_values_that_json_does_not_have():
    @dataclass
    class Content:
        path: Path
        levels_dbm: np.ndarray
        n: np.int64
        p: float

    content = Content(Path("a"), np.array([1.0, math.nan]), np.int64(3), math.inf)
    assert json.loads(json_text(content)) == {
        "path": "a", "levels_dbm": [1.0, None], "n": 3, "p": None,
    }  # fmt: skip
    assert json.loads(json_text({"path": "a\udc80"})) == {"path": "a\udc80"}
    with pytest.raises(TypeError, match="no JSON for object"):
        json_text(object())


def test_markdown():
    assert markdown_table(TABLE).splitlines()[:3] == [
        "| cell | level (dBm) | readings | verdict |",
        "| --- | --- | --- | --- |",
        "| 262-01-1-1 | -60.0 ± 1.5 | 12 | **located** |",
    ]
    assert markdown_table(Table([Column("cell")], [])) == ""


def test_degrees_are_those_of_a_metre():
    assert Column("at").text(Degrees(52.5, -0.1)).text == "52.50000 -0.10000"


# Nothing else pads text or writes tables.

MARKUP = re.compile(r"</?(td|tr|th|thead|tbody|table)\b|\| ?-{3}|^\| | \| .* \|$")
ELSEWHERE = {
    "logger/core/document.py": "the place where it belongs",
    "logger/drivers/protocols/nmea.py": "digits of a fraction of a second",
    "logger/drivers/reading/modem_gnss.py": "digits of a fraction of a second",
    "postproc/interop/sighting.py": "digits of a fraction of a second",
    "logger/command_line.py": "one width of names under all titles of the help",
}
"""Files that may, with what they pad or write."""


def _writers(text):
    """Lines of a module that pad or align text, or write a table."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute) and node.attr in {"ljust", "rjust", "center"}:
            yield node.lineno
        elif isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            spec = "".join(
                part.value if isinstance(part, ast.Constant) else "{}"
                for part in node.format_spec.values
            )
            if re.search(r"[<>^]", spec) or re.fullmatch(r"[1-9]\d*(\.\d+f)?", spec):
                yield node.lineno
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if MARKUP.search(node.value):
                yield node.lineno
        elif isinstance(node, ast.ImportFrom | ast.Import):
            names = [getattr(node, "module", None) or "", *(one.name for one in node.names)]
            if any(name.startswith(("rich.table", "rich.columns", "tabulate")) for name in names):
                yield node.lineno


@pytest.mark.parametrize(
    "text",
    [
        "f'{a:>8}'",
        "f'{a:<{n}}'",
        "f'{a:8}'",
        "f'{a:8.1f}'",
        "a.ljust(3)",
        "'<td>'",
        "f'<tr class={a}>'",
        "'| a | b |'",
        "from rich.table import Table",
    ],
)
def test_the_search_finds(text):
    assert list(_writers(text))


@pytest.mark.parametrize("text", ["f'{a:.1f}'", "f'{a:+.0f}'", "f'{a:02}'", "f'{a:,}'", "'a | b'"])
def test_the_search_leaves(text):
    assert not list(_writers(text))


def test_nothing_else_pads_text_or_writes_a_table():
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for folder in ("logger", "postproc")
        for path in (ROOT / folder).rglob("*.py")
        if "sim" not in path.parts  # modems pad their replies
        for line in _writers(path.read_text("utf-8"))
        if str(path.relative_to(ROOT)) not in ELSEWHERE
    }
    assert not found
    assert all(list(_writers((ROOT / name).read_text("utf-8"))) for name in ELSEWHERE)


def test_no_template_writes_a_table():
    templates = [
        path
        for folder in ("logger", "postproc")
        for kind in ("html", "js", "css")
        for path in (ROOT / folder).rglob(f"*.{kind}")
        if "map" not in path.parts
    ]
    assert len(templates) > 5
    tags = re.compile(r"<(td|tr|th|table)\b")
    assert not [path for path in templates if tags.search(path.read_text("utf-8"))]
