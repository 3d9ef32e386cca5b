"""Nothing that is printed steers a terminal, and JSON stays what it was."""

import io
import json
import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from logger.core.printable import PlainStream, printable


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
