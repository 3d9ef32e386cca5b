"""The survey on one page that needs no network: coverage, cells, regions, and the unusual ones."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from logger.core.arrays import FloatArray, IntArray
from logger.core.document import Column, Table
from logger.core.errors import ConfigError
from logger.core.places import Utm
from logger.core.suspicion.rule import WORDS
from postproc.basemap.reading import read_basemap
from postproc.ground import Towns
from postproc.html_page import page_environment
from postproc.pictures.survey import Box, Clock, round_step
from postproc.pictures.survey import Survey as Frame
from postproc.survey.agreement import LoggerReport
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.location import CELL_COLUMNS, cell_row, word_text
from postproc.survey.tasks import RunChoice, runs_of

SQUARE_M = 50.0
"""Of the coverage: a side of a block of houses."""
_MOST_PIXELS = 1600
_WIDTH = 1200.0
_FALSE_EAST_M, _MIDDLE_SCALE = 500_000.0, 0.9996
"""Of a UTM zone."""
_EARTH_M = 6_371_000.0
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


class Walked(NamedTuple):
    """Squares of a town in which any cell was heard: column and row in its zone, shape (n, 2)."""

    utm: Utm
    square: IntArray

    @property
    def km2(self) -> float:
        """On the ground: a metre of the zone is shorter in its middle and longer at its borders."""
        east = ((self.square[:, 0] + 0.5) * SQUARE_M - _FALSE_EAST_M) / (_MIDDLE_SCALE * _EARTH_M)
        scale = _MIDDLE_SCALE * (1.0 + 0.5 * east**2)
        return float(np.sum(SQUARE_M**2 / scale**2)) / 1e6

    @property
    def box(self) -> Box:
        """What a plan shows."""
        return Box.around(np.asarray((self.square + 0.5) * SQUARE_M, float)).enlarge(5 * SQUARE_M)

    @property
    def centre_text(self) -> str:
        """Latitude and longitude of the middle."""
        box = self.box
        middle_m = 0.5 * (box.west + box.east), 0.5 * (box.south + box.north)
        lat_deg, lon_deg = self.utm.to_latlon(*middle_m)
        return (
            f"{abs(lat_deg):.2f}° {'N' if lat_deg >= 0.0 else 'S'}, "
            f"{abs(lon_deg):.2f}° {'E' if lon_deg >= 0.0 else 'W'}"
        )


class Plan(NamedTuple):
    """The picture of a town; `height` and `bar` are in its units, `ground` is a JPEG as base64."""

    walked: Walked
    coverage: str
    shapes: Sequence[Shape]
    height: float
    ground: str
    bar_m: float
    bar: float


def html(
    survey: Survey,
    cells: Sequence[LocatedCell],
    loggers: Sequence[LoggerReport],
    choice: RunChoice,
    basemap: Path | None,
) -> str:
    """The page; all text from runs is escaped. Raises `ConfigError` as `read_basemap`."""
    towns = walked_ground(survey, choice)
    grounds = _grounds(basemap, towns)
    numbered = dict(enumerate(cells, 1))
    plans = [_plan(town, numbered, ground) for town, ground in zip(towns, grounds, strict=True)]
    drawn = {shape.number for plan in plans for shape in plan.shapes}
    template = page_environment("postproc.survey.answers").get_template("survey.html")
    return template.render(
        n_runs=len(runs_of(survey, choice)),
        n_cells=len(cells),
        table=Table(
            [Column("no.", "d"), *CELL_COLUMNS],
            [(number, *cell_row(cell)) for number, cell in numbered.items()],
            "All cells",
            name_column=1,
        ),
        plans=plans,
        beyond=[n for n, cell in numbered.items() if cell.lat_deg is not None and n not in drawn],
        has_basemap=basemap is not None,
        unusual=[cell for cell in cells if unusual(cell)],
        why=unusual,
        liars=[one for one in loggers if one.contradiction],
        noted=[one for one in loggers if one.remark],
        km2=sum(town.km2 for town in towns),
        width=_WIDTH,
    )


def _plan(walked: Walked, cells: Mapping[int, LocatedCell], ground: str) -> Plan:
    box = walked.box
    scale = _WIDTH / box.width
    bar_m = round_step(box.width, _SCALE_PARTS)
    shapes = [_shape(number, cell, walked.utm, box, scale) for number, cell in cells.items()]
    return Plan(
        walked,
        _coverage(walked.square, box, scale),
        [shape for shape in shapes if shape is not None],
        box.height * scale,
        ground,
        bar_m,
        bar_m * scale,
    )


def unusual(cell: LocatedCell) -> str:
    """Why a cell is worth a look; empty where nothing is."""
    if cell.two_sources is not None and cell.two_sources > _UNUSUAL_LOG_FACTOR:
        return "two transmitters explain its levels better than one"
    if cell.moved is not None and cell.moved > _UNUSUAL_LOG_FACTOR:
        return "its transmitter seems to have moved"
    if cell.n_places > 1:
        return f"its identity is heard in {cell.n_places} places, farther apart than a cell reaches"
    return "" if cell.word in {None, WORDS[0]} else word_text(cell)


def walked_ground(survey: Survey, choice: RunChoice) -> list[Walked]:
    """The ground on which any cell was heard, town by town, the largest first."""
    runs = runs_of(survey, choice)
    towns = Towns(survey.ground(runs))
    found: list[list[IntArray]] = [[] for _ in towns.zones]
    for ground in survey.ground(runs):
        town, x_m, y_m = towns.place(ground)
        square = np.floor(np.column_stack([x_m, y_m]) / SQUARE_M).astype(np.int64)
        for number, own in enumerate(found):
            own.append(np.unique(square[town == number], axis=0))
    return [
        Walked(utm, np.unique(np.concatenate(own), axis=0))
        for utm, own in zip(towns.zones, found, strict=True)
    ]


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


def _grounds(basemap: Path | None, towns: Sequence[Walked]) -> list[str]:
    """Pictures of the ground as base64, empty where there is none of a town.

    Raises `ConfigError` where a file has none of any town.
    """
    if basemap is None:
        return [""] * len(towns)
    found, errors = [], []
    for town in towns:
        frame = Frame((), Clock(np.zeros(1, np.int64), (None,)), town.utm, (0.0, 0.0), ())
        try:
            ground = read_basemap(basemap, frame, town.box, _MOST_PIXELS)
        except ConfigError as error:
            ground = None
            errors.append(error)
        jpeg = b"" if ground is None else ground.jpeg((255, 255, 255), 0.7)
        found.append(b64encode(jpeg).decode())
    if errors and not any(found):
        raise errors[0]
    return found
