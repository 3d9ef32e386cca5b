"""Every reader of a file that others write, on whatever may stand there."""

import io
from functools import partial
from pathlib import Path

import pytest

from logger.config import PowerSettings, load_config
from logger.core.document import json_text, terminal_lines
from logger.core.errors import ConfigError
from logger.core.live_settings import FOLLOW
from logger.device.battery import BatteryWatch, batteries, too_low_to_begin
from logger.device.leds import StatusLight
from logger.device.machine import kept_in_memory, machine
from logger.device.mode_switch import SavedModes
from logger.device.page_requests import FILE, PageRequests
from logger.device.status import report
from logger.doctor.examination import without_private
from logger.doctor.single_tests import holders, plug, power, temperature
from logger.page.feed import TABLES, Feed, JournalTail
from logger.page.server import open_run
from logger.page.token import make_token, read_token
from tests.kit import foreign_files

SUPPLY = ("type", "scope", "present", "capacity", "voltage_now", "current_now", "status")


def _supply(folder: Path, name: str) -> Path:
    supply = folder / "class/power_supply/a"
    supply.mkdir(parents=True)
    for other, text in (("type", "Battery"), ("present", "1"), ("capacity", "50")):
        if other != name:
            (supply / other).write_text(text)
    return supply / name


def _sensor(folder: Path, name: str) -> Path:
    sensor = folder / "class/hwmon/hwmon0"
    sensor.mkdir(parents=True)
    for other, text in (("name", "ina219"), ("in1_input", "3300")):
        if other != name:
            (sensor / other).write_text(text)
    return sensor / name


def _led_names(folder: Path) -> None:
    (folder / "led").mkdir(exist_ok=True)
    StatusLight("led", folder).close()


def _status(folder: Path) -> None:
    said = report(folder)[0]
    assert list(terminal_lines(said, 80))
    assert json_text(said.content)


def _feed(folder: Path) -> None:
    feed = Feed(folder, folder)
    feed.look()
    assert feed.text


def _requests(folder: Path) -> None:
    requests = PageRequests(folder)
    (folder / FILE).rename(folder / "other")
    assert requests.take() == []
    (folder / "other").rename(folder / FILE)
    for note in requests.take():
        assert note.code in {"page-request", FOLLOW}


def _closed_run(folder: Path) -> None:
    if run := open_run(folder, "run-000001.h5"):
        run[0].close()


def _below(folder: Path, name: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


READERS = {
    "status": (lambda f: f / "status.json", _status),
    "feed of the page": (lambda f: f / "status.json", _feed),
    "requests": (lambda f: f / FILE, _requests),
    "saved modes": (lambda f: f / "modem-modes.json", lambda f: SavedModes(f).all()),
    "site.toml": (lambda f: f / "site.toml", lambda f: load_config(f / "site.toml")),
    "token": (lambda f: f / "token", read_token),
    "first token": (lambda f: f / "token", make_token),
    "journal": (
        lambda f: f / "run-000001.journal",
        lambda f: list(JournalTail(f / "run-000001.journal", TABLES).rows()),
    ),
    "closed run": (lambda f: f / "run-000001.h5", _closed_run),
    "trigger of the LED": (lambda f: _below(f, "led/trigger"), _led_names),
    "temperature": (lambda f: _below(f, "class/thermal/thermal_zone0/temp"), None),
    "throttling": (lambda f: _below(f, "devices/platform/soc/soc:firmware/get_throttled"), None),
    "name of a process": (
        lambda f: _below(f, "1/comm"),
        lambda f: ((f / "1/fd").mkdir(), list(holders("a", "/dev/null", f))),
    ),
    **{f"battery {name}": (lambda f, n=name: _supply(f, n), None) for name in SUPPLY},
    **{
        f"sensor {name}": (lambda f, n=name: _sensor(f, n), None)
        for name in ("name", "in1_input", "curr1_input")
    },
}


def _machine(folder: Path) -> None:
    settings = PowerSettings(stop_percent=10.0, stop_volts=3.0)
    machine(folder, folder)
    batteries(folder)
    too_low_to_begin(settings, folder)
    list(BatteryWatch(settings, lambda: 0.0, folder).look())
    power(folder)
    temperature(folder)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("reader", READERS)
def test_whatever_stands_there_is_an_answer_or_an_error_in_words(tmp_path, reader):
    path_of, read = READERS[reader]
    wrong = []
    for kind in (*foreign_files.TEXTS, *foreign_files.KINDS):
        folder = tmp_path / kind.replace(" ", "-")
        folder.mkdir()
        foreign_files.make(path_of(folder), kind)
        try:
            outcome = foreign_files.attempt(
                partial(read or _machine, folder), *((ConfigError, OSError) if read else ())
            )
        except AssertionError as error:
            wrong.append((kind, str(error).splitlines()[0]))
        else:
            assert not isinstance(outcome, OSError) or outcome.strerror or str(outcome)
    assert wrong == []


@pytest.mark.parametrize("text", foreign_files.TEXTS.values(), ids=list(foreign_files.TEXTS))
def test_a_mount_or_an_event_of_any_name_is_read(tmp_path, text):
    mountinfo = tmp_path / "mountinfo"
    name = text.replace(b" ", b"").replace(b"\n", b"").replace(b"\r", b"")[:1000] or b"x"
    mountinfo.write_bytes(b"36 35 98:0 / /%s rw - ext4 /dev/a rw\n" % name)
    assert plug(tmp_path, mountinfo).state == "ok"
    assert kept_in_memory(tmp_path, mountinfo.read_text(errors="replace")) == ""
    io.StringIO(without_private(text[:1000].decode(errors="replace")))
