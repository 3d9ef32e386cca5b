"""Ground far from other ground: groups of runs, towns of a survey, places of one identity.

Readings are stored in the UTM zone of the first fix of their run. A town has one zone, that of its
middle, in which all its readings are placed: ground on both sides of a border between zones is one
ground, and none of it counts twice. Distances are through the Earth, so that no meridian, equator
or pole is a border.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import atan2, degrees, hypot
from typing import NamedTuple, TypeVar

import numpy as np

from logger.core.arrays import FloatArray, IntArray
from logger.core.cell_names import FEWEST_SCANS, REUSED_M, identity_of, is_by_channel
from logger.core.certainty import OnMap
from logger.core.document import Document, Line, Part, number_of
from logger.core.errors import ConfigError, EstimationError, GeoError
from logger.core.model.area import Area
from logger.core.places import MAX_LATITUDE_DEG, Places, Track, Utm, track_of
from logger.core.readings import CELL_REACH_M, Readings
from logger.core.readings import places_of as at_readings
from logger.core.rows import numbered_texts, rows_of_each
from logger.core.runfile import Run
from logger.core.timebase import utc_clock
from logger.core.types import known_utc_text
from postproc.scan_counts import check_observed, heard_utc_ns

_TILE_M = 5000.0
"""Readings are first taken together in squares of their own zone: a city has some hundred."""
_APART_M = 25_000.0
"""Between two towns: one picture of both would show little but the way between them."""
_LARGEST_M = 300_000.0
"""Of a town: farther from its middle a zone distorts. What is larger is divided."""
_SIDE_BY_SIDE_M, _IN_A_ROW = 1e6, 90
"""Of towns in one plane. 8000 fit: coordinates of `Readings` end at 1e8 m."""
_EARTH_M = 6_371_000.0
"""Of a sphere: true to 0.6 %, enough to tell which positions are in one place."""
_OFFSET, _STRIDE = 1 << 19, 1 << 20
Key = TypeVar("Key")


class Ground(NamedTuple):
    """Some positions (n,): east and north in a UTM zone each, negative in the south."""

    zone: IntArray
    x_m: FloatArray
    y_m: FloatArray


def place_numbers(lat_lon_deg: FloatArray, apart_m: float) -> IntArray:
    """Number (n,) of the place of each position (2, n); those nearer than `apart_m` share one."""
    point_m = _points_m(lat_lon_deg)
    if not len(point_m) or np.linalg.norm(np.ptp(point_m, axis=0)) < apart_m:
        return np.zeros(len(point_m), np.int64)
    from scipy.spatial import cKDTree  # noqa: PLC0415 (0.2 s; for far places only)

    pairs = cKDTree(point_m).query_pairs(apart_m, output_type="ndarray")
    return _components(pairs.T, len(point_m))


def _components(links: IntArray, n: int) -> IntArray:
    """Number of the component of each of `n` things, which links (2, m) join."""
    from scipy.sparse import coo_array, csgraph  # noqa: PLC0415 (as above)

    matrix = coo_array((np.ones(links.shape[1]), links), shape=(n, n))
    return np.asarray(csgraph.connected_components(matrix, directed=False)[1], np.int64)


def places_of(parts: Mapping[Key, Readings]) -> list[dict[Key, Readings]]:
    """Readings of one identity by their run, where one transmitter may be heard.

    The place with most readings comes first; each is in the zone of its first run.
    """
    tile = {digest: _tiles_of(obs.places) for digest, obs in parts.items()}
    tiles = np.unique(np.concatenate(list(tile.values()))) if tile else np.zeros(0, np.int64)
    is_reused = any(is_by_channel(obs.cell) for obs in parts.values())
    apart_m = REUSED_M if is_reused else 2.0 * CELL_REACH_M
    number = place_numbers(tile_centres_deg(tiles), apart_m)
    places: list[dict[Key, Readings]] = [{} for _ in range(np.max(number, initial=-1) + 1)]
    for digest, obs in parts.items():
        own = number[np.searchsorted(tiles, tile[digest])]
        for place in np.unique(own).tolist():
            whole = bool(np.all(own == place))
            first = next(iter(places[place].values()), obs)
            near = obs if whole else obs.part(own == place)
            places[place][digest] = replace(near, places=near.places.in_zone(first.utm))
    return sorted(places, key=lambda place: -sum(map(len, place.values())))


def elsewhere_reasons(cell: str, n_places: int, n_readings: int) -> list[str]:
    """The finding that other places name an identity too, with `n_readings` there."""
    if n_places == 1:
        return []
    where = "another place" if n_places == 2 else f"{n_places - 1} other places"
    if is_by_channel(cell):
        return [f"heard in {where} too, with {n_readings} readings: networks use codes again"]
    how = f"with {n_readings} readings, farther away than any cell reaches"
    return [f"heard in {where} too, {how}: these are different transmitters"]


def ground_of(places: Places) -> Ground:
    """Places, each with its zone."""
    return Ground(np.full(len(places), places.utm.zone), places.x_m, places.y_m)


class Towns:
    """The towns of some ground, the largest first; `zones` has the zone of each."""

    def __init__(self, ground: Iterable[Ground]) -> None:
        tiles = [np.unique(_tiles(part)) for part in ground]
        self._tile = np.unique(np.concatenate(tiles)) if tiles else np.zeros(0, np.int64)
        centre_deg = tile_centres_deg(self._tile)
        number = _divide(place_numbers(centre_deg, _APART_M), _points_m(centre_deg))
        rank = np.argsort(np.argsort(-np.bincount(number), kind="stable"))
        self._town = rank[number]
        own = [self._tile[self._town == town] for town in range(len(rank))]
        self.zones = tuple(map(_zone_of, own))
        # a corner is a multiple of the tiles: blocks of 50 m are not cut
        self._corner_m = np.array([_corner_m(*one) for one in zip(own, self.zones, strict=True)])

    def place(self, ground: Ground) -> tuple[IntArray, Ground]:
        """Number of the town of each position (n,), and the positions in its zone."""
        town = self._town[np.searchsorted(self._tile, _tiles(ground))]
        x_m, y_m = ground.x_m.copy(), ground.y_m.copy()
        target = np.array([utm.zone for utm in self.zones], np.int64)[town]
        ways = np.stack([ground.zone, target])[:, ground.zone != target]
        for zone, to in np.unique(ways, axis=1).T.tolist():
            rows = (ground.zone == zone) & (target == to)
            lat_lon_deg = Utm(zone).to_latlon_arrays(x_m[rows], y_m[rows])
            x_m[rows], y_m[rows] = Utm(to).to_xy_arrays(*lat_lon_deg)
        return town, Ground(target, x_m, y_m)

    def in_one_plane(self, ground: Ground) -> FloatArray:
        """East and north of positions (n,), shape (2, n), with the towns side by side."""
        town, at = self.place(ground)
        row, column = np.divmod(town, _IN_A_ROW)
        away_m = _SIDE_BY_SIDE_M * np.stack([column, row]) - self._corner_m[town].T
        return np.asarray(np.stack([at.x_m, at.y_m]) + away_m, float)


def _tiles(ground: Ground) -> IntArray:
    column = np.floor(ground.x_m / _TILE_M).astype(np.int64) + _OFFSET
    row = np.floor(ground.y_m / _TILE_M).astype(np.int64) + _OFFSET
    return (ground.zone.astype(np.int64) * _STRIDE + column) * _STRIDE + row


def tile_centres_deg(tile: IntArray) -> FloatArray:
    """Latitude and longitude of the middle of tiles (n,), shape (2, n)."""
    row, column = tile % _STRIDE - _OFFSET, tile // _STRIDE % _STRIDE - _OFFSET
    zone = tile // _STRIDE // _STRIDE
    lat_lon_deg = np.zeros((2, len(tile)))
    for number in np.unique(zone).tolist():
        own = zone == number
        middle_m = ((values[own] + 0.5) * _TILE_M for values in (column, row))
        lat_lon_deg[:, own] = Utm(number).to_latlon_arrays(*middle_m)
    return lat_lon_deg


def _points_m(lat_lon_deg: FloatArray) -> FloatArray:
    """On a sphere, shape (n, 3)."""
    lat, lon = np.radians(lat_lon_deg)
    axes = (np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat))
    return np.asarray(_EARTH_M * np.stack(axes, axis=1), float)


def _divide(number: IntArray, point_m: FloatArray) -> IntArray:
    """Places (n,) of bounded size: those that are larger are cut in their middle."""
    number = number.copy()
    waiting = list(range(int(np.max(number, initial=-1)) + 1))
    while waiting:
        own = np.flatnonzero(number == waiting.pop())
        axis = int(np.argmax(np.ptp(point_m[own], axis=0)))
        along_m = point_m[own, axis]
        if np.ptp(along_m) > _LARGEST_M:
            new = int(np.max(number)) + 1
            number[own[along_m > 0.5 * (along_m.min() + along_m.max())]] = new
            waiting += [int(number[own[np.argmin(along_m)]]), new]
    return number


def _zone_of(tile: IntArray) -> Utm:
    """The zone of a town: that of all its tiles, else of their middle."""
    zones = np.unique(tile // _STRIDE // _STRIDE)
    if len(zones) == 1:
        return Utm(int(zones[0]))
    middle = _middle(_points_m(tile_centres_deg(tile)))
    return Utm.at(min(max(middle.lat, -MAX_LATITUDE_DEG), MAX_LATITUDE_DEG), middle.lon)


def _corner_m(tile: IntArray, utm: Utm) -> FloatArray:
    """East and north of a corner of a tile near the middle of a town, in its zone."""
    middle = _middle(_points_m(tile_centres_deg(tile)))
    middle_m = np.array(utm.to_xy(middle.lat, middle.lon))
    return np.asarray(np.floor(middle_m / _TILE_M) * _TILE_M, float)


def _middle(point_m: FloatArray) -> OnMap:
    x, y, z = np.mean(point_m, axis=0).tolist()
    return OnMap(lat=degrees(atan2(z, hypot(x, y))), lon=degrees(atan2(y, x)))


# --- groups of runs ---


class HeardIn(OnMap, frozen=True, kw_only=True):
    """A place of an identity: middle, runs, readings with a position, first and last of these.

    The times are of the runs that know UTC.
    """

    runs: tuple[str, ...]
    n: int
    first_utc: str | None
    last_utc: str | None

    @property
    def text(self) -> str:
        """Place, runs and days in words."""
        runs = runs_text(self.runs, self.first_utc, self.last_utc)
        return f"{place_name(self)} ({runs})"


@dataclass(frozen=True, slots=True)
class Group:
    """Runs of one place: they share ground, or an identity that one transmitter may have sent.

    `where` is the middle of their ground, None of runs without a position. `several` has where each
    identity was heard that is named farther apart than any cell reaches, the group's own place
    first. Beside other groups, `first_utc` and `last_utc` are its first and last reading, None
    where no run knows UTC. `cells` are those asked for, none for all.
    """

    runs: tuple[Run, ...]
    where: OnMap | None
    first_utc: str | None = None
    last_utc: str | None = None
    several: Mapping[str, tuple[HeardIn, ...]] = field(default_factory=dict)
    cells: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The place in words."""
        return "without a position" if self.where is None else place_name(self.where)

    @property
    def title(self) -> str:
        """The place with its runs and days."""
        days = days_text(self.first_utc, self.last_utc)
        return f"{self.name} ({number_of(len(self.runs), 'run')}{days})"

    @property
    def file_name(self) -> str:
        """The place in the name of a file."""
        return self.name.replace("° ", "").replace(", ", "-").replace(" ", "-")


