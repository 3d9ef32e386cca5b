import re
from dataclasses import replace

import pytest

from logger.core.ellipse import metres
from postproc.report import wording
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
def test_lengths_have_their_significant_digits(value_m, text):
    assert metres(value_m) == text
    assert metres(float("inf")) == "unknown"


def test_times():
    assert wording.time_text(3725.4) == "1:02:05"
    assert [wording.duration_text(s) for s in (7.2, 119.0, 1886.0, 7500.0)] == [
        "7 s",
        "119 s",
        "31 min",
        "2 h 05 min",
    ]
    assert [wording.number_of(n, "cell") for n in (0, 1, 2)] == ["0 cells", "1 cell", "2 cells"]


def headline(result, **changes):
    return wording.headline(replace(result.cells[0], **changes))


def test_a_located_cell_needs_no_further_walk(result):
    located = headline(result)
    assert (located.title, located.advice) == (
        "Located: most likely within 14 m, surely within 29 m",
        None,
    )
    expected = r"With a probability of 95 %, it is in a region of .* m² around 52\.50\d+ 13\.40"
    assert re.match(expected, located.text)


def test_an_ambiguous_cell_has_the_locators_advice(result):
    ambiguous = headline(result, verdict="ambiguous", warnings=("why", "to decide walk there"))
    assert ambiguous.advice == "To decide walk there."
    assert ambiguous.text.startswith("The levels fit several positions: 100% at 52.50")
    assert headline(result, verdict="ambiguous", warnings=("why",)).advice is None


def test_a_cell_without_a_position_has_a_reason_and_advice(result):
    undecided = headline(result, verdict="cannot tell", warnings=("one-sided walk",))
    assert undecided.text == "One-sided walk."
    assert "Walk around the most likely position, 52.50" in undecided.advice
    at_limit = replace(result.cells[0].posterior, limit_share=0.5)
    far = headline(result, verdict="cannot tell", posterior=at_limit)
    assert "do not show the distance yet" in far.advice
    unknown = headline(result, verdict="cannot tell", posterior=None)
    assert "Walk where this cell is received" in unknown.advice
    assert headline(result, verdict="cannot tell", posterior=None, obs=None, warnings=()).text


def test_the_heading_counts_verdicts(result):
    a, b = result.cells
    answers = [headline(result)]
    assert wording.heading([], []) == "No cell was observed"
    assert (
        wording.heading([a], answers)
        == f"Cell {a.cell}: located: most likely within 14 m, surely within 29 m"
    )
    assert wording.heading([a, b], answers) == "1 of 2 cells located, 1 without a position"
    both = [a, replace(b, verdict="ambiguous")]
    assert wording.heading(both, answers) == "1 of 2 cells located, 1 ambiguous"
