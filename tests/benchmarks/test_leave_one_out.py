"""A constant is chosen on the other campaigns, and assessed on the one left out."""

from dataclasses import replace

import pytest

from benchmarks.scoreboard import leave_one_out, strata
from benchmarks.scoreboard.tables import in_markdown
from logger.core.model.prior import Prior
from tests.kit.walk_scores import scored_walk


def walks(**log_density):
    return [
        scored_walk(campaign=campaign, log_density=value, covered=value > 0.0)
        for campaign, value in log_density.items()
    ]


SCORES = {
    "small": walks(leuven=6.0, lyon=-3.0, ota=-3.0),
    "large": walks(leuven=-1.0, lyon=1.0, ota=2.0),
}


def test_each_campaign_is_assessed_with_what_the_others_choose():
    found = leave_one_out.choices(SCORES, SCORES["small"])
    assert {one.left_out: one.value for one in found} == {
        "leuven": "large",
        "lyon": "small",
        "ota": "small",
    }
    scores = [strata.log_density(one.held_out) for one in found]
    assert scores == [-1.0, -3.0, -3.0]
    assert [one.usual_score for one in found] == [6.0, -3.0, -3.0]


def test_the_tables_have_a_line_for_each_value_and_campaign():
    by_value, by_campaign = leave_one_out.tables("trust", SCORES, SCORES["small"])
    assert [line[0] for line in by_value.lines] == ["small", "large"]
    assert [line[:3] for line in by_campaign.lines][-1] == ("all", "3", "")
    text = in_markdown([by_value, by_campaign])
    assert "| leuven | 1 | large | 0.000 | -1.000 | 6.000 |" in text
    assert "nan" not in text


FIELDS = {
    "trust": "noise",
    "reach_lengths": "reaches",
    "far_probability": "reaches",
    "sector_probability": "stations",
}


def test_every_variant_changes_one_constant():
    prior = Prior()
    for name, variants in leave_one_out.constants(prior).items():
        assert sum(variant == prior for variant in variants.values()) == 1
        assert len({repr(variant) for variant in variants.values()}) == len(variants)
        field = FIELDS.get(name, name)
        for value, variant in variants.items():
            assert replace(variant, **{field: getattr(prior, field)}) == prior
            if field == name:
                assert getattr(variant, name) == pytest.approx(float(value))


def test_the_probabilities_of_a_variant_sum_to_one():
    constants = leave_one_out.constants(Prior())
    for value, prior in constants["sector_probability"].items():
        share = sum(one.probability for one in prior.stations if one.antenna_db)
        assert share == pytest.approx(float(value))
        assert sum(one.probability for one in prior.stations) == pytest.approx(1.0)
    for value, prior in constants["far_probability"].items():
        share = sum(one.probability for one in prior.reaches if one.flat_m > 300.0)
        assert share == pytest.approx(float(value))
        assert sum(one.probability for one in prior.reaches) == pytest.approx(1.0)
