"""Scans of the simulated city say what a modem's scans say, and missing readings are true."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scoreboard.city import FLOOR_DBM, NEIGHBOURS, NOISES, SCANS, city, outages, report

COMMAND = Path(__file__).resolve().parents[2] / "benchmarks" / "missing.py"


@pytest.mark.parametrize("from_lists", [False, True])
def test_a_scan_has_the_serving_cell_and_the_strongest_neighbours(from_lists):
    made = city(np.random.default_rng(1), "6 dB / 15 m")
    is_there, limit_dbm = report(made, from_lists=from_lists)
    assert np.all(is_there[made.serving, np.arange(SCANS)])
    count = np.sum(is_there, axis=0)
    assert count.max() == NEIGHBOURS + 1
    is_full = count == NEIGHBOURS + 1
    assert np.all(limit_dbm[~is_full] == FLOOR_DBM)
    above = ~is_there & (made.level_dbm > np.maximum(limit_dbm, FLOOR_DBM))
    assert np.any(above) == from_lists  # a cell that is on no list is missing though it is strong


@pytest.mark.parametrize("noise", NOISES)
def test_readings_alone_are_higher_than_the_levels_around_them(noise):
    made = city(np.random.default_rng(2), noise)
    is_there, _ = report(made)
    comes_and_goes = np.abs(np.mean(is_there, axis=1) - 0.4) < 0.3
    assert np.any(comes_and_goes)
    for level_dbm, at in zip(made.level_dbm[comes_and_goes], is_there[comes_and_goes], strict=True):
        assert np.mean(level_dbm[at]) > np.mean(level_dbm) + 1.0


def test_outages_have_their_share_and_come_in_stretches():
    rng = np.random.default_rng(3)
    out = np.stack([outages(rng, 0.1) for _ in range(200)])
    assert np.mean(out) == pytest.approx(0.1, abs=0.02)
    begins = np.sum(out[:, 1:] & ~out[:, :-1])
    assert np.sum(out[:, 1:]) / begins == pytest.approx(30.0, rel=0.2)
    assert not np.any(outages(rng, 0.0))


@pytest.mark.parametrize("where", [(), ("--live",)], ids=["desk", "live"])
def test_the_command_compares_the_ways(tmp_path, where):
    file = tmp_path / "found.json"
    asked = ["--runs", "1", "--noise", "white 3 dB", "--loss", "none", "--json", file, *where]
    ran = subprocess.run(
        [sys.executable, COMMAND, *asked], capture_output=True, text=True, check=True
    )
    (one,) = json.loads(file.read_text())["white 3 dB, loss none"]
    assert list(one) == ["readings", "regular", "every", "careful"]
    n_different = 3 if where else 4  # the device takes every reading
    assert len({estimate["area_m2"] for estimate in one.values()}) == n_different
    assert all(estimate["error_m"] < 1000.0 for estimate in one.values())
    assert "white 3 dB, loss none: 1 walks" in ran.stdout
    assert ran.stderr == ""
