import os

import pytest

from logger.doctor import machine
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
