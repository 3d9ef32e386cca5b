"""Nothing that is printed steers a terminal, and JSON stays what it was."""

import io
import json
import sys
import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from logger.core.printable import PlainStream, plain_streams, printable


@given(st.text())
def test_nothing_that_steers_is_left(text):
    shown = printable(text)
    assert not any(unicodedata.category(c) in {"Cc", "Cf", "Cs", "Zl", "Zp"} for c in shown)
    assert printable(shown) == shown
    assert len(shown.splitlines()) <= 1


@given(st.recursive(st.text(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_json_means_the_same(value):
    stream = io.StringIO()
    print(json.dumps(value, ensure_ascii=False, indent=1), file=PlainStream(stream))
    assert json.loads(stream.getvalue()) == value


def test_text_of_people_stays():
    assert printable("Grüße, 北京 – ✓ 🗼") == "Grüße, 北京 – ✓ 🗼"
    assert (
        printable("\x1b[2J\x9b1m\u202eabc\r\n\udcff")
        == "\\u001b[2J\\u009b1m\\u202eabc\\u000d\\u000a\\udcff"
    )


def test_a_stream_keeps_lines_and_tabs_and_all_else_of_the_stream_below():
    stream = io.StringIO()
    plain = PlainStream(stream)
    print("a\tb\n\x1b]0;title\x07", file=plain)
    plain.flush()
    assert stream.getvalue() == "a\tb\n\\u001b]0;title\\u0007\n"
    assert plain.isatty() is False


def test_a_terminal_without_our_characters_shows_no_doubt(monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(written, encoding="ascii"))
    with plain_streams():
        print("-12.4 ± 19.0 dBm, 1\N{NARROW NO-BREAK SPACE}400 m², Zoë")
        sys.stdout.flush()
    assert written.getvalue() == b"-12.4 +- 19.0 dBm, 1 400 m2, Zo?\n"
