from dataclasses import replace

import numpy as np
import pytest

from postproc.cell_estimation import estimate_cell
from postproc.json_text import as_json
from postproc.smoothing import smooth_runs
from postproc.summary import summarise
from tests.kit.sample_results import write_run
from tests.kit.walks import simulate


def test_processes_give_what_one_gives(tmp_path):
    run = write_run(tmp_path / "a.journal", seconds=60, cells=4)
    alone, shared = (summarise(smooth_runs([run], processes=n)) for n in (1, 2))
    assert as_json(shared) == as_json(alone)
    assert len(shared.cells) == 4


def test_a_level_set_aside_is_named_and_moves_nothing():
    obs, source = simulate(np.random.default_rng(5), "random", count=400)
    at = int(np.argmax(np.hypot(obs.x_m - source[0], obs.y_m - source[1])))
    level_dbm = obs.level_dbm.copy()
    level_dbm[at] += 30.0
    plain, found = (estimate_cell(one) for one in (obs, replace(obs, level_dbm=level_dbm)))
    assert [spike.scan_seq for spike in found.set_aside] == [at]
    assert plain.set_aside == ()
    assert sum(f"dBm in scan {at}, is" in why and "set aside" in why for why in found.warnings) == 1
    assert at in [outlier.scan_seq for outlier in found.residuals.outliers]
    assert found.residuals.excess_kurtosis == pytest.approx(
        plain.residuals.excess_kurtosis, abs=0.3
    )
    assert found.verdict == plain.verdict
    assert np.hypot(*(found.batch.state[:2] - plain.batch.state[:2])) < 20.0  # 550 m with it
    assert found.n == plain.n == 400
