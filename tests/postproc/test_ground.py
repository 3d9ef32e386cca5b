"""Which runs are of one place."""

import pytest

from logger.core.certainty import OnMap
from logger.core.errors import GeoError
from logger.core.runfile import read_run
from logger.core.types import Record, Scan
from postproc.ground import Group, by_place, check_one_place
from tests.kit import runs
from tests.postproc.baseline.walks import cell, name, write_walk

KM_DEG = 1.0 / 111.2
"""Of latitude."""


def walks(folder, *north_km_and_cell, n=12):
    """Runs, each so far north of the first with readings of one cell."""
    return [
        read_run(
            write_walk(folder, k, lambda _, cid=cid: [cell(cid, -70.0)], n=n,
                       lat_deg=47.0 + km * KM_DEG, finish=False)
        )
        for k, (km, cid) in enumerate(north_km_and_cell)
    ]  # fmt: skip


def numbers(groups):
    return [[int(run.meta.run_id, 16) for run in group.runs] for group in groups]


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ([(0, 1), (20, 2), (40, 3)], [[0, 1, 2]]),  # each near the next
        ([(0, 1), (60, 2), (10, 3)], [[0, 2], [1]]),
        ([(0, 1), (60, 1), (120, 2)], [[0, 1], [2]]),  # a cell that both may hear
        ([(0, 1), (200, 1)], [[0, 1]]),
        ([(0, 1), (260, 1)], [[0], [1]]),  # farther than any cell reaches
        ([(0, 1), (200, 1), (400, 1)], [[0, 1, 2]]),
    ],
)
def test_ground_and_cells_join_runs(tmp_path, where, expected):
    groups = by_place(walks(tmp_path, *where))
    assert numbers(groups) == expected
    has_far = len({cid for _, cid in where}) == 1 and len(groups) > 1
    assert [list(group.several) for group in groups] == [[name(1)] * has_far] * len(groups)


def test_a_name_read_once_is_no_cell_in_another_place(tmp_path):
    for n, several in ((1, []), (2, [name(1)])):
        for folder in (near := tmp_path / f"near{n}", far := tmp_path / f"far{n}"):
            folder.mkdir()
        groups = by_place([*walks(near, (0, 1)), *walks(far, (0, 2), (300, 1), n=n)])
        assert [list(group.several) for group in groups] == [several, several]


def test_runs_without_a_position(tmp_path):
    placed = walks(tmp_path, (0, 1), (500, 2))
    lost = tmp_path / "lost.journal"
    runs.write_journal(
        lost, [Record(1, "modem", Scan(0, (runs.reading(1, -70.0),)))], run_id="f" * 32
    )
    everything = [read_run(lost), *placed]
    assert [len(by_place(some)) for some in (everything[:1], everything[:2], everything)] == [
        1,
        1,
        3,
    ]
    assert [group.name for group in by_place(everything)] == [
        "47.00° N, 13.40° E", "51.50° N, 13.40° E", "without a position",
    ]  # fmt: skip
    check_one_place(everything[:2])
    with pytest.raises(GeoError, match="3 places"):
        check_one_place(everything)


def test_names_are_words_and_parts_of_file_names():
    group = Group((), OnMap(lat=-12.046, lon=-77.043))
    assert (group.name, group.file_name) == ("12.05° S, 77.04° W", "12.05S-77.04W")
