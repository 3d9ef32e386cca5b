"""Loggers against the others at the same places."""

import numpy as np

from postproc.survey.agreement import _median_of_others


def test_the_median_of_the_others_is_that_without_each():
    """Ties and even and odd numbers, in any order of the rows."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        n_places, n_loggers = rng.integers(1, 20), rng.integers(3, 12)
        heard = rng.permuted(np.arange(n_loggers) < 3, axis=0) | (
            rng.random((n_places, n_loggers)) < 0.5
        )
        place, logger = np.nonzero(heard)
        level_dbm = np.round(rng.normal(-80.0, 8.0, len(place)), rng.integers(0, 3))
        table = np.full(heard.shape, np.nan)
        table[place, logger] = level_dbm
        mixed = rng.permutation(len(place))
        found = _median_of_others(place[mixed], level_dbm[mixed])
        expected = [
            np.nanmedian(np.delete(table[p], m))
            for p, m in zip(place[mixed], logger[mixed], strict=True)
        ]
        assert found.tolist() == expected
