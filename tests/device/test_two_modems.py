"""Two modems at once, on real ptys: a SIM7600 and a SIM800 on one walk, 9 dB apart."""

import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from logger.config import parse_config
from logger.core.runfile import read_run
from logger.device.clock import ScaledClock
from logger.device.leds import flashes_of
from logger.device.memory import MEMORY_MB
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.dialects import DIALECTS
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import APART_DB, scenario
from logger.sim.walk import WalkTime
from tests.kit import service

SPEED = 10.0
AWAY_S = 90.0
"""Longer than the time without a scan after which a modem has failed."""


def _site(folder, first, second, gnss, drivers=("auto", "auto")):
    text = (
        f'[run]\ndirectory = "{folder / "runs"}"\n'
        f'[modem]\nport = "{first}"\nname = "sim7600"\n'
        f'driver = "{drivers[0]}"\n'
        f'[gnss]\nport = "{gnss}"\n'
        f'[[source]]\nkind = "modem"\nname = "sim800"\nport = "{second}"\n'
        f'driver = "{drivers[1]}"\n'
        f"[live]\nmax_fix_age_s = {3.0 + 0.2 * SPEED}\n"
    )
    return parse_config(text, "site.toml"), text


@pytest.fixture(scope="module")
def two_modems(tmp_path_factory):
    """A run in which the SIM800 is away for a while; the status meanwhile and at the end."""
    folder = tmp_path_factory.mktemp("two")
    clock = ScaledClock(SPEED)
    walk, time = scenario("block", 3), WalkTime(clock)
    names = {"sim7600": folder / "a", "sim800": folder / "b"}
    with ExitStack() as stack:
        ports = {
            name: stack.enter_context(
                PtyDevice(answering(walk.modem(time.now_s, DIALECTS[name], number)), path)
            )
            for number, (name, path) in enumerate(names.items())
        }
        gnss = stack.enter_context(PtyDevice(talking(walk.receiver(cold_start_s=0.0), time)))
        config, text = _site(folder, *names.values(), gnss.path)
        ended = threading.Event()
        under_way = Service(config, begin_run(config, text, clock), clock, ended)
        under_way.start()
        try:
            service.wait_for(lambda: under_way.recorder.counts["sim800"] > 60)
            away_s = clock.now_ns() / 1e9
            ports["sim800"].unplug()
            clock.wait(ended, AWAY_S)
            status = under_way.snapshot()
            ports["sim800"].plug()
            service.wait_for(lambda: not under_way.snapshot().ports["sim800"].fault)
            back = under_way.snapshot()
            back_s = clock.now_ns() / 1e9
            clock.wait(ended, 20.0)
        finally:
            run = read_run(under_way.stop("end"))
    return run, status, back, (away_s, back_s)


def _scan_times_s(run, name):
    scans = run.tables["scans"]
    return scans["t_ns"][scans["source"] == name] / 1e9


def test_one_unplugged_leaves_no_gap_in_the_other(two_modems):
    run, _, _, (away_s, back_s) = two_modems
    others, own = _scan_times_s(run, b"sim7600"), _scan_times_s(run, b"sim800")
    assert not np.any((own > away_s + SPEED) & (own < back_s - SPEED))
    assert np.any(own > back_s)
    during = others[(others > away_s - 10.0) & (others < back_s + 10.0)]
    assert np.max(np.diff(during)) < 10.0, "a poll each 2 s, at most five late on a busy machine"


def test_the_status_and_the_light_say_which_has_a_fault(two_modems):
    _, status, back, _ = two_modems
    assert status.state == "error"
    assert status.text.startswith("sim800: port ")
    assert "sim7600" not in status.text
    assert [name for name, port in status.ports.items() if port.fault] == ["sim800"]
    assert flashes_of(status).count(0.5) == 3, "the third source in site.toml"
    assert not any(port.fault for port in back.ports.values())
    assert back.state != "error"


