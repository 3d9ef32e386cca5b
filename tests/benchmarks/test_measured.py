"""Measured walks: the whole path, and what is counted."""

import json
from dataclasses import asdict, replace
from math import exp, isnan

import numpy as np
import pytest

from benchmarks.scoreboard import measured_report, strata, tree
from benchmarks.scoreboard.measured import CURVE, LEVELS, read_scores, score_walk
from benchmarks.scoreboard.measured_report import areas_at_equal_coverage, comparison
from benchmarks.scoreboard.strata import coverage, error_ratio, groups, interval
from benchmarks.scoreboard.tables import in_markdown
from benchmarks.scoreboard.traces import observe
from benchmarks.scoreboard.traces import traces as measured_traces
from logger.core.model.prior import REACHES, Prior
from tests.kit.walk_scores import scored_walk

LEUVEN = "kuleuven_lora_p2p"


def test_a_walk_goes_through_import_and_smoother(traces):
    trace = next(one for one in measured_traces() if one.name == "campus_1105_125358_n124")
    obs, source = observe(trace.campaign, trace.name)
    file = (traces / LEUVEN / f"{trace.name}.csv").read_text().splitlines()
    assert len(obs) == len(file) - 1
    column = file[0].split(",").index("rssi_dbm")
    assert obs.level_dbm[0] == float(file[1].split(",")[column])
    away_m = np.hypot(obs.x_m - source[0], obs.y_m - source[1])
    assert np.min(away_m) == pytest.approx(trace.closest_m, rel=0.05)
    assert len(set(np.round(obs.position_sigma_m, 3))) > 1  # the smoother's, not one for all

    variants = {"usual": Prior(), "near": replace(Prior(), reaches=REACHES["near"])}
    usual, near = score_walk(trace, variants)
    assert (usual.variant, near.variant) == ("usual", "near")
    posterior = tree.locate(obs.usable())
    assert usual.error_m == pytest.approx(
        np.hypot(posterior.x_m - source[0], posterior.y_m - source[1])
    )
    assert usual.area_m2[-1] == pytest.approx(posterior.region_area_m2)
    assert usual.is_covered == tree.region(posterior).holds(source, 10.0)
    assert list(usual.area_m2) == sorted(usual.area_m2)
    assert near.area_m2[-1] < usual.area_m2[-1]
    at_truth = tree.density(posterior, *(np.array([v]) for v in source))[0] * 1e6
    assert 0.2 < exp(usual.log_density) / at_truth < 5.0


def test_the_density_integrates_to_one(traces):
    obs, source = observe(LEUVEN, "campus_1105_125358_n124")
    squares = tree.locate(obs.usable()).squares
    posterior = type("Stub", (), {"squares": squares})
    density = tree.density(posterior, squares.x_m, squares.y_m)
    assert np.sum(density * squares.size_m**2) == pytest.approx(1.0)
    far = np.array([source[0] + 1e6])
    assert tree.density(posterior, far, np.array([source[1]])) == 0.0


def test_every_walk_has_a_session(traces):
    sessions = {one.session for one in measured_traces()}
    assert {"covenant_gsm1800", "lyon_bike_lora/velo25nigth", "powder_frs462/0706_1024"} < sessions
    campaigns = {one.campaign for one in measured_traces()}
    assert {name.partition("/")[0] for name in sessions} == campaigns
    assert len(sessions) < len(measured_traces())


def test_groups_take_each_walk_once():
    scores = [scored_walk(closest_m=d) for d in (0.0, 50.0, 199.0, 800.0, 1e4)]
    found = dict(groups(scores))
    assert [len(found[f"closest pass {at} m"]) for at in ("< 50", "50 to 200", "200 to 800")] == [
        1,
        2,
        0,
    ]
    assert [len(found[f"closest pass {at} m"]) for at in ("800 to 1200", "> 1200")] == [1, 1]
    areas = [scored_walk(area_km2=a) for a in (0.001, 0.01, 0.5, 7.0)]
    found = dict(groups(areas))
    bins = ("< 0.01", "0.01 to 0.1", "0.1 to 1", "1 to 10")
    assert [len(found[f"region {at} km2"]) for at in bins] == [1, 1, 1, 1]


