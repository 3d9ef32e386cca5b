"""Batteries as folders of sysfs, and what a low one does to a recording."""

import threading
from itertools import count
from time import monotonic

import pytest

from logger.config import PowerSettings, parse_config
from logger.core.runfile import read_run
from logger.device.battery import (
    LOOK_EVERY_S,
    Battery,
    BatteryWatch,
    batteries,
    is_low,
    too_low_to_begin,
    wait_for_charger,
)
from logger.device.clock import ScaledClock
from logger.device.notify import ServiceManager
from logger.device.service import Service
from logger.device.startup import begin_run
from tests.kit.service import site_toml
from tests.kit.simulated_devices import simulated_devices

TEN_PERCENT = PowerSettings(stop_percent=10.0)


def write(folder, **values):
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in values.items():
        (folder / name).write_text(f"{value}\n")


def ups(sys, capacity=80, status="Discharging", voltage_now=4_050_000):
    write(sys / "class/power_supply/bat0", type="Battery", present=1, capacity=capacity,
          status=status, voltage_now=voltage_now, current_now=-512_000)  # fmt: skip


def ina219(sys, millivolts=7900):
    write(sys / "class/hwmon/hwmon2", name="ina219", in0_input=-12, in1_input=millivolts,
          curr1_input=640, power1_input=5_056_000)  # fmt: skip


def test_a_battery_of_the_kernel_and_a_sensor_are_read(tmp_path):
    ups(tmp_path)
    ina219(tmp_path)
    write(tmp_path / "class/power_supply/ac", type="Mains", online=1)
    write(tmp_path / "class/power_supply/mouse", type="Battery", scope="Device", capacity=3)
    write(tmp_path / "class/hwmon/hwmon0", name="cpu_thermal", temp1_input=51_000)
    assert batteries(tmp_path) == [
        Battery("bat0", 80.0, 4.05, -0.512, "discharging"),
        Battery("ina219", None, 7.9, 0.64, None),
    ]
    assert str(batteries(tmp_path)[0]) == "bat0: 80 %, 4.05 V, -0.51 A, discharging"


@pytest.mark.parametrize("capacity", ["", "x", "-5", "255"])
def test_what_is_no_percentage_is_unknown(tmp_path, capacity):
    ups(tmp_path, capacity=capacity, voltage_now="", status="Unknown")
    assert batteries(tmp_path) == [Battery("bat0", None, None, -0.512, None)]
    assert str(batteries(tmp_path)[0]) == "bat0: -0.51 A"


def test_a_machine_without_a_battery_has_none(tmp_path):
    assert batteries(tmp_path) == []
    watch = BatteryWatch(TEN_PERCENT, monotonic, tmp_path)
    assert list(watch.look()) == []
    assert (watch.latest, watch.low) == (None, "")


@pytest.mark.parametrize(
    ("capacity", "status", "settings", "low"),
    [
        (10, "Discharging", TEN_PERCENT, True),
        (11, "Discharging", TEN_PERCENT, False),
        (3, "Charging", TEN_PERCENT, False),
        (3, "Not charging", TEN_PERCENT, False),
        (3, "Unknown", TEN_PERCENT, True),
        (0, "Discharging", PowerSettings(), False),
        (80, "Discharging", PowerSettings(stop_volts=4.1), True),
    ],
)
def test_only_a_limit_that_is_set_makes_a_battery_low(tmp_path, capacity, status, settings, low):
    ups(tmp_path, capacity, status)
    assert is_low(batteries(tmp_path)[0], settings) is low


def _looks(watch, n):
    return [note for _ in range(n) for note in watch.look()]


def test_a_note_is_made_of_each_change_and_none_of_no_change(tmp_path):
    ups(tmp_path, 80)
    watch = BatteryWatch(TEN_PERCENT, count(0.0, LOOK_EVERY_S).__next__, tmp_path)
    assert [note.code for note in _looks(watch, 5)] == ["battery"]
    ups(tmp_path, 71)
    assert _looks(watch, 5) == []
    ups(tmp_path, 70)
    assert [note.text for note in _looks(watch, 5)] == ["bat0: 70 %, 4.05 V, -0.51 A, discharging"]


def test_one_low_reading_does_not_end_a_walk(tmp_path):
    ina219(tmp_path)
    settings = PowerSettings(stop_volts=6.4)
    watch = BatteryWatch(settings, count(0.0, LOOK_EVERY_S).__next__, tmp_path)
    for millivolts in (7900, 6300, 7800, 6300, 6300, 7700):
        ina219(tmp_path, millivolts)
        _looks(watch, 1)
    assert watch.low == ""
    ina219(tmp_path, 6300)
    codes = [note.code for note in _looks(watch, 9)]
    assert codes.count("battery-low") == 1
    assert watch.low == "battery low: ina219: 6.30 V, 0.64 A"


def test_recording_begins_again_well_above_the_limit_or_at_a_charger(tmp_path):
    assert too_low_to_begin(TEN_PERCENT, tmp_path) == ""
    ups(tmp_path, 12)
    assert "waiting for a charger: bat0: 12 %" in too_low_to_begin(TEN_PERCENT, tmp_path)
    assert too_low_to_begin(PowerSettings(), tmp_path) == ""
    ups(tmp_path, 12, "Charging")
    assert too_low_to_begin(TEN_PERCENT, tmp_path) == ""
    ups(tmp_path, 16)
    assert too_low_to_begin(TEN_PERCENT, tmp_path) == ""


def test_a_service_waits_for_the_charger_until_it_is_stopped(tmp_path):
    ups(tmp_path, 4)
    ended = threading.Event()
    waiting = threading.Thread(
        target=wait_for_charger, args=(TEN_PERCENT, ServiceManager(""), ended, tmp_path)
    )
    waiting.start()
    waiting.join(0.2)
    assert waiting.is_alive()
    ended.set()
    waiting.join(5.0)
    assert not waiting.is_alive()


def test_a_low_battery_closes_the_run(tmp_path):
    sys = tmp_path / "sys"
    ups(sys, 60)
    with simulated_devices() as (modem, gnss, _):
        text = site_toml(tmp_path, modem.path, gnss.path).read_text()
        config = parse_config(f"{text}\n[power]\nstop_percent = 10\n", "site.toml")
        clock = ScaledClock(20.0)
        writer = begin_run(config, text, clock)
        watch = BatteryWatch(config.power, lambda: 100.0 * monotonic(), sys)
        service = Service(config, writer, clock, threading.Event(), battery=watch)
        service.start()
        service.wait(60.0, lambda: ups(sys, 8) if service.recorder.counts["Scan"] else None)
        assert service.snapshot().battery == Battery("bat0", 8.0, 4.05, -0.512, "discharging")
        run = read_run(service.stop(service.low_battery))
    assert run.end.reason.startswith("battery low: bat0: 8 %")
    notes = [row["code"].decode() for row in run.tables["notes"] if row["source"] == b"battery"]
    assert notes[0] == "battery"
    assert notes[-1] == "battery-low"
    assert len(run.tables["scans"])
