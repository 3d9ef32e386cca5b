"""Figures of accuracy stand in docs/accuracy.md alone, and few in the tables of the README."""

import re

import pytest

from tests.docs.pages import PAGES, name_of, text_of

FIGURES = "docs/accuracy.md"
FIGURE = re.compile(
    r"\b[01]\.\d\d\b(?!\.)"  # a coverage or a rate
    r"|\b\d+(?:\.\d+)? ?%"
    r"|\b\d+ of (?:all )?\d+ (?:walks|runs|cells|worlds|transmitters|stations|simulated|measured)"
    r"|(?:median error|error|off) (?:of|by|is|was) \d+ ?m\b"
)
DEFINITIONS = {
    "50 %": "the first radius",
    "95 %": "the region and the second radius",
    "68 %": "accuracy of a fix",
    "75 %": "scans that name a cell, where its readings count",
    "90 %": "earlier walks that heard a cell, by which it is missed",
    "0.95": "probability with which a displacement is detected",
    "5 %": "charge of a battery",
    "8 %": "charge of a battery",
    "10 %": "charge of a battery",
}
"""Numbers that look like a figure and are a setting or a definition."""


def figures(text: str) -> list[str]:
    """What looks like a measured accuracy, without definitions."""
    return [match[0] for match in FIGURE.finditer(text) if match[0] not in DEFINITIONS]


@pytest.mark.parametrize("page", [page for page in PAGES if name_of(page) != FIGURES], ids=name_of)
def test_no_other_page_has_a_figure_of_accuracy(page):
    text = text_of(page)
    if page.name == "README.md":
        text = "\n".join(line for line in text.splitlines() if not line.startswith("|"))
    assert figures(text) == []


def test_a_figure_is_found():
    text = "Regions held 97 % of them, coverage 0.93, 3 of 60 walks, off by 30 m; 95 % region."
    assert figures(text) == ["97 %", "0.93", "3 of 60 walks", "off by 30 m"]


def test_every_definition_is_used():
    text = "\n".join(text_of(page) for page in PAGES if name_of(page) != FIGURES)
    assert [number for number in DEFINITIONS if number not in text] == []
