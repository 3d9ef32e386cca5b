"""The survey on one page that needs no network: coverage, cells, regions, and the unusual ones."""

from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from logger.core.answer import CONSPICUOUS, to_do_about
from logger.core.arrays import FloatArray, IntArray
from logger.core.certainty import metres
from logger.core.document import Column, Table, Word
from logger.core.errors import ConfigError
from logger.core.places import Places, Utm
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import WORD_RATES, word_rate_text
from postproc.basemap import read_basemap
from postproc.ground import Towns, place_name
from postproc.html_page import page_environment
from postproc.notebook_plan import length_text, round_step
from postproc.pictures.survey import Box, Clock
from postproc.pictures.survey import Survey as Frame
from postproc.result import VERDICTS
from postproc.summary import sentence
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.location import CELL_COLUMNS, Location, cell_row
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
_INSET_AREA = 0.05
"""A region that takes less of the plan is drawn larger beside it."""
_LEAST_INSET_M = 60.0
_MOST_LABELS = 40
"""Cells without a word on a plan that has their numbers too."""
_MOST_ODD = 8
"""Cells with a word that a page shows before they are folded."""


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
        return place_name(Places.of(*self.box.middle_m, utm=self.utm).on_map)


class Plan(NamedTuple):
    """The picture of a town; `height` and `bar` are in its units, `ground` is a JPEG as base64.

    `inset` is what is drawn larger, None where nothing is.
    """

    walked: Walked
    coverage: str
    shapes: Sequence[Shape]
    height: float
    ground: str
    bar_m: float
    bar: float
    inset: Box | None

    @property
    def inset_view(self) -> str:
        """The inset as a view box of the picture."""
        if self.inset is None:
            return ""
        box, inset = self.walked.box, self.inset
        view_m = inset.west - box.west, box.north - inset.north, inset.width, inset.height
        # with commas: spaces in a text of a page may become such as no line ends at
        return ",".join(f"{part_m * _WIDTH / box.width:.2f}" for part_m in view_m)


def html(survey: Survey, location: Location, choice: RunChoice, basemap: Path | None) -> str:
    """The page; all text from runs is escaped. Raises `ConfigError` as `read_basemap`."""
    cells, loggers = location.cells, location.loggers
    towns = walked_ground(survey, choice)
    grounds = _grounds(basemap, towns)
    ordered = sorted(cells, key=_rank)
    numbered = dict(enumerate(ordered, 1))
    plans = [_plan(town, numbered, ground) for town, ground in zip(towns, grounds, strict=True)]
    plans.sort(key=lambda plan: min((shape.number for shape in plan.shapes), default=len(cells)))
    plan_of = {shape.number: k for k, plan in enumerate(plans, 1) for shape in plan.shapes}
    odd = [number for number, cell in numbered.items() if word_of(cell)]
    counts = Counter(map(word_of, ordered))
    environment = page_environment("postproc.survey.answers")
    environment.filters |= {"length_text": length_text, "metres": metres, "sentence": sentence}
    environment.globals |= {"word_of": word_of, "reasons_of": reasons_of}
    template = environment.get_template("survey.html")
    shown, few, unsure = (
        _table(dict(group), label)
        for group, label in (
            ([one for one in numbered.items() if not _is_few(one[1]) and not _is_unsure(one[1])],
             "Cells with a position"),
            ([one for one in numbered.items() if _is_few(one[1])], "Cells of few readings"),
            ([one for one in numbered.items() if _is_unsure(one[1])], "Cells that stay open"),
        )
    )  # fmt: skip
    return template.render(
        n_runs=len(runs_of(survey, choice)),
        heading=_heading(counts),
        asked=any(cell.word for cell in cells),
        counts=Counter(cell.verdict for cell in cells),
        n_cells=len(cells),
        tables=(shown, unsure, few),
        plans=plans,
        plan_of=plan_of,
        beyond=[n for n, cell in numbered.items() if cell.lat_deg is not None and n not in plan_of],
        has_basemap=basemap is not None,
        cells=numbered,
        odd=odd,
        most_odd=_MOST_ODD,
        most_labels=_MOST_LABELS,
        harmless=_harmless(numbered[odd[0]]) if odd else (),
        rate=_rate(numbered[odd[0]]) if odd else "",
        unnoticed=location.unnoticed,
        to_do_about=to_do_about,
        liars=[one for one in loggers if one.contradiction],
        noted=[one for one in loggers if one.remark],
        km2=sum(town.km2 for town in towns),
        width=_WIDTH,
    )


