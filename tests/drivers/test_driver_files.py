"""Each driver comes with its notes, its tests and the replies that these read."""

from pathlib import Path

import pytest

from logger.drivers.registry import FAMILIES

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_driver_has_its_notes_tests_and_replies(name):
    vendor = type(FAMILIES[name]).__module__.split(".")[2]
    missing = [
        path
        for path in (
            f"logger/drivers/{vendor}/{name}.py",
            f"tests/drivers/{vendor}/test_{name}.py",
            f"tests/drivers/data/ati/{name}.txt",
            f"tests/drivers/data/own/{name}.txt",
            f"firmware_notes/{'at' if name == 'generic' else name}.md",
        )
        if not (ROOT / path).is_file()
    ]
    assert not missing


@pytest.mark.parametrize("folder", ["ati", "own"])
def test_replies_belong_to_a_driver_that_is_found(folder):
    """A driver that is missing in `DRIVERS` of its vendor folder leaves its replies behind."""
    files = (ROOT / "tests" / "drivers" / "data" / folder).glob("*.txt")
    assert {path.stem for path in files} == set(FAMILIES)
