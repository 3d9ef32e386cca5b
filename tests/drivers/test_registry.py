from pathlib import Path

import pytest

from logger.core.errors import ConfigError
from logger.drivers.registry import DRIVERS, make_driver

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", DRIVERS)
def test_driver_has_a_page_and_a_test_and_its_own_name(name):
    assert (ROOT / "firmware_notes" / f"{name}.md").is_file()
    assert (ROOT / "tests" / "drivers" / f"test_{name}.py").is_file()
    assert make_driver(name).name == name


@pytest.mark.parametrize("name", DRIVERS)
def test_driver_asks_nothing_about_the_subscriber_and_transmits_nothing(name):
    driver = make_driver(name)
    for dialogue in (driver.setup(), driver.poll()):
        assert not _commands(dialogue) & {"CIMI", "CGSN", "GSN", "CCID", "CNUM", "CMGS", "CUSD", "CGATT", "CIPSTART"}


def _commands(dialogue):
    """Names of the commands of a dialogue in which every answer is OK."""
    from logger.drivers.dialogue import Reply

    names = set()
    try:
        command = next(dialogue)
        while True:
            assert not command.text.startswith("ATD")
            names.add(command.text.removeprefix("AT+").split("=")[0].rstrip("?"))
            command = dialogue.send(Reply(command.text, (), "OK"))
    except StopIteration:
        return names


def test_unknown_driver_is_told_with_the_known_ones():
    with pytest.raises(ConfigError, match=r"'sim8000'.*sim800"):
        make_driver("sim8000")
