import threading

import pytest

from logger.device import leds
from logger.device.leds import Lamp
from tests.kit.service import assert_ends, wait_for


@pytest.fixture
def led(tmp_path):
    """An LED's folder as the kernel makes it, in which the card's trigger is chosen."""
    folder = tmp_path / "ACT"
    folder.mkdir()
    (folder / "trigger").write_text("none timer [mmc0] heartbeat\n")
    (folder / "brightness").write_text("1")
    return folder


LONG_S = 1e6


def _shows(led, level):
    wait_for(lambda: (led / "brightness").read_text() == level)


def test_each_sign_blinks_in_its_own_way_and_the_kernel_gets_its_led_back(led, monkeypatch):
    flashes = {"no fix": (0.05, 0.05), "recording": (0.001, LONG_S), "error": (LONG_S, 0.001)}
    monkeypatch.setattr(leds, "FLASHES_S", flashes)
    with Lamp("ACT", led.parent) as lamp:
        assert (led / "trigger").read_text() == "none"
        for _ in range(3):
            _shows(led, "1")
            _shows(led, "0")
        lamp.show("error")
        _shows(led, "1")
        lamp.show("recording")
        _shows(led, "0")
        lamp.show("no fix")
        _shows(led, "1")
        _shows(led, "0")
    assert (led / "trigger").read_text() == "mmc0"


def test_a_change_is_shown_at_once_and_the_end_does_not_wait_for_a_flash(led, monkeypatch):
    flashes = {"no fix": (LONG_S, LONG_S), "recording": (0.001, LONG_S), "error": (1.0, 1.0)}
    monkeypatch.setattr(leds, "FLASHES_S", flashes)

    def show():
        with Lamp("ACT", led.parent) as lamp:
            _shows(led, "1")
            lamp.show("recording")
            _shows(led, "0")

    assert_ends(show)
    assert (led / "trigger").read_text() == "mmc0"


def test_no_sign_is_a_steady_light():
    assert all(on > 0 and off > 0 for on, off in leds.FLASHES_S.values())
    assert len(set(leds.FLASHES_S.values())) == len(leds.FLASHES_S)


@pytest.mark.parametrize("name", ["", "none"])
def test_no_led_and_a_missing_one_change_nothing(tmp_path, name, caplog):
    before = threading.active_count()
    with Lamp(name, tmp_path) as lamp:
        lamp.show("error")
        assert threading.active_count() == before
    assert len(caplog.records) == bool(name)


def test_an_led_that_goes_away_is_told_once(led, monkeypatch, caplog):
    monkeypatch.setattr(leds, "FLASHES_S", dict.fromkeys(leds.FLASHES_S, (0.01, 0.01)))
    with Lamp("ACT", led.parent):
        wait_for(lambda: (led / "brightness").read_text() == "0")
        led.rename(led.parent / "gone")
        wait_for(lambda: caplog.records)
    assert len(caplog.records) == 1
