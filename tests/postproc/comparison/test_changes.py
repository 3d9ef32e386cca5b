"""Words of a comparison: what changed gets its word, what did not gets none."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.comparison.changes import (
    FALSE_WORDS,
    Offset,
    change_of,
    compare,
    offset_of,
    pattern_of,
    probability,
    scale_of,
)
from postproc.comparison.ground import FREEDOM, Differences, Grid, half_blocks_at, scale_db
from tests.postproc.comparison.city import START_M, name, walk


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


def with_one_level(cells, cid, from_m=0.0):
    return [
        replace(obs, level_dbm=np.where(obs.x_m < START_M[0] + from_m, obs.level_dbm, -80.0))
        if obs.cell == name(cid)
        else obs
        for obs in cells
    ]


def test_a_cell_whose_level_a_modem_repeats_is_listed_and_neither_new_nor_gone():
    repeated = with_one_level(walk(2), 3)
    for other in (walk(1), walk(1, without=(3,))):
        for pair in ((other, repeated), (repeated, other)):
            compared = compare(*pair, same_modem=True)
            assert words(compared) == {}
            third = next(cell for cell in compared.cells if cell.cell == name(3))
            assert third.word == "not comparable"
            assert "repeat" in third.text


def test_where_a_modem_repeats_a_level_it_did_not_miss_the_cell():
    for seed in range(3):
        repeated = with_one_level(walk(seed + 50), 3, from_m=700.0)
        assert words(compare(walk(seed), repeated, same_modem=True)) == {}


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


def test_a_weaker_cell_may_stand_elsewhere():
    # only the mean was tested: one that moved away is weaker too
    compared = compare(walk(1), walk(2, extra_db={3: -12.0}), same_modem=True)
    (text,) = [cell.text for cell in compared.cells if cell.word == "weaker"]
    assert "weaker on average" in text
    assert text.endswith("or it stands elsewhere now")


def test_a_louder_modem_is_no_change():
    compared = compare(walk(1), walk(2, offset_db=12.0), same_modem=False)
    assert words(compared) == {}
    assert compared.offset_db["GSM"] == pytest.approx(12.0, abs=1.5)


def test_few_cells_do_not_show_whether_a_modem_changed():
    for n, says in ((1, "it may as well be the modem"), (2, "it may be that one that changed")):
        a, b = (
            [obs for obs in one if obs.cell in (name(2), name(3))[:n]]
            for one in (walk(1), walk(2, extra_db={2: -25.0}))
        )
        compared = compare(a, b, same_modem=False)
        changed = next(cell for cell in compared.cells if cell.cell == name(2))
        assert changed.word in {"weaker", "gone"}
        assert says in changed.text
        assert ("GSM" in compared.offset_db) == (n > 1)


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


def differences(random, n, change_db=0.0, *, variance_db2=16.0, floor_db=None):
    """Of one cell; with `floor_db` those below it are censored there."""
    variance = np.full(n, variance_db2)
    error_db = random.standard_t(FREEDOM, n) * scale_db(variance)
    values = change_db + error_db
    bound = np.zeros(n, np.int64)
    if floor_db is not None:
        bound[values < floor_db] = -1
        values = np.maximum(values, floor_db)
    return Differences("c", "GSM", np.arange(n), values, variance, bound)


@pytest.mark.parametrize("n", [6, 12, 30])
def test_false_alarms_are_as_rare_as_promised(n):
    random, exact = np.random.default_rng(n), Offset(0.0, 1e-3)
    p = np.array(
        [probability(change_of(differences(random, n), 1.0), exact, 1.0) for _ in range(1500)]
    )
    for level in (0.1, 0.03, 0.01):
        assert np.mean(p <= level) <= level + 3.0 * np.sqrt(level / len(p))


@pytest.mark.parametrize("floor_db", [None, -2.0])
def test_a_change_is_found_with_its_size(floor_db):
    """Censored differences say at least as much as their bound."""
    random = np.random.default_rng(1)
    changes = [change_of(differences(random, 16, -6.0, floor_db=floor_db), 1.0) for _ in range(100)]
    found_db = np.array([change.db for change in changes])
    if floor_db is None:
        assert abs(np.mean(found_db) + 6.0) < 0.5
        spread = np.std(found_db) / np.mean([change.sigma_db for change in changes])
        assert 0.5 < spread < 1.2
    else:
        assert np.median(found_db) < floor_db - 1.0
    p = [probability(change, Offset(0.0, 0.5), 1.0) for change in changes]
    # a censored difference may also be a cell that was missed
    assert np.mean(np.array(p) < 0.01) > (0.8 if floor_db is None else 0.5)


def test_an_offset_of_all_cells_is_no_change():
    random = np.random.default_rng(2)
    changes = [change_of(differences(random, 12, 8.0), 1.0) for _ in range(10)]
    offset = offset_of(changes[1:], same_modem=False)
    assert abs(offset.db - 8.0) < 1.5
    assert probability(changes[0], offset, 1.0) > 0.01


def test_a_changed_minority_does_not_move_the_offset():
    random = np.random.default_rng(3)
    steady = [change_of(differences(random, 12, 3.0), 1.0) for _ in range(9)]
    changed = [change_of(differences(random, 12, 40.0), 1.0) for _ in range(3)]
    assert abs(offset_of(steady + changed, same_modem=False).db - 3.0) < 2.0


def test_two_cells_that_disagree_leave_the_offset_open():
    random = np.random.default_rng(5)
    same, steady, changed = (
        change_of(differences(random, 12, db), 1.0) for db in (0.0, 0.0, -15.0)
    )
    offset = offset_of([steady, changed], same_modem=False)
    assert offset.sigma_db > 4.0
    assert probability(same, offset, 1.0) > 0.05
    assert offset_of([steady, same], same_modem=False).sigma_db < 2.0


def test_without_other_cells_the_offset_is_the_prior():
    assert offset_of([], same_modem=True) == (0.0, 2.0)
    assert offset_of([], same_modem=False) == (0.0, 6.0)


def test_walks_that_differ_more_widen_the_noise():
    random = np.random.default_rng(4)
    quiet = [differences(random, 10, variance_db2=16.0) for _ in range(20)]
    assert scale_of(quiet) == pytest.approx(1.0, abs=0.2)
    loud = [
        Differences(d.cell, d.rat, d.block, 3.0 * d.difference_db, d.variance_db2, d.bound)
        for d in quiet
    ]
    assert 4.0 < scale_of(loud) < 12.0
    assert scale_of(quiet[:1]) == 1.0


GRID = Grid()


def along_a_street(difference_db):
    n = len(difference_db)
    block = GRID.blocks_of(half_blocks_at(390_000.0 + 50.0 * np.arange(n), np.full(n, 5_820_000.0)))
    return Differences("c", "", block, difference_db, np.full(n, 16.0), np.zeros(n, np.int64))


def test_noise_has_no_pattern():
    random = np.random.default_rng(1)
    p = np.array(
        [pattern_of(along_a_street(random.normal(0, 4.0, 15)), 0.0, GRID)[1] for _ in range(200)]
    )
    for level in (0.1, 0.02):
        assert np.mean(p <= level) <= level + 3.0 * np.sqrt(level / len(p))


def test_a_slope_is_a_pattern():
    random = np.random.default_rng(2)
    slope_db = np.linspace(-15.0, 15.0, 15)
    contrast_db, p = pattern_of(along_a_street(slope_db + random.normal(0, 4.0, 15)), 0.0, GRID)
    assert contrast_db > 15.0
    assert p < 0.001


def test_a_change_everywhere_is_no_pattern():
    random = np.random.default_rng(3)
    assert pattern_of(along_a_street(20.0 + random.normal(0, 4.0, 15)), 0.0, GRID)[1] > 0.01


def test_censored_differences_are_no_pattern():
    """A cell that is 20 dB weaker all along: where it is below the floor, less is seen of that."""
    random, n = np.random.default_rng(5), 20
    street = along_a_street(-20.0 + random.normal(0, 4.0, n))
    margin_db = np.repeat([30.0, 5.0], n // 2)
    is_below = street.difference_db < -margin_db
    assert np.count_nonzero(is_below) == n // 2
    censored = replace(
        street,
        difference_db=np.where(is_below, -margin_db, street.difference_db),
        bound=np.where(is_below, -1, 0),
    )
    assert pattern_of(censored, -20.0, GRID)[1] > 0.05
    assert pattern_of(replace(censored, bound=np.zeros(n)), -20.0, GRID)[1] < 0.001


def across_a_city(difference_db):
    side = int(np.sqrt(len(difference_db)))
    east_m, north_m = 50.0 * np.indices((side, side)).reshape(2, -1)
    street = along_a_street(difference_db)
    return replace(
        street, block=GRID.blocks_of(half_blocks_at(390_000.0 + east_m, 5_820_000.0 + north_m))
    )


def test_a_city_of_blocks_is_tested_in_larger_squares():
    random, n = np.random.default_rng(6), 60 * 60
    contrasts_db, p = np.array(
        [pattern_of(across_a_city(random.normal(0, 4.0, n)), 0.0, GRID) for _ in range(40)]
    ).T
    assert np.mean(p <= 0.1) <= 0.1 + 3.0 * np.sqrt(0.1 / len(p))
    assert np.max(contrasts_db) < 6.0
    slope_db = np.linspace(-10.0, 10.0, n)
    contrast_db, p_of_slope = pattern_of(
        across_a_city(slope_db + random.normal(0, 4.0, n)), 0.0, GRID
    )
    assert contrast_db > 12.0
    assert p_of_slope < 1e-4


def test_few_blocks_have_no_pattern():
    assert pattern_of(along_a_street(np.linspace(-20.0, 20.0, 7)), 0.0, GRID) == (0.0, 1.0)


def test_equal_runs_give_equal_answers():
    values = np.random.default_rng(4).normal(0, 4.0, 20)
    assert pattern_of(along_a_street(values), 0.0, GRID) == pattern_of(
        along_a_street(values), 0.0, GRID
    )


def test_a_change_below_the_least_of_a_word_is_no_noise():
    """It gets no word, and no sentence that calls it noise."""
    compared = compare(walk(1), walk(2, extra_db={3: -5.0}), same_modem=True)
    small = [cell for cell in compared.cells if cell.is_small_change]
    assert [(cell.cell, cell.word) for cell in small] == [(name(3), "same")]
    assert small[0].p < 0.05 / compared.n_tests
    assert "more than noise" in small[0].text
    assert all("within the noise" in c.text for c in compared.cells if c not in small)
