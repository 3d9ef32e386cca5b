import os

import pytest

from logger.config import PowerSettings
from logger.doctor import single_tests as machine
from tests.kit.simulated_devices import simulated_devices


@pytest.mark.parametrize(
    ("bits", "state"),
    [
        ("0", "ok"),
        ("50005", "fail"),
        ("50000", "warn"),
        ("20000", "warn"),
        ("4", "warn"),
        ("junk", "ok"),
        (None, "ok"),
    ],
)
def test_undervoltage_reported_by_the_firmware(tmp_path, bits, state):
    if bits is not None:
        file = tmp_path / "devices/platform/soc/soc:firmware/get_throttled"
        file.parent.mkdir(parents=True)
        file.write_text(bits + "\n")
    assert machine.power(tmp_path).state == state


@pytest.mark.parametrize(
    ("degrees", "state", "says"),
    [
        ([48_312, 47_000], "ok", "48 degrees"),
        ([48_000, 74_000], "warn", "close to slowing down"),
        ([83_000], "warn", "is slowed down"),
        ([], "ok", "not reported"),
        (["junk"], "ok", "not reported"),
    ],
)
def test_the_hottest_zone_counts(tmp_path, degrees, state, says):
    for i, value in enumerate(degrees):
        zone = tmp_path / f"class/thermal/thermal_zone{i}"
        zone.mkdir(parents=True)
        (zone / "temp").write_text(f"{value}\n")
    line = machine.temperature(tmp_path)
    assert (line.state, says in line.text) == (state, True)


def test_another_process_that_holds_the_port_is_named():
    with simulated_devices() as (modem, _, _):
        held = os.open(modem.path, os.O_RDWR | os.O_NOCTTY)
        child = os.fork()
        if child == 0:
            os.read(os.open("/dev/zero", os.O_RDONLY), 1)
            import time

            time.sleep(3600)
            os._exit(0)
        try:
            os.close(held)
            (line,) = machine.holders("modem", modem.path)
        finally:
            os.kill(child, 9)
            os.waitpid(child, 0)
    assert line.state == "fail"
    assert f"process {child}" in line.text


@pytest.mark.parametrize(
    ("capacity", "settings", "state", "says"),
    [
        (None, PowerSettings(), "ok", "none"),
        (None, PowerSettings(stop_percent=5), "warn", "no effect"),
        (80, PowerSettings(stop_percent=5), "ok", "bat0: 80 %, discharging"),
        (15, PowerSettings(stop_percent=5), "warn", "charge it"),
        (7, PowerSettings(stop_percent=5), "fail", "too low to record"),
    ],
)
def test_the_battery_is_examined(tmp_path, capacity, settings, state, says):
    if capacity is not None:
        folder = tmp_path / "class/power_supply/bat0"
        folder.mkdir(parents=True)
        for name, value in (("type", "Battery"), ("capacity", capacity), ("status", "Discharging")):
            (folder / name).write_text(f"{value}\n")
    line = machine.battery(settings, tmp_path)
    assert (line.state, line.what) == (state, "battery")
    assert says in line.text


def test_a_sensor_without_a_percentage_needs_another_limit(tmp_path):
    folder = tmp_path / "class/hwmon/hwmon1"
    folder.mkdir(parents=True)
    (folder / "name").write_text("ina219\n")
    (folder / "in1_input").write_text("7900\n")
    assert "set stop_volts" in machine.battery(PowerSettings(stop_percent=5), tmp_path).text
    assert machine.battery(PowerSettings(stop_volts=6.4), tmp_path).state == "ok"