def test_records_name_their_modem(two_modems):
    run = two_modems[0]
    readings = run.tables["readings"]
    assert set(readings["source"]) == {b"sim7600", b"sim800"}
    ready = [row for row in run.tables["notes"] if row["code"] == b"modem-ready"]
    drivers = {row["source"]: row["text"].split()[-1] for row in ready}
    assert drivers == {b"sim7600": b"sim7600", b"sim800": b"sim800"}
    assert _apart_db(run) == pytest.approx(APART_DB, abs=4.0)


def _apart_db(run, from_ns=0):
    mean_dbm = {
        name: np.mean(
            [
                record.value.readings[0].level_dbm
                for _, record in run.records("scans")
                if record.source == name and record.value.readings and record.t_ns > from_ns
            ]
        )
        for name in ("sim7600", "sim800")
    }
    return mean_dbm["sim7600"] - mean_dbm["sim800"]


@pytest.mark.parametrize("drivers", [("auto", "auto"), ("sim7600", "sim800")])
def test_modems_that_come_back_exchanged_keep_their_names(tmp_path, drivers):
    clock = ScaledClock(SPEED)
    walk, time = scenario("block", 3), WalkTime(clock)
    with ExitStack() as stack:
        ports = [
            stack.enter_context(
                PtyDevice(answering(walk.modem(time.now_s, DIALECTS[name], k)), tmp_path / name)
            )
            for k, name in enumerate(("sim7600", "sim800"))
        ]
        gnss = stack.enter_context(PtyDevice(talking(walk.receiver(cold_start_s=0.0), time)))
        config, text = _site(tmp_path, *(port.path for port in ports), gnss.path, drivers)
        under_way = Service(config, begin_run(config, text, clock), clock, threading.Event())
        under_way.start()
        try:
            counts = under_way.recorder.counts
            service.wait_for(lambda: counts["sim800"] > 60 and counts["sim7600"] > 60)
            for port in ports:
                port.unplug()
            back_ns = clock.now_ns()
            for port, path in zip(ports, reversed([port.path for port in ports]), strict=True):
                port.plug(Path(path))
            least = {name: counts[name] + 60 for name in ("sim7600", "sim800")}
            texts = set()
            service.wait_for(
                lambda: (
                    texts.add(under_way.snapshot().text)
                    or all(counts[name] > n for name, n in least.items())
                )
            )
            status = under_way.snapshot()
        finally:
            run = read_run(under_way.stop("end"))
    assert status.state != "error"
    assert not any(fault.strip().endswith(":") for text in texts for fault in text.split(";"))
    assert [Path(status.ports[name].url).name for name in least] == ["sim800", "sim7600"]
    assert _apart_db(run, back_ns) == pytest.approx(APART_DB, abs=4.0)


def _peak_mb(folder, *modems):
    """Most memory of a process that simulates a city, records it and estimates its cells."""
    names = [option for name in modems for option in ("--modem", name)]
    command = [*service.FIELDLOGGER, "simulate", "--out", str(folder), "--scenario", "city-clean"]
    script = (
        "import os, sys; from logger.cli import main; from logger.device.memory import give_back; "
        "give_back(); code = main(sys.argv[1:]); "
        "peak = next(l for l in open('/proc/self/status') if l.startswith('VmHWM')); "
        "print(int(peak.split()[1]) // 1024); os._exit(code)"
    )
    arguments = [*command[3:], "--duration", "120", "--speed", "20", *names]
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], check=True, capture_output=True, text=True
    )
    return int(done.stdout.split()[-1])


def test_two_modems_fit_into_the_memory_of_the_unit(tmp_path):
    """The simulated city and its devices are in the same process: the service takes less."""
    one, two = _peak_mb(tmp_path, "sim800"), _peak_mb(tmp_path, "sim7600", "sim800")
    print(f"one modem {one} MB, two modems {two} MB, MemoryMax= {MEMORY_MB} MB")
    assert two < MEMORY_MB
    assert two < one + 40
