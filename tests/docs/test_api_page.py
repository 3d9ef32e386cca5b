"""The examples of `docs/api.md` and of the notebook run, and docstrings name shapes and units."""

import inspect
import json
import re

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import postproc
from logger.core import readings as core_readings
from logger.core.locator import pipeline
from logger.core.runfile import finish_journal
from postproc import api
from postproc.estimators import ekf_initialisation, filters, least_squares, rts
from tests.docs.pages import ROOT
from tests.kit.runs import UTC0_NS
from tests.kit.sample_results import write_run

FUNCTIONS = [name for name in postproc.__all__ if inspect.isfunction(getattr(postproc, name))]
BLOCKS = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHAPE_AND_UNIT = re.compile(r"shape|\(n,|\bm\b|metres|dBm|ns\b|degrees|scalar")


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """The two runs that the page names."""
    for number, seconds in ((17, 240), (18, 100)):
        write_run(
            tmp_path / f"run-0000{number}.journal",
            seconds=seconds,
            cells=1,
            run_id=f"{number:032}",
            utc0_ns=UTC0_NS + number * 86_400 * 10**9,
        )
        finish_journal(tmp_path / f"run-0000{number}.journal")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def without_screen(monkeypatch):
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    yield
    plt.close("all")


def test_the_page_runs(runs, capsys, without_screen):
    names = {}
    for block in BLOCKS.findall((ROOT / "docs/api.md").read_text("utf-8")):
        exec(block, names)
    assert names["alone"].posterior is not None
    assert (runs / "walk.geojson").exists()
    assert list(names["frame"]["cell"]) == [cell.cell for cell in names["result"].cells]
    assert "262-01-4711-100" in capsys.readouterr().out


def test_the_page_describes_every_function():
    page = (ROOT / "docs/api.md").read_text("utf-8")
    for name in FUNCTIONS:
        parameters = inspect.signature(getattr(postproc, name)).parameters
        missing = [p for p in parameters if not re.search(rf"\b{p}\b", page)]
        assert (name, missing) == (name, [])
    assert set(FUNCTIONS) <= set(re.findall(r"`(\w+)`", page))


def code_of(name):
    """The cells of a notebook, which has no outputs."""
    notebook = json.loads((ROOT / "examples" / name).read_text("utf-8"))
    assert (notebook["nbformat"], {cell["cell_type"] for cell in notebook["cells"]}) == (
        4,
        {"code", "markdown"},
    )
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in code)
    return ["".join(cell["source"]) for cell in code]


def test_the_notebook_runs(capsys, without_screen):
    """Cell by cell in one namespace, as a kernel does, without a kernel's server and sockets."""
    names = {}
    for code in code_of("locate.ipynb"):
        exec(code, names)
    assert names["cell"].verdict == "located"
    assert names["error_m"] < names["cell"].posterior.r95_m
    assert names["mirrored"].verdict != "located"
    assert "most likely within" in capsys.readouterr().out


def test_the_notebook_of_several_runs_finds_the_rogue(tmp_path, monkeypatch, without_screen):
    folder = tmp_path / "examples"
    folder.mkdir()
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    monkeypatch.chdir(folder)
    names = {}
    for code in code_of("runs.ipynb"):
        exec(code, names)
    first = names["answer"]
    assert (first.cell, first.word.word) == ("232-01-7777-4660", "suspicious")
    assert first.provenance.runs == ("rogue-sim7600.h5", "rogue-sim800.h5")
    assert list(names["frame"]["cell"]) == [cell.cell for cell in names["result"].cells]
    (feature,) = json.loads((folder / "cells.geojson").read_text())["features"]
    assert feature["properties"]["word"] == "suspicious"


def test_the_published_type_is_the_returned_one(runs):
    found = postproc.observations("run-000017.h5")
    for name in ("t_ns", "x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq"):
        assert getattr(found.cells[0], name).shape == (len(found.cells[0]),)
        assert isinstance(getattr(found.cells[0], name), np.ndarray)


@pytest.mark.parametrize(
    "public",
    [
        *(getattr(api, name) for name in ("locate", "observations", "smooth", "verify")),
        core_readings.Readings,
        pipeline.locate,
        filters.reference_ekf,
        ekf_initialisation.run,
        rts.smooth,
        least_squares.fit,
    ],
)
def test_docstrings_name_shapes_and_units(public):
    text = inspect.getdoc(public)
    summary, blank, *_ = text.splitlines()
    assert summary.endswith(".")
    assert blank == ""
    assert SHAPE_AND_UNIT.search(text), text


@pytest.mark.parametrize("name", FUNCTIONS)
def test_docstrings_of_the_api_name_each_array_and_error(name):
    text = inspect.getdoc(getattr(api, name))
    assert "Raises" in text
    signature = inspect.signature(getattr(api, name))
    arrays = [p for p in signature.parameters if p.endswith(("_m", "_dbm", "_db"))]
    assert [p for p in arrays if f"`{p}`" not in text and p != "height_m"] == []
