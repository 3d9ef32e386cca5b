from dataclasses import replace

import numpy as np
import pytest

from logger.core.places import Places
from postproc.result import Options
from postproc.smoothing import estimate_cell, smooth_runs
from tests.kit.sample_results import json_of, write_run
from tests.kit.walks import simulate


def test_processes_give_what_one_gives(tmp_path):
    run = write_run(tmp_path / "a.journal", seconds=60, cells=4)
    alone, shared = (json_of(smooth_runs([run], processes=n)) for n in (1, 2))
    assert shared == alone
    assert len(shared["cells"]) == 4


def test_a_level_set_aside_is_named_and_moves_nothing():
    obs, source = simulate(np.random.default_rng(5), "random", count=400)
    at = int(np.argmax(np.hypot(obs.x_m - source[0], obs.y_m - source[1])))
    level_dbm = obs.level_dbm.copy()
    level_dbm[at] += 30.0
    plain, found = (estimate_cell(one) for one in (obs, replace(obs, level_dbm=level_dbm)))
    assert [spike.scan_seq for spike in found.set_aside] == [at]
    assert plain.set_aside == ()
    where = f"dBm in reading {at + 1} of 400, is"
    assert sum(where in why and "set aside" in why for why in found.warnings) == 1
    assert at in [outlier.scan_seq for outlier in found.residuals.outliers]
    assert found.residuals.excess_kurtosis == pytest.approx(
        plain.residuals.excess_kurtosis, abs=0.3
    )
    assert found.verdict == plain.verdict
    assert np.hypot(*(found.batch.state[:2] - plain.batch.state[:2])) < 20.0  # 550 m with it
    assert found.n == plain.n == 400


def test_repeated_levels_are_counted_in_the_warnings_and_in_nothing_else():
    """The last report of a walk for another 800 m, as of a telephone in a pocket."""
    obs, _ = simulate(np.random.default_rng(5), "random", count=120, step=7.0)
    obs = replace(obs, level_dbm=np.round(obs.level_dbm))
    n, at = len(obs), np.arange(80)
    last_x_m, last_y_m, last_dbm = obs.x_m[-1], obs.y_m[-1], obs.level_dbm[-1]
    places = Places.of(
        np.append(obs.x_m, last_x_m + 11.0 * (1 + at)),
        np.append(obs.y_m, last_y_m + 0.0 * at),
        utm=obs.utm,
        sigma_m=np.append(obs.position_sigma_m, 0.0 * at),
        t_ns=np.append(obs.t_ns, obs.t_ns[-1] + (1 + at) * 10**9),
    )
    longer = replace(
        obs,
        places=places,
        level_dbm=np.append(obs.level_dbm, last_dbm + 0.0 * at),
        scan_seq=np.append(obs.scan_seq, n + at),
        known_limit=None,
    )
    plain, found = (estimate_cell(one) for one in (obs, longer))
    assert "80 of 200 readings repeat the one before" in " / ".join(found.warnings)
    assert "repeat the one before" not in " / ".join(plain.warnings)
    assert found.n == 200
    assert (found.posterior.x_m, found.posterior.r95_m) == pytest.approx(
        (plain.posterior.x_m, plain.posterior.r95_m)
    )
    assert found.residuals.independent == pytest.approx(plain.residuals.independent)


@pytest.mark.parametrize(("noise_db", "rise_db"), [(0.3, 10), (1.0, 20), (3.0, 5), (3.0, 10)])
def test_levels_that_rise_with_the_distance_are_never_located(noise_db, rise_db):
    """However large the radius that would do; `rise_db` for ten times the distance.

    Least squares asks for an exponent below zero, or runs away.
    """
    rng = np.random.default_rng(3)
    obs, _ = simulate(rng, "square", count=300, step=2.8)
    away_m = np.hypot(obs.x_m - 60.0, obs.y_m - 100.0)
    level_dbm = -110.0 + rise_db * np.log10(away_m) + rng.normal(0.0, noise_db, len(obs))
    found = estimate_cell(replace(obs, level_dbm=level_dbm), Options(within_m=1e6))
    assert found.verdict == "cannot tell"
    assert any("path loss exponent of" in why for why in found.warnings)
