import threading
from contextlib import closing

import pytest
from msgspec.structs import replace

from logger.device import leds
from logger.device.leds import StatusLight
from logger.device.status import PortStatus, Status
from tests.kit.service import assert_ends, wait_for


@pytest.fixture
def led_folder(tmp_path):
    """An LED's folder as the kernel makes it, in which the card's trigger is chosen."""
    folder = tmp_path / "ACT"
    folder.mkdir()
    (folder / "trigger").write_text("none timer [mmc0] heartbeat\n")
    (folder / "brightness").write_text("1")
    return folder


LONG_S = 1e6


def status(state):
    return Status(state, "", "run-1.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {})


@pytest.mark.parametrize("text", ["waiting for the card: Input/output error", "failed: full"])
def test_a_failing_card_is_worse_than_a_faulty_port(text):
    ports = {name: PortStatus(name) for name in ("a", "b", "gnss")}
    ports["b"] = PortStatus("b", fault="no such port")
    faulty = replace(status("error"), text="b: no such port", ports=ports)
    assert leds.flashes_of(faulty).count(leds.LONG_FLASH_S[0]) == 2
    assert leds.flashes_of(replace(faulty, text=text)) == leds.FLASHES_S["error"]


def _shows(led_folder, level):
    wait_for(lambda: (led_folder / "brightness").read_text() == level)


def test_each_sign_blinks_in_its_own_way_and_the_kernel_gets_its_led_back(led_folder, monkeypatch):
    flashes = {"no fix": (0.05, 0.05), "recording": (0.001, LONG_S), "error": (LONG_S, 0.001)}
    monkeypatch.setattr(leds, "FLASHES_S", flashes)
    with closing(StatusLight("ACT", led_folder.parent)) as light:
        assert (led_folder / "trigger").read_text() == "none"
        for _ in range(3):
            _shows(led_folder, "1")
            _shows(led_folder, "0")
        light.publish(status("error"))
        _shows(led_folder, "1")
        light.publish(status("recording"))
        _shows(led_folder, "0")
        light.publish(status("no fix"))
        _shows(led_folder, "1")
        _shows(led_folder, "0")
    assert (led_folder / "trigger").read_text() == "mmc0"


def test_a_change_is_shown_at_once_and_the_end_does_not_wait_for_a_flash(led_folder, monkeypatch):
    flashes = {"no fix": (LONG_S, LONG_S), "recording": (0.001, LONG_S), "error": (1.0, 1.0)}
    monkeypatch.setattr(leds, "FLASHES_S", flashes)

    def blink():
        with closing(StatusLight("ACT", led_folder.parent)) as light:
            _shows(led_folder, "1")
            light.publish(status("recording"))
            _shows(led_folder, "0")

    assert_ends(blink)
    assert (led_folder / "trigger").read_text() == "mmc0"


def test_no_sign_is_a_steady_light():
    assert all(seconds > 0 for times in leds.FLASHES_S.values() for seconds in times)
    assert all(len(times) % 2 == 0 for times in leds.FLASHES_S.values())
    assert len(set(leds.FLASHES_S.values())) == len(leds.FLASHES_S)


@pytest.mark.parametrize("name", ["", "none"])
def test_no_led_and_a_missing_one_change_nothing(tmp_path, name, caplog):
    before = threading.active_count()
    with closing(StatusLight(name, tmp_path)) as light:
        light.publish(status("error"))
        assert threading.active_count() == before
    assert len(caplog.records) == bool(name)


def test_an_led_that_goes_away_is_told_once(led_folder, monkeypatch, caplog):
    monkeypatch.setattr(leds, "FLASHES_S", dict.fromkeys(leds.FLASHES_S, (0.01, 0.01)))
    with closing(StatusLight("ACT", led_folder.parent)):
        wait_for(lambda: (led_folder / "brightness").read_text() == "0")
        led_folder.rename(led_folder.parent / "gone")
        wait_for(lambda: caplog.records)
    assert len(caplog.records) == 1
