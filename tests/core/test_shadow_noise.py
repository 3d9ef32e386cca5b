from dataclasses import replace

import numpy as np
import pytest

from logger.core import shadow_ekf
from logger.core.shadow_ekf import split_noise
from tests.kit.walks import observations, path, shadowing

PLACE = np.array([60.0, 90.0, -30.0, 3.0])


def readings(rng, *, white_db, shadow_db, d_c=15.0, count=400):
    x, y = path("square", count, 2.8)
    level = PLACE[2] - 10.0 * PLACE[3] * np.log10(np.hypot(x - PLACE[0], y - PLACE[1]))
    level = level + shadowing(rng, x, y, shadow_db, d_c) + white_db * rng.normal(size=count)
    return replace(observations(x, y, level), known_limit=np.zeros(count, np.int64))


@pytest.mark.parametrize(("white_db", "shadow_db"), [(1.0, 6.0), (2.0, 3.0), (3.0, 1.0)])
def test_the_white_share_is_estimated_whatever_the_locator_has(white_db, shadow_db):
    result = []
    for seed in range(5):
        readings_there = readings(
            np.random.default_rng(seed), white_db=white_db, shadow_db=shadow_db
        )
        for white_share in (0.02, 0.5):
            candidates = shadow_ekf.candidates(
                np.hypot(white_db, shadow_db), 15.0, white_share, 0.0
            )
            result.append(shadow_ekf.likeliest(candidates, PLACE, readings_there).white_db)
    assert np.median(result) == pytest.approx(
        white_db, rel=0.4
    )  # shares of the candidates are up to 2.5 apart


def test_few_readings_leave_the_locators_share():
    readings_there = readings(np.random.default_rng(1), white_db=3.0, shadow_db=1.0)
    candidates = shadow_ekf.candidates(3.2, 15.0, 0.02, 0.0)
    assert shadow_ekf.likeliest(candidates, PLACE, readings_there.part(slice(49))) == split_noise(
        3.2, 15.0, 0.02, 0.0
    )
    assert shadow_ekf.likeliest(candidates, PLACE, readings_there.part(slice(50))) != candidates[0]


def test_readings_at_the_limit_are_no_obstacle():
    readings_there = readings(np.random.default_rng(2), white_db=2.0, shadow_db=3.0)
    readings_there = replace(readings_there, known_limit=np.full(len(readings_there), -1))
    candidates = shadow_ekf.candidates(3.6, 15.0, 0.3, 0.0)
    assert shadow_ekf.likeliest(candidates, PLACE, readings_there) == candidates[0]


def test_nothing_is_asked_where_nearly_all_noise_is_white():
    assert shadow_ekf.candidates(3.0, 0.0, 1.0, 5.0) == [split_noise(3.0, 0.0, 1.0, 5.0)]
    assert shadow_ekf.candidates(3.0, 2.3, 0.99, 5.0) == [split_noise(3.0, 0.0, 1.0, 5.0)]
