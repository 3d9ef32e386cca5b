"""Each driver comes with its notes, its tests and the replies that these read."""

import re
from importlib import import_module

import pytest

from logger.drivers.registry import FAMILIES
from tests.docs.pages import ROOT, section_of

NOTES = ROOT / "firmware_notes"
COMMON = NOTES / "at.md"
"""What every modem gets, and all of the driver `generic`."""


@pytest.mark.parametrize("name", FAMILIES)
def test_a_driver_has_its_tests_and_replies(name):
    missing = [
        path
        for path in (
            f"logger/drivers/{name}.py",
            f"tests/drivers/test_{name}.py",
            f"tests/drivers/data/ati/{name}.txt",
            f"tests/drivers/data/own/{name}.txt",
        )
        if not (ROOT / path).is_file()
    ]
    assert not missing


@pytest.mark.parametrize("name", FAMILIES)
def test_the_notes_name_each_command_that_a_driver_sends(name):
    """In the section of the driver in the page of its maker, or among those of all modems."""
    section = notes_of(name)
    assert section or name == "generic", f"no page of {NOTES.name} has a section {name}"
    known = section + COMMON.read_text("utf-8")
    sent = {re.match(r"AT[+#^!*]?[A-Z0-9]*", text)[0] for text in FAMILIES[name].sends()}
    assert sorted(text for text in sent if not re.search(rf"{re.escape(text)}\b", known)) == []


def notes_of(name: str) -> str:
    """The section of a driver, whichever page it is in; empty where there is none."""
    for page in NOTES.glob("*.md"):
        text = page.read_text("utf-8")
        title = re.search(rf"^## ({name}(?::.*)?)$", text, re.MULTILINE)
        if title:
            return section_of(text, title[1]) or ""
    return ""


@pytest.mark.parametrize("folder", ["ati", "own"])
def test_replies_belong_to_a_driver_that_is_found(folder):
    """A driver that is not found leaves its replies behind."""
    files = (ROOT / "tests" / "drivers" / "data" / folder).glob("*.txt")
    assert {path.stem for path in files} == set(FAMILIES)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_driver_is_one_file_with_an_exchange_and_its_sources_at_the_head(name):
    """No package, no helpers in other files but those that all families share."""
    module = import_module(type(FAMILIES[name]).__module__)
    assert module.__name__ == f"logger.drivers.{name}"
    head = module.__doc__ or ""
    for title in ("Needs:", "Known by:", "Doubts:", "Sources:"):
        assert title in head, f"{name}: no line {title!r}"
    exchange = [line[4:] for line in head.splitlines() if line.startswith("    ")]
    assert any(re.match(r"AT[+^!#]", line) for line in exchange)
    assert FAMILIES[name].read(exchange), f"{name}: its own head is not read"
