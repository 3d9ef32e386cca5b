"""`postproc survey locate`: the estimates of `smooth`, for any partition, order and scheduler."""

import json
from dataclasses import replace

import duckdb
import geopandas as gpd
import numpy as np
import pyogrio
import pytest

from benchmarks.synthetic_city.walks import Walker, draw_walkers
from logger.core.runfile import read_sound_run
from postproc.cli import main
from postproc.result import Options
from postproc.smoothing import smooth_runs
from postproc.survey.agreement import liars, report
from postproc.survey.alignment import align
from postproc.survey.cell_location import MOST_READINGS, OF_A_SQUARE, joined_readings, thin
from postproc.survey.dataset import Survey
from postproc.survey.intake import add_files
from postproc.survey.location import locate_survey
from postproc.survey.scheduling import Cluster
from postproc.survey.tasks import RunChoice, compare_loggers, locate_cells, tasks_of
from tests.postproc.baseline.walks import cell, name, write_walk
from tests.postproc.survey.cities import write_city


def _locate(survey, **choice):
    tasks = tasks_of(survey, survey.cells(), RunChoice(**choice), Options())
    return [one for task in tasks for one in locate_cells(task)]


def test_estimates_are_those_of_smooth(tmp_path):
    """Runs of three modems along three streets past one transmitter."""

    def passing(number):
        return lambda k: (cell(1, -55.0 - abs(k - 30) // 2 - 3 * number),)

    files = [write_walk(tmp_path, n, passing(n), n=60, lon_deg=13.4 + 2e-3 * n) for n in range(3)]
    survey = Survey.open_or_make(tmp_path / "s")
    list(add_files(survey, files))
    survey = Survey.open(survey.folder)
    (found,) = _locate(survey)
    ordered = [tmp_path / run.name for run in survey.runs.values()]
    (expected,) = smooth_runs([read_sound_run(path) for path in ordered], [name(1)]).cells
    posterior = expected.posterior
    for key in ("x_m", "y_m", "r50_m", "r95_m", "p0_dbm", "eta", "sigma_db"):
        assert getattr(found, key) == pytest.approx(getattr(posterior, key), abs=1e-9)
    assert found.n_readings == found.n_used == 180
    assert found.n_modems == 3
    offsets = [one.offset_db for one in found.offsets]
    assert offsets == pytest.approx(posterior.offsets.mean_db.tolist())


def test_what_the_radii_suppose_is_in_every_output(tmp_path, scheduler, capsys):
    """Past a mast far away: the levels hardly change."""
    noise = np.random.default_rng(1).integers(-3, 4, 60).tolist()
    path = write_walk(tmp_path, 1, lambda k: (cell(1, -90.0 + k // 20 + noise[k]),), n=60)
    (expected,) = smooth_runs([read_sound_run(path)], [name(1)]).cells
    supposed = expected.place.supposition
    assert supposed
    folder = tmp_path / "s"
    list(add_files(Survey.open_or_make(folder), [path]))
    arguments = ["survey", "locate", str(folder), "--scheduler", scheduler]
    assert main([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cells"][0]["supposition"] == supposed
    assert main(arguments) == 0
    assert supposed in " ".join(capsys.readouterr().out.split())
    located = folder / "located.parquet"
    assert duckdb.sql(f"SELECT supposition FROM '{located}'").fetchall() == [(supposed,)]
    page = tmp_path / "map.html"
    assert main(["survey", "map", str(folder), "-o", str(page), "--scheduler", scheduler]) == 0
    assert supposed in page.read_text()


def test_partition_and_order_do_not_matter(tmp_path):
    _, one = write_city(tmp_path / "one")
    _, other = write_city(tmp_path / "other", order=[5, 2, 7, 0, 1, 6, 4, 3], split=3)
    assert other.batches == ("000001", "000002")
    assert _locate(one) == _locate(other)


def test_of_very_many_modems_without_common_ground_those_heard_most_count(tmp_path):
    """25 modems, each along a street of its own."""

    def passing(number):
        return lambda k: (cell(1, -55.0 - abs(k - 10) - abs(number - 12)),)

    files = [
        write_walk(tmp_path, n, passing(n), n=20 + n % 2, lon_deg=13.4 + 5e-4 * n)
        for n in range(25)
    ]
    survey = Survey.open_or_make(tmp_path / "s")
    list(add_files(survey, files))
    (found,) = _locate(Survey.open(survey.folder))
    assert found.n_modems == 25
    assert found.n_readings == sum(20 + n % 2 for n in range(25))
    assert found.n_used == sum(sorted(20 + n % 2 for n in range(25))[-20:])
    assert any("of more than 20 modems" in reason for reason in found.reasons)
    assert len(found.offsets) == 25


def test_many_modems_are_put_on_one_scale(tmp_path):
    walkers = draw_walkers(8, 4)
    city, survey = write_city(tmp_path / "s", walkers=walkers, n_runs=24, n_scans=200)
    (area,) = {one.area for one in survey.cells()}
    parts = survey.observations(area, [city.names[0]])[city.names[0]]
    obs = joined_readings(parts, [survey.runs[digest].modem for digest in parts])
    aligned = align(obs.usable())
    assert obs.n_modems == 8
    known = np.isfinite(aligned.sigma_db)  # one modem shares no ground where levels are high
    assert np.count_nonzero(known) == 7
    assert aligned.obs.n_modems == 2
    names = list(dict.fromkeys(survey.runs[digest].modem for digest in parts))
    true_db = {walker.name: walker.offset_db for walker in walkers}
    error_db = aligned.offset_db - [true_db[one] - true_db[names[0]] for one in names]
    assert np.all(np.abs(error_db[known][1:]) < 4.0 * aligned.sigma_db[known][1:])
    assert np.max(aligned.sigma_db[known]) < 1.0
    # up to four modems are the locator's
    few = replace(obs, modem=obs.modem % 4)
    assert align(few).obs is few


def test_lying_loggers_are_named(tmp_path):
    walkers = draw_walkers(8, 4)
    walkers[2] = Walker("loud", walkers[2].offset_db, lie_db=20.0)
    walkers[5] = Walker("elsewhere", 0.0, lie_m=500.0)
    _, survey = write_city(tmp_path / "s", walkers=walkers, n_runs=40, n_scans=300, n_stations=9)
    tasks = tasks_of(survey, survey.cells(), RunChoice(), Options())
    accused = liars(report([one for task in tasks for one in compare_loggers(task)]))
    assert set(accused) == {"loud", "elsewhere"}
    assert "dB from those of the others" in accused["loud"]
    assert "do not fit its positions" in accused["elsewhere"]


def test_a_logger_12_db_too_high_is_noted_and_counts(tmp_path):
    """A constant offset cannot be told from that of a modem: it is named, and subtracted."""
    walkers = draw_walkers(8, 4)
    usual_db = float(np.median([walker.offset_db for walker in walkers]))
    walkers[2] = Walker("loud", usual_db, lie_db=12.0)
    _, survey = write_city(tmp_path / "s", walkers=walkers, n_runs=40, n_scans=300, n_stations=9)
    tasks = tasks_of(survey, survey.cells(), RunChoice(), Options())
    loggers = report([one for task in tasks for one in compare_loggers(task)])
    assert not liars(loggers)
    assert [one.logger for one in loggers if one.remark] == ["loud"]
    (noted,) = [one for one in loggers if one.remark]
    assert noted.offset_db == pytest.approx(12.0, abs=1.5)
    assert "12 dB from those of the others; that is subtracted" in noted.remark
    true_db = {walker.name: walker.offset_db + walker.lie_db for walker in walkers}
    errors_db = []
    for one in survey.cells():
        parts = survey.observations(one.area, [one.cell])[one.cell]
        names = [survey.runs[digest].modem for digest in parts]
        aligned, modems = align(joined_readings(parts, names).usable()), list(dict.fromkeys(names))
        loud = modems.index("loud")
        if np.isfinite(aligned.sigma_db[loud]):
            expected_db = true_db["loud"] - true_db[modems[0]]
            errors_db.append(aligned.offset_db[loud] - expected_db)
    assert len(errors_db) >= 4
    assert np.max(np.abs(errors_db)) < 2.0


def test_thinning_keeps_means(tmp_path):
    _, survey = write_city(tmp_path / "s", n_stations=1, n_runs=4)
    (one,) = survey.cells()
    parts = survey.observations(one.area, [one.cell])[one.cell]
    obs = joined_readings(parts, ["a"] * len(parts)).usable()
    assert thin(obs) is obs
    times = MOST_READINGS // len(obs) + 2
    each = np.repeat(np.arange(len(obs)), times)
    many = {"places": obs.places.part(each), "scan_seq": obs.scan_seq[each]}
    noise = np.random.default_rng(1).normal(0.0, 3.0, times * len(obs))
    dense = replace(obs, **many, level_dbm=np.repeat(obs.level_dbm, times) + noise, ta=None,
                    known_limit=None)  # fmt: skip
    thinned = thin(dense)
    assert len(thinned) <= 1000 * OF_A_SQUARE
    assert np.mean(thinned.level_dbm) == pytest.approx(np.mean(dense.level_dbm), abs=0.1)


@pytest.fixture(scope="module")
def results(tmp_path_factory, scheduler):
    folder = tmp_path_factory.mktemp("city") / "s"
    _, survey = write_city(folder)
    assert main(["survey", "locate", str(folder), "--scheduler", scheduler, "--json"]) == 0
    return survey


def test_command(results, scheduler, capsys):
    """Cells that were located from the same runs are not located again: no scheduler is needed."""
    arguments = ["survey", "locate", str(results.folder)]
    assert main([*arguments, "--scheduler", "tcp://127.0.0.1:1", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [one["cell"] for one in document["cells"]] == [one.cell for one in results.cells()]
    assert main(arguments) == 0
    assert "2 known from before" in capsys.readouterr().out
    assert main([*arguments, "--cell", "262-01-1-1"]) == 2
    assert "not in the survey" in capsys.readouterr().err


def test_the_command_has_the_default_prior(results):
    tasks = tasks_of(results, results.cells(), RunChoice(), Options())
    expected = {one.cell: one.lat_deg for task in tasks for one in locate_cells(task)}
    located = results.folder / "located.parquet"
    assert dict(duckdb.sql(f"SELECT cell, lat_deg FROM '{located}'").fetchall()) == expected


def test_duckdb_geopandas_and_gdal_read_the_results(results):
    parquet, package = (results.folder / f"located.{form}" for form in ("parquet", "gpkg"))
    rows = duckdb.sql(f"SELECT cell, lat_deg, r95_m FROM '{parquet}' ORDER BY cell").fetchall()
    frame = gpd.read_parquet(parquet).sort_values("cell")
    assert [row[0] for row in rows] == frame["cell"].tolist()
    assert frame.crs.to_epsg() == 4326
    assert frame["position"].y.tolist() == [row[1] for row in rows]
    assert all(frame["region"].is_valid)
    layers = {name for name, _ in pyogrio.list_layers(package)}
    assert layers == {"cells", "regions", "loggers"}
    regions = gpd.read_file(package, layer="regions")
    assert set(regions.geometry.geom_type) == {"MultiPolygon"}
    assert regions["verdict"].tolist() == gpd.read_file(package, layer="cells")["verdict"].tolist()


def test_torn_line_is_computed_again(results, scheduler, capsys):
    store = results.folder / "estimates.jsonl"
    whole = store.read_bytes()
    store.write_bytes(whole[: len(whole) - 100])
    arguments = ["survey", "locate", str(results.folder), "--scheduler", scheduler]
    assert main(arguments) == 0
    assert "1 known from before" in capsys.readouterr().out
    assert main(arguments) == 0
    assert "2 known from before" in capsys.readouterr().out


def test_loggers_are_compared_once(tmp_path, scheduler):
    """Without a scheduler too, once both results of every cell are known."""
    _, survey = write_city(tmp_path / "s", walkers=draw_walkers(4, 4))
    with Cluster(scheduler) as cluster:
        first = locate_survey(survey, Options(), cluster=cluster)
    assert len(first.loggers) == 4
    with Cluster("tcp://127.0.0.1:1") as nobody:
        assert locate_survey(survey, Options(), cluster=nobody) == replace(first, n_known=2)
    kept = survey.folder / "loggers.jsonl"
    kept.write_bytes(kept.read_bytes()[:-20])  # torn
    with Cluster(scheduler) as cluster:
        assert locate_survey(survey, Options(), cluster=cluster).loggers == first.loggers


def test_since(results, scheduler, capsys):
    arguments = ["survey", "locate", str(results.folder), "--scheduler", scheduler, "--json",
                 "-o", str(results.folder / "late")]  # fmt: skip
    assert main([*arguments, "--since", "2026-09-01"]) == 0
    capsys.readouterr()
    written = (results.folder / "late.parquet").read_bytes()
    assert main([*arguments, "--since", "2100-01-01"]) == 2
    assert "has no run of this time" in capsys.readouterr().err
    assert (results.folder / "late.parquet").read_bytes() == written
    assert main([*arguments, "--since", "soon"]) == 2
    assert capsys.readouterr().err == "postproc: 'soon' is no date, such as 2026-11-01\n"


def test_mistakes_are_one_line(tmp_path, capsys):
    (tmp_path / "run.h5").touch()
    for folder in (tmp_path, tmp_path / "none", tmp_path / "run.h5"):
        assert main(["survey", "locate", str(folder)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line == f"postproc: {folder} is no survey; `postproc survey add` makes one"


def test_a_survey_of_another_version_is_refused_with_what_to_do(tmp_path, capsys):
    (tmp_path / "survey.json").write_text('{"format": "cellwalk survey", "version": 1}')
    assert main(["survey", "locate", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("of another version of this program; add its runs to a new folder")
