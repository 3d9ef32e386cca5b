import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from logger.core import ekf
from logger.core.places import Places


def _measurement(x, receiver):
    distance = max(math.hypot(x[0] - receiver[0], x[1] - receiver[1]), 1.0)
    return x[2] - 10.0 * x[3] * math.log10(distance)


def _walk(seed, n=300):
    rng = np.random.default_rng(seed)
    receiver = np.array([500_000.0, 5_600_000.0]) + np.cumsum(rng.normal(0.3, 1.0, (n, 2)), axis=0)
    station = receiver[0] + (150.0, -80.0)
    levels = [_measurement((*station, -30.0, 3.1), r) + rng.normal(0, 3) for r in receiver]
    return receiver, np.array(levels)


def test_jacobian_of_the_specification():
    state = ekf.EkfState(1000.0, 2000.0, -40.0, 2.5, ekf.start(Places.of(0, 0)).p)
    assert ekf.jacobian(state, 1100.0, 2100.0) == pytest.approx(
        (0.0543, 0.0543, 1.0, -21.51), abs=5e-3
    )
    assert ekf.jacobian(state, 1100.0, 2100.0)[0] == pytest.approx(0.05429, abs=1e-5)


def test_jacobian_against_central_differences():
    rng = np.random.default_rng(4)
    for _ in range(200):
        x = np.array([*rng.uniform(-500, 500, 2), rng.uniform(-80, 0), rng.uniform(1, 5)])
        receiver = x[:2] + rng.choice([-1, 1], 2) * rng.uniform(1, 300, 2)
        numeric = []
        for i in range(4):
            up, down = x.copy(), x.copy()
            up[i] += 1e-4
            down[i] -= 1e-4
            numeric.append((_measurement(up, receiver) - _measurement(down, receiver)) / 2e-4)
        assert ekf.jacobian(
            ekf.EkfState(*x, ekf.start(Places.of(0, 0)).p), *receiver
        ) == pytest.approx(numeric, rel=1e-6, abs=1e-8)


def test_the_start_is_the_specified_one():
    state = ekf.start(Places.of(12.0, 34.0))
    assert state[:4] == (12.0, 34.0, -40.0, 3.0)
    assert np.array_equal(ekf.covariance_matrix(state.p), 1000.0 * np.eye(4))


@pytest.mark.parametrize("correct", [ekf.step, ekf.joseph_step])
def test_agrees_with_filterpy(correct):
    receiver, levels = _walk(1)
    oracle = ExtendedKalmanFilter(dim_x=4, dim_z=1)
    oracle.x = np.array([[*receiver[0], -40.0, 3.0]], float).T
    oracle.x = oracle.x.reshape(4, 1)
    oracle.P = 1000.0 * np.eye(4)
    oracle.Q = 1e-5 * np.eye(4)
    oracle.R = np.array([[9.0]])
    oracle.F = np.eye(4)
    state = ekf.start(Places.of(*receiver[0]))
    for (rx, ry), level in zip(receiver.tolist(), levels.tolist(), strict=True):
        oracle.predict()

        def row(x, rx=rx, ry=ry):
            return np.array(
                [ekf.jacobian(ekf.EkfState(*x.ravel(), ekf.start(Places.of(0, 0)).p), rx, ry)]
            )

        oracle.update(
            np.array([[level]]),
            row,
            lambda x, rx=rx, ry=ry: np.array([[_measurement(x.ravel(), (rx, ry))]]),
        )
        step = correct(state, rx, ry, level)
        state = step.state
        assert step.innovation_db == pytest.approx(float(oracle.y[0, 0]), rel=1e-9, abs=1e-9)
        assert step.innovation_var_db2 == pytest.approx(float(oracle.S[0, 0]), rel=1e-9)
        assert list(state[:4]) == pytest.approx(oracle.x.ravel().tolist(), rel=1e-9, abs=1e-9)
        assert ekf.covariance_matrix(state.p) == pytest.approx(oracle.P, rel=1e-9, abs=1e-9)


def test_covariance_stays_symmetric_and_positive():
    receiver, levels = _walk(2, 2000)
    state = ekf.start(Places.of(*receiver[0]))
    for (rx, ry), level in zip(receiver.tolist(), levels.tolist(), strict=True):
        state = ekf.step(state, rx, ry, level).state
    matrix = ekf.covariance_matrix(state.p)
    assert np.array_equal(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_reference_is_never_within_its_ellipse():
    """The measured failure that keeps the reference from being the answer: no truth in its
    ellipse.
    """
    inside = 0
    for seed in range(20):
        receiver, levels = _walk(seed)
        station = receiver[0] + (150.0, -80.0)
        state = ekf.start(Places.of(*receiver[0]))
        for (rx, ry), level in zip(receiver.tolist(), levels.tolist(), strict=True):
            state = ekf.step(state, rx, ry, level).state
        error = np.array(state[:2]) - station
        covariance = ekf.covariance_matrix(state.p)[:2, :2]
        inside += float(error @ np.linalg.solve(covariance, error)) <= 5.991
    assert inside == 0


def test_drms_and_triangle():
    p = ekf.upper_triangle(np.diag([9.0, 16.0, 1.0, 1.0]))
    assert ekf.drms_m(p) == pytest.approx(5.0)
    rng = np.random.default_rng(0)
    a = rng.normal(size=(4, 4))
    assert ekf.covariance_matrix(ekf.upper_triangle(a @ a.T)) == pytest.approx(a @ a.T)
