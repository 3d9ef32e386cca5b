"""However long the walk, a recording stays within what the viewer can draw, and small."""

import numpy as np
import pyarrow.compute as pc
import pytest

from benchmarks.view import WALKS, walk
from logger.core.readings import observe
from postproc.estimators.filters import MOST_ROWS, FilterPath
from postproc.result import CellResult, ObservedRun, Result
from postproc.view.plan import MOST_POINTS, MOST_STRIPS, level_strips
from postproc.view.scene import MOST_DOTS, write_scene
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks
from tests.kit.sample_view import sample_view


def long_view(run):
    """Every cell with its readings, the first with a posterior and a filter path of full length."""
    observations = observe(*(run.tables[name] for name in ("fixes", "scans", "readings")))
    first, *others = observations.cells
    at = np.linspace(0, len(first) - 1, min(len(first), MOST_ROWS)).astype(int)
    x = np.column_stack(
        [first.x_m[at], first.y_m[at], np.full(len(at), -30.0), np.full(len(at), 3.0)]
    )
    filtered = FilterPath(
        first.t_ns[at], x, np.tile(np.eye(4), (len(at), 1, 1)), np.ones(len(at)), np.ones(len(at))
    )
    posterior = kit.sample_posterior(first)
    cells = [
        CellResult(
            first.cell, len(first), first, "located", (), posterior, filtered, filtered, filtered
        )
    ]
    cells += [CellResult(obs.cell, len(obs), obs, "cannot tell", ()) for obs in others]
    return sample_view(Result((ObservedRun(run, observations, ()),), tuple(cells)))


@pytest.mark.parametrize(("length", "most_mb"), [("1 h", 4.0), ("28 h", 60.0)])
def test_size(length, most_mb, tmp_path):
    write_scene(long_view(walk(*WALKS[length])), tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size < most_mb * 1e6
    if length == "28 h":
        check_bounds(tmp_path / "x.rrd")


def check_bounds(path):
    """No entity has more strips or points at one time than the viewer can draw."""
    n_dots = 0
    for parts in chunks(path).values():
        batches = [chunk.to_record_batch() for chunk in parts]
        for batch in batches:
            for name in batch.schema.names:
                longest = {":strips": MOST_STRIPS, ":positions": MOST_POINTS}.get(
                    name[name.rfind(":") :]
                )
                assert (
                    longest is None
                    or pc.max(pc.list_value_length(batch.column(name))).as_py() <= longest
                ), name
        if any(name.startswith("SeriesPoints") for batch in batches for name in batch.schema.names):
            n_dots += sum(chunk.num_rows for chunk in parts if not chunk.is_static)
    assert 0 < n_dots <= MOST_DOTS


def test_a_long_track_has_fewer_strips():
    t_ns = np.arange(20_001) * 10**9
    positions_m = np.column_stack([t_ns / 1e9, 0.0 * t_ns])
    strips, level_dbm = level_strips(t_ns, positions_m, -50.0 - t_ns / 1e12)
    assert len(strips) == len(level_dbm) == MOST_STRIPS
    assert strips[0][-1, 0] == strips[1][0, 0]
    assert strips[-1][-1, 0] == 20_000.0
    np.testing.assert_allclose(level_dbm[0], -50.002)


def test_silence_is_a_gap():
    t_ns = np.array([0, 1, 2, 100, 101]) * 10**9
    positions_m = np.column_stack([np.arange(5.0), np.zeros(5)])
    strips, _ = level_strips(t_ns, positions_m, np.zeros(5))
    assert [strip[:, 0].tolist() for strip in strips] == [[0, 1], [1, 2], [3, 4]]


def test_no_strip_leads_from_a_run_to_an_earlier_one():
    t_ns = np.array([100, 101, 0, 1]) * 10**9
    strips, _ = level_strips(t_ns, np.column_stack([np.arange(4.0), np.zeros(4)]), np.zeros(4))
    assert [strip[:, 0].tolist() for strip in strips] == [[0, 1], [2, 3]]


@pytest.mark.parametrize("count", [0, 1])
def test_one_reading_has_no_strip(count):
    strips, level_dbm = level_strips(
        np.zeros(count, np.int64), np.zeros((count, 2)), np.zeros(count)
    )
    assert (strips, len(level_dbm)) == ([], 0)
