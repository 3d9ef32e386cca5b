from dataclasses import replace

import pytest

from logger.core.certainty import metres
from logger.core.document import number_of
from postproc import summary
from postproc.report import page
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
    assert page.time_text(3725.4) == "1:02:05"
    assert [page.duration_text(s) for s in (7.2, 119.0, 1886.0, 7500.0)] == [
        "7 s",
        "119 s",
        "31 min",
        "2 h 05 min",
    ]
    assert [number_of(n, "cell") for n in (0, 1, 2)] == ["0 cells", "1 cell", "2 cells"]


def advice(result, **changes):
    cell = replace(result.cells[0], **changes)
    return summary.advice(result.answer(cell), cell)


def test_a_located_cell_needs_no_further_walk_and_a_conspicuous_one_is_searched(result):
    assert not advice(result)
    for word in ("suspicious", "unusual"):
        assert advice(kit.with_word(result, word=word)).startswith("Go there and look")
    assert not advice(kit.with_word(result, word="nothing unusual"))


def test_an_ambiguous_cell_has_the_locators_advice(result):
    said = advice(result, verdict="ambiguous", warnings=("why", "to decide walk there"))
    assert said == "To decide walk there."
    assert not advice(result, verdict="ambiguous", warnings=("why",))


def test_a_cell_without_a_position_has_advice(result):
    assert "Walk around the most likely position, 52.50" in advice(result, verdict="cannot tell")
    at_limit = replace(result.cells[0].posterior, limit_share=0.5)
    far = advice(result, verdict="cannot tell", posterior=at_limit)
    assert "do not show the distance yet" in far
    distant = kit.as_if_distant(result.cells[0]).posterior
    towards = advice(result, verdict="cannot tell", posterior=distant)
    assert towards.startswith("Walk towards the most likely position, 52.50")
    unknown = advice(result, verdict="cannot tell", posterior=None)
    assert "Walk where this cell is received" in unknown


def test_the_heading_says_which_cells_are_suspicious_or_counts_verdicts(result):
    a, b = result.cells
    assert page.heading(replace(result, cells=())) == "No cell was observed"
    assert page.heading(result) == "1 of 2 cells located, 1 not located"
    both = [a, replace(b, verdict="ambiguous")]
    assert page.located_text(both) == "1 of 2 cells located, 1 ambiguous"
    assert page.heading(kit.with_word(result)) == "One cell is suspicious"
    unusual = kit.with_word(result, word="unusual")
    assert page.heading(unusual) == "No cell is suspicious, 1 is unusual"
    none = kit.with_word(result, word="nothing unusual")
    assert page.heading(none) == "No cell is suspicious"
