"""How often the scans near a reading name its cell, and what that says about the path loss."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.places import Places
from logger.core.readings import LEAST_SHARE, NEAR_M, observe
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.world import Shadowing
from postproc.walk import Naming, named_shares, observe_run, with_named_shares
from tests.kit import runs

STEP_M = 4.0
FLOOR_DBM = -100.0


def _naming(*cells):
    """Rows of scans: for each cell whether the scans name it."""
    cell, scan = np.nonzero(np.array(cells, np.bool_))
    return Naming(cell, scan, np.zeros_like(cell))


def _brute_force(x_m, naming, row):
    """By the definition: lists of two cells and more, and the scans that name the cell."""
    near = np.abs(x_m - x_m[naming.scan[row]]) <= NEAR_M
    has_cell = np.isin(np.arange(len(x_m)), naming.scan[naming.cell == naming.cell[row]])
    is_list = np.bincount(naming.scan, minlength=len(x_m)) > 1
    return np.sum(near & has_cell) / np.sum(near & (has_cell | is_list))


def test_shares_are_those_of_the_definition():
    rng = np.random.default_rng(1)
    x_m = np.cumsum(rng.exponential(5.0, 300))
    naming = _naming(*(rng.random((6, 300)) < np.array([0.9, 0.6, 0.5, 0.3, 0.1, 0.05])[:, None]))
    found = named_shares(Places.of(x_m, np.zeros(300)), naming)
    assert found == pytest.approx([_brute_force(x_m, naming, k) for k in range(len(naming.cell))])
    assert found.min() < 0.1
    assert found.max() > 0.9


def test_a_scan_of_the_serving_cell_alone_says_nothing_beside_lists():
    n = 200
    served, listed = np.arange(n) % 2 == 0, np.arange(n) % 2 == 1
    naming = _naming(served | listed, listed, listed)
    assert np.all(named_shares(Places.of(np.arange(n) * STEP_M, np.zeros(n)), naming) == 1.0)


def test_without_lists_the_serving_cell_replaces_the_other():
    n = 400
    first = np.arange(n) < n // 2
    share = named_shares(Places.of(np.arange(n) * STEP_M, np.zeros(n)), _naming(first, ~first))
    assert share[0] == 1.0
    assert share[n // 2 - 1] == pytest.approx(0.5, abs=0.02)


def test_a_scan_of_another_technology_says_nothing():
    n = 100
    is_gsm = np.arange(n) % 2 == 0
    cell, scan = np.nonzero(np.array([is_gsm, is_gsm, ~is_gsm, ~is_gsm]))
    naming = Naming(cell, scan, (cell >= 2).astype(np.int64))
    assert np.all(named_shares(Places.of(np.arange(n) * STEP_M, np.zeros(n)), naming) == 1.0)


def _walk(tmp_path, *, every):
    """400 scans of 4 m; cell 1 in all of them, cell 2 in one of so many after the first half."""
    records = []
    for k in range(400):
        t_ns = k * 3 * 10**9
        lat_deg = 52.0 + k * STEP_M / 111_200.0
        cells = [1, 3] + [2] * (k < 200 or k % every == 0)
        readings = tuple(
            CellReading("neighbour", "GSM", "262", "01", 4711, cell, rssi_dbm=-60.0 - k / 10)
            for cell in cells
        )
        records.append(Record(t_ns, "gnss", Fix(True, None, lat_deg, 13.0, hdop=1.0)))
        records.append(Record(t_ns, "modem", Scan(t_ns, readings, 2 * k, 2 * k)))
    path = tmp_path / "walk.journal"
    runs.write_journal(path, records)
    return read_run(path)


def test_readings_of_a_run_count_where_nearly_all_scans_name_the_cell(tmp_path):
    run = _walk(tmp_path, every=4)
    cells = {obs.cell: obs for obs in observe_run(run).observations.cells}
    always, seldom = cells["262-01-4711-1"], cells["262-01-4711-2"]
    assert np.all(always.named_share == 1.0)
    assert len(always.usable()) == len(always)
    near_end = seldom.named_share[-1]
    assert near_end == pytest.approx(0.25, abs=0.03)
    kept = seldom.usable()
    assert len(kept) == np.count_nonzero(seldom.named_share >= LEAST_SHARE)
    # near scan k < 200, a quarter of the scans from 200 on names it
    reach = int(NEAR_M / STEP_M)
    share = [1.0 - 0.75 * max(k + reach - 199, 0) / (2 * reach + 1) for k in range(reach, 200)]
    expected = reach + np.count_nonzero(np.array(share) >= LEAST_SHARE)
    assert len(kept) == pytest.approx(expected, abs=2)
    assert kept.named_share is None
    assert len(kept.part(slice(0, 50)).usable()) == 50


def test_where_nothing_is_known_of_the_scans_all_readings_count(tmp_path):
    run = _walk(tmp_path, every=4)
    plain = observe(*(run.tables[name] for name in ("fixes", "scans", "readings")))
    assert all(len(obs.usable()) == len(obs) for obs in plain.cells)
    empty = replace(plain, cells=())
    assert with_named_shares(empty, run.tables["readings"]).cells == ()


def test_truncated_levels_bias_the_path_loss_less():
    """Of levels above a floor; the true exponent is 3.5."""
    rng = np.random.default_rng(7)
    x_m = 20.0 + np.arange(500) * STEP_M
    biases = []
    for _ in range(40):
        shadow_db = Shadowing.draw(6.0, 60.0, rng).at_db(x_m, np.zeros_like(x_m))
        level_dbm = 0.0 - 35.0 * np.log10(x_m) + shadow_db + rng.normal(0.0, 2.0, len(x_m))
        named = level_dbm >= FLOOR_DBM
        others = np.ones_like(named)
        share = named_shares(Places.of(x_m, np.zeros_like(x_m)), _naming(named, others, others))
        regular = share[: np.count_nonzero(named)] >= LEAST_SHARE
        slopes = [
            np.polyfit(np.log10(x_m[named][some]), level_dbm[named][some], 1)[0]
            for some in (slice(None), regular)
        ]
        biases.append(np.array(slopes) / -10.0 - 3.5)
    every, regular_only = np.mean(biases, axis=0)
    assert every < -0.4
    assert abs(regular_only) < 0.4 * abs(every)
