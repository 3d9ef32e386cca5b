"""The guide explains each term where it is used first, and its pictures show what programs do."""

import re

import pytest

from logger.core.types import Verdict
from logger.device.leds import FLASHES_S
from tests.docs.pages import ROOT, shell_lines, text_of
from tools.guide_pictures import MEANING, PICTURES, answers_picture, led_picture

GUIDE = ROOT / "docs/guide.md"
TERMS = (
    "base station", "cell", "identity", "IMSI catcher", "IMSI", "SIM", "2G", "GSM", "LTE",
    "Raspberry Pi", "Pi", "modem", "level", "dBm", "dB", "receiver", "GPS", "fix", "run", "NMEA",
    "band", "HAT", "serving cell", "neighbours", "pipx", "region", "located", "ambiguous",
    "cannot tell", "unusual", "suspicious", "baseline",
)  # fmt: skip
"""Terms of radio and of this project that the guide explains, each where it is printed bold."""
COMMON = {
    "USB": "on every computer",
    "PIN": "on every phone",
    "MAIN": "label of a socket",
    "GNSS": "label of a socket",
    "MHZ": "explained by the word frequencies before it",
    "V": "volt", "A": "ampere", "GB": "size of a card",
    "EC25": "name of a product",
    "SIM800": "name of a product", "SIM808": "name of a product",
    "SIM7000": "name of a product", "SIM7600": "name of a product",
    "A, B, C": "names of the kits",
}  # fmt: skip
"""Abbreviations that need no explanation, with the reason."""
INTRODUCTION = "## What this is about"


def prose(text: str) -> str:
    """The guide after its first paragraph, without headings, code, pictures and targets of links.

    The paragraph before and the headings name what the page is about.
    """
    body = text.partition(INTRODUCTION)[2]
    body = re.sub(r"^#.*$", "", body, flags=re.MULTILINE)
    body = re.sub(r"!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)|`[^`]*`", " ", body)
    return " ".join(body.split())


def first_uses(text: str, term: str) -> list[bool]:
    """Whether each use of a term is its explanation, in the order of the text."""
    pattern = rf"(?<![\w-])(\*\*)?{term}s?(?![\w-])"
    flags = 0 if term.isupper() or len(term) <= 2 else re.IGNORECASE
    return [match[1] is not None for match in re.finditer(pattern, text, flags)]


@pytest.mark.parametrize("term", TERMS)
def test_each_term_is_explained_where_it_is_used_first(term):
    longer = [other for other in TERMS if term in other and term != other]
    text = prose(text_of(GUIDE))
    for other in longer:
        text = re.sub(rf"(?<![\w*-])(\*\*)?{other}s?(?![\w-])", "", text)
    uses = first_uses(text, term)
    assert uses[:1] == [True], f"{term} is used before it is explained"
    assert uses.count(True) == 1, f"{term} is explained twice"


def test_a_term_that_is_used_too_early_is_found():
    assert first_uses("The modems hear. A **modem** is a radio.", "modem") == [False, True]


def test_every_abbreviation_is_explained_or_common():
    known = set(COMMON) | set("ABC") | {term for term in TERMS if term.isupper()} | {"2G", "3G"}
    used = set(re.findall(r"\b[A-Z][A-Z0-9]+\b", prose(text_of(GUIDE))))
    assert sorted(used - known) == []


def test_the_answers_are_all_explained():
    assert set(Verdict.__args__) <= set(TERMS)


def test_the_picture_of_the_lamp_has_its_patterns():
    assert set(MEANING) == {*FLASHES_S, "dark"}
    assert (PICTURES / "led.svg").read_text("utf-8") == led_picture()


def test_the_picture_of_the_answers_is_what_the_program_says():
    """Drawing raises where a verdict is another; the last digit of a region is the machine's."""
    drawn = (PICTURES / "answers.svg").read_text("utf-8")
    shape = re.compile(r'(?: d| c[xy])="[^"]*"')
    assert shape.sub("", drawn) == shape.sub("", answers_picture())


@pytest.mark.parametrize("picture", sorted(PICTURES.glob("*.svg")), ids=lambda path: path.name)
def test_pictures_have_a_title_and_load_nothing(picture):
    text = picture.read_text("utf-8")
    assert "<title id=" in text
    assert 'role="img"' in text
    assert not re.search(r"(?:href|src|url)\s*[=(]\s*[\"']?(?!#)", text.replace("xmlns", ""))


OUTPUT = re.compile(r"^```text\n\$ (.*)\n((?:.*\n)+?)```$", re.MULTILINE)


def test_the_output_shown_is_of_commands_of_the_guide():
    """A run has another number there than in the other examples."""
    shown = OUTPUT.findall(GUIDE.read_text("utf-8"))
    known = {_without_number(" ".join(line.split())) for line in shell_lines(GUIDE)}
    assert shown
    assert [command for command, _ in shown if _without_number(command) not in known] == []
    assert any(re.search(r"^[\d-]+ +(\w+ +)?located ", text, re.MULTILINE) for _, text in shown)


def _without_number(command: str) -> str:
    return re.sub(r"run(-\d{6})?\.h5", "RUN.h5", command)
