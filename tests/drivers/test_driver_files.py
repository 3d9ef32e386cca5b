"""Each driver comes with its notes, its tests and the replies that these read."""

import re
from importlib import import_module
from pathlib import Path

import pytest

from logger.drivers.registry import FAMILIES

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_driver_has_its_notes_tests_and_replies(name):
    missing = [
        path
        for path in (
            f"logger/drivers/{name}.py",
            f"tests/drivers/test_{name}.py",
            f"tests/drivers/data/ati/{name}.txt",
            f"tests/drivers/data/own/{name}.txt",
            f"firmware_notes/{'at' if name == 'generic' else name}.md",
        )
        if not (ROOT / path).is_file()
    ]
    assert not missing


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
