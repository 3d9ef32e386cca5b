import numpy as np

from logger.core import ekf
from postproc.estimators.filtered import reference_ekf, run_ekf
from tests.kit.walks import simulate


def test_reference_is_the_live_filter_step_by_step():
    obs, _ = simulate(np.random.default_rng(1), "L", count=50)
    found = reference_ekf(obs)
    state = ekf.start(float(obs.x_m[0]), float(obs.y_m[0]))
    for i in range(50):
        step = ekf.step(state, float(obs.x_m[i]), float(obs.y_m[i]), float(obs.level_dbm[i]))
        state = step.state
        assert found.x[i].tolist() == list(state[:4])
        assert np.array_equal(found.p[i], ekf.covariance_matrix(state.p))
        assert (found.innovation_db[i], found.innovation_var_db2[i]) == step[1:]


def test_nis_is_the_innovation_by_its_variance():
    obs, _ = simulate(np.random.default_rng(2), "square", count=30)
    found = run_ekf(obs, ekf.start(0.0, 0.0), r_db2=100.0)
    assert np.array_equal(found.nis, found.innovation_db**2 / found.innovation_var_db2)
    assert len(found) == 30
