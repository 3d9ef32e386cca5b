"""`fieldlogger simulate` with another modem, and with one that misbehaves."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from logger.cli import main
from logger.core.errors import ConfigError
from logger.core.runfile import read_run
from logger.sim.dialects import DIALECTS
from logger.sim.faults import FAULTS
from logger.sim.scenario import CITIES, SCENARIOS
from logger.simulate import simulate


def test_another_modem_that_misbehaves(tmp_path, capsys):
    # the modem's deadlines are real seconds, of which a simulated hour has the fewer the faster it
    # goes
    command = ["simulate", "--out", str(tmp_path), "--speed", "20", "--modem", "sim7600"]
    for lasts_s in (240, 2400):  # the second for a machine that is ten times as slow
        fault = f"garbage:{lasts_s / 20}:{lasts_s / 3}"
        assert main([*command, "--duration", str(lasts_s), "--fault", fault]) == 0
        run = read_run(capsys.readouterr().out.strip())
        notes = {row["code"].decode(): row["text"].decode() for row in run.tables["notes"]}
        after = run.tables["readings"]["t_ns"] > lasts_s / 3 * 1e9
        if "garbage" in notes and np.any(after):
            break
    assert notes["modem-identified"].endswith("driver sim7600")
    assert "garbage" in notes
    assert np.any(after)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (["--modem", "ec25"], "no simulated modem is called 'ec25'; known are: sim800, sim7600"),
        (["--fault", "flood:1:2"], "no fault is called 'flood'"),
        (["--fault", "hang"], "NAME:FROM:TO"),
        (["--fault", "hang:1:later"], "NAME:FROM:TO"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, capsys, wrong, says):
    assert main(["simulate", "--out", str(tmp_path), *wrong]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_the_help_lists_every_name_in_one_piece(capsys):
    assert main(["simulate", "--help"]) == 0
    words = capsys.readouterr().out.replace(",", " ").replace(". ", " ").replace(".\n", " ").split()
    assert {*SCENARIOS, *CITIES, *DIALECTS, *FAULTS} <= set(words)


def test_a_fault_without_times_names_the_faults(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path), "--fault", "storm"]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in FAULTS)


def test_the_page_of_a_walk_that_is_led_is_served_until_the_signal(tmp_path):
    command = [sys.executable, "-m", "logger.cli", "simulate", "--out", str(tmp_path)]
    options = "--scenario city-rogue --city brno --page --follow --speed 20 --duration 60"
    with subprocess.Popen(
        [*command, *options.split()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        address = next(line.split()[-1] for line in process.stderr if line.startswith("the page"))
        with urllib.request.urlopen(address + "live") as news:
            texts = (json.loads(line[5:]) for line in news if line.startswith(b"data:"))
            assert (
                next(text for text in texts if text["status"] is not None)["status"]["fixes"] >= 0
            )
            kept = next(text["kept"] for text in texts if text["kept"] is not None)
        end_s = time.monotonic() + 15.0
        while (ptys := _open_ptys(process.pid)) and time.monotonic() < end_s:
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        path = process.stdout.read().strip()
        assert process.wait(60) == 0
    assert ptys == []  # a receiver that talks on takes a processor until the Ctrl-C
    run = read_run(path)
    assert len(run.tables["readings"]) == kept
    assert run.meta.live.target == "suspicious"


def _open_ptys(pid):
    links = []
    for path in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            links.append(os.readlink(path))
    return [link for link in links if "ptmx" in link]


def test_an_unknown_city_is_one_line(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path), "--city", "paris"]) == 2
    assert "known are: graz, leipzig, brno" in capsys.readouterr().err


def test_a_page_that_ends_at_once_has_said_why_itself(tmp_path, capfd):
    page = [sys.executable, "-c", "raise SystemExit('tornado is missing')"]
    with pytest.raises(ConfigError) as error:
        simulate(tmp_path, "block", 1, 5.0, 20.0, page_command=page)
    assert str(error.value) == "the walk has not begun, as its page has ended"
    assert capfd.readouterr().err == "tornado is missing\n"
    assert not list(tmp_path.iterdir())
