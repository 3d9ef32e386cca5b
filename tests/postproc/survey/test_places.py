"""Ground on both sides of borders between zones, and identities in several places."""

import re
from dataclasses import replace

import numpy as np
import pytest
from pyproj import Geod, Proj

from logger.core.places import Places, Utm
from logger.core.readings import Readings, in_order
from postproc.cli import main
from postproc.ground import Ground, Towns, places_of
from postproc.result import Options
from postproc.survey.answers.page import html, walked_ground
from postproc.survey.dataset import Survey
from postproc.survey.intake import add_files
from postproc.survey.location import EVERY_RUN, Location
from postproc.survey.parquet_batch import Batch
from postproc.survey.tasks import compare_loggers, locate_cells, tasks_of
from postproc.survey.walk_readings import HeardCell, SurveyRun, WalkReadings
from tests.postproc.baseline.walks import cell, name, write_walk

SIDE_M, STEP_M = 3000.0, 20.0
BORDERS = {
    "no border": (52.5, 13.4, (33, 33)),
    "Halle, 12 E": (51.48, 12.0, (32, 33)),
    "6 E": (50.9, 6.0, (31, 32)),
    "equator": (0.0, 9.0, (32, -32)),
    "equator and 12 E": (0.0, 12.0, (-32, 33)),
    "date line": (-17.8, 180.0, (-60, -1)),
    "date line in the north": (66.0, 180.0, (60, 1)),
    "Bergen, of a wider zone": (60.4, 6.0, (31, 32)),
    "Svalbard": (78.2, 12.0, (32, 33)),
    "far north": (83.9, -30.0, (25, 26)),
    "zones that do not touch": (51.48, 12.0, (31, 34)),
}


def fill(lat_deg, lon_deg, side_m=SIDE_M):
    """Degrees of a square of ground, a point for each 20 m by an equal area map."""
    at_m = np.arange(-side_m / 2, side_m / 2, STEP_M) + 0.5 * STEP_M
    east_m, north_m = (values.ravel() for values in np.meshgrid(at_m, at_m))
    lon, lat = equal_area(lat_deg, lon_deg)(east_m, north_m, inverse=True)
    return lat, lon


def equal_area(lat_deg, lon_deg):
    return Proj(proj="laea", lat_0=lat_deg, lon_0=lon_deg, ellps="WGS84")


def walk(number, zone, lat_deg, lon_deg, cells=("262-01-801-1",)):
    """A run with these places, stored in a zone."""
    x_m, y_m = Utm(zone).to_xy_arrays(lat_deg, lon_deg)
    n, digest = len(x_m), f"{number:064x}"
    run = SurveyRun(
        digest, digest, digest[:32], f"{number}.h5", f"l{number}", f"m{number}", number, n
    )
    return WalkReadings(
        run, tuple(HeardCell(one, "GSM", n, n, ()) for one in cells), zone,
        np.zeros(n, np.int64), np.arange(n) * 10**9, x_m, y_m, np.full(n, 5.0),
        -55.0 - 30.0 * np.arange(n) / n, np.arange(n), np.full(n, -1), np.full(n, np.nan),
    )  # fmt: skip


def survey_of(folder, walks):
    Survey.open_or_make(folder)
    batch = Batch()
    for one in walks:
        batch.take(one)
    batch.write(folder, "000001")
    return Survey.open(folder)


