from dataclasses import replace

import numpy as np
import pytest

from logger.core.locator.pipeline import locate
from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.estimators import least_squares, residuals
from postproc.estimators.filters import FilterPath
from postproc.estimators.least_squares_rows import each_reading
from postproc.estimators.metrics import consistency
from postproc.estimators.residuals import diagnose, findings
from tests.kit.walks import observations, with_places

SOURCE = np.array([130.0, 150.0, -30.0, 3.0])


def walk(rng, *, white_db=3.0, shadow_db=0.0, d_c=15.0, count=500):
    """Round a square of 250 m past a source inside; readings 2 m apart, of honest log-distance
    levels.
    """
    s = 2.0 * np.arange(count)
    corner = 250.0 * np.arange(5)
    x, y = (
        np.interp(s, corner, 250.0 * np.array(turn)) for turn in ([0, 1, 1, 0, 0], [0, 0, 1, 1, 0])
    )
    shadow = rng.normal(size=count)
    rho = np.exp(-2.0 / d_c)
    for k in range(1, count):
        shadow[k] = rho * shadow[k - 1] + np.sqrt(1.0 - rho**2) * shadow[k]
    level = SOURCE[2] - 10.0 * SOURCE[3] * np.log10(np.hypot(x - SOURCE[0], y - SOURCE[1]))
    at = np.arange(count)
    level = level + white_db * rng.normal(size=count) + shadow_db * shadow
    return Readings(
        "c",
        None,
        Places.of(x, y, utm=Utm(32), sigma_m=np.zeros(count), t_ns=at * 10**9),
        level,
        at + 1000,
    )


def around(obs):
    """Distance and azimuth in radians from the source."""
    dx, dy = obs.x_m - SOURCE[0], obs.y_m - SOURCE[1]
    return np.hypot(dx, dy), np.arctan2(dx, dy)


def fit_state(obs):
    return least_squares.fit(obs, Places.of(*SOURCE[:2])).state


def test_residuals_are_level_minus_model_and_what_a_limit_hides_is_none():
    obs = walk(np.random.default_rng(1))
    level = obs.level_dbm.copy()
    level[:9] = -110.0
    obs = replace(obs, level_dbm=level, rat="GSM")
    result = diagnose(SOURCE, obs)
    expected = obs.level_dbm - (SOURCE[2] - 10.0 * SOURCE[3] * np.log10(around(obs)[0]))
    assert np.all(np.isnan(result.residual_db[:9]))
    np.testing.assert_allclose(result.residual_db[9:], expected[9:])
    assert result.sigma_db == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize(("white_db", "shadow_db"), [(3.0, 0.0), (0.5, 6.0), (3.0, 6.0)])
def test_worlds_of_the_model_raise_no_alarm(white_db, shadow_db):
    rng = np.random.default_rng(2)
    alarms = {"levels": 0, "sector": 0, "outlying": 0, "correlated": 0}
    for _ in range(12):
        obs = walk(rng, white_db=white_db, shadow_db=shadow_db)
        findings_text = " ".join(findings(diagnose(fit_state(obs), obs)))
        alarms = {word: count + (word in findings_text) for word, count in alarms.items()}
    assert alarms["correlated"] == (12 if shadow_db else 0)
    assert max(alarms["levels"], alarms["sector"], alarms["outlying"]) <= 2


def test_numbers_describe_white_noise():
    result = diagnose(SOURCE, walk(np.random.default_rng(3)))
    assert abs(result.skewness) < 0.35
    assert abs(result.excess_kurtosis) < 0.7
    assert result.beyond_3_sigma < 0.012
    assert abs(result.lag1) < 0.1
    assert result.correlated < 0.1
    assert result.decorrelation_m < 2.0
    assert result.independent > 250


def test_decorrelation_distance_is_estimated_along_the_walk():
    lengths, independent = [], []
    for seed in range(8):
        result = diagnose(
            SOURCE, walk(np.random.default_rng(seed), white_db=0.0, shadow_db=6.0, d_c=20.0)
        )
        lengths.append(result.decorrelation_m)
        independent.append(result.independent)
    assert np.median(lengths) == pytest.approx(20.0, rel=0.4)
    assert np.median(independent) == pytest.approx(1000.0 / 40.0, rel=0.4)


