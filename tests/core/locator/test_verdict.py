import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from logger.core.locator.pipeline import decide, locate
from logger.core.locator.verdict import assess
from logger.core.model.prior import Prior, Station
from tests.kit.walks import observations, path, simulate, with_places


@cache
def clear():
    """A walk around a transmitter that leaves one small region, and its posterior."""
    obs, _ = simulate(np.random.default_rng(24), "square", white_db=2.0, count=150, step=5.6)
    return obs, locate(obs)


def reasons(obs, **prior):
    outcome, why, *_ = assess(locate(obs, Prior(**prior)), obs)
    assert outcome == "cannot tell"
    return " / ".join(why)


def beside(mode, east_m, probability, peak):
    """Another mode of the same shape."""
    return replace(
        mode,
        probability=probability,
        peak=peak,
        state=mode.state + np.array([east_m, 0.0, 0.0, 0.0]),
        place=replace(mode.place, x_m=mode.place.x_m + east_m),
    )


def some(obs, chosen):
    return replace(obs.part(chosen), known_limit=None)


# --- located ---


def test_located():
    obs, found = clear()
    outcome, (why,), *_ = assess(found, obs)
    assert outcome == "located"
    assert found.modes[0].probability > 0.995
    assert why == f"one position holds > 99 %; 95 % lie within {found.r95_m:.0f} m of it"


@pytest.mark.parametrize("probability", [0.0, 0.001, 0.004, 0.0099])
def test_a_mode_that_would_be_printed_as_0_percent_is_no_rival_however_sharp(probability):
    obs, found = clear()
    best = replace(found.modes[0], probability=1.0 - probability)
    outcome, why, *_ = assess(
        replace(found, modes=(best, beside(best, 300.0, probability, 1.0))), obs
    )
    assert outcome == "located"
    assert not re.search(r"\b(0|100) %", " ".join(why))


SHARES = [
    (0.99, 0.01),
    (0.985, 0.015),
    (0.333, 0.333, 0.333),
    (0.5, 0.495),
    (0.905, 0.05, 0.035, 0.01),
    (0.6, 0.25, 0.012),
]


@pytest.mark.parametrize("shares", SHARES)
def test_shares_of_modes_add_up_and_none_is_0_or_100(shares):
    obs, found = clear()
    best = replace(found.modes[0], probability=shares[0])
    others = (beside(best, 300.0 * i, share, 0.5) for i, share in enumerate(shares[1:], 1))
    outcome, why, *_ = assess(replace(found, modes=(best, *others)), obs)
    assert outcome == "ambiguous"
    percents = [int(percent) for percent in re.findall(r"(\d+) %", why[0])]
    assert sum(percents) == 100
    assert all(0 < percent < 100 for percent in percents)
    assert len(re.findall(" % at ", why[0])) == len(shares)


def test_the_advice_names_a_listed_mode():
    obs, found = clear()
    best = replace(found.modes[0], probability=0.6)
    rest = (beside(best, 5.0, 0.002, 1.0), beside(best, 400.0, 0.398, 0.9))
    _, (named, advice), *_ = assess(replace(found, modes=(best, *rest)), obs)
    place = re.search(r"walk past (\S+ \S+),", advice)[1]
    assert f"at {place}" in named


@pytest.mark.parametrize(
    ("height_m", "sigma_m"), [(0.0, 0.0), (5.0, 3.0), (60.0, 0.0), (60.0, 9.0)]
)
def test_the_advice_expects_the_levels_of_the_model_with_height_and_fix_error(height_m, sigma_m):
    obs, found = clear()
    obs = with_places(obs, sigma_m=np.full(len(obs), sigma_m))
    best = replace(found.modes[0], probability=0.6)
    other = beside(best, 400.0, 0.4, 0.9)
    posterior = replace(
        found, modes=(best, other), prior=found.prior.of_station(Station(1.0, height_m))
    )
    _, (_, advice), *_ = assess(posterior, obs)
    *_, p0_dbm, eta = best.state.tolist()
    for flat_m, text in ((20.0, r"about (-?\d+) dBm there"), (400.0, r", (-?\d+) dBm if")):
        distance_m = math.sqrt(flat_m**2 + height_m**2 + 2.0 * sigma_m**2)
        expected_dbm = p0_dbm - 10.0 * eta * math.log10(distance_m)
        assert int(re.search(text, advice)[1]) == pytest.approx(expected_dbm, abs=0.51)


def test_an_irrelevant_second_mode_changes_nothing():
    obs, found = clear()
    best = found.modes[0]
    assert (
        assess(replace(found, modes=(best, beside(best, 900.0, 0.01, 0.001))), obs)[0] == "located"
    )


# --- ambiguous ---


def test_two_modes():
    obs, _ = simulate(np.random.default_rng(25), "straight", white_db=2.0, count=150, step=5.6)
    found = locate(obs)
    outcome, why, *_ = assess(found, obs)
    assert outcome == "ambiguous"
    assert len(why) == 2
    for mode in found.modes:
        lat_deg, lon_deg = obs.utm.to_latlon(mode.x_m, mode.y_m)
        assert f"% at {lat_deg:.5f} {lon_deg:.5f}" in why[0]


@pytest.mark.parametrize(
    ("probability", "peak"), [(0.04, 0.001), (0.01, 0.2)], ids=["its mass", "its peak"]
)
def test_a_rival_counts_for_its_mass_or_its_peak(probability, peak):
    obs, found = clear()
    best = found.modes[0]
    assert (
        assess(replace(found, modes=(best, beside(best, 300.0, probability, peak))), obs)[0]
        == "ambiguous"
    )


