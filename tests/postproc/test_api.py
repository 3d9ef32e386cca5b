"""The public functions, as a script outside the project calls them."""

import importlib
import inspect
import json
import pkgutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import postproc
from logger.core.errors import ConfigError, EstimationError, GeoError, RunFileError
from logger.core.types import Fix
from postproc import Claim, locate
from tests.kit import runs
from tests.kit.sample_results import ETA, P0_DBM, cell_name, json_of, write_run

FUNCTIONS = (
    "by_place", "export", "locate", "observations", "read_run", "smooth", "suspect", "verify",
)  # fmt: skip
SOURCE_M = (40.0, 60.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("api") / "walk.journal"
    write_run(path, seconds=360, cells=2)
    return path


def walk():
    """Receiver positions around a block of 150 m, and levels with 2 dB of white noise."""
    corner = np.linspace(0.0, 4.0, 200)
    x = np.interp(corner, range(5), [0.0, 150.0, 150.0, 0.0, 0.0])
    y = np.interp(corner, range(5), [0.0, 0.0, 150.0, 150.0, 0.0])
    distance = np.hypot(x - SOURCE_M[0], y - SOURCE_M[1])
    noise = np.random.default_rng(2).normal(0.0, 2.0, len(x))
    return x, y, P0_DBM - 10.0 * ETA * np.log10(distance) + noise


def test_no_submodule_takes_the_name_of_a_function():
    for module in pkgutil.walk_packages(postproc.__path__, "postproc."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in FUNCTIONS:
        assert inspect.isfunction(getattr(postproc, name)), name
    assert set(postproc.__all__) <= set(dir(postproc))
    with pytest.raises(AttributeError, match="no attribute 'smoothe'"):
        _ = postproc.smoothe


def test_the_package_imports_nothing_until_a_name_is_used():
    code = "import sys, postproc; print(len(sys.modules)); assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_both_packages_are_typed(tmp_path):
    root = Path(postproc.__file__).parents[1]
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
    built = subprocess.run(
        [*command, "-w", tmp_path, root], capture_output=True, text=True, check=False
    )
    if built.returncode:  # the builder is not installed here: what it would take has to be there
        assert "hatchling" in built.stderr
        assert all((root / name / "py.typed").is_file() for name in ("logger", "postproc"))
        return
    names = zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist()
    assert {"logger/py.typed", "postproc/py.typed"} <= set(names)


def test_bare_arrays_are_located_in_their_own_frame():
    x, y, level = walk()
    here = locate(x, y, level)
    assert here.verdict == "located"
    assert np.hypot(here.posterior.x_m - SOURCE_M[0], here.posterior.y_m - SOURCE_M[1]) < 20.0
    far = locate(list(x + 5e5), y + 5e6, level)
    assert far.posterior.x_m - 5e5 == pytest.approx(here.posterior.x_m, abs=0.01)
    unsure = locate(x, y, level, position_sigma_m=15.0, environment="urban", height_m=20.0)
    assert unsure.posterior.prior.height_m == 20.0


def test_observations_are_located_as_in_a_result(path):
    (obs, _) = postproc.observations(path).cells
    alone = locate(obs)
    found = postproc.smooth(path, [cell_name(0)])
    (cell,) = found.cells
    assert (alone.posterior.x_m, alone.verdict) == (cell.posterior.x_m, cell.verdict)
    assert found.runs[0].run.path == path
    assert postproc.smooth([postproc.read_run(path)], [cell_name(0)]).cells[0].n == cell.n


def test_each_documented_argument_may_be_named():
    """The page names the arguments, and so does who reads it."""
    for name in FUNCTIONS:
        parameters = inspect.signature(getattr(postproc, name)).parameters.values()
        assert [p.name for p in parameters if p.kind is p.POSITIONAL_ONLY] == [], name
    x, y, level = walk()
    by_name = locate(x_m=x, y_m=y, level_dbm=level).posterior
    assert (by_name.x_m, by_name.y_m) == (
        locate(x, y, level).posterior.x_m,
        locate(x, y, level).posterior.y_m,
    )


def test_no_argument_beside_observations_is_ignored(path):
    obs = postproc.observations(path).cells[0]
    for extra in ({"y_m": obs.y_m, "level_dbm": obs.level_dbm}, {"rat": "GSM"},
                  {"position_sigma_m": 5.0}):  # fmt: skip
        with pytest.raises(ConfigError, match="observations have their own"):
            locate(obs, **extra)


def test_what_cannot_be_located_says_why(tmp_path):
    few = locate([0.0, 1.0], [0.0, 0.0], [-60.0, -61.0])
    assert (few.verdict, few.posterior) == ("cannot tell", None)
    for wrong in (([0.0], [0.0, 1.0], [0.0]), ([[0.0]], [[0.0]], [[0.0]])):
        with pytest.raises(ConfigError, match="one shape"):
            locate(*wrong)
    with pytest.raises(ConfigError, match="shape"):
        locate([0.0] * 6, [0.0] * 6, [0.0] * 6, position_sigma_m=[1.0, 2.0])
    with pytest.raises(ConfigError, match=r"locate\(x_m, y_m"):
        locate([0.0])
    with pytest.raises(ConfigError, match=r"locate\(x_m, y_m"):
        locate(x_m=[0.0], level_dbm=[0.0])
    with pytest.raises(ConfigError, match="environment"):
        locate([0.0] * 6, [0.0] * 6, [0.0] * 6, environment="moon")
    with pytest.raises(ConfigError, match="'5G' is unknown: one of GSM, WCDMA"):
        locate([0.0] * 6, [0.0] * 6, [0.0] * 6, rat="5G")
    assert locate([0.0], [0.0], [-60.0], rat="gsm").verdict == "cannot tell"
    with pytest.raises(RunFileError):
        postproc.read_run(tmp_path / "none.h5")
    runs.write_journal(tmp_path / "lost.journal", [])
    with pytest.raises(EstimationError, match="no position fix"):
        postproc.observations(tmp_path / "lost.journal")


def test_claims_are_verified(path):
    run = postproc.read_run(path)
    (truth,) = run.meta.truth
    near = Claim(truth.cell, truth.lat_deg, truth.lon_deg)
    far = Claim(truth.cell, truth.lat_deg + 0.02, truth.lon_deg)
    verdicts = [cell.verdict for cell in postproc.verify(run, [near, far], [truth.cell]).cells]
    assert verdicts == ["consistent", "rejected"]
    assert postproc.verify(run, far).cells[0].verdict == "rejected"
    (path.parent / "claims.csv").write_text(f"cell,lat,lon\n{truth.cell},{truth.lat_deg},13.4\n")
    assert len(postproc.verify(run, path.parent / "claims.csv").cells) == 1


def test_a_run_and_its_result_are_exported(path):
    result = postproc.smooth(path, cell_name(0))
    target = path.parent / "cells.geojson"
    by_result, by_run = (
        postproc.export(result, target),
        postproc.export(path, target, result=result),  # as in earlier versions
    )
    assert by_result == by_run
    assert (by_result.format, by_result.n_estimates) == ("geojson", 1)
    assert postproc.export([result, result], target).n_estimates == 2
    best = json_of(result)["cells"][0]["best"]
    assert f"{best['lat']:.6f}" in target.read_text()
    assert postproc.export(path, path.parent / "walk.csv", cells=cell_name(1)).n_levels == 180
    with pytest.raises(ConfigError, match="can contain estimates"):
        postproc.export(result, path.parent / "cells.wigle", form="wigle")
    with pytest.raises(ConfigError, match="format 'shp'"):
        postproc.export(path, path.parent / "walk.shp", form="shp")


def test_of_results_some_cells_are_exported_and_runs_are_not_taken_for_results(path, tmp_path):
    result, target = postproc.smooth(path), tmp_path / "cells.csv"
    assert postproc.export(result, target, cells=cell_name(1)).n_estimates == 1
    assert [line.split(",")[0] for line in target.read_text().splitlines()][1:] == [cell_name(1)]
    with pytest.raises(ConfigError, match="cell nowhere is in no result"):
        postproc.export(result, target, cells=[cell_name(1), "nowhere"])
    with pytest.raises(ConfigError, match="one run a file"):
        postproc.export([path, path], target)


def test_every_answer_has_its_word_and_its_place(path):
    result = postproc.smooth(path)
    assert [answer.word.word for answer in result.answers] == ["nothing unusual"] * 2
    truth = postproc.read_run(path).meta.truth[0]
    by_name = {answer.cell: answer for answer in result.answers}
    answer = by_name[truth.cell]
    assert (answer.latitude_deg, answer.longitude_deg) == pytest.approx(
        (truth.lat_deg, truth.lon_deg), abs=5e-4
    )
    (cell,) = (cell for cell in result.cells if cell.cell == truth.cell)
    assert (cell.latitude_deg, cell.longitude_deg) == (answer.latitude_deg, answer.longitude_deg)
    x, y, level = walk()
    assert locate(x, y, level).latitude_deg is None  # the plane is on no map
    suspicions = postproc.suspect([path])
    assert {cell.cell for cell in suspicions.cells} == set(by_name)
    assert "nothing unusual" in str(suspicions)


def test_the_reasons_of_bare_arrays_have_metres_and_no_degrees():
    x = np.repeat(
        np.linspace(0.0, 300.0, 100), 2
    )  # a straight street: the mirror image fits as well
    level = -30.0 - 30.0 * np.log10(np.hypot(x - 150.0, 60.0))
    noise = np.random.default_rng(3).normal(0.0, 1.0, len(x))
    result = locate(x, np.zeros(len(x)), level + noise)
    assert result.verdict == "ambiguous"
    assert " at x 1" in result.warnings[0]


def test_runs_of_two_cities_are_a_result_each(path):
    other = path.with_name("other.journal")
    moved = []
    for _, record in postproc.read_run(path).records("fixes", "scans"):
        value = record.value
        if isinstance(value, Fix):
            value = replace(value, lat_deg=value.lat_deg - 5.0)
        moved.append(replace(record, value=value))
    runs.write_journal(other, moved, run_id="2" * 32)
    groups = postproc.by_place([path, other])
    assert [[run.path for run in group.runs] for group in groups] == [[path], [other]]
    for refused in (postproc.smooth, postproc.suspect):
        with pytest.raises(GeoError, match="2 places"):
            refused([path, other])


def test_progress_is_shown_by_the_callers_own_bar(path):
    seen = []

    def bar(items, what, total, names=()):
        for item in items:
            seen.append((what, total))
            yield item

    postproc.smooth(path, cell_name(1), progress=bar)
    assert seen == [("smoothing", 1), ("locating", 1)]
    postproc.smooth(path, cell_name(1), progress=True)


def test_the_version_is_that_of_the_package():
    assert postproc.__version__ == version("cellwalk")


LINE = np.arange(40) * 10.0


@pytest.mark.parametrize(
    ("x", "y", "level", "sigma_m", "says"),
    [
        (np.where(LINE == 50, np.nan, LINE), LINE, LINE - 500, 0.0, "finite"),
        (LINE, np.full(40, np.inf), -LINE / 4 - 50, 0.0, "finite"),
        (LINE, LINE, np.full(40, np.nan), 0.0, "finite"),
        (LINE, LINE, np.full(40, 150.0), 0.0, "-200 to 50 dBm"),
        (LINE, LINE, np.full(40, -999.0), 0.0, "-200 to 50 dBm"),
        (LINE, LINE, -LINE / 4 - 50, np.nan, "finite"),
        (LINE, LINE, -LINE / 4 - 50, -1.0, "negative"),
        (13.4 + LINE * 1e-5, 52.5 + LINE * 1e-6, -LINE / 4 - 50, 0.0, "look like degrees"),
        (52.5 + LINE * 1e-3, 170.1 + LINE * 1e-3, -LINE / 4 - 50, 0.0, "look like degrees"),
        (np.full(40, -118.2), 34.0 + LINE * 1e-6, -LINE / 4 - 50, 0.0, "look like degrees"),
    ],
)
def test_bare_arrays_that_cannot_be_a_walk_are_refused(x, y, level, sigma_m, says):
    with pytest.raises(ConfigError, match=says):
        locate(x, y, level, position_sigma_m=sigma_m)


@pytest.mark.parametrize("what", [["a", "b"], [[1.0], [2.0, 3.0]], {"x": 1.0}])
def test_what_is_no_array_of_numbers_is_refused(what):
    x, y, level = walk()
    for arrays in ((what, y, level), (x, y, what)):
        with pytest.raises(ConfigError, match="arrays of numbers"):
            locate(*arrays)
    with pytest.raises(ConfigError, match="arrays of numbers"):
        locate(x, y, level, position_sigma_m=what)


def test_masked_values_are_not_taken_for_levels():
    x, y, level = walk()
    masked = np.ma.masked_array(level, mask=np.arange(len(level)) < 9)
    with pytest.raises(ConfigError, match="leave out NaN"):
        locate(x, y, masked)


def test_a_result_keeps_its_readings_when_the_caller_writes_to_his_arrays():
    x, y, level = walk()
    cell = locate(x, y, level)
    before = cell.obs.x_m.copy(), cell.obs.level_dbm.copy()
    x[:], level[:] = 0.0, -50.0
    np.testing.assert_array_equal((cell.obs.x_m, cell.obs.level_dbm), before)


def test_no_run_at_all_is_said():
    for function in (postproc.smooth, postproc.suspect, postproc.by_place):
        with pytest.raises(ConfigError, match="no run is given"):
            function([])
    with pytest.raises(ConfigError, match="no run is given"):
        postproc.verify([], [])


def test_an_unknown_loss_is_refused(path):
    with pytest.raises(ConfigError, match="loss 'l1' is unknown: one of linear, soft_l1"):
        postproc.smooth(path, loss="l1")


@pytest.mark.parametrize("within_m", [0.0, -5.0, np.nan, np.inf])
def test_a_radius_that_is_none_is_refused(within_m):
    with pytest.raises(ConfigError, match="a radius is more than 0 m"):
        locate(*walk(), within_m=within_m)


@pytest.mark.parametrize("height_m", [-4.0, np.nan, np.inf])
def test_a_height_that_is_none_is_refused(height_m):
    with pytest.raises(ConfigError, match="an antenna is 0 to 10000 m above"):
        locate(*walk(), height_m=height_m)


def test_a_receiver_that_stands_is_a_walk():
    assert locate(np.full(40, 7.0), np.full(40, 3.0), -60 - LINE % 30 / 10).verdict == "cannot tell"


def test_an_area_narrows_the_answer_and_is_named_in_it(path, tmp_path):
    free, within = locate(*walk()), locate(*walk(), within_walk_m=30.0)
    assert within.posterior.outside_share < 0.5
    assert within.posterior.region_area_m2 <= free.posterior.region_area_m2
    run = postproc.read_run(path)
    lat_deg, lon_deg = postproc.observations(run).track.lat_lon_deg[:, 0]
    ring = [
        [lon_deg + 0.01 * east, lat_deg + 0.01 * north]
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    file = tmp_path / "block.geojson"
    file.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    cell, *_ = postproc.smooth(run, area=file).answers
    assert cell.place.area == "inside block.geojson"
    assert cell.sentence.endswith(", if it is inside block.geojson")
    assert any("without the area" in reason for reason in cell.reasons)


def test_an_area_that_cannot_be_used_is_refused(path, tmp_path):
    file = tmp_path / "far.geojson"
    ring = [[100.0, 10.0], [100.1, 10.0], [100.1, 10.1]]
    file.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    with pytest.raises(ConfigError, match="bare arrays are on no map"):
        locate(*walk(), area=file)
    with pytest.raises(ConfigError, match="no walk is near the area inside far.geojson"):
        postproc.smooth(path, area=file)
    with pytest.raises(ConfigError, match="not allowed"):
        postproc.smooth(path, area=file, within_walk_m=100.0)


def test_no_result_is_no_file(tmp_path):
    with pytest.raises(ConfigError, match="no result is given"):
        postproc.export([], tmp_path / "cells.csv")
    assert not list(tmp_path.iterdir())