def test_a_stratum_counts_what_is_wrong():
    scores = [
        scored_walk(area_km2=0.02, covered=False, verdict="located"),
        scored_walk(area_km2=0.02, verdict="located"),
        scored_walk(area_km2=0.08),
    ]
    whole = strata.strata(scores)[0]
    assert (whole.name, whole.walks, whole.small) == ("all", 3, (2, 1))
    assert whole.verdicts == {"cannot tell": (1, 0), "located": (2, 1)}
    assert whole.coverage.value == pytest.approx(2 / 3)
    assert whole.inner == pytest.approx((0.0, 2 / 3))
    assert whole.ratio.value == pytest.approx(0.5)
    assert whole.area_km2.value == pytest.approx(0.02)


def test_the_interval_draws_sessions():
    one = [scored_walk("day_1") for _ in range(50)]
    other = [scored_walk("day_2", covered=False) for _ in range(50)]
    assert interval([*one, *other], coverage) == (0.0, 1.0)
    assert all(isnan(end) for end in interval(one, coverage))
    many = [scored_walk(f"day_{k}", covered=k % 5 != 0) for k in range(100)]
    low, high = interval(many, coverage)
    assert (low, high) == pytest.approx((0.73, 0.87), abs=0.02)  # 0.8 +- 1.64 x 0.04
    assert interval(many, error_ratio) == pytest.approx((0.5, 0.5))


def test_the_tables_show_the_counts():
    text = in_markdown(
        measured_report.tables([scored_walk(), scored_walk(area_km2=0.02, covered=False)])
    )
    assert "| class A | 2 | 1 | 0.00 | 0.50 | 0.500 | 0.26 |" in text
    assert "| class A | 1, 1 wrong | 0 | 0 | 2, 1 wrong |" in text
    assert "| class A | 2 | 20.0 | 40.0 | 0.50 | 300 |" in text
    assert "| class A | 2 | 1 | 0.000 | 0.500 | 0.500 | 1.00 |" in text
    assert f"{LEVELS[-1]:.0%}" == "95%"


def test_each_transmitter_counts_once():
    scores = [scored_walk(transmitter="one") for _ in range(9)]
    scores.append(scored_walk(transmitter="other", covered=False))
    whole = strata.strata(scores)[0]
    assert whole.coverage.value == pytest.approx(0.9)
    assert whole.transmitters == 2
    assert whole.of_transmitters == pytest.approx((0.0, 0.5, 0.5))


def test_every_walk_has_a_transmitter(traces):
    passed = {(one.campaign, one.transmitter) for one in measured_traces()}
    assert all(transmitter for _, transmitter in passed)
    assert len({campaign for campaign, _ in passed}) < len(passed) < len(measured_traces())


def curved_walk(covered, areas_km2, name):
    """A walk whose region holds the truth from a level on."""
    held = tuple(k >= covered for k in range(len(CURVE)))
    areas_m2 = tuple(1e6 * one for one in areas_km2)
    score = scored_walk(name, curve_held=held, curve_area_m2=areas_m2)
    return replace(score, trace=score.trace._replace(name=name))


def test_areas_are_compared_where_both_hold_as_many():
    areas_km2 = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    walks = [(k % 8, f"walk_{k}") for k in range(40)]
    before = [curved_walk(k, areas_km2, name) for k, name in walks]
    smaller = [curved_walk(k, 0.5 * areas_km2, name) for k, name in walks]
    # one level later, so each coverage costs a larger region
    later = [curved_walk(k + 1, areas_km2, name) for k, name in walks]
    covered, area_km2, other_km2 = areas_at_equal_coverage(before, smaller)
    assert covered == pytest.approx(0.95)
    assert other_km2 == pytest.approx(0.5 * area_km2)
    _, area_km2, other_km2 = areas_at_equal_coverage(before, later)
    assert other_km2 > 1.05 * area_km2


def test_the_comparison_takes_the_same_walks_of_both(tmp_path):
    now = [curved_walk(3, np.arange(1.0, 10.0), f"walk_{k}") for k in range(3)]
    file = tmp_path / "other.json"
    before = [replace(one, log_density=0.5) for one in now[1:]]
    file.write_text(json.dumps([asdict(one) for one in before]))
    assert read_scores(file) == before
    text = in_markdown(comparison(now, read_scores(file), file.name))
    assert "| powder_frs462 | 2 | 0.50 -> 1.00 | +0.50 |" in text
    assert "mean over 1 campaigns: +0.50" in text