SEVERAL = "heard in {places} places, {apart_km} km apart, farther than any cell reaches: {where}"
"""The finding that runs of several places name one identity."""
_TWO = "Two transmitters have one identity, or one was carried from place to place"
_MOST_RUNS = 3
"""Of a sentence."""


class _Walk(NamedTuple):
    """A run that has a position: its fixes, and what it named where.

    `heard` has, for each identity, the rows of the readings that name it without doubt, where the
    walker was known to be, `at` where that was for each reading.
    """

    run: Run
    track: Track
    at: Places
    heard: Mapping[str, IntArray]

    def tiles_of(self, cell: str) -> IntArray:
        return np.unique(_tiles_of(self.at.part(self.heard[cell])))


def by_place(runs: Sequence[Run]) -> list[Group]:
    """The runs in groups that have no ground and no cell in common, in the order of their runs.

    Ground that is 25 km apart is not shared. An identity is one cell where readings of it are not
    farther apart than twice `CELL_REACH_M`. Runs without a position are a group of their own only
    where the others are several.
    """
    walks = [walk for walk in map(_walk_of, runs) if walk is not None]
    groups = _groups_of(walks) if len(walks) > 1 else [walks]
    several = _heard_in_several(walks)
    lost = [run for run in runs if all(walk.run is not run for walk in walks)]
    if len(groups) < 2:
        middle = middle_of([walk.track for walk in walks]) if walks else None
        everywhere = {cell: tuple(one for _, one in at) for cell, at in several.items()}
        return [Group(tuple(runs), middle, several=everywhere)]
    found = []
    for group in groups:
        own = tuple(walk.run for walk in group)
        ids = {run.meta.run_id for run in own}
        where = {
            cell: tuple(one for _, one in sorted(at, key=lambda place: ids.isdisjoint(place[0])))
            for cell, at in several.items()
            if not all(ids.isdisjoint(by) for by, _ in at)
        }
        times_ns = [at_ns for both in heard_utc_ns(own).values() for at_ns in both]
        first_utc, last_utc = first_and_last_utc(times_ns)
        middle = middle_of([walk.track for walk in group])
        found.append(Group(own, middle, first_utc, last_utc, where))
    return [*found, *([Group(tuple(lost), None)] if lost else [])]


