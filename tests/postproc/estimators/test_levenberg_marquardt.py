import numpy as np
import pytest
from scipy.optimize import least_squares

from postproc.estimators.least_squares import minimise

T = np.linspace(0.0, 4.0, 50)


def _decay(x):
    return x[0] * np.exp(-x[1] * T) + x[2] - (3.0 * np.exp(-0.7 * T) + 1.0 + 0.01 * np.sin(9.0 * T))


def _decay_slope(x):
    return np.column_stack([np.exp(-x[1] * T), -x[0] * T * np.exp(-x[1] * T), np.ones(len(T))])


def test_it_ends_where_scipy_does():
    start = np.array([1.0, 0.2, 0.0])
    end = minimise(_decay, _decay_slope, start, (1.0, 1.0, 1.0), 200)
    expected = least_squares(_decay, start, jac=_decay_slope, method="lm", xtol=1e-12, ftol=1e-12)
    assert end.converged
    assert end.cost == pytest.approx(expected.cost, rel=1e-9)
    np.testing.assert_allclose(end.state, expected.x, rtol=1e-4)


def test_a_curved_valley():
    """Rosenbrock's function: the way to its minimum is no straight line."""
    end = minimise(
        lambda x: np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]),
        lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]),
        np.array([-1.2, 1.0]),
        (1.0, 1.0),
        200,
    )
    assert end.converged
    np.testing.assert_allclose(end.state, [1.0, 1.0], atol=1e-6)


def test_too_few_steps_are_no_minimum():
    start = np.array([1.0, 0.2, 0.0])
    assert not minimise(_decay, _decay_slope, start, (1.0, 1.0, 1.0), 1).converged


def test_what_is_not_finite_is_no_minimum():
    with np.errstate(all="ignore"):
        end = minimise(
            lambda x: np.array([np.inf * x[0], 1.0]),
            lambda _: np.ones((2, 1)),
            np.array([1.0]),
            (1.0,),
            200,
        )
    assert not end.converged


def test_a_search_that_is_lost_ends_at_once():
    """The exponential falls for ever: without a bound the search follows it."""
    seen = []

    def misfit(x):
        seen.append(float(x[0]))
        return np.exp(-x)

    def slope(x):
        return -np.diag(np.exp(-x))

    far = minimise(misfit, slope, np.zeros(1), (1.0,), 50)
    bounded = minimise(misfit, slope, np.zeros(1), (1.0,), 50, lambda x: x[0] > 5.0)
    assert far.state[0] > 10.0
    assert not bounded.converged
    assert 5.0 < bounded.state[0] == seen[-1] < 10.0
