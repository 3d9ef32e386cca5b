import pytest

from logger.doctor.examination import without_private


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("modem IMEI 490154203237518 ready", "490154203237518"),
        ("target 262-01-4711-17 set", "4711"),
        ("at 52.51234, 13.41234", "52.5"),
        ("/dev/serial/by-id/usb-Prolific_USB_A1B2C3-if00-port0", "A1B2C3"),
        ("socket://laptop.local:7000 refused", "laptop"),
        ("socket://192.168.0.17:7000", "192"),
        ("/home/maria/runs is full", "maria"),
        ("hotspot aa:bb:cc:dd:ee:ff", "dd:ee"),
        ("cell lac 4711 lost", "4711"),
        ("+491701234567 called", "1701234567"),
    ],
)
def test_what_names_somebody_is_left_out(text, safe):
    assert safe not in without_private(text)


@pytest.mark.parametrize(
    "text",
    [
        "3.4 GB free, slowest write of 64 kB 12 ms",
        "undervoltage now: use a 5 V 3 A supply",
        "19 scans a minute; modem set up by driver sim800",
        "port /dev/ttyUSB0 lost",
    ],
)
def test_what_helps_stays(text):
    assert without_private(text) == text