def is_near(group: Group, area: Area) -> bool:
    """Whether a run of a group, where it has a position, comes near an area."""
    for run in group.runs:
        with suppress(ConfigError, EstimationError, GeoError):
            area.at([track_of(run.tables["fixes"])])
            return True
    return False


def check_one_place(runs: Sequence[Run]) -> None:
    """Raise `GeoError` for runs of several places, which `by_place` tells apart."""
    groups = by_place(runs)
    if len(groups) > 1:
        names = "; ".join(group.name for group in groups)
        raise GeoError(
            f"{groups[1].runs[0].path} was walked far from {groups[0].runs[0].path}: these runs "
            f"are of {len(groups)} places ({names}): give those of one place"
        )


def groups_with(groups: Sequence[Group], cells: Sequence[str]) -> Iterator[Group]:
    """Groups that name some of the `cells`, each asked for those; none is all, of every group.

    What is heard in several places is said of those alone.
    Raises `ConfigError` for a cell that no group names.
    """
    named = [
        {name.decode() for run in group.runs
         for name in np.unique(run.named_readings["cell"]).tolist()}
        for group in groups
    ]  # fmt: skip
    check_observed(cells, set().union(*named))
    for group, names in zip(groups, named, strict=True):
        own = tuple(cell for cell in cells if cell in names)
        if own or not cells:
            several = {cell: at for cell, at in group.several.items() if cell in own or not cells}
            yield replace(group, cells=own, several=several)


