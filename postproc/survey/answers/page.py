"""The survey on one page that needs no network: coverage, cells, regions, and the unusual ones."""

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from logger.core.arrays import FloatArray, IntArray
from logger.core.geo import Utm
from logger.core.suspicion.finding import WORDS
from postproc.basemap.reading import read_basemap
from postproc.html_page import page_environment
from postproc.pictures.clock import Clock
from postproc.pictures.geometry import Box, round_step
from postproc.pictures.survey import Survey as Frame
from postproc.survey.agreement import LoggerReport
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.tables import word_text
from postproc.survey.tasks import RunChoice, runs_of

SQUARE_M = 50.0
"""Of the coverage: a side of a block of houses."""
_MOST_PIXELS = 1600
_WIDTH = 1200.0
_SCALE_PARTS = 8
"""The scale bar is about one of so many of the width."""
_UNUSUAL_LOG_FACTOR = 4.0
"""Two transmitters this much likelier than one, as the verdict has it."""
_CLASSES = {"located": "located", "ambiguous": "ambiguous", "cannot tell": "unsure"}


class Shape(NamedTuple):
    """A cell on the plan: place in units of the picture, and the path of its region."""

    number: int
    cell: LocatedCell
    kind: str
    x: float
    y: float
    path: str


def html(
    survey: Survey,
    cells: Sequence[LocatedCell],
    loggers: Sequence[LoggerReport],
    choice: RunChoice,
    basemap: Path | None,
) -> str:
    """The page; all text from runs is escaped."""
    utm = Utm(survey.zone)
    walked = walked_squares(survey, choice, utm)
    centre_m = np.asarray((walked + 0.5) * SQUARE_M, float)
    box = Box.around(centre_m).enlarge(5 * SQUARE_M) if len(walked) else Box(0.0, 0.0, 1.0, 1.0)
    scale = _WIDTH / box.width
    bar_m = round_step(box.width, _SCALE_PARTS)
    shapes = [
        shape
        for number, cell in enumerate(cells, 1)
        if (shape := _shape(number, cell, utm, box, scale)) is not None
    ]
    template = page_environment("postproc.survey.answers").get_template("survey.html")
    return template.render(
        n_runs=len(runs_of(survey, choice)),
        cells=cells,
        shapes=shapes,
        unusual=[cell for cell in cells if unusual(cell)],
        why=unusual,
        liars=[one for one in loggers if one.contradiction],
        noted=[one for one in loggers if one.remark],
        walked=_coverage(walked, box, scale),
        km2=len(walked) * SQUARE_M**2 / 1e6,
        width=_WIDTH,
        height=box.height * scale,
        ground=_ground(basemap, box, utm),
        bar_m=bar_m,
        bar=bar_m * scale,
    )  # fmt: skip


def unusual(cell: LocatedCell) -> str:
    """Why a cell is worth a look; empty where nothing is."""
    if cell.two_sources is not None and cell.two_sources > _UNUSUAL_LOG_FACTOR:
        return "two transmitters explain its levels better than one"
    if cell.moved is not None and cell.moved > _UNUSUAL_LOG_FACTOR:
        return "its transmitter seems to have moved"
    if any("farther than" in reason and "identity" in reason for reason in cell.reasons):
        return "heard far away too"
    return "" if cell.word in {None, WORDS[0]} else word_text(cell)


def walked_squares(survey: Survey, choice: RunChoice, utm: Utm) -> IntArray:
    """Column and row of each square in which any cell was heard, shape (n, 2)."""
    allowed = set(runs_of(survey, choice))
    found = []
    for batch in survey.batches:
        rows = survey.batch_rows(batch, ["run", "zone", "x_m", "y_m"])
        runs = rows["run"].combine_chunks()
        is_allowed = np.array([name in allowed for name in runs.dictionary.to_pylist()], bool)
        same_zone = rows["zone"].to_numpy() == utm.zone
        keep = same_zone & is_allowed[runs.indices.to_numpy()] if len(rows) else same_zone
        xy_m = np.column_stack([rows[name].to_numpy()[keep] for name in ("x_m", "y_m")])
        found.append(np.unique(np.floor(xy_m / SQUARE_M).astype(np.int64), axis=0))
    return np.unique(np.concatenate(found), axis=0) if found else np.zeros((0, 2), np.int64)


def _coverage(walked: IntArray, box: Box, scale: float) -> str:
    """Path of the squares (n, 2): a rectangle for neighbours in a row, since a city has 10^5."""
    if not len(walked):
        return ""
    x, y = walked[np.lexsort((walked[:, 0], walked[:, 1]))].T
    begins = np.flatnonzero(np.append(True, (np.diff(x) != 1) | (np.diff(y) != 0)))
    n = np.diff(np.append(begins, len(x)))
    side = SQUARE_M * scale
    west = (x[begins] * SQUARE_M - box.west) * scale
    north = (box.north - (y[begins] + 1) * SQUARE_M) * scale
    return "".join(
        f"M{left:.1f} {top:.1f}h{width:.1f}v{side:.1f}h-{width:.1f}z"
        for left, top, width in zip(west.tolist(), north.tolist(), (n * side).tolist(), strict=True)
    )


def _shape(number: int, cell: LocatedCell, utm: Utm, box: Box, scale: float) -> Shape | None:
    if cell.lat_deg is None or cell.lon_deg is None:
        return None
    x_m, y_m = utm.to_xy(cell.lat_deg, cell.lon_deg)
    if not (box.west <= x_m <= box.east and box.south <= y_m <= box.north):
        return None
    kind = "odd" if unusual(cell) else _CLASSES[cell.verdict]
    path = ""
    if cell.verdict != "cannot tell":
        path = " ".join(
            _ring(np.asarray(part.exterior.coords), utm, box, scale)
            for part in shapely.get_parts(shapely.from_wkb(cell.region_wkb))
        )
    return Shape(number, cell, kind, (x_m - box.west) * scale, (box.north - y_m) * scale, path)


def _ring(lonlat: FloatArray, utm: Utm, box: Box, scale: float) -> str:
    x_m, y_m = utm.to_xy_arrays(lonlat[:, 1], lonlat[:, 0])
    at = np.column_stack([(x_m - box.west) * scale, (box.north - y_m) * scale])
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in at.tolist()) + "Z"


def _ground(basemap: Path | None, box: Box, utm: Utm) -> str:
    """The picture of the ground as base64, empty without a file."""
    if basemap is None:
        return ""
    frame = Frame((), Clock(np.zeros(1, np.int64), (None,)), utm, (0.0, 0.0), ())
    ground = read_basemap(basemap, frame, box, _MOST_PIXELS)
    return "" if ground is None else b64encode(ground.jpeg((255, 255, 255), 0.7)).decode()
