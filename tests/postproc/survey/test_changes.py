"""`survey diff` of two months of a city between which cells came, went and moved."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from benchmarks.synthetic_city.walks import draw_walk, draw_walkers
from benchmarks.synthetic_city.world import ORIGIN_M, draw_city
from postproc.cli import main
from postproc.survey.dataset import Survey
from postproc.survey.parquet_batch import Batch

SEED, SILENT_DBM = 4, -300.0
SMALL_DBM = -36.0
"""At 1 m, of a cell that is heard up to some 200 m."""
WALKS, SCANS = 10, 300
LATE = 100
"""Number of the first walk of the second month: ten days after the first one."""


def _west_of(walk, east_m):
    """The part of a walk that is not farther east."""
    keep = walk.x_m < ORIGIN_M[0] + east_m
    columns = {
        one.name: getattr(walk, one.name)[keep]
        for one in fields(walk)
        if isinstance(getattr(walk, one.name), np.ndarray)
    }
    return replace(walk, **columns)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The second month leaves out the east, where a small cell is gone too."""
    city = draw_city(16, SEED, spacing_m=300.0)
    by_east = np.argsort(city.position_m[:, 0]).tolist()
    gone, moved, new, gone_in_the_east = by_east[1], by_east[2], by_east[4], by_east[-1]
    city.p0_dbm[gone_in_the_east] = SMALL_DBM
    limit_m = 0.6 * city.size_m

    def with_power(which, power_dbm, where):
        p0_dbm = city.p0_dbm.copy()
        p0_dbm[which] = power_dbm
        return replace(city, p0_dbm=p0_dbm, position_m=where)

    there_m = city.position_m.copy()
    there_m[moved] += (0.0, 500.0 if there_m[moved, 1] < city.size_m / 2 else -500.0)
    before = with_power([new], SILENT_DBM, city.position_m)
    after = with_power([gone, gone_in_the_east], SILENT_DBM, there_m)
    walkers = draw_walkers(4, SEED)
    batch = Batch()
    for k in range(WALKS):
        batch.take(draw_walk(before, walkers[k % 4], k, SCANS, SEED))
        late = draw_walk(after, walkers[k % 4], LATE + k, SCANS, SEED)
        batch.take(_west_of(late, limit_m))
    survey = Survey.open_or_make(tmp_path_factory.mktemp("city") / "s")
    batch.write(survey.folder, "000001")
    names = {"gone": gone, "moved": moved, "new": new, "in the east": gone_in_the_east}
    return survey.folder, {city.names[number]: word for word, number in names.items()}


@pytest.fixture
def changes(folder, scheduler, capsys):
    arguments = ["--before", "2026-09-28", "--scheduler", scheduler, "--json"]
    assert main(["survey", "diff", str(folder[0]), *arguments]) == 0
    return {one["cell"]: one for one in json.loads(capsys.readouterr().out)["cells"]}


def test_changes_are_named_and_nothing_else(folder, changes):
    words = {name: one["word"] for name, one in changes.items()}
    injected = folder[1]
    found = {injected.get(name, name): word for name, word in words.items()
             if word not in {"same", "not comparable"}}  # fmt: skip
    assert found == {"gone": "gone", "moved": "moved", "new": "new"}


def test_nothing_is_gone_where_nobody_walked(folder, changes):
    (name,) = [name for name, word in folder[1].items() if word == "in the east"]
    assert changes[name]["word"] == "not comparable"
