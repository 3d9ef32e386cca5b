"""Words of a comparison: what changed gets its word, what did not gets none."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.comparison.changes import FALSE_WORDS, compare
from tests.postproc.comparison.city import name, walk


def words(compared):
    return {cell.cell: cell.word for cell in compared.cells if cell.is_change}


def test_repeated_walks_get_few_words():
    """At most the rate that is promised, with room for 40 pairs (Poisson, 99 %)."""
    pairs = [
        compare(walk(seed), walk(seed + 1000, offset_db=5.0), same_modem=False)
        for seed in range(40)
    ]
    n_with_word = sum(bool(words(pair)) for pair in pairs)
    assert n_with_word <= 6  # 40 x 0.05 = 2
    assert FALSE_WORDS == 0.05
    tested = [cell for pair in pairs for cell in pair.cells if cell.change_db is not None]
    assert len(tested) >= 5 * len(pairs)
    assert abs(np.median([pair.offset_db["GSM"] for pair in pairs]) - 5.0) < 1.0
    changes_db = np.array([cell.change_db for cell in tested])
    assert abs(np.median(changes_db)) < 0.5
    sigmas_db = np.array([cell.sigma_db for cell in tested])
    # the null allows walks that differ more than these
    assert 0.2 < np.std(changes_db / sigmas_db) < 1.1


@pytest.mark.parametrize("cid", [2, 3, 4])
@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"extra_db": 15.0}, "stronger"),
        ({"extra_db": -12.0}, "weaker"),
        ({"without": True}, "gone"),
    ],
)
def test_a_changed_cell_gets_its_word(cid, change, word):
    more = {"without": (cid,)} if "without" in change else {"extra_db": {cid: change["extra_db"]}}
    n_right = 0
    for seed in range(5):
        found = words(compare(walk(seed), walk(seed + 50, **more), same_modem=False))
        n_right += found.get(name(cid)) in ({word, "gone"} if word == "weaker" else {word})
        assert set(found) <= {name(cid)}
    assert n_right >= 4


def test_a_cell_that_is_left_elsewhere_is_gone_here():
    """Heard by the second walk only where the first one was not: no level can be compared."""
    first = [obs.part(obs.x_m < 390_000.0 + 1000.0) for obs in walk(1)]
    second = [
        obs.part(obs.x_m > 390_000.0 + 1050.0) if obs.cell == name(3) else obs for obs in walk(2)
    ]
    compared = compare([obs for obs in first if len(obs)], second, same_modem=True)
    third = next(cell for cell in compared.cells if cell.cell == name(3))
    assert third.n_b > 0
    assert third.word == "gone"
    assert "walk B heard it elsewhere" in third.text


def test_new_is_gone_the_other_way_round():
    for seed in range(5):
        with_it, without = walk(seed), walk(seed + 50, without=(3,))
        assert words(compare(with_it, without, same_modem=True)) == {name(3): "gone"}
        assert words(compare(without, with_it, same_modem=True)) == {name(3): "new"}


def test_the_other_direction_is_the_opposite():
    a, b = walk(1), walk(2, extra_db={3: 15.0}, offset_db=4.0)
    there, back = (compare(*pair, same_modem=False) for pair in ((a, b), (b, a)))
    backward = {cell.cell: cell for cell in back.cells}
    assert there.offset_db["GSM"] == pytest.approx(-back.offset_db["GSM"], abs=0.5)
    for cell in there.cells:
        if cell.change_db is not None:
            assert cell.change_db == pytest.approx(-backward[cell.cell].change_db, abs=0.5)


def test_a_moved_transmitter_is_moved():
    """From one end of the walk towards the other: stronger here and weaker there."""
    n_moved = 0
    for seed in range(5):
        moved = walk(seed + 50, sites={2: (1000.0, -80.0)})
        found = words(compare(walk(seed), moved, same_modem=True))
        assert set(found) <= {name(2)}
        n_moved += found.get(name(2)) == "moved"
    assert n_moved >= 4


def test_a_louder_modem_is_no_change():
    compared = compare(walk(1), walk(2, offset_db=12.0), same_modem=False)
    assert words(compared) == {}
    assert compared.offset_db["GSM"] == pytest.approx(12.0, abs=1.5)


def test_ground_that_only_one_walk_covered_says_nothing():
    def part(cells, chosen):
        parts = (obs.part(chosen(obs.x_m - 390_000.0)) for obs in cells)
        return [obs for obs in parts if len(obs)]

    a = part(walk(1), lambda x_m: x_m < 700.0)
    b = part(walk(2, without=(3,)), lambda x_m: x_m > 900.0)
    compared = compare(a, b, same_modem=True)
    assert compared.n_common_blocks == 0
    assert {cell.word for cell in compared.cells} == {"not comparable"}
    assert "in 0 blocks" in next(c.text for c in compared.cells if c.cell == name(4))
    assert "where walk B was not" in next(c.text for c in compared.cells if c.cell == name(3))


def test_a_modem_that_names_one_cell_cannot_miss_another():
    """A serving cell only: what it did not name may be there."""

    def serving_only(cells):
        level_dbm = np.full((len(cells), 400), -np.inf)
        for i, obs in enumerate(cells):
            level_dbm[i, obs.scan_seq] = obs.level_dbm
        best = np.argmax(level_dbm, axis=0)
        parts = (obs.part(best[obs.scan_seq] == i) for i, obs in enumerate(cells))
        return [obs for obs in parts if len(obs) > 1]

    a, b = serving_only(walk(1)), serving_only(walk(2, without=(3,)))
    compared = compare(a, b, same_modem=True)
    third = next(cell for cell in compared.cells if cell.cell == name(3))
    assert third.word == "not comparable"
    assert "one cell at a time" in third.text


def test_a_cell_named_once_is_no_cell():
    cells = walk(1)
    once = replace(cells[0].part(slice(0, 1)), cell="262-01-801-99")
    compared = compare([*cells, once], walk(2), same_modem=True)
    assert "262-01-801-99" not in {cell.cell for cell in compared.cells}


def test_nothing_compared_with_something_is_no_error():
    assert compare([], [], same_modem=True).cells == ()
    assert words(compare(walk(1), [], same_modem=True)) == {}
