import json

import numpy as np
import pytest

from benchmarks.scoreboard import report, targets
from benchmarks.scoreboard.cases import CASES, SPECIFIED_READINGS
from benchmarks.scoreboard.claims import claims
from benchmarks.scoreboard.run import jobs_of
from benchmarks.scoreboard.score import BOUND, EXACT, LEAST_SQUARES, OURS, Score
from benchmarks.scoreboard.summary import VerdictCount, rows_of, verdicts_of
from benchmarks.scoreboard.walks import TELLING
from tests.kit.walk_scores import scored_walk


def scores_of(method, errors_m, *, area_m2=100.0, missed=0, nees=2.0, **about):
    return [
        Score(method, run, e, run >= missed, area_m2, nees, **about)
        for run, e in enumerate(errors_m)
    ]


GOOD = {
    OURS: scores_of(OURS, np.full(100, 10.0), missed=5, verdict="located"),
    EXACT: scores_of(EXACT, np.full(100, 9.6), area_m2=80.0),
    LEAST_SQUARES: scores_of(LEAST_SQUARES, np.full(100, 12.0)),
}


def test_every_target_belongs_to_a_case():
    assert {case for target in targets.TARGETS for case in target.cases} <= set(CASES)


def test_reached():
    found = targets.assess({f"white-{shape}": GOOD for shape in TELLING})
    error, area, coverage, anees = found[:4]
    assert [one.value for one in found[:4]] == pytest.approx([10.0 / 9.6, 1.25, 0.95, 1.0])
    assert [one.limit for one in found[:4]] == pytest.approx([1.0] * 4)
    assert all(one.is_reached for one in found)
    assert (error.runs, area.runs, coverage.runs) == (400, 400, 100)
    assert coverage.interval == pytest.approx((0.888, 0.978), abs=1e-3)  # Wilson, 95 of 100
    assert anees.walks == "white-L"


def test_not_reached():
    bad = GOOD | {OURS: scores_of(OURS, np.full(100, 20.0), missed=30, nees=8.0)}
    found = {f"white-{shape}": bad for shape in TELLING}
    assert [one.is_reached for one in targets.assess(found)[:4]] == [False, True, False, False]


def test_measured_walks_are_assessed_by_group():
    found = {
        (one.walks, one.what): one
        for one in targets.assess_measured(
            [
                scored_walk(area_km2=0.02),
                scored_walk(area_km2=0.02, covered=False, geometry="D"),
                scored_walk("day_2", area_km2=5.0, error_m=60.0),
            ]
        )
    }
    assert found["measured, all", "coverage"].value == pytest.approx(2 / 3)
    assert found["measured, all", "coverage"].interval == (0.5, 1.0)
    assert not found["measured, class D", "coverage"].is_reached
    assert found["measured, small region", "share of wrong regions"].value == 0.5
    assert found["measured, class A", "median error / strongest reading's"].is_reached
    assert found["measured, region 1 to 10 km2", "coverage"].is_reached
    assert ("measured, region 0.1 to 1 km2", "coverage") not in found


def test_left_out_methods_leave_out_their_targets():
    assert len(targets.assess({"white-L": {OURS: GOOD[OURS]}})) == 2
    assert not targets.assess({"white-L": {EXACT: GOOD[EXACT]}})


def test_a_failure_counts_as_infinitely_far():
    scores = [*scores_of(OURS, [1.0, 2.0]), Score(OURS, 2, np.inf, False, failure="diverged")]
    (row,) = rows_of({OURS: scores})
    assert (row.runs, row.failures, row.median_error_m, row.p90_error_m) == (3, 1, 2.0, np.inf)
    assert row.coverage == pytest.approx(2 / 3)


def test_area_ratio_is_taken_run_by_run():
    ours = [
        Score(OURS, k, 1.0, True, area_m2, 2.0) for k, area_m2 in enumerate((10.0, 400.0, 90.0))
    ]
    limit = [
        Score(EXACT, k, 1.0, True, area_m2, 2.0) for k, area_m2 in enumerate((10.0, 100.0, 30.0))
    ]
    assert rows_of({OURS: ours, EXACT: limit})[0].area_ratio == pytest.approx(3.0)


def test_anees_of_one_place_leaves_out_the_others():
    scores = [
        Score(OURS, 0, 1.0, True, 10.0, nees=2.0, places=1),
        Score(OURS, 1, 90.0, True, 10.0, nees=98.0, places=2),
    ]
    (row,) = rows_of({OURS: scores})
    assert (row.half_anees, row.half_anees_of_one_place) == (25.0, 1.0)


def test_verdicts_are_counted_with_what_they_missed():
    assert verdicts_of(GOOD[OURS]) == [VerdictCount("located", 100, (0, 1, 2, 3, 4))]


def test_a_claim_beyond_the_bound():
    found = {
        f"spec-{count}-begun": {OURS: scores_of(OURS, [70.0]), BOUND: [Score(BOUND, 0, 120.0)]}
        for count in SPECIFIED_READINGS
    }
    assert [claim.is_within_bound for claim in claims(found)] == [True, False, False]


def test_report_bears_what_is_infinite():
    failed = {
        OURS: [Score(OURS, 0, np.inf, False, failure="diverged")],
        EXACT: scores_of(EXACT, [1.0]),
    }
    board = report.board({"white-L": failed}, [], seed=1)
    (case,) = json.loads(report.as_json(board))["cases"]
    assert case["methods"][0]["median_error_m"] is None
    assert "| cellwalk | inf |" in report.markdown(board)


def test_jobs():
    jobs = jobs_of(["white-L", "real-B"], seed=1, runs=10_000, methods=[OURS, BOUND])
    assert sum(job.case == "white-L" for job in jobs) == 10_000
    assert sum(job.case == "real-B" for job in jobs) == CASES["real-B"].most
    assert jobs[0].methods == (OURS, BOUND)
    assert len(jobs_of(["white-L", "clip-45"], seed=1, runs=None, methods=None)) == 160
