import numpy as np
import pytest

from logger.core.errors import ConfigError
from postproc.reproductions.theory import printed_pairs, summary


def test_indirect_column_follows_from_the_direct_one_with_three_degrees_of_freedom():
    for p_fa in (0.02, 0.05, 0.1):
        for pair in printed_pairs(p_fa):
            assert abs(pair.difference) <= 0.03
            assert pair.dof2 > pair.dof3 > pair.dof4
    pair = next(pair for pair in printed_pairs(0.05) if pair.printed_direct == 0.93)
    assert round(pair.dof3, 2) == 0.95
    assert round(pair.dof2, 2) != 0.95
    assert round(pair.dof4, 2) != 0.95


def test_a_printed_one_needs_a_rate_of_two_per_cent():
    for p_fa, possible in ((0.01, False), (0.019, False), (0.021, True), (0.05, True)):
        assert all(
            pair.possible == possible for pair in printed_pairs(p_fa) if pair.printed_direct == 1.0
        )


def test_summary_has_every_case_and_states_what_is_unknown():
    result = summary(0.05, None, (100.0, 20_000.0), 2000, 1)
    assert len(result["rows"]) == 8
    assert {row["claim_sigma_m"][0] for row in result["rows"]} == {0.0, 37.8}
    for row in result["rows"]:
        for rates in (row["direct"], row["indirect"]):
            assert rates["simulated"] == pytest.approx(rates["theory"], abs=0.05)
    assert len(result["cannot_be_known"]) == 3
    plane = summary(0.05, np.array([[900.0, 0.0], [0.0, 900.0], [-900.0, -900.0]]), (50.0,), 500, 1)
    assert all(len(row["offset_m"]) == 2 for row in plane["rows"])


@pytest.mark.parametrize(
    "change", [{"p_fa": 0.0}, {"p_fa": 1.5}, {"sigmas_m": (0.0,)}, {"trials": 0}]
)
def test_options_that_make_no_sense(change):
    with pytest.raises(ConfigError):
        summary(
            **{"p_fa": 0.05, "receivers_m": None, "sigmas_m": (100.0,), "trials": 10, "seed": 0}
            | change
        )