def document_of_groups(groups: Sequence[Group], documents: Sequence[Document]) -> Document:
    """What a command says of each group, under a heading; of one group that alone.

    In JSON each group has its place and its document.
    """
    found = {cell: where for group in reversed(groups) for cell, where in group.several.items()}
    findings = [Line(f"{cell} is {several_text(found[cell])}. {_TWO}", "yellow")
                for cell in sorted(found)]  # fmt: skip
    several = [{"cell": cell, "places": found[cell]} for cell in sorted(found)]
    if len(groups) == 1:
        (only,) = documents
        if not found:
            return only
        content = {**only.content, "several_places": several}
        return replace(only, content=content, body=[*findings, *only.body])
    content = {
        "several_places": several,
        "groups": [
            {
                "place": group.name,
                "lat": group.where and group.where.lat,
                "lon": group.where and group.where.lon,
                "first_utc": group.first_utc,
                "last_utc": group.last_utc,
                **document.content,
            }
            for group, document in zip(groups, documents, strict=True)
        ],
    }
    titles = ", ".join(group.title for group in groups)
    body: list[Part] = [f"{len(groups)} places: {titles}", *findings]
    for group, document in zip(groups, documents, strict=True):
        body += ["", Line(group.title, "bold")]
        body += [document.title] if document.title else []
        body += [Line(warning, "yellow") for warning in document.warnings]
        body += document.body
    remarks = [remark for document in documents for remark in document.remarks]
    return Document(content, body=body, remarks=remarks)


