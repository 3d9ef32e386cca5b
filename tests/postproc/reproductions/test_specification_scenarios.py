import numpy as np
import pytest

from logger.core import ekf
from logger.core.places import Places, join_places
from logger.core.types import Note
from postproc.reproductions import specification
from postproc.reproductions import specification_walks as walks
from postproc.reproductions.specification import QUICK
from postproc.reproductions.specification_walks import ORIGIN_M, true_level_dbm


def test_the_live_reference_is_the_filter_itself():
    at = walks.around_block()
    level_dbm = true_level_dbm(walks.STATION, at)
    steps = walks.of_stage(walks.track(at, level_dbm[None]), "reference-ekf")
    x_m, y_m = at.x_m + ORIGIN_M[0], at.y_m + ORIGIN_M[1]
    state = ekf.start(Places.of(x_m[0], y_m[0]))
    for step, *reading in zip(steps, x_m, y_m, level_dbm, strict=True):
        state = ekf.step(state, *reading).state
        assert (step.x_m, step.y_m) == pytest.approx(state[:2], abs=1e-3)
        assert walks.claimed_radius_m(step) == pytest.approx(ekf.drms_m(state.p), rel=1e-3)


def test_a_cell_that_was_not_received_is_not_in_the_scan():
    levels = np.array([[-70.0, np.nan], [-80.0, -60.0]])
    at = Places.of(np.zeros(2), np.zeros(2))
    scans = [record.value for _, record in walks.records(at, levels)][1::2]
    assert [[reading.cid for reading in scan.readings] for scan in scans] == [[1, 2], [2]]


def test_the_mirror_image_is_as_likely_until_the_line_is_left():
    line = Places.of(np.linspace(-200.0, 200.0, 80), np.full(80, 100.0))
    level_dbm = true_level_dbm(walks.STATION, line)
    assert walks.mirror_probability(line, level_dbm) == pytest.approx(0.5, abs=0.02)
    bent = join_places([line, Places.of(np.full(40, 200.0), np.linspace(100.0, -100.0, 40))])
    assert walks.mirror_probability(bent, true_level_dbm(walks.STATION, bent)) < 0.05


def test_stationary_and_target_change_are_as_the_checklist_has_them():
    stationary = walks.stationary()
    assert [check.verdict for check in stationary] == ["holds", "does not hold", "holds"]
    assert [check.verdict for check in walks.target_change()] == ["holds"] * 3


def test_a_target_that_never_changes_fails_the_check(monkeypatch):
    findings_text = walks.track
    monkeypatch.setattr(
        walks,
        "track",
        lambda *walk: [value for value in findings_text(*walk) if not isinstance(value, Note)],
    )
    assert [check.verdict for check in walks.target_change()] == ["fails", "holds", "fails"]


def test_cost_counts_bytes_and_holds():
    assert (
        specification._bytes((1.5, (2.5,)))
        == specification._bytes(1.5) * 2 + specification._bytes(()) * 2 + 3 * 8
    )
    result = specification._cost_checks(QUICK)
    assert result[0].verdict == result[1].verdict == "holds"
