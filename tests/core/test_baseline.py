"""What a baseline answers without a file; `tests/test_baseline_file.py` has the rest."""

from logger.core.baseline import (
    HeardInSquare,
    NotedBaseline,
    SquareHistory,
    best_dbm,
    squares_around,
    squares_within,
)


def test_without_a_baseline_nothing_is_known():
    baseline = NotedBaseline()
    assert baseline.n_walks == 0
    assert baseline.cell("262-01-1-1") is None
    assert baseline.trust_note("262-01-1-1") is None
    assert not baseline.channels("262", "01", "GSM")
    around = squares_around(baseline, 52.5, 13.4, 500.0)
    assert [square.square for square in around] == squares_within(52.5, 13.4, 500.0)
    assert not any(square.cells or square.n_walks for square in around)


def test_the_best_level_is_that_of_all_squares_that_heard_the_cell():
    heard = [HeardInSquare(1, 2, dbm, dbm, dbm, 0.0) for dbm in (-80.0, -70.0, -60.0)]
    squares = tuple(SquareHistory(i, {}, {"a": here}) for i, here in enumerate(heard))
    assert best_dbm((*squares, SquareHistory(9, {}, {"b": heard[0]})), "a") == -60.0
    assert best_dbm(squares[:1], "a") == -80.0
    assert best_dbm(squares, "b") is None
