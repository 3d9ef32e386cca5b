"""Recordings of runs with few records, of diverged filters and of unusual names."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.estimators.filters import FilterPath
from postproc.smoothing import smooth_runs
from postproc.view.scene import write_scene
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks, temporal_columns, times
from tests.kit.runs import meta
from tests.kit.sample_view import sample_view

CELL = f"/plan/cells/{kit.cell_name(0)}"


def write(path, records, **changes):
    writer = RunWriter(path, meta(**changes))
    for record in records:
        writer.append(record)
    writer.close(records[-1].t_ns if records else 0, "test")
    return read_run(path)


def scan(t_ns, *cids):
    cells = tuple(CellReading("scan", "GSM", "262", "01", 1, cid, rssi_dbm=-70.0) for cid in cids)
    return Record(t_ns, "modem", Scan(t_ns, cells, None))


FIX = Record(0, "gnss", Fix(True, None, 52.0, 13.0))


@pytest.mark.parametrize(
    "records",
    [
        [],
        [Record(0, "logger", Note("info", "start", "only a note"))],
        [scan(0, 1, 2), scan(10**9, 1)],
        [FIX],
        [FIX, scan(10, 1)],
        [FIX, Record(10, "modem", Scan(0, (), None))],
        [FIX, Record(10, "modem", Scan(0, (CellReading("serving", rssi_dbm=-60.0),), None))],
        [Record(0, "gnss", Fix(False)), scan(10, 1)],
    ],
    ids=[
        "nothing",
        "a note",
        "no fix",
        "only a fix",
        "one reading",
        "empty scan",
        "unknown cell",
        "invalid fix",
    ],
)
def test_runs_with_few_records(records, tmp_path):
    result = smooth_runs([write(tmp_path / "x.journal", records)])
    write_scene(sample_view(result), tmp_path / "x.rrd")
    entities = chunks(tmp_path / "x.rrd")
    assert any(entity.startswith("/report") for entity in entities)
    has_fix = any(isinstance(r.value, Fix) and r.value.valid for r in records)
    assert ("/plan/walker" in entities) == has_fix
    assert ("/plan/missing" in entities) != has_fix


def test_levels_without_any_fix(tmp_path):
    result = smooth_runs([write(tmp_path / "x.journal", [scan(0, 1, 2), scan(10**9, 1)])])
    write_scene(sample_view(result), tmp_path / "x.rrd")
    columns = temporal_columns(tmp_path / "x.rrd", "/rssi/262-01-1-1")
    assert times(columns, "elapsed").tolist() == [0, 10**9]
    assert "utc" not in columns


def test_a_diverged_filter_is_not_drawn(result, tmp_path):
    cell = result.cells[0]
    filtered = cell.reference
    lost = FilterPath(
        filtered.t_ns,
        filtered.x * np.nan,
        filtered.p * np.nan,
        *[filtered.innovation_db * np.nan] * 2,
    )
    away = FilterPath(
        filtered.t_ns, filtered.x * 1e30, filtered.p * 1e30, *[filtered.innovation_db] * 2
    )
    for odd in (lost, away):
        changed = replace(result, cells=(replace(cell, reference=odd, ekf=odd),))
        write_scene(sample_view(changed), tmp_path / "x.rrd")
        assert f"{CELL}/reference" not in chunks(tmp_path / "x.rrd")


def test_a_cell_name_may_contain_any_character(tmp_path):
    name = "a/b [c] *$é 漢"
    label = Record(10, "modem", Scan(0, (CellReading("scan", label=name, rssi_dbm=-60.0),), None))
    result = smooth_runs([write(tmp_path / "x.journal", [FIX, label])])
    write_scene(sample_view(result), tmp_path / "x.rrd")
    assert sum(entity.startswith("/rssi/") for entity in chunks(tmp_path / "x.rrd")) == 1


def test_missing_folder_is_one_line(view, tmp_path):
    with pytest.raises(RunFileError, match="no such folder"):
        write_scene(view, tmp_path / "absent" / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_of_the_same_name_is_one_line(view, tmp_path):
    (tmp_path / "x.rrd").mkdir()
    with pytest.raises(RunFileError, match="cannot write"):
        write_scene(view, tmp_path / "x.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["x.rrd"]
