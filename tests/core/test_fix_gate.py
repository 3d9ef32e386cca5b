import numpy as np

from logger.core.fix_gate import FixGate
from logger.core.types import Fix


def _which_pass(*at):
    """Whether each fix passes: seconds, latitude and longitude."""
    gate = FixGate()
    return [gate.passes(round(t_s * 1e9), Fix(True, None, lat, lon)) for t_s, lat, lon in at]


def test_a_fix_that_no_train_reaches_is_none_until_others_bear_it_out():
    north_deg, far = 1e-5, (52.5, 15.6)
    walk = [(t, 52.5 + t * north_deg, 13.4) for t in range(20)]
    assert all(_which_pass(*walk))
    leap = [*walk[:5], (5, *far), *walk[6:]]
    assert [t for t, passes in enumerate(_which_pass(*leap)) if not passes] == [5]
    cold_start = [(0, *far), *walk[1:]]
    assert [t for t, passes in enumerate(_which_pass(*cold_start)) if not passes] == [1, 2, 3, 4, 5]
    scattered = [*walk[:3], (3, *far), (4, -10.0, 20.0), (5, 40.0, 100.0), *walk[6:]]
    assert [t for t, passes in enumerate(_which_pass(*scattered)) if not passes] == [3, 4, 5]


def test_a_train_a_gap_and_the_antimeridian_are_no_leap():
    assert all(_which_pass(*[(t, 52.5 + t * 83.0 / 111_320.0, 13.4) for t in range(10)]))
    assert all(_which_pass((0, 52.5, 13.4), (600, 52.9, 13.4)))
    assert all(_which_pass((0, -17.0, 179.9999), (1, -17.0, -179.9999)))
    gate = FixGate()
    assert gate.passes(0, Fix(True, None, 52.5, 13.4))
    assert gate.passes(1, Fix(False))
    assert not gate.passes(10**9, Fix(True, None, 52.6, 13.4))


def test_where_each_fix_is_a_leap_the_times_are_none():
    """An import whose seconds are the number of the row, of a drive with a row each 500 m."""
    passes = _which_pass(*[(t, 52.5 + t * 0.0045, 13.4) for t in range(60)])
    assert not any(passes[1:10])
    assert all(passes[10:])


def test_after_a_jammer_the_gate_is_as_strict_as_before():
    """Ten scattered fixes in a second or in ten; an hour later one leap is one."""
    rng = np.random.default_rng(3)
    for every_s in (0.1, 1.0):
        far = [
            (600 + k * every_s, *place)
            for k, place in enumerate(rng.uniform(-60.0, 60.0, (10, 2)).tolist())
        ]
        before = [(t, 52.5, 13.4) for t in range(600)]
        after = [(t, 52.5, 13.4) for t in range(615, 4200)]
        passes = _which_pass(*before, *far, *after, (4201, 10.0, 10.0), (4202, 52.5, 13.4))
        assert all(passes[:600])
        assert not any(passes[600:609])
        assert passes[-2:] == [False, True]
