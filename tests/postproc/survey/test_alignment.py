"""Offsets of many modems: their sigmas are those of the errors, of errors that a walk keeps too."""

import numpy as np
import pytest

from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.survey.alignment import PLACE_M, align

MODEMS, WALKS, PLACES = 8, 4, 60
NOISE_DB = 2.0


def _walks(rng, offset_db, common_db):
    """Each modem walks one street some times; a walk has an error of its own, and each level."""
    number = np.repeat(np.arange(MODEMS), WALKS)
    place_dbm = rng.normal(-70.0, 6.0, PLACES)
    along_m = (np.arange(PLACES) + 0.5) * PLACE_M
    error_db = rng.normal(0.0, common_db, len(number))[:, None]
    level_dbm = (
        place_dbm
        + offset_db[number][:, None]
        + error_db
        + rng.normal(0.0, NOISE_DB, (len(number), PLACES))
    )
    n = level_dbm.size
    return Readings(
        "262-01-801-1",
        "GSM",
        Places.of(
            390_000.0 + np.tile(along_m, len(number)),
            np.full(n, 5_820_010.0),
            utm=Utm(33),
            sigma_m=np.full(n, 4.0),
            t_ns=np.tile(np.arange(PLACES) * 10**10, len(number)),
        ),
        level_dbm.ravel(),
        np.arange(n),
        modem=np.repeat(number, PLACES),
        without_spikes=True,
    )


@pytest.mark.parametrize("common_db", [0.0, 0.4, 0.8])
def test_offsets_have_the_errors_that_their_sigmas_say(common_db):
    """Mean of the squared errors in units of the variances, against the first modem."""
    rng = np.random.default_rng(21)
    scores = []
    for _ in range(60):
        offset_db = rng.normal(0.0, 4.0, MODEMS)
        found = align(_walks(rng, offset_db, common_db))
        known = np.isfinite(found.sigma_db[1:])
        error_db = (found.offset_db - (offset_db - offset_db[0]))[1:][known]
        scores.append(np.mean((error_db / found.sigma_db[1:][known]) ** 2))
    mean, sigma = np.mean(scores), np.std(scores) / np.sqrt(len(scores))
    assert mean - 3.0 * sigma < 1.0
    assert mean + 3.0 * sigma > 0.6
    assert mean < 1.5