# --- cannot tell, each reason on its own walk ---


def test_few_readings():
    obs, _ = clear()
    assert "only 6 readings, at least 8 are needed" in reasons(some(obs, np.arange(0, 150, 25)))
    eight = assess(locate(some(obs, np.arange(0, 150, 19))), some(obs, np.arange(0, 150, 19)))[1]
    assert not any("readings" in why for why in eight)


def test_short_walk():
    x = np.arange(40) * 0.45
    obs = observations(x, 0 * x, -60 - 0.5 * np.arange(40))
    assert "the walk spans only 18 m" in reasons(obs)


def test_same_level_throughout():
    x, y = path("square", 150, 5.6)
    flat = observations(x, y, -80.0 + 0.5 * np.sin(np.arange(150)))
    assert "the level hardly changes along the walk" in reasons(flat)


def test_mass_at_the_end_of_the_search():
    x, y = path("L", 150, 5.6)
    obs = observations(x, y, -95.0 + 4.0 * np.random.default_rng(26).normal(size=150))
    assert "the transmitter may be farther than the searched 1 km" in reasons(obs, reach_m=1000.0)
    assert "they fit a mast kilometres away as well" in reasons(obs)


def test_one_sided_walk():
    """Past the corner of an L, seen from a distance."""
    x, y = path("L", 150, 5.6)
    source = 900.0, -500.0
    level = -20 - 35 * np.log10(np.hypot(x - source[0], y - source[1]))
    obs = observations(x, y, level + 1.0 * np.random.default_rng(1).normal(size=150))
    found = locate(obs)
    assert len([mode for mode in found.modes if mode.probability > 0.03]) == 1
    bearing = np.degrees(np.arctan2(x - found.x_m, y - found.y_m))
    seen = f"seen from there, it covers {np.ptp(bearing):.0f} of 360 degrees"
    assert f"the walk passes the position on one side only: {seen}" in reasons(obs)


def test_large_region():
    x, y = path("L", 150, 5.6)
    obs = observations(x, y, -95.0 + 4.0 * np.random.default_rng(26).normal(size=150))
    assert "and a location needs 150 m" in reasons(obs)


def test_all_reasons_are_listed():
    obs = observations([0.0, 8.0], [0.0, 1.0], [-70.0, -71.0])
    assert len(assess(locate(obs), obs).reasons) >= 3


def test_the_radius_decides_whatever_the_extent_of_the_walk():
    obs, found = clear()
    r95_m = found.r95_m
    assert decide(found, obs, within_m=1.01 * r95_m).verdict == "located"
    outcome, (why, *_), *_ = decide(found, obs, within_m=0.99 * r95_m)
    assert outcome == "cannot tell"
    assert why == f"95 % lie within {r95_m:.0f} m, and a location needs {0.99 * r95_m:.0f} m"


def test_several_wide_modes_are_no_answer():
    obs, found = clear()
    best = replace(found.modes[0], probability=0.6)
    two = replace(found, modes=(best, beside(best, 400.0, 0.39, 0.9)))
    semi_major_m = best.ellipse.semi_major_m
    assert assess(two, obs, within_m=1.01 * semi_major_m).verdict == "ambiguous"
    outcome, (why, *_), *_ = assess(two, obs, within_m=0.99 * semi_major_m)
    assert outcome == "cannot tell"
    assert why.startswith("the widest of 2 places reaches over ")


def test_the_reach_of_the_region_is_no_reason_of_its_own():
    """Every walk along a straight street whose level hardly changes reaches far."""
    x, y = path("straight", 60, 5.6)
    distance_m = np.hypot(x, y - 1500.0)
    obs = observations(x, y, -20.0 - 25.0 * np.log10(distance_m))
    assert "from the walk" not in reasons(obs)


# --- never located ---


@pytest.mark.parametrize("eta", [-3.0, -0.09, 0.3, 1.4, 6.5, 20.0])
def test_an_exponent_that_no_walk_has_is_never_located(eta):
    obs, found = clear()
    best = found.modes[0]
    state = best.state.copy()
    state[3] = eta
    outcome, (why, *_), *_ = assess(replace(found, modes=(replace(best, state=state),)), obs)
    assert outcome == "cannot tell"
    assert f"exponent of {eta:.1f}" in why


@pytest.mark.parametrize(("span_db", "verdict"), [(0.5, "cannot tell"), (5.9, "cannot tell")])
def test_levels_within_6_db_are_never_located(span_db, verdict):
    obs, found = clear()
    level_dbm = obs.level_dbm - np.min(obs.level_dbm)
    level_dbm = -80.0 + span_db * level_dbm / np.max(level_dbm)
    outcome, (why, *_), *_ = assess(found, replace(obs, level_dbm=level_dbm))
    assert outcome == verdict
    assert "6 dB" in why


def test_a_span_between_modems_is_no_span():
    """A constant level, read 20 dB higher by the second modem."""
    obs, found = clear()
    modem = np.arange(len(obs)) % 2
    flat = replace(obs, modem=modem, level_dbm=-80.0 + 20.0 * modem + (np.arange(len(obs)) % 3))
    offsets = type("Offsets", (), {"mean_db": np.array([0.0, 20.0])})()
    outcome, (why, *_), *_ = assess(replace(found, offsets=offsets), flat)
    assert outcome == "cannot tell"
    assert "it spans 2 of the 6 dB" in why


def test_seven_readings_are_never_located():
    obs, found = clear()
    seven = some(obs, np.arange(0, 140, 20))
    assert len(seven) == 7
    assert assess(found, seven).verdict == "cannot tell"
    assert assess(found, obs).verdict == "located"
