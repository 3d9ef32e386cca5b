"""The walks of a survey as a baseline for the logger (`logger.baseline_file`)."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from logger.baseline_store import FARTHEST_SIGMA_M, BaselineStore, WalkSummary, rows_by_square
from logger.core.baseline import squares_of
from logger.core.cell_names import FEWEST_SCANS, is_by_channel
from logger.core.places import Places, Utm
from logger.core.rows import rows_of_each
from postproc.survey.dataset import Survey
from postproc.survey.walk_readings import HeardCell, SurveyRun


def add_walks(survey: Survey, store: BaselineStore) -> Iterator[bool]:
    """Add each run as a walk, and yield whether it was new; positions are the smoothed ones.

    A cell counts where a scan of the run named it without doubt and two of the survey did.
    """
    known = {cell.cell for cell in survey.cells() if cell.n_scans >= FEWEST_SCANS}
    for batch in survey.batches:
        heard = survey.heard_in(batch)
        table = survey.batch_rows(batch)
        digests = table["run"].combine_chunks()
        names = digests.dictionary.to_pylist()
        for number, rows in rows_of_each(digests.indices.to_numpy()):
            digest = names[number]
            if digest in survey.runs:
                sure = {
                    one.cell: one
                    for one in heard[digest]
                    if one.n_scans and one.cell in known and not is_by_channel(one.cell)
                }
                walk = _summary(survey.runs[digest], sure, table.take(pa.array(rows)))
                yield store.add(walk, {survey.runs[digest].replaces}.__contains__) is not None


def _summary(run: SurveyRun, heard: Mapping[str, HeardCell], rows: pa.Table) -> WalkSummary:
    columns: dict[str, Any] = {
        name: rows[name].to_numpy()
        for name in ("zone", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq")
    }
    all_names = rows["cell"].to_numpy(zero_copy_only=False)
    usable = columns["position_sigma_m"] <= FARTHEST_SIGMA_M
    usable &= np.isin(all_names, list(heard))
    columns = {name: values[usable] for name, values in columns.items()}
    names, cell = np.unique(all_names[usable].astype(str), return_inverse=True)
    cells = names.tolist()
    zone = Utm(int(rows["zone"][0].as_py()))
    square = squares_of(Places.of(columns["x_m"], columns["y_m"], utm=zone).lat_lon_deg)
    by_square = rows_by_square(square, cell, columns["scan_seq"], columns["level_dbm"], cells)
    return WalkSummary(
        digest=run.digest,
        run_id=run.run_id,
        name=run.name,
        began_utc_ns=run.began_utc_ns,
        n_readings=len(cell),
        cells={name: heard[name].rat for name in cells},
        heard=by_square,
        visits=sorted({(row.square, heard[row.cell].rat) for row in by_square}),
        channels=sorted((name, *pair) for name in cells for pair in heard[name].channels),
        content=run.content,
        seal=run.digest,
        is_complete=run.is_complete,
        marks=run.marks,
        is_copy=run.is_copy,
    )
