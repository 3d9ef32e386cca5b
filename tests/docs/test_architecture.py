"""ARCHITECTURE.md is short, and its files and what travels through them are those of the code."""

import re

from tests.docs.pages import ROOT, section_of

TEXT = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
MOST_WORDS = 1500
MOST_FILES = 15
"""Of one reading from the port to the report."""
STAYS = 12
_ROW = re.compile(r"^\| (\d+) \| `([\w/.]+)` \| `(\w+)` \|", re.MULTILINE)
_WORD = re.compile(r"^\| \w+ \| .* \| `(\w+)` in `([\w/.]+)` \|$", re.MULTILINE)


def names(file: str, name: str) -> bool:
    """Whether a file of the repository has a name."""
    return re.search(rf"\b{name}\b", (ROOT / file).read_text("utf-8")) is not None


def test_it_is_short():
    assert len(TEXT.split()) <= MOST_WORDS
    assert len(re.findall(r"^!\[", TEXT, re.MULTILINE)) == 1


def test_what_travels_is_in_each_file_of_the_way():
    rows = _ROW.findall(section_of(TEXT, "The way of a row"))
    assert [int(number) for number, _, _ in rows] == list(range(1, STAYS + 1))
    assert len({file for _, file, _ in rows}) <= MOST_FILES
    assert [(file, name) for _, file, name in rows if not names(file, name)] == []


def test_each_word_is_a_type_in_its_file():
    words = _WORD.findall(section_of(TEXT, "The words"))
    assert words
    assert [(name, file) for name, file in words if not names(file, f"class {name}")] == []


def test_a_wrong_place_is_found():
    assert not names("logger/core/readings.py", "class Record")