def test_standard_errors_of_bins_are_true():
    rng = np.random.default_rng(4)
    for white_db, shadow_db, limits in ((3.0, 0.0, (0.6, 1.4)), (0.5, 5.0, (0.2, 1.2))):
        chi2 = []
        for _ in range(6):
            obs = walk(rng, white_db=white_db, shadow_db=shadow_db)
            result = diagnose(fit_state(obs), obs)
            chi2 += [
                np.mean((bins.mean_db / bins.sigma_db) ** 2)
                for bins in (result.by_distance, result.by_azimuth)
            ]
            assert result.by_azimuth.readings.sum() == len(obs)
        assert limits[0] < np.mean(chi2) < limits[1]


def test_bins_hold_their_means():
    obs = walk(np.random.default_rng(5))
    result = diagnose(SOURCE, obs)
    azimuth = np.degrees(around(obs)[1]) % 360.0
    for centre, mean, readings in zip(*(result.by_azimuth[i] for i in (0, 1, 3)), strict=True):
        inside = (azimuth >= centre - 15.0) & (azimuth < centre + 15.0)
        assert np.count_nonzero(inside) == readings
        assert np.mean(result.residual_db[inside]) == pytest.approx(mean)


@pytest.mark.parametrize(("change", "word"), [(2.5, "faster"), (-2.0, "more slowly")])
def test_an_exponent_that_changes_is_named(change, word):
    obs = walk(np.random.default_rng(6), white_db=1.5)
    distance, _ = around(obs)
    bent = replace(
        obs, level_dbm=obs.level_dbm - 10.0 * change * np.maximum(np.log10(distance / 130.0), 0.0)
    )
    result = diagnose(fit_state(bent), bent)
    assert result.exponent_change.eta_change == pytest.approx(
        change, abs=4.0 * result.exponent_change.eta_sigma
    )
    assert any(f"levels fall {word} beyond" in text for text in findings(result))


def test_a_sector_antenna_is_named():
    azimuths_deg, z = [], []
    for seed in range(6):
        obs = walk(np.random.default_rng(seed), white_db=1.5)
        pattern_db = 4.5 * np.cos(around(obs)[1] - np.radians(120.0))
        result = diagnose(SOURCE, replace(obs, level_dbm=obs.level_dbm + pattern_db))
        assert any(text.startswith("sector antenna suspected") for text in findings(result))
        azimuths_deg.append(result.sector.azimuth_deg)
        z.append((result.sector.difference_db - 9.0) / result.sector.difference_sigma_db)
    assert np.mean(azimuths_deg) == pytest.approx(120.0, abs=12.0)
    assert np.max(np.abs(z)) < 3.0


def test_an_azimuth_that_hardly_changes_gives_no_sector():
    """All readings in one direction: what a sector does, power and exponent do as well."""
    obs = walk(np.random.default_rng(8), count=60)
    state = np.array([100_000.0, 0.0, -30.0, 3.0])
    result = diagnose(state, obs)
    assert result.sector is None or result.sector.difference_sigma_db > 20.0
    assert not any("sector" in text for text in findings(result))


def test_a_difference_that_no_antenna_has_is_no_sector():
    result = diagnose(SOURCE, walk(np.random.default_rng(8), white_db=1.5))
    for difference_db, is_named in ((12.0, True), (1175.0, False)):
        named = replace(
            result, sector=residuals.Sector(331.0, difference_db, 0.1 * difference_db, 80.0)
        )
        assert any("sector" in text for text in findings(named)) is is_named


def test_outliers_are_named_by_reading_and_size():
    obs = walk(np.random.default_rng(9))
    level = obs.level_dbm.copy()
    level[[40, 300]] += [-30.0, 22.0]
    result = diagnose(SOURCE, replace(obs, level_dbm=level))
    assert [one.scan_seq for one in result.outliers] == [1040, 1300]
    assert result.outliers[0].t_ns == 40 * 10**9
    assert result.outliers[0].residual_db == pytest.approx(-30.0, abs=9.0)
    assert result.outliers[0].sigmas == pytest.approx(
        abs(result.outliers[0].residual_db) / result.sigma_db
    )
    (text,) = (text for text in findings(result) if "outlying" in text)
    assert "2 outlying readings" in text
    assert f"the worst, reading 41 of {len(obs)}, is" in text
    assert "weaker" in text


