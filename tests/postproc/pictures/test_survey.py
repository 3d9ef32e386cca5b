from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.pictures.survey import survey_of
from tests.kit import sample_results as kit


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("survey") / "walk.journal", seconds=60, cells=2)
    return kit.sample_result(run)


def with_paths(result, *paths):
    """The same run several times, under other paths."""
    (observed,) = result.runs
    runs = [replace(observed, run=replace(observed.run, path=Path(path))) for path in paths]
    return replace(result, runs=tuple(runs))


def test_runs_with_the_same_name_are_numbered(result):
    paths = [f"{folder}/run-000001.journal.2" for folder in "abc"]
    survey = survey_of(with_paths(result, *paths, "x.h5"))
    names = [walk.name for walk in survey.walks]
    assert names == ["run-000001", "run-000001 (2)", "run-000001 (3)", "x"]


def test_positions_convert_to_degrees_and_back(result):
    survey = survey_of(result)
    positions_m = np.array([(0.0, 0.0), (30.0, -70.0)])
    for position_m, degrees in zip(positions_m, survey.degrees(positions_m), strict=True):
        np.testing.assert_allclose(survey.position_m(*degrees), position_m, atol=1e-6)
    np.testing.assert_allclose(survey.degrees(np.zeros((1, 2))), [(kit.LAT, kit.LON)], atol=1e-6)


def test_tracks_of_all_runs_have_one_origin(result):
    survey = survey_of(with_paths(result, "a.h5", "b.h5"))
    first, second = survey.walks
    np.testing.assert_array_equal(first.track_m, second.track_m)
    assert first.track_m[0].tolist() == [0.0, 0.0]
    assert len(survey.track_m) == 120


def test_warnings_of_one_of_several_runs_name_its_file(result):
    assert survey_of(result).warnings == result.runs[0].warnings == ("about the run",)
    survey = survey_of(replace(with_paths(result, "a.h5", "b.h5"), warnings=("about both",)))
    assert survey.warnings == ("about both", "a.h5: about the run", "b.h5: about the run")


def test_without_a_fix_there_is_no_track(result):
    (observed,) = result.runs
    survey = survey_of(replace(result, runs=(replace(observed, observations=None),)))
    assert (survey.utm, survey.track_m.shape) == (None, (0, 2))
    assert [levels.cell for levels in survey.walks[0].levels] == [
        kit.cell_name(0),
        kit.cell_name(1),
    ]
