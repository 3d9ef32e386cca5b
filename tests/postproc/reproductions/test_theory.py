import numpy as np
import pytest
from scipy.stats import binom, chi2, ncx2

from logger.core.errors import ConfigError
from postproc.reproductions import theory
from postproc.reproductions.theory import Scene, default_receivers

TRIALS = 6000
SQUARE = np.array([[1.0, 0.2], [-0.3, 1.0], [-1.0, -0.4], [0.5, -1.0], [1.5, 1.2]])


def scene(receivers, sigma=50.0, claim=0.0):
    n, d = receivers.shape
    return Scene(receivers, np.full(n, sigma), np.full(d, claim))


def agrees(share, probability):
    low, high = binom.interval(0.999, TRIALS, probability)
    return low <= share * TRIALS <= high


@pytest.mark.parametrize("claim_sigma", [0.0, 40.0])
@pytest.mark.parametrize(
    ("receivers", "p_fa"), [(2000.0 * SQUARE, 0.05), (default_receivers(50.0), 0.01)]
)
def test_closed_form_and_simulation_agree(receivers, p_fa, claim_sigma):
    here = scene(receivers, claim=claim_sigma)
    true = np.zeros(here.dimensions)
    false = np.pad([120.0, 80.0], (0, here.dimensions - 2))
    rng = np.random.default_rng(3)
    for share in theory.simulate(here, true, true, p_fa, TRIALS, rng):
        assert agrees(share, p_fa)
    assert_powers(here, true, false, p_fa, rng)
    direct, indirect = theory.simulate(here, true, false, p_fa, TRIALS, rng)
    assert indirect > direct


def assert_powers(here, true, false, p_fa, rng):
    """Second-order terms of the ranges shift the noncentrality by some per cent."""
    formulas = (theory.direct_noncentrality, theory.indirect_noncentrality)
    shares = theory.simulate(here, true, false, p_fa, TRIALS, rng)
    for share, formula, dof in zip(shares, formulas, here.receivers_m.shape, strict=True):
        power = theory.detection(p_fa, dof, formula(here, true, false))
        assert share == pytest.approx(power, abs=0.02)


def test_receivers_of_unequal_quality_and_a_claim_sure_on_one_axis():
    here = Scene(2000.0 * SQUARE, np.array([20.0, 50.0, 90.0, 30.0, 400.0]), np.array([60.0, 0.0]))
    true, false, rng = np.zeros(2), np.array([70.0, -40.0]), np.random.default_rng(4)
    assert agrees(theory.simulate(here, true, true, 0.05, TRIALS, rng)[1], 0.05)
    assert_powers(here, true, false, 0.05, rng)


def test_both_noncentralities_are_one_for_small_offsets():
    here = scene(default_receivers(100.0), claim=30.0)
    direct, indirect = (
        f(here, np.zeros(3), np.array([1.0, 2.0, -1.0]))
        for f in (theory.direct_noncentrality, theory.indirect_noncentrality)
    )
    assert direct == pytest.approx(indirect, rel=0.01)


def test_too_few_receivers_leave_the_direct_test():
    here = scene(default_receivers(100.0)[:3])
    assert theory.indirect_noncentrality(here, np.zeros(3), np.ones(3)) is None
    assert "needs 4 receivers" in theory.not_observable(here, np.zeros(3))
    rng = np.random.default_rng(1)
    assert theory.simulate(here, np.zeros(3), np.zeros(3), 0.05, 100, rng)[1] is None
    assert theory.not_observable(scene(2000.0 * SQUARE[:3]), np.zeros(2)) is None
    line = np.array([[1.0, 0.0], [2.0, 0.0], [-3.0, 0.0], [5.0, 0.0]]) * 1000.0
    assert "not observed" in theory.not_observable(scene(line), np.zeros(2))


def test_detection_is_the_noncentral_chi_square():
    assert theory.detection(0.05, 4, 0.0) == pytest.approx(0.05)
    assert theory.detection(0.05, 3, 7.0) == pytest.approx(ncx2.sf(chi2.isf(0.05, 3), 3, 7.0))
    assert theory.detection(0.01, 4, theory.noncentrality_of(0.01, 4, 0.93)) == pytest.approx(0.93)


@pytest.mark.parametrize(
    "values",
    [
        (np.zeros((0, 2)), np.zeros(0), np.zeros(2)),
        (np.zeros((3, 4)), np.ones(3), np.zeros(4)),
        (np.zeros((3, 2)), np.array([1.0, 0.0, 1.0]), np.zeros(2)),
        (np.zeros((3, 2)), np.ones(3), np.array([0.0, -1.0])),
    ],
)
def test_scenes_that_are_none(values):
    with pytest.raises(ConfigError):
        Scene(*values)