def test_an_overconfident_filter_is_named_and_a_consistent_one_is_not():
    rng = np.random.default_rng(10)
    obs = walk(rng)
    findings_text = {}
    for name, claimed in (("honest", 9.0), ("sure", 5.0), ("humble", 20.0)):
        states = np.zeros((500, 4)), np.zeros((500, 4, 4))
        innovations = FilterPath(
            obs.t_ns, *states, rng.normal(0.0, 3.0, 500), np.full(500, claimed)
        )
        result = diagnose(SOURCE, obs, innovations)
        assert result.innovations == consistency(
            innovations.innovation_db, innovations.innovation_var_db2
        )
        findings_text[name] = [text for text in findings(result) if "filter" in text]
    (text,) = findings_text["sure"]
    assert text.startswith("the filter is overconfident: its squared innovations are 1.")
    assert findings_text["honest"] == findings_text["humble"] == []


@pytest.mark.parametrize("count", [1, 5, 19])
def test_few_readings_are_listed_without_statistics(count):
    result = diagnose(SOURCE, walk(np.random.default_rng(11), count=count))
    assert len(result.residual_db) == count
    assert findings(result) == []
    assert result.exponent_change is result.sector is result.by_distance is None


def test_standing_still_is_survived():
    obs = walk(np.random.default_rng(12), count=50)
    result = diagnose(SOURCE, with_places(obs, x_m=np.zeros(50), y_m=np.zeros(50)))
    assert result.exponent_change is result.sector is None
    assert result.independent == 1.0


# --- trends against the dense solution ---


def test_a_trend_is_the_generalised_least_squares_one():
    obs = walk(np.random.default_rng(13), white_db=2.0, shadow_db=3.0)
    design = each_reading(obs, 0.0).jacobian(SOURCE)
    distance, azimuth = around(obs)
    ground = residuals.Ground(obs.places, obs.level_dbm, 10.0 * np.log10(distance), azimuth, design)
    noise = residuals.noise_of(ground, np.sin(azimuth), np.cos(azimuth))
    which = [np.flatnonzero(noise.square == k) for k in range(noise.square.max() + 1)]
    rows = np.column_stack([design, np.sin(azimuth), np.cos(azimuth), obs.level_dbm])
    mean = np.array([np.mean(rows[k], axis=0) for k in which])
    precision = np.linalg.inv(noise.covariance_db2)
    information = mean[:, :6].T @ precision @ mean[:, :6]
    coefficient = np.linalg.solve(information, mean[:, :6].T @ precision @ mean[:, 6])[4:]
    covariance = np.linalg.inv(information)[4:, 4:]
    sector = residuals.sector(ground)
    assert sector.difference_db == pytest.approx(2.0 * np.hypot(*coefficient), rel=1e-6)
    assert sector.azimuth_deg == pytest.approx(
        np.degrees(np.arctan2(*coefficient)) % 360.0, abs=1e-4
    )
    assert sector.chi2 == pytest.approx(
        coefficient @ np.linalg.solve(covariance, coefficient), rel=1e-6
    )


def test_the_curve_at_the_place_shown_goes_through_the_levels():
    """Beside a street the place is unsure, and the mean of P0 and eta is that of all places."""
    rng = np.random.default_rng(5)
    x_m = np.arange(0.0, 400.0, 2.0)
    level_dbm = -25.0 - 30.0 * np.log10(np.hypot(x_m - 150.0, 80.0)) + rng.normal(0.0, 5.0, 200)
    obs = observations(x_m, np.zeros(200), np.round(level_dbm), 4.0)
    posterior = locate(obs)
    mean_db, at_place_db = (
        float(np.mean(each_reading(obs, posterior.prior.height_m).residuals(state)))
        for state in (posterior.modes[0].state, residuals.state_at_place(posterior, obs))
    )
    assert abs(at_place_db) < 0.1
    assert abs(mean_db) > 1.0
