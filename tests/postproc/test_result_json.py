"""The JSON of `smooth` keeps its contract, which `docs/result.schema.json` states."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

from logger.core.model.area import Area
from logger.core.model.prior import Prior
from logger.core.runfile import read_run
from postproc.result import Options
from postproc.smoothing import smooth_runs
from postproc.suspicion.run_assessment import conspicuous_first
from tests.kit import runs
from tests.kit import sample_results as kit

SCHEMA = Path(__file__).parents[2] / "docs" / "result.schema.json"

STATE = ["lat", "lon", "drms_m", "p0_dbm", "p0_sigma_db", "eta", "eta_sigma", "ellipse95", "n"]
CELL = [
    *(
        "cell",
        "n",
        "n_scans",
        "first_utc",
        "last_utc",
        "verdict",
        "best",
        "modes",
        "region95",
        "region50",
        "prior",
    ),
    "alternatives",
    *("noise", "reference_ekf", "ekf", "ekf_backward", "agreement", "rts", "batch", "residuals"),
    *("set_aside", "truth", "warnings"),
]
WORD = ["word", "word_reasons"]


@pytest.fixture(scope="module")
def validator():
    published = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(published)
    return jsonschema.Draft202012Validator(published)


@pytest.fixture(scope="module")
def summaries(tmp_path_factory):
    """One run, and two runs of which one has no position fix."""
    folder = tmp_path_factory.mktemp("json")
    run = kit.write_run(folder / "walk.journal", seconds=120, cells=2)
    empty = [runs.Record(1, "modem", runs.Scan(0, ()))]
    runs.write_journal(folder / "lost.journal", empty, run_id="1" * 32)
    results = [smooth_runs(some) for some in ([run], [run, read_run(folder / "lost.journal")])]
    return [kit.json_of(conspicuous_first(result)[0]) for result in results]


def test_the_published_schema_names_every_field(summaries, validator):
    closed = json.loads(json.dumps(validator.schema))
    for kind in filter(lambda one: "properties" in one, closed["$defs"].values()):
        kind["additionalProperties"] = False
    for summary in summaries:
        jsonschema.Draft202012Validator(closed).validate(summary)


def test_results_are_valid(summaries, validator):
    for summary in summaries:
        validator.validate(summary)


def test_the_schema_rejects_other_documents(summaries, validator):
    one = summaries[0]
    for wrong in ({}, {**one, "cells": [{}]}, {**one, "run": None}, {"cells": one["cells"]}):
        assert not validator.is_valid(wrong)


def test_keys_and_their_order(summaries):
    one, several = summaries
    assert list(one) == ["run", "cells", "unnoticed"]
    assert list(several) == ["runs", "warnings", "cells", "unnoticed"]
    assert "a strong new station" in one["unnoticed"]
    (located, *_) = one["cells"]
    assert list(located) == [*CELL, *WORD]
    assert list(several["cells"][0]) == [*CELL, "runs", "offsets", "without", *WORD]
    assert list(located["ekf"]) == [*STATE, "converged"]
    more = ["sigma_db", "converged", "bounded", "correlation_inflation", "rivals"]
    assert list(located["batch"]) == STATE + more
    best = ["lat", "lon", "r95_m", "r50_m", "drms_m", "may_be_distant", *STATE[3:7], "strongest"]
    assert list(located["best"]) == best
    assert list(located["modes"][0]) == ["lat", "lon", "probability", "percent", "ellipse95"]
    assert list(one["run"])[-2:] == ["n_readings_without_position", "warnings"]


def test_an_area_stands_beside_the_prior(tmp_path, validator):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    prior = replace(Prior(), area=Area.within_walk(200.0))
    summary = kit.json_of(smooth_runs([run], options=Options(prior)))
    validator.validate(summary)
    (cell,) = summary["cells"]
    assert list(cell) == [*CELL[:12], "area", *CELL[12:]]
    assert cell["area"]["text"] == "within 200 m of the walk"
    assert 0.0 <= cell["area"]["outside_share"] <= 1.0
    assert "area" not in cell["prior"]


def test_what_was_not_estimated_is_null(tmp_path):
    run = kit.write_run(tmp_path / "walk.journal", seconds=4, cells=1)
    (cell,) = kit.json_of(smooth_runs([run]))["cells"]
    assert list(cell) == [key for key in CELL if key != "noise"]
    assert cell["ekf"] == dict.fromkeys(STATE) | {"n": 0, "converged": None} == cell["batch"]
    assert set(cell["best"].values()) == {None}
    assert (cell["prior"], cell["region95"]) == (None, {"area_m2": None, "geojson": None})
