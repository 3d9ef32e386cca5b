"""No estimator passes on what it ended with where it did not converge."""

import json
from dataclasses import replace

import numpy as np
import pytest

from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.cli import main
from postproc.estimators import least_squares
from postproc.estimators.convergence import MOST_ETA, P0_RANGE_DBM, REACH_M, ended_well
from postproc.estimators.filters import FilterPath
from postproc.result import CellResult
from postproc.smoothing import _converged_only

FINE = np.array([10.0, 20.0, -30.0, 3.0])


def few_readings(seed):
    """Five to twelve readings that hardly or not at all determine a place: noise, a ramp, a
    constant, a far source.
    """
    rng = np.random.default_rng(seed)
    n, kind = int(rng.integers(5, 13)), seed % 4
    x, y = (np.cumsum(rng.normal(0.0, 20.0, n)) for _ in range(2))
    if kind == 1:
        y = np.zeros(n)
    distance = np.hypot(x - 50.0, y - 50.0) + 1.0
    level = (
        rng.normal(-80.0, 4.0, n),
        -80.0 - np.arange(n),
        np.full(n, -75.0),
        -60.0 - 30.0 * np.log10(distance) + rng.normal(0.0, 6.0, n),
    )[kind]
    at = np.arange(n)
    return Readings(
        "c",
        "LTE",
        Places.of(x, y, utm=Utm(32), sigma_m=np.zeros(n), t_ns=at * 10**9),
        np.round(level),
        at,
    )


@pytest.mark.parametrize("loss", ["linear", "huber", "cauchy"])
def test_least_squares_converges_to_a_possible_state_or_reports_that_it_did_not(loss):
    n_failed = 0
    for seed in range(80):
        obs = few_readings(seed)
        fit = least_squares.fit(
            obs,
            Places.of(np.mean(obs.x_m) + 30.0, np.mean(obs.y_m)),
            loss=loss,
            height_m=5.0,
        )
        n_failed += not fit.converged
        if fit.converged:
            assert np.all(np.isfinite(fit.covariance))
            assert np.min(np.hypot(fit.state[0] - obs.x_m, fit.state[1] - obs.y_m)) < REACH_M
            assert P0_RANGE_DBM[0] <= fit.state[2] <= P0_RANGE_DBM[1]
            assert 0.0 < fit.state[3] <= MOST_ETA
    assert 10 < n_failed < 80


def test_levels_as_large_as_floats_end_in_no_answer():
    obs = few_readings(0)
    for level in (1e300, -1e300, 1e9):
        wild = obs.level_dbm.copy()
        wild[::2] = level
        fit = least_squares.fit(
            replace(obs, level_dbm=wild),
            Places.of(0.0, 0.0),
        )
        assert not fit.converged


BROKEN = {
    "nan place": (FINE * np.array([np.nan, 1, 1, 1]), np.eye(4)),
    "infinite place": (FINE + np.array([np.inf, 0, 0, 0]), np.eye(4)),
    "another continent": (FINE + np.array([3e6, 0, 0, 0]), np.eye(4)),
    "gigawatts": (FINE + np.array([0, 0, 1e9, 0]), np.eye(4)),
    "no exponent": (FINE * np.array([1, 1, 1, 100]), np.eye(4)),
    "nan covariance": (FINE, np.full((4, 4), np.nan)),
    "infinite covariance": (FINE, np.diag([np.inf, 1, 1, 1])),
    "negative variance": (FINE, np.diag([1.0, -1.0, 1, 1])),
}


@pytest.mark.parametrize("broken", BROKEN)
@pytest.mark.parametrize("name", ["reference", "ekf", "backward", "rts"])
def test_a_filter_that_diverged_is_not_passed_on(name, broken):
    obs = few_readings(0)

    def filter_path(state, covariance):
        none = np.array([np.nan])
        return FilterPath(obs.t_ns[-1:], state[None], covariance[None], none, none)

    broken_one, whole = filter_path(*BROKEN[broken]), filter_path(FINE, np.eye(4))
    every = dict.fromkeys(("reference", "ekf", "backward", "rts"), whole)
    found = _converged_only(CellResult("c", 5, obs, "located", (), **(every | {name: broken_one})))
    assert found.failed == (name,)
    assert [one for one in every if getattr(found, one) is None] == [name]
    assert len(found.warnings) == 1
    assert "did not converge" in found.warnings[0]


def test_the_filter_of_the_specification_may_end_with_a_negative_exponent():
    obs, state = few_readings(0), FINE * np.array([1, 1, 1, -0.2])
    assert ended_well(state, np.eye(4), obs, any_slope=True)
    assert not ended_well(state, np.eye(4), obs)


def test_a_run_with_a_failed_fit_is_printed_and_exported(tmp_path, capsys):
    """Eleven readings whose least squares runs away: no number of it in JSON, table, KML, GeoJSON
    or GPX.
    """
    rows = ["t_s,lat,lon,rssi_dbm,cell"]
    level = (-90, -88, -86, -85, -85, -85, -86, -88, -90, -92, -95)
    rows += [f"{2 * i},52.{5000 + 2 * i},13.4,{dbm},262-01-1-1" for i, dbm in enumerate(level)]
    (tmp_path / "w.csv").write_text("\n".join(rows))
    run = str(tmp_path / "w.h5")
    assert main(["import", str(tmp_path / "w.csv"), "-o", run]) == 0
    capsys.readouterr()
    assert main(["smooth", run, "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert cell["batch"]["converged"] is False
    assert cell["batch"] == dict.fromkeys(cell["batch"]) | {"converged": False, "n": 0}
    assert "least squares did not converge" in cell["warnings"]
    assert not [text for text in cell["warnings"] if "least squares lies" in text]
    assert main(["smooth", run, "-v"]) == 0
    table = capsys.readouterr().out
    (row,) = [line for line in table.splitlines() if line.startswith("least squares")]
    assert row.split() == ["least", "squares", "did", "not", "converge"]
    for suffix in ("kml", "geojson", "gpx"):
        target = tmp_path / f"w.{suffix}"
        assert main(["export", run, "-o", str(target), "--all-estimators"]) == 0
        assert "least squares of 262-01-1-1: it did not converge" in capsys.readouterr().err
        assert "least squares<" not in target.read_text()
        assert '"least squares"' not in target.read_text()