@pytest.mark.parametrize("where", BORDERS)
@pytest.mark.parametrize("shared", ["halves", "twice"])
def test_ground_of_several_zones_is_one_ground(tmp_path, where, shared):
    """Each half, or the whole ground twice, in another zone: the area is that of the ground."""
    lat_deg, lon_deg, zones = BORDERS[where]
    lat, lon = fill(lat_deg, lon_deg)
    half = (
        (np.mod(lon - lon_deg + 180.0, 360.0) < 180.0)
        if shared == "halves"
        else np.ones(len(lon), bool)
    )
    other = ~half if shared == "halves" else half
    parts = [(zone, lat[own], lon[own]) for zone, own in zip(zones, (half, other), strict=True)]
    survey = survey_of(tmp_path / "s", [walk(n, *part) for n, part in enumerate(parts, 1)])
    (town,) = walked_ground(survey, EVERY_RUN)
    # brute force: squares of an equal area map that contain a point
    x_m, y_m = equal_area(lat_deg, lon_deg)(lon, lat)
    squares = np.unique(np.floor(np.column_stack([x_m, y_m]) / 50.0), axis=0)
    corner = [equal_area(lat_deg, lon_deg)(*at, inverse=True) for at in
              ((-1500, -1500), (1500, -1500), (1500, 1500), (-1500, 1500))]  # fmt: skip
    geodesic_m2 = abs(Geod(ellps="WGS84").polygon_area_perimeter(*zip(*corner, strict=True))[0])
    assert 2500.0 * len(squares) == pytest.approx(geodesic_m2, rel=0.01)
    # a grid that is turned or shifted has a square more along each border
    assert 0.999 * geodesic_m2 < 1e6 * town.km2 < 1.045 * geodesic_m2


def test_area_is_that_on_the_ground(tmp_path):
    """Far from the middle of its zone, where squares of the zone are 0.7 % too large."""
    lat, lon = fill(10.0, 14.4)
    survey = survey_of(tmp_path / "s", [walk(1, 32, lat, lon)])
    (town,) = walked_ground(survey, EVERY_RUN)
    by_scale = len(town.square) * 2500.0 / 1e6
    factors = Proj(proj="utm", zone=32, ellps="WGS84").get_factors(14.4, 10.0)
    assert town.km2 == pytest.approx(by_scale / factors.areal_scale, rel=1e-4)
    assert by_scale / town.km2 > 1.006


def test_each_town_has_a_plan_and_all_ground_is_drawn(tmp_path):
    places = [(51.48, 12.0), (48.1, 11.5), (-33.9, 151.2), (51.34, 12.37)]
    walks = []
    for number, (lat_deg, lon_deg) in enumerate(places):
        lat, lon = fill(lat_deg, lon_deg, 1000.0)
        for zone in {Utm.at(float(a), float(b)).zone for a, b in zip(lat, lon, strict=True)}:
            own = [Utm.at(float(a), float(b)).zone == zone for a, b in zip(lat, lon, strict=True)]
            walks.append(walk(10 * number + abs(zone), zone, lat[own], lon[own]))
    survey = survey_of(tmp_path / "s", walks)
    towns = walked_ground(survey, EVERY_RUN)
    assert len(towns) == 4
    page = html(survey, Location((), (), 0, ""), EVERY_RUN, None)
    assert page.count('<svg class="plan"') == 4
    whole = float(re.search(r"([0-9.]+) km² walked", page)[1])
    each = [float(text) for text in re.findall(r"Plan \d of 4: .*, ([0-9.]+) km²", page)]
    assert sum(each) == pytest.approx(whole, abs=0.02)
    assert 4.0 < whole < 4.0 * 1.15
    assert "33.90° S, 151.20° E" in page
    assert page.count('class="walked" d="M') == 4


def test_a_town_that_is_larger_than_a_map_is_divided():
    """A drive from Lisbon to Helsinki: each part in a zone near it, no position twice or lost."""
    t = np.linspace(0.0, 1.0, 20_000)
    lat, lon = 38.7 + t * 21.5, -9.1 + t * 34.1
    x_m, y_m = Utm(29).to_xy_arrays(lat, lon)
    ground = Ground(np.full(len(t), 29), x_m, y_m)
    towns = Towns([ground])
    town, at = towns.place(ground)
    assert len(towns.zones) > 8
    for number in range(len(towns.zones)):
        own = town == number
        assert np.hypot(np.ptp(at.x_m[own]), np.ptp(at.y_m[own])) < 700e3
    assert at.zone.tolist() == [towns.zones[number].zone for number in town]
    some = zip(at.zone[::500].tolist(), at.x_m[::500], at.y_m[::500], strict=True)
    back = [Utm(zone).to_latlon(x, y) for zone, x, y in some]
    assert np.allclose(back, np.column_stack([lat, lon])[::500], atol=1e-6)


