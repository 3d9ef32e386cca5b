import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.cli import main
from postproc.reproductions.toa import setting, simulate

SEEDS = range(5)
REFERENCE = {
    0.01: ((0.1041, 0.0002), (0.0914, 0.0001)),
    0.1: ((0.3291, 0.0007), (0.2889, 0.0005)),
    1.0: ((1.042, 0.002), (0.910, 0.0015)),
    10.0: ((3.338, 0.008), (2.786, 0.0065)),
    100.0: ((12.26, 0.04), (8.30, 0.025)),
}


@pytest.fixture(scope="module")
def five_seeds():
    return [list(simulate(setting(seed=seed))) for seed in SEEDS]


def test_the_reference_averages_are_met_within_three_standard_deviations(five_seeds):
    for number, (sigma2, (lse, kf)) in enumerate(REFERENCE.items()):
        rows = [result[number] for result in five_seeds]
        assert {row.sigma2_m2 for row in rows} == {sigma2}
        assert np.mean([row.lse_m for row in rows]) == pytest.approx(lse[0], abs=3.0 * lse[1])
        assert np.mean([row.kf_m for row in rows]) == pytest.approx(kf[0], abs=3.0 * kf[1])


def test_pseudo_inverse_and_rows_agree_in_every_row(five_seeds):
    assert max(row.pinv_difference_m for rows in five_seeds for row in rows) < 1e-9


def test_the_filter_of_full_rank_is_consistent_where_the_noise_is_small(five_seeds):
    for row in five_seeds[0][:2]:
        assert row.squares_nees == pytest.approx(1.0, abs=0.02)
        assert np.mean(row.squares_m) < np.mean(row.kf_m) < np.mean(row.lse_m)


def test_nothing_depends_on_where_the_origin_is():
    here = setting(sigma2_m2=[0.3], runs=50)
    there = replace(
        here,
        anchors=type(here.anchors)(here.anchors.position_m + np.array([4e5, 5.7e6])),
        path_m=here.path_m + np.array([4e5, 5.7e6]),
    )
    (a,), (b,) = simulate(here), simulate(there)
    assert b.kf_m == pytest.approx(a.kf_m, abs=1e-5)
    assert b.epoch_bound_m == pytest.approx(a.epoch_bound_m, abs=1e-6)


def _output(capsys, *argv):
    assert main(["validate", "toa", "--runs", "200", *argv]) == 0
    return capsys.readouterr().out


def test_json_has_a_row_for_each_variance(capsys):
    result = json.loads(_output(capsys, "--json", "--sigma2", "0.01", "0.5", "--steps"))
    printed, derived = result["rows"]
    assert (printed["sigma2"], printed["q_from"], derived["sigma2"], derived["q_from"]) == (
        0.01,
        "README",
        0.5,
        "derived",
    )
    assert len(printed["steps"]) == 11
    assert np.mean([step["kf_m"] for step in printed["steps"]]) == pytest.approx(printed["kf_m"])
    assert printed["kf_m"] < printed["lse_m"]


def test_any_anchors_and_any_path(capsys):
    anchors, path = "0,0;60,0;30,50;10,20", "5,5 7,6 10,6 12,9 15,9"
    (row,) = json.loads(
        _output(capsys, "--json", "--anchors", anchors, "--path", path, "--sigma2", "1")
    )["rows"]
    assert row["bound_motion_m"] is None
    assert 0.5 * row["bound_epoch_m"] < row["kf_m"] < 3.0 * row["bound_epoch_m"]


def test_table_and_picture(capsys, tmp_path):
    out = _output(capsys, "--steps", "--plot", str(tmp_path / "toa.png"))
    assert "step 10" in out
    assert (tmp_path / "toa.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "argv",
    [
        ["--anchors", "0,0 1,1 2,2"],
        ["--anchors", "0,0 1,1"],
        ["--anchors", ""],
        ["--anchors", "a,b"],
        ["--anchors", "1,2,3 4,5,6 7,8,9"],
        ["--path", "0,0 1,1"],
        ["--path", "0,0 nan,1 2,2"],
        ["--path", "0,0 1e200,1 2,2"],
        ["--sigma2", "-1"],
        ["--sigma2", "inf"],
        ["--runs", "0"],
        ["--seed", "-1"],
        ["--runs", "10", "--plot", "nowhere/toa.png"],
    ],
)
def test_a_mistake_is_one_line(argv, capsys):
    assert main(["validate", "toa", *argv]) == 2
    output = capsys.readouterr().err.splitlines()
    assert len(output) == 1
    assert output[0].startswith("postproc: ")
