"""What one walk contributes to a baseline: its cells and their levels by square."""

from dataclasses import dataclass
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from logger.baseline_file import SCALE, UNKNOWN
from logger.core.arrays import BoolArray, FloatArray, IntArray
from logger.core.censoring import levels_dbm
from logger.core.column import UNKNOWN_ID, UNKNOWN_TIME
from logger.core.places import track_of
from logger.core.provenance import is_import
from logger.core.readings import places_of
from logger.core.rows import Rows
from logger.core.runfile import Run
from logger.core.squares import SQUARE_M, squares_of

FARTHEST_SIGMA_M = SQUARE_M / 2.0
"""A reading whose position is less sure than this belongs to no square."""


class HeardRow(NamedTuple):
    """A cell in a square: scans, strongest level, and sums of the levels in 0.01 dB."""

    square: int
    cell: str
    n_scans: int
    best_dbm: float
    sum_level: int
    sum_squares: int


@dataclass(frozen=True, slots=True)
class WalkSummary:
    """A walk by square.

    `digest` says which walk it is, in whatever file (`walk_digest`); `content` is the digest of its
    content, `seal` what it was sealed with. `is_complete` is false of a run that was cut or that
    lacks frames, of which there may be more. `cells` has
    the technology of each cell. `visits` are the squares in which cells of a technology were named.
    `channels` are (cell, channel number, code), `UNKNOWN` where it was not printed. `began_utc_ns`
    is None if no fix had a time.
    """

    digest: str
    run_id: str
    name: str
    began_utc_ns: int | None
    n_readings: int
    cells: dict[str, str]
    heard: list[HeardRow]
    visits: list[tuple[int, str]]
    channels: list[tuple[str, int, int]]
    content: str = ""
    seal: str = ""
    is_complete: bool = True

    @property
    def n_squares(self) -> int:
        """Number of squares in which a cell was heard."""
        return len({square for square, _ in self.visits})


def summarise_walk(run: Run) -> WalkSummary:
    """Cells and levels of a run by square.

    A reading counts if its cell is named without doubt and has a level and a position. Of several
    readings of a cell in one scan the strongest counts. Raises as `track_of` for a run without a
    position.
    """
    fixes, readings = run.tables["fixes"], run.tables["readings"]
    squares, usable = _squares(fixes, run.tables["scans"], readings)
    rows, square = readings[usable], squares[usable]
    names, cell = np.unique(rows["cell"], return_inverse=True)
    first = np.unique(cell, return_index=True)[1]
    cells = [_text(name) for name in names]
    rats = [_text(rat) for rat in rows["rat"][first]]
    times = fixes["utc_ns"][fixes["utc_ns"] != UNKNOWN_TIME]
    return WalkSummary(
        digest=walk_digest(run),
        run_id=run.meta.run_id,
        name=run.path.name,
        began_utc_ns=int(times[0]) if len(times) else None,
        n_readings=len(rows),
        cells=dict(zip(cells, rats, strict=True)),
        heard=rows_by_square(square, cell, rows["seq"], levels_dbm(rows), cells),
        visits=sorted({(int(s), rats[c]) for s, c in set(zip(square.tolist(), cell, strict=True))}),
        channels=_channels(rows, cell, cells),
        content=content_digest(fixes, readings),
        seal=run.end.digest if run.end else "",
        is_complete=run.is_complete,
    )


def walk_digest(run: Run) -> str:
    """Which walk a run is: the digest of its hash chain, or of its content.

    Content identifies an import, since of two imports of one source the chains differ, and a run
    that lacks frames of what was sealed. It identifies no other run: a copy that differs in what
    the digest of the content leaves out would be taken for it.
    """
    is_part = run.end is not None and not run.is_complete
    if is_import(run.meta.origin) or is_part or not run.digest:
        return content_digest(run.tables["fixes"], run.tables["readings"])
    return run.digest


def content_digest(fixes: Rows, readings: Rows) -> str:
    """SHA-256 of the times, positions, names and levels of a walk.

    It does not depend on the file: a journal, the HDF5 file made of it and a second import of the
    same source have the same one.
    """
    state = sha256()
    for values in (fixes["t_ns"], fixes["lat_deg"], fixes["lon_deg"], readings["t_ns"]):
        state.update(len(values).to_bytes(8, "little"))
        state.update(np.ascontiguousarray(values).tobytes())
    for values in (readings["cell"], levels_dbm(readings)):
        state.update(np.ascontiguousarray(values).tobytes())
    return state.hexdigest()


def _squares(fixes: Rows, scans: Rows, readings: Rows) -> tuple[IntArray, BoolArray]:
    """Square of each reading, shape (n,), and which readings are usable."""
    track = track_of(fixes)
    places, is_known = places_of(track, scans, readings)
    is_sure = places.sigma_m <= FARTHEST_SIGMA_M
    is_named = (readings["cell"] != b"") & (readings["identity_unsure"] == 0)
    usable = is_known & is_sure & is_named & np.isfinite(levels_dbm(readings))
    squares = squares_of(places.lat_lon_deg)
    return squares, usable


def rows_by_square(
    square: IntArray, cell: IntArray, scan: IntArray, level_dbm: FloatArray, cells: list[str]
) -> list[HeardRow]:
    """Sums of each cell in each square; arrays of shape (n,), `cell` the number in `cells`."""
    # the strongest reading of a cell in a scan comes first among its equals
    order = np.lexsort((-level_dbm, scan, cell, square))
    square, cell, scan, level_dbm = square[order], cell[order], scan[order], level_dbm[order]
    same_group = (np.diff(square) == 0) & (np.diff(cell) == 0)
    is_first = np.concatenate([[True], ~(same_group & (np.diff(scan) == 0))])[: len(square)]
    square, cell, level_dbm = square[is_first], cell[is_first], level_dbm[is_first]
    if not len(square):
        return []
    changes = (np.diff(square) != 0) | (np.diff(cell) != 0)
    begin = np.flatnonzero(np.concatenate([[True], changes]))
    scaled = np.round(SCALE * level_dbm).astype(np.int64)
    columns = (
        square[begin],
        cell[begin],
        np.diff(np.append(begin, len(square))),
        np.maximum.reduceat(level_dbm, begin),
        np.add.reduceat(scaled, begin),
        np.add.reduceat(scaled**2, begin),
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [HeardRow(row[0], cells[row[1]], *row[2:]) for row in rows]


def _channels(rows: Rows, cell: IntArray, cells: list[str]) -> list[tuple[str, int, int]]:
    code = np.full(len(rows), UNKNOWN, np.int64)
    for name in ("pci", "psc", "bsic"):  # a technology has one of them
        code = np.where(rows[name] == UNKNOWN_ID, code, rows[name])
    channel = np.where(rows["arfcn"] == UNKNOWN_ID, UNKNOWN, rows["arfcn"])
    seen = set(zip(cell.tolist(), channel.tolist(), code.tolist(), strict=True))
    return sorted((cells[c], number, k) for c, number, k in seen if (number, k) != (UNKNOWN,) * 2)


def _text(stored: bytes) -> str:
    return stored.decode("utf-8", "replace")