def several_evidence(where: Sequence[HeardIn]) -> dict[str, int | str]:
    """What `SEVERAL` says."""
    places = "; ".join(one.text for one in where)
    return {"places": len(where), "apart_km": round(apart_m(where) / 1000.0), "where": places}


def several_text(where: Sequence[HeardIn]) -> str:
    """The finding that an identity is heard in places that no cell reaches together."""
    return SEVERAL.format(**several_evidence(where))


def apart_m(where: Sequence[OnMap]) -> float:
    """Largest distance between some places on the ground."""
    at_deg = np.array([(one.lat, one.lon) for one in where]).reshape(-1, 2).T
    return max((float(np.max(away_m(at_deg, one))) for one in where), default=0.0)


def away_m(lat_lon_deg: FloatArray, where: OnMap) -> FloatArray:
    """Distance on the ground of positions (2, n) from a place."""
    from pyproj import Geod  # noqa: PLC0415 (as above)

    lat, lon = lat_lon_deg
    there = np.full(len(lat), where.lon), np.full(len(lat), where.lat)
    return np.asarray(Geod(ellps="WGS84").inv(lon, lat, *there)[2], float)


def place_name(where: OnMap) -> str:
    """Latitude and longitude to a kilometre."""
    north, east = "N" if where.lat >= 0.0 else "S", "E" if where.lon >= 0.0 else "W"
    return f"{abs(where.lat):.2f}° {north}, {abs(where.lon):.2f}° {east}"


def _walk_of(run: Run) -> _Walk | None:
    """None without a position that can be mapped."""
    readings = run.tables["readings"]
    try:
        track = track_of(run.tables["fixes"])
    except (EstimationError, GeoError):
        return None
    at, is_known = at_readings(track, run.tables["scans"], readings)
    names, which = numbered_texts(readings["cell"])
    rows = np.flatnonzero(is_known & (readings["identity_unsure"] == 0))
    named = ((names[k].decode(), rows[some]) for k, some in rows_of_each(which[rows]))
    heard = {name: some for name, some in named if identity_of(name) is not None}
    return _Walk(run, track, at, heard)


def _groups_of(walks: Sequence[_Walk]) -> list[list[_Walk]]:
    shared = [(_APART_M, {k: np.unique(_tiles_of(walk.track)) for k, walk in enumerate(walks)})]
    n_runs = Counter(cell for walk in walks for cell in walk.heard)
    for cell in (cell for cell, n in n_runs.items() if n > 1):
        tiles = {k: walk.tiles_of(cell) for k, walk in enumerate(walks) if cell in walk.heard}
        shared.append((2.0 * CELL_REACH_M, tiles))
    first, second = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for apart_m, tiles in shared:
        run = np.repeat(list(tiles), [len(own) for own in tiles.values()])
        place = place_numbers(tile_centres_deg(np.concatenate([*tiles.values()])), apart_m)
        order = np.argsort(place, kind="stable")
        same = np.flatnonzero(np.diff(place[order]) == 0)
        first.append(run[order][same])
        second.append(run[order][same + 1])
    links = np.stack([np.concatenate(first), np.concatenate(second)])
    groups: dict[int, list[_Walk]] = {}
    for walk, group in zip(walks, _components(links, len(walks)).tolist(), strict=True):
        groups.setdefault(group, []).append(walk)
    return list(groups.values())