def _heading(counts: Mapping[str, int]) -> str:
    named = [
        f"{counts[word]} {'cell is' if counts[word] == 1 else 'cells are'} {word}"
        for word in CONSPICUOUS
        if counts[word]
    ]
    if not counts["suspicious"]:
        named.insert(0, "No cell is suspicious")
    return ", ".join(named)


def _rank(cell: LocatedCell) -> tuple[int, int, int, bool, float, str]:
    """Suspicious cells first, those that most runs call so; then by verdict and radius."""
    word = word_of(cell)
    by_word = CONSPICUOUS.index(word) if word else len(CONSPICUOUS)
    radius_m = cell.r95_m or 0.0
    return (
        by_word,
        -cell.word_runs,
        VERDICTS.index(cell.verdict),
        _is_few(cell),
        radius_m,
        cell.cell,
    )


def _is_few(cell: LocatedCell) -> bool:
    """Whether so little was heard of it that nothing was computed, and nothing is odd about it."""
    return not cell.n_used and not word_of(cell)


def _is_unsure(cell: LocatedCell) -> bool:
    """Whether more walks are needed to locate it, and nothing is odd about it."""
    return bool(cell.n_used) and cell.verdict == "cannot tell" and not word_of(cell)


def _table(cells: Mapping[int, LocatedCell], label: str) -> Table:
    name, *others = CELL_COLUMNS
    rows = []
    for number, cell in cells.items():
        shown, *values = cell_row(cell)
        rows.append((number, shown, Word(word_of(cell)), *values))
    return Table([Column("no.", "d"), name, Column("word"), *others], rows, label, name_column=1)


def _rate(cell: LocatedCell) -> str:
    return word_rate_text(cell.word) if cell.word and cell.word in WORD_RATES else ""


def _harmless(cell: LocatedCell) -> tuple[str, ...]:
    causes = ", ".join(RULES[rule].harmless for rule in cell.word_rules if rule in RULES)
    return tuple(dict.fromkeys(filter(None, causes.split(", "))))


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
        _inset([shape for shape in shapes if shape is not None], box, scale),
    )


def _inset(shapes: Sequence[Shape], box: Box, scale: float) -> Box | None:
    first = min((shape for shape in shapes if shape.kind), default=None)
    if first is None or first.cell.r95_m is None or first.cell.verdict == "cannot tell":
        return None
    diameter_m = 2.0 * first.cell.r95_m
    if diameter_m**2 >= _INSET_AREA * box.width * box.height:
        return None
    x_m, y_m = box.west + first.x / scale, box.north - first.y / scale
    half_m = 0.5 * max(1.6 * diameter_m, _LEAST_INSET_M)
    return Box(x_m, y_m, x_m, y_m).enlarge(half_m)


def reasons_of(cell: LocatedCell) -> tuple[str, ...]:
    """Why a cell is worth a look; none where nothing is."""
    reasons = list(cell.word_reasons) if cell.word in CONSPICUOUS else []
    if cell.word in CONSPICUOUS and not reasons:
        reasons = [f"rules {', '.join(cell.word_rules)}"]
    if cell.two_sources is not None and cell.two_sources > _UNUSUAL_LOG_FACTOR:
        reasons.append("two transmitters explain its levels better than one")
    if cell.moved is not None and cell.moved > _UNUSUAL_LOG_FACTOR:
        reasons.append("its transmitter seems to have moved")
    return tuple(reasons)


def word_of(cell: LocatedCell) -> str:
    """Its word, empty for a cell about which nothing is unusual."""
    if cell.word in CONSPICUOUS:
        return str(cell.word)
    return "unusual" if reasons_of(cell) else ""


def walked_ground(survey: Survey, choice: RunChoice) -> list[Walked]:
    """The ground on which any cell was heard, town by town, the largest first."""
    runs = runs_of(survey, choice)
    towns = Towns(survey.ground(runs))
    found: list[list[IntArray]] = [[] for _ in towns.zones]
    for ground in survey.ground(runs):
        town, at = towns.place(ground)
        square = np.floor(np.column_stack([at.x_m, at.y_m]) / SQUARE_M).astype(np.int64)
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
    if not box.contains(np.array([x_m, y_m])):
        return None
    kind = word_of(cell)
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
        frame = Frame((), Clock(np.zeros(1, np.int64), (None,)), town.utm, np.zeros(2), ())
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