PAIRS = {
    "Berlin and Munich": ((52.5, 13.4), (48.1, 11.5)),
    "two continents": ((52.5, 13.4), (-33.9, 151.2)),
    "both sides of the date line": ((-17.0, 179.5), (-21.0, -178.5)),
    "both sides of the equator": ((2.0, 9.0), (-2.0, 9.0)),
    "in one zone": ((52.5, 13.4), (55.6, 13.0)),
}


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("turned", [False, True])
def test_each_place_of_an_identity_has_a_row(tmp_path, pair, turned):
    places = PAIRS[pair][::-1] if turned else PAIRS[pair]

    def passing(number):
        return lambda k: (cell(1, -55.0 - abs(k - 30) // 2 - 3 * number),)

    files = [
        write_walk(tmp_path, n, passing(n % 2), n=60, lat_deg=lat_deg, lon_deg=lon_deg + 2e-3 * n)
        for n, (lat_deg, lon_deg) in enumerate([places[0], places[0], places[1]])
    ]
    survey = Survey.open_or_make(tmp_path / "s")
    list(add_files(survey, files))
    survey = Survey.open(tmp_path / "s")
    (task,) = tasks_of(survey, survey.cells(), EVERY_RUN, Options())
    rows = locate_cells(task)
    assert [(row.place, row.n_places, row.n_readings, row.n_scans, row.n_runs) for row in rows] == [
        (1, 2, 120, 120, 2),
        (2, 2, 60, 60, 1),
    ]
    for row, (lat_deg, lon_deg) in zip(rows, places, strict=True):
        away_m = Geod(ellps="WGS84").inv(lon_deg, lat_deg, row.lon_deg, row.lat_deg)[2]
        assert away_m < 3000.0
        assert any("different transmitters" in reason for reason in row.reasons)


def test_what_cannot_be_told_apart_is_one_place():
    """Readings within the reach of one cell are one place, wherever the borders are."""
    obs = replace(_observations(51.5, 11.9, 32))
    near = _observations(51.5, 12.1, 33)
    (place,) = places_of({"a": obs, "b": near})
    assert {part.utm for part in place.values()} == {Utm(32)}
    lat, lon = place["b"].utm.to_latlon_arrays(place["b"].x_m, place["b"].y_m)
    assert np.allclose([lat[0], lon[0]], [51.5, 12.1], atol=1e-7)


def test_one_run_in_two_places():
    here, there = _observations(51.5, 11.9, 32), _observations(47.0, 11.9, 32)
    places = places_of({"a": in_order([here, there]), "b": there})
    assert [sum(map(len, place.values())) for place in places] == [80, 40]
    assert [list(place) for place in places] == [["a", "b"], ["a"]]


def test_a_name_by_channel_is_used_again_nearer():
    here, there = _observations(51.5, 11.9, 32), _observations(51.5, 12.1, 32)  # 14 km
    by_channel = [replace(obs, cell="LTE-5780-210") for obs in (here, there)]
    assert len(places_of({"a": here, "b": there})) == 1
    assert [list(place) for place in places_of(dict(zip("ab", by_channel, strict=True)))] == [
        ["a"],
        ["b"],
    ]
    (place,) = places_of({"a": by_channel[0], "b": by_channel[0]})
    assert list(place) == ["a", "b"]


def _observations(lat_deg, lon_deg, zone, n=40):
    x_m, y_m = Utm(zone).to_xy(lat_deg, lon_deg)
    return Readings(
        name(1),
        "GSM",
        Places.of(
            x_m + np.arange(n) * 5.0,
            np.full(n, y_m),
            utm=Utm(zone),
            sigma_m=np.full(n, 5.0),
            t_ns=np.arange(n) * 10**9,
        ),
        -60.0 - np.arange(n) % 7,
        np.arange(n),
    )


def test_loggers_of_two_zones_share_their_ground(tmp_path):
    """Three loggers on the same ground, one in the next zone: none is without common ground."""
    lat, lon = fill(51.48, 12.0, 1000.0)
    walks = [walk(n, zone, lat, lon) for n, zone in enumerate((32, 33, 32), 1)]
    survey = survey_of(tmp_path / "s", walks)
    (task,) = tasks_of(survey, survey.cells(), EVERY_RUN, Options())
    assert [one.n_blocks > 300 for one in compare_loggers(task)] == [True] * 3


def test_changes_are_looked_for_in_every_town(tmp_path, scheduler, capsys):
    """Ground of six towns, in seven zones, each read at both times."""
    day_ns = 86_400 * 10**9
    walks = []
    towns = [
        *((48.1, 11.5), (51.48, 12.0), (-33.9, 151.2)),
        *((40.4, -3.7), (-16.8, 179.8), (60.2, 25.0)),
    ]
    for number, (lat_deg, lon_deg) in enumerate(towns):
        lat, lon = fill(lat_deg, lon_deg, 1000.0)
        for later in (0, 1):
            zone = Utm.at(lat_deg, lon_deg + (-0.1 if later else 0.1)).zone
            one = walk(10 * number + later + 1, zone, lat[::4], lon[::4])
            began_ns = 1_790_000_000 * 10**9 + 10 * later * day_ns
            walks.append(replace(one, run=replace(one.run, began_utc_ns=began_ns, logger="x")))
    survey_of(tmp_path / "s", walks)
    main(
        ["survey", "diff", str(tmp_path / "s"), "--before", "2026-09-25", "--scheduler", scheduler]
    )
    out = capsys.readouterr().out
    n_blocks = int(re.search(r"have walked (\d+) blocks", out)[1])
    assert n_blocks == pytest.approx(len(towns) * 400, rel=0.15)


def test_a_walker_gets_a_walk_in_his_own_town(tmp_path, scheduler, capsys):
    """The town of the walker has fewer readings than the other; a third town has none."""
    lat, lon = fill(52.5, 13.4, 600.0)
    there_lat, there_lon = fill(48.85, 2.35, 600.0)
    walks = [walk(n, 33, lat[::2], lon[::2], [f"262-01-1-{n}"]) for n in (1, 2, 3)]
    walks.append(walk(4, 31, there_lat[::4], there_lon[::4], ["208-01-1-4"]))
    survey_of(tmp_path / "s", walks)
    command = ["survey", "next", str(tmp_path / "s"), "--scheduler", scheduler]
    assert main([*command, "--from", "48.85,2.35", "--walkers", "3"]) == 0
    said = capsys.readouterr()
    assert re.findall(r"^walker (\d), (\S+):", said.out, re.MULTILINE) == [("1", "208-01-1-4")]
    assert "2 of 3 walkers have no walk" in said.err
    assert main([*command, "--from", "40.4,-3.7"]) == 2
    assert "within 20 km of --from" in capsys.readouterr().err


def test_walks_that_no_other_logger_confirms_are_counted(tmp_path, scheduler, capsys):
    """Three loggers walk one town at both times, a fourth another."""
    walks = []
    for number, (logger, town) in enumerate(
        [*(("x", (52.5, 13.4)), ("y", (52.5, 13.4)), ("z", (52.5, 13.4))), ("w", (48.1, 11.5))]
    ):
        lat, lon = fill(*town, 1000.0)
        for later in (0, 1):
            one = walk(10 * number + later, Utm.at(*town).zone, lat[::2], lon[::2])
            began_ns = (1_790_000_000 + 864_000 * later) * 10**9
            run = replace(one.run, began_utc_ns=began_ns, logger=logger, modem=logger)
            walks.append(replace(one, run=run))
    survey_of(tmp_path / "s", walks)
    command = ["survey", "diff", str(tmp_path / "s"), "--before", "2026-09-25"]
    assert main([*command, "--scheduler", scheduler]) == 0
    assert "share no ground with them: 2" in capsys.readouterr().err