def _heard_in_several(walks: Sequence[_Walk]) -> dict[str, list[tuple[list[str], HeardIn]]]:
    """By which runs and where each identity was heard that two scans name in several places."""
    several = {}
    for cell in sorted({cell for walk in walks for cell in walk.heard}):
        heard = [(walk, walk.heard[cell]) for walk in walks if cell in walk.heard]
        tiles = [_tiles_of(walk.at.part(rows)) for walk, rows in heard]
        different = np.unique(np.concatenate(tiles))
        number = place_numbers(tile_centres_deg(different), 2.0 * CELL_REACH_M)
        places = []
        for place in dict.fromkeys(number.tolist()) if np.any(number) else ():
            near = different[number == place]
            own = [(walk, rows[np.isin(at, near)])
                   for (walk, rows), at in zip(heard, tiles, strict=True)]  # fmt: skip
            own = [(walk, rows) for walk, rows in own if len(rows)]
            if sum(map(_n_scans, own)) >= FEWEST_SCANS:
                places.append(([walk.run.meta.run_id for walk, _ in own], _heard_in(own)))
        if len(places) > 1:
            several[cell] = places
    return several


def _n_scans(heard: tuple[_Walk, IntArray]) -> int:
    walk, rows = heard
    return len(np.unique(walk.run.tables["readings"]["seq"][rows]))


def _heard_in(heard: Sequence[tuple[_Walk, IntArray]]) -> HeardIn:
    middle = middle_of([walk.at.part(rows) for walk, rows in heard])
    times_ns = []
    for walk, rows in heard:
        clock = utc_clock(walk.run.meta.origin, walk.run.tables["fixes"])
        t_ns = walk.run.tables["readings"]["t_ns"][rows]
        times_ns += [clock(int(t_ns.min())), clock(int(t_ns.max()))]
    first_utc, last_utc = first_and_last_utc([at_ns for at_ns in times_ns if at_ns is not None])
    return HeardIn(
        lat=middle.lat,
        lon=middle.lon,
        runs=tuple(walk.run.name for walk, _ in heard),
        n=sum(len(rows) for _, rows in heard),
        first_utc=first_utc,
        last_utc=last_utc,
    )


def runs_text(names: Sequence[str], first_utc: str | None, last_utc: str | None) -> str:
    """Some runs, and their days."""
    few, n_more = ", ".join(names[:_MOST_RUNS]), len(names) - _MOST_RUNS
    more = f" and {n_more} more" if n_more > 0 else ""
    return f"{few}{more}{days_text(first_utc, last_utc)}"


def first_and_last_utc(times_ns: Sequence[int]) -> tuple[str | None, str | None]:
    """As `days_text` takes them."""
    return known_utc_text(min(times_ns, default=None)), known_utc_text(max(times_ns, default=None))


def days_text(first_utc: str | None, last_utc: str | None) -> str:
    """The first and the last day after a comma; nothing where they are unknown."""
    days = dict.fromkeys(utc[:10] for utc in (first_utc, last_utc) if utc)
    return f", {' to '.join(days)}" if days else ""


def _tiles_of(places: Places) -> IntArray:
    return _tiles(ground_of(places))


def middle_of(parts: Sequence[Places]) -> OnMap:
    """The middle of the medians of some places."""
    medians_deg = [one.median.lat_lon_deg for one in parts]
    return _middle(_points_m(np.hstack(medians_deg)))
