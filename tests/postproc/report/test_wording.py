from dataclasses import replace

import pytest

from postproc.report import wording
from postproc.results import summary
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return kit.sample_result(
        kit.write_run(tmp_path_factory.mktemp("words") / "w.journal", seconds=60, cells=2)
    )


@pytest.mark.parametrize(
    ("value_m", "text"),
    [
        (0.4, "0 m"),
        (75.4, "75 m"),
        (999.4, "999 m"),
        (2840.0, "2.8 km"),
        (28_400.0, "28 km"),
        (None, "unknown"),
    ],
)
def test_metres_have_the_digits_that_matter(value_m, text):
    assert wording.metres(value_m) == text
    assert wording.metres(float("inf")) == "unknown"


@pytest.mark.parametrize(
    ("area_m2", "text"), [(681.0, "680 m²"), (11_328.0, "11\u202f000 m²"), (1_240_000.0, "1.2 km²")]
)
def test_areas_have_two_digits(area_m2, text):
    assert wording.area_text(area_m2) == text


@pytest.mark.parametrize(
    ("east", "north", "text"),
    [
        (0, 1, "north"),
        (1, 1, "north-east"),
        (1, 0.3, "east"),
        (0, -1, "south"),
        (-1, 0, "west"),
        (-1, 1, "north-west"),
    ],
)
def test_directions_are_those_of_a_compass(east, north, text):
    assert wording.direction(east, north) == text


def test_times():
    assert wording.time_text(3725.4) == "1:02:05"
    assert [wording.duration_text(s) for s in (7.2, 119.0, 1886.0, 7500.0)] == [
        "7 s",
        "119 s",
        "31 min",
        "2 h 05 min",
    ]
    assert [wording.number_of(n, "cell") for n in (0, 1, 2)] == ["0 cells", "1 cell", "2 cells"]


def answers(result, **changes):
    cell = replace(result.cells[0], **changes)
    return wording.answer(cell, summary(result)["cells"][0])


def test_a_located_cell_needs_no_further_walk(result):
    found = answers(result)
    assert (found.title, found.advice) == ("Located within 29 m", None)


def test_the_advice_of_an_ambiguous_one_is_the_locators(result):
    found = answers(result, verdict="ambiguous", warnings=("why", "to decide walk there"))
    assert found.advice == "To decide walk there."
    assert answers(result, verdict="ambiguous", warnings=("why",)).advice is None


def test_one_that_cannot_be_told_says_why_and_where_to_walk(result):
    found = answers(result, verdict="cannot tell", warnings=("one-sided walk",))
    assert found.text == "One-sided walk."
    assert "past the likeliest place, 52.50" in found.advice
    posterior = result.cells[0].posterior
    lost = replace(posterior, limit_share=0.5)
    assert (
        "says little of the distance"
        in answers(result, verdict="cannot tell", posterior=lost).advice
    )
    assert (
        "Walk where this cell is heard"
        in answers(result, verdict="cannot tell", posterior=None).advice
    )
    assert answers(result, verdict="cannot tell", posterior=None, obs=None, warnings=()).text


def test_verdicts_are_counted(result):
    a, b = result.cells
    told = [answers(result)]
    assert wording.counted([], []) == "No cell was heard"
    assert wording.counted([a], told) == f"Cell {a.cell}: located within 29 m"
    assert wording.counted([a, b], told) == "1 of 2 cells located, 1 cannot be told"
    both = [a, replace(b, verdict="ambiguous")]
    assert wording.counted(both, told) == "1 of 2 cells located, 1 ambiguous"
