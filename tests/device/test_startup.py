"""The first second of a run: its journal is on the card before anything is imported that takes
time.
"""

import os
import random
import tty
from importlib.metadata import version

import pytest

from logger.config import parse_config
from logger.core.errors import ConfigError
from logger.core.runfile import read_run, recover
from logger.device.clock import Clock
from logger.device.service import Service
from logger.device.startup import LIBRARIES, begin_run, installed_versions
from tests.kit import service
from tests.kit.first_flush import first_flush, instrumented_service

HEAVY = {
    "numpy",
    "pyproj",
    "h5py",
    "pynmea2",
    "serial",
    "importlib.metadata",
    "ctypes",
    "asyncio",
    "urllib.request",
}
HEAVY_OF_OURS = (
    "logger.drivers.registry",
    "logger.core.locator",
    "logger.core.live",
    "logger.core.places",
    "logger.device.service",
)


@pytest.fixture
def config(tmp_path):
    return service.site_toml(tmp_path, str(tmp_path / "no-modem"), str(tmp_path / "no-receiver"))


def test_nothing_heavy_is_imported_before_the_journal_is_durable(config):
    with instrumented_service(config) as process:
        modules = first_flush(process).modules
    assert not modules & HEAVY
    assert modules.isdisjoint(HEAVY_OF_OURS)


def test_nothing_the_ports_need_waits_for_numpy(tmp_path):
    """What records is imported without numpy, so that ports are open while the live estimate is
    still imported.
    """
    script = "import logger.device.service, sys; print(*sys.modules)"
    modules = set(service.run_python(script).split())
    assert {
        "logger.device.service",
        "logger.device.recorder",
        "logger.drivers.registry",
        "serial",
    } <= modules
    assert not modules & {"numpy", "pyproj", "h5py"}


def test_a_journal_exists_whenever_a_killed_process_had_come_so_far(tmp_path, config):
    """Killed at random moments of the start, and right at that point: what is there then is read
    and recovered.
    """
    rng = random.Random(7)
    runs = tmp_path / "runs"
    begun = 0
    for wait_s in [None, None, *(rng.uniform(0.0, 0.4) for _ in range(10))]:
        with instrumented_service(config) as process:
            if wait_s is None:
                first_flush(process)
                durable = True
            else:
                service.wait_at_most(process, wait_s)
                process.kill()
                durable = b"durable" in process.stdout.read()
        begun += durable
        whole = [p for p in runs.glob("*.journal") if p.stat().st_size]
        assert len(whole) >= begun
    for journal in whole:
        run = read_run(journal)
        assert run.end is None
        assert run.meta.versions == installed_versions()
    assert not [recovered.error for recovered in recover(runs) if recovered.error]
    assert begun >= 2


def test_versions_are_those_of_the_packages():
    found = installed_versions()
    assert {name: found[name] for name in LIBRARIES} == {name: version(name) for name in LIBRARIES}
    assert found["cellwalk"] == version("cellwalk")


def test_versions_by_the_names_of_debian(tmp_path):
    for name in (
        "h5py._debian_h5py_serial-3.7.0.egg-info",
        "pyserial-3.5.egg-info",
        "numpy-1.24.2.dist-info",
    ):
        (tmp_path / name).mkdir()
    found = installed_versions([str(tmp_path / "none"), str(tmp_path)])
    assert {name: found[name] for name in found if name != "python"} == {
        "h5py": "3.7.0",
        "pyserial": "3.5",
        "numpy": "1.24.2",
    }


@pytest.mark.parametrize(
    "change", ['port = "smoke://signal"', 'port = "/dev/null"\ndriver = "sim8000"']
)
def test_a_run_that_can_never_be_leaves_no_journal(tmp_path, change):
    text = (
        f'[run]\ndirectory = "{tmp_path}"\n[modem]\n{change}\n[gnss]\nport = "/dev/no-receiver"\n'
    )
    config, clock = parse_config(text, "site.toml"), Clock()
    writer = begin_run(config, text, clock)
    with pytest.raises(ConfigError):
        Service(config, writer, clock, None)
    assert not list(tmp_path.glob("run-*"))


def test_what_a_receiver_sent_before_its_port_was_opened_is_recorded(tmp_path):
    """The whole service: the feed begins long before the logger does."""
    said = service.nmea_epochs(20)
    master, slave = os.openpty()
    tty.setraw(slave)
    assert os.write(master, said) == len(said) > 2000
    config = service.site_toml(tmp_path, str(tmp_path / "none"), os.ttyname(slave))
    with service.running_service(config) as logger:
        service.wait_for(lambda: service.journal_holds(tmp_path / "runs", said))
        service.stop_service(logger)
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("kept", [None, "", "\0\0\0\0\0\0", "x", "7" * 200])
def test_the_number_of_a_removed_run_is_not_given_again(tmp_path, config, kept):
    """Who fetches runs under their names would replace a walk by a later one."""
    text = config.read_text()
    site, clock = parse_config(text, "site.toml"), Clock()
    for number in (1, 2):
        path = begin_run(site, text, clock).path
        assert path.name == f"run-{number:06d}.journal"
        path.unlink()
    (path.parent / ".last-run").write_text("999999")
    for number in (1_000_000, 1_000_001):
        path = begin_run(site, text, clock).path
        assert path.name == f"run-{number}.journal"
        path.unlink()
    (path.parent / ".last-run").write_text("000002")
    begin_run(site, text, clock, origin="simulated walk block").path.unlink()
    if kept is not None:  # a power cut may leave anything
        (path.parent / ".last-run").write_text(kept)
    expected = 1 if kept is not None else 3
    assert begin_run(site, text, clock).path.name == f"run-{expected:06d}.journal"
