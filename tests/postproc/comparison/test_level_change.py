"""The test of a changed mean: its rate of false alarms, and censored differences."""

import numpy as np
import pytest

from postproc.comparison.changes import Offset, change_of, offset_of, probability, scale_of
from postproc.comparison.ground import FREEDOM, Differences, scale_db


def differences(random, n, change_db=0.0, *, variance_db2=16.0, floor_db=None):
    """Of one cell; with `floor_db` those below it are censored there."""
    variance = np.full(n, variance_db2)
    error_db = random.standard_t(FREEDOM, n) * scale_db(variance)
    values = change_db + error_db
    bound = np.zeros(n, np.int64)
    if floor_db is not None:
        bound[values < floor_db] = -1
        values = np.maximum(values, floor_db)
    return Differences("c", "GSM", np.arange(n), values, variance, bound)


@pytest.mark.parametrize("n", [6, 12, 30])
def test_false_alarms_are_as_rare_as_promised(n):
    random, exact = np.random.default_rng(n), Offset(0.0, 1e-3)
    p = np.array(
        [probability(change_of(differences(random, n), 1.0), exact, 1.0) for _ in range(1500)]
    )
    for level in (0.1, 0.03, 0.01):
        assert np.mean(p <= level) <= level + 3.0 * np.sqrt(level / len(p))


@pytest.mark.parametrize("floor_db", [None, -2.0])
def test_a_change_is_found_with_its_size(floor_db):
    """Censored differences say at least as much as their bound."""
    random = np.random.default_rng(1)
    changes = [change_of(differences(random, 16, -6.0, floor_db=floor_db), 1.0) for _ in range(100)]
    found_db = np.array([change.db for change in changes])
    if floor_db is None:
        assert abs(np.mean(found_db) + 6.0) < 0.5
        spread = np.std(found_db) / np.mean([change.sigma_db for change in changes])
        assert 0.5 < spread < 1.2
    else:
        assert np.median(found_db) < floor_db - 1.0
    p = [probability(change, Offset(0.0, 0.5), 1.0) for change in changes]
    # a censored difference may also be a cell that was missed
    assert np.mean(np.array(p) < 0.01) > (0.8 if floor_db is None else 0.5)


def test_an_offset_of_all_cells_is_no_change():
    random = np.random.default_rng(2)
    changes = [change_of(differences(random, 12, 8.0), 1.0) for _ in range(10)]
    offset = offset_of(changes[1:], same_modem=False)
    assert abs(offset.db - 8.0) < 1.5
    assert probability(changes[0], offset, 1.0) > 0.01


def test_a_changed_minority_does_not_move_the_offset():
    random = np.random.default_rng(3)
    steady = [change_of(differences(random, 12, 3.0), 1.0) for _ in range(9)]
    changed = [change_of(differences(random, 12, 40.0), 1.0) for _ in range(3)]
    assert abs(offset_of(steady + changed, same_modem=False).db - 3.0) < 2.0


def test_without_other_cells_the_offset_is_the_prior():
    assert offset_of([], same_modem=True) == (0.0, 2.0)
    assert offset_of([], same_modem=False) == (0.0, 6.0)


def test_walks_that_differ_more_widen_the_noise():
    random = np.random.default_rng(4)
    quiet = [differences(random, 10, variance_db2=16.0) for _ in range(20)]
    assert scale_of(quiet) == pytest.approx(1.0, abs=0.2)
    loud = [
        Differences(d.cell, d.rat, d.block, 3.0 * d.difference_db, d.variance_db2, d.bound)
        for d in quiet
    ]
    assert 4.0 < scale_of(loud) < 12.0
    assert scale_of(quiet[:1]) == 1.0
