"""One cell whose work fails in any step of a command: its row has the reason, no other changes."""

import copy
import io
import json
import os
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from pathlib import Path
from shutil import copyfile
from tempfile import mkdtemp

import pytest

from logger.core.errors import SOMETHING_LOST, ConfigError, EstimationError
from logger.core.locator import pipeline
from logger.core.runfile import read_run
from postproc import smoothing
from postproc.cell_work import attempt, attempt_alone
from postproc.cli import main
from postproc.verification import run_claims, run_sites
from postproc.walk import observe_run
from tests.kit import rerun_recordings
from tests.kit.runs import UTC0_NS
from tests.kit.sample_results import LAT, LON, cell_name, write_run

BAD, GOOD = cell_name(0), [cell_name(1)]
"""The bad one is heard first and located, so that it takes part in every step."""


def remembering(work, readings):
    """The same function, which remembers its results by the readings."""
    known = {}

    def remember(*arguments, **more):
        obs = arguments[readings]
        key = obs.cell, len(obs), obs.level_dbm.tobytes()
        if key not in known:
            known[key] = work(*arguments, **more)
        return known[key]

    return remember


locate, decide = remembering(pipeline.locate, 0), remembering(pipeline.decide, 1)


@cache
def walk() -> Path:
    path = Path(mkdtemp()) / "walk.h5"
    write_run(path, seconds=170, cells=2)
    return path


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A walk past both cells, each of which is located once only for all tests."""
    for module in (smoothing, run_claims, run_sites):
        monkeypatch.setattr(module, "locate", locate)
    monkeypatch.setattr(smoothing, "decide", decide)
    return copyfile(walk(), tmp_path / "walk.h5")


@cache
def clean_rows(command, key="cells"):
    """Rows of a command that nothing disturbs."""
    out = io.StringIO()
    with redirect_stdout(out):
        assert main([*command, "--json"]) == 0
    return rows(out.getvalue(), key)


def is_about(value, cell, depth=3):
    """Whether an argument of a step is the cell, its name, or something about it."""
    if isinstance(value, str) or depth == 0:
        return value == cell
    if isinstance(value, (tuple, list)):
        return any(is_about(one, cell, depth - 1) for one in value)
    if isinstance(value, dict):
        return any(is_about(one, cell, depth - 1) for one in value.values())
    names = ("cell", "name", "result", "differences", "focus")
    return any(is_about(getattr(value, name, None), cell, depth - 1) for name in names)


PLANTED = ZeroDivisionError("planted")


def fail_in(monkeypatch, step, error=PLANTED):
    """Make a step raise where it is about the bad cell."""
    module, _, name = step.rpartition(".")
    owner = import_module(module)
    real, calls = getattr(owner, name), []

    def raise_planted(*arguments, **more):
        if any(is_about(one, BAD) for one in (*arguments, *more.values())):
            calls.append(name)
            raise copy.copy(error)  # each keeps where it was raised
        return real(*arguments, **more)

    monkeypatch.setattr(owner, name, raise_planted)
    return calls


RULES = ("logger.core.suspicion.signal._steady_dbm",)


def outputs(capsys, *argv):
    code = main([os.fspath(one) for one in argv])
    out, err = capsys.readouterr()
    return code, out, err


def rows(text, key="cells"):
    return {row["cell"]: row for row in json.loads(text)[key]}


@pytest.fixture
def check(run, capsys, caplog, monkeypatch):
    """Run a command with a step that fails; compare the rows of the other cells with clean ones."""

    def compare(step, *argv, reasons="warnings", key="cells", text=False, common=()):
        command = tuple(os.fspath(walk() if one == run else one) for one in argv)
        clean = clean_rows(command, key)
        fail_in(monkeypatch, step)
        code, out, _ = outputs(capsys, *argv, "--json")
        planted = rows(out, key)
        assert code == SOMETHING_LOST
        assert planted.keys() == clean.keys()
        for cell in GOOD:  # what is computed of all cells together depends on the bad one
            rest = [planted[cell].pop(name, None) for name in common]
            assert len(rest) == len(common)
            assert planted[cell] == {k: v for k, v in clean[cell].items() if k not in common}
        # a rule also runs on the device, where no text of an error is recorded
        error = "ZeroDivisionError (" if step in RULES else "ZeroDivisionError: planted"
        row = planted[BAD]
        assert row["error"].startswith(error)
        why = row[reasons] if isinstance(row[reasons], list) else [row[reasons]]
        assert any(error in text for text in why)
        assert any(error in one.getMessage() for one in caplog.records)
        if text:
            code, out, _ = outputs(capsys, *argv)
            assert code == SOMETHING_LOST
            assert "".join(error.split()) in "".join(out.split())
            assert BAD in out

    return compare


ESTIMATE = [
    "postproc.smoothing.locate",
    "postproc.smoothing.decide",
    "postproc.smoothing.timing_of",
    "postproc.smoothing.too_few",
    "postproc.smoothing.reference_ekf",
    "postproc.smoothing._passes",
    "postproc.estimators.least_squares.fit",
    "postproc.estimators.ekf_initialisation.why_not_located",
    "postproc.estimators.residuals.diagnose",
    "postproc.smoothing.merge",
    "postproc.smoothing.shares_of",
    "postproc.summary.region_of",
    "postproc.summary.truth_of",
    "logger.core.suspicion.signal._steady_dbm",
]


@pytest.mark.parametrize("step", ESTIMATE)
def test_every_step_of_an_estimate(step, check, run):
    check(step, "smooth", run, text=step.endswith("fit"))


def test_the_test_for_two_transmitters(check, run, monkeypatch):
    monkeypatch.setattr(smoothing, "decide", pipeline.decide)
    check("logger.core.locator.pipeline.divide", "smooth", run)


@pytest.mark.parametrize("details", [False, True])
def test_its_lines_on_the_terminal(details, run, capsys, monkeypatch):
    step = "_estimator_rows" if details else "_cell_rows"
    fail_in(monkeypatch, f"postproc.summary.{step}")
    code, out, _ = outputs(capsys, "smooth", run, *["-v"] * details)
    assert code == SOMETHING_LOST
    assert all(cell in out for cell in (BAD, *GOOD))
    assert "ZeroDivisionError: planted" in " ".join(out.split())


def test_a_rule_of_suspicion(check, run):
    check("logger.core.suspicion.signal._steady_dbm", "suspect", run, reasons="error", text=True)


CLAIM = f"{LAT},{LON},50"


@pytest.mark.parametrize(
    "step",
    [
        "postproc.verification.run_claims.verify_cell",
        "postproc.verification.run_claims.locate",
        "postproc.verification.run_claims._geodesic",
    ],
)
def test_a_claim_about_it(step, check, run):
    text = step.endswith("verify_cell")
    joint = ("q",)
    check(step, "verify", run, "--claim", CLAIM, reasons="reasons", text=text, common=joint)


@pytest.mark.parametrize(
    "step",
    ["postproc.verification.run_sites.within_one", "postproc.verification.run_sites.locate"],
)
def test_one_place_or_two(step, check, run):
    check(step, "verify", run, "--sites", reasons="why_not", text=True)


@pytest.fixture
def another(tmp_path):
    path = tmp_path / "another.h5"
    day_ns = 86_400 * 10**9
    write_run(
        path, seconds=170, cells=2, boot_id="another", run_id="another", utc0_ns=UTC0_NS + day_ns
    )
    return path


@pytest.mark.parametrize(
    "step",
    [
        "postproc.comparison.ground._surely_placed",
        "postproc.comparison.changes.differences_of",
        "postproc.comparison.changes._change_of_tested",
    ],
)
def test_what_changed(step, check, run, another):
    joint = ("change_db", "sigma_db", "contrast_db", "p", "where")
    check(step, "compare", run, another, "-v", reasons="text", common=("text", *joint))


@pytest.mark.parametrize(
    "step",
    [
        *("postproc.report.rendering.picture_of", "postproc.report.rendering.cell_section"),
        *("postproc.report.figures.fit_of", "postproc.report.cell_map._place"),
        "postproc.estimators.least_squares.fit",
    ],
)
def test_its_part_of_the_page(step, run, capsys, monkeypatch):
    page = run.with_suffix(".html")
    assert outputs(capsys, "report", run)[0] == 0
    clean = page.read_text()
    assert fail_in(monkeypatch, step) == []
    code, out, _ = outputs(capsys, "report", run)
    planted = page.read_text()
    assert code == SOMETHING_LOST
    assert "ZeroDivisionError: planted" in planted
    assert "2 cells in detail" in out
    for cell in (BAD, *GOOD):
        assert planted.count(f">{cell}<")
    assert planted.count("cell-2-") == clean.count("cell-2-") or step.endswith(".fit")


@pytest.mark.parametrize(
    "step",
    [
        *("postproc.view.view_model.picture_of", "postproc.view.scene._draw_area"),
        *("postproc.view.scene.cell_report", "postproc.view.scene._plots"),
    ],
)
def test_its_part_of_the_view(step, run, tmp_path, capsys, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.setattr("postproc.view.view_model.MOST_STEPS", 2)
    cells = [part for cell in (BAD, *GOOD) for part in ("--cell", cell)]
    saved = tmp_path / "walk.rrd"
    fail_in(monkeypatch, step)
    code, _, _ = outputs(capsys, "view", run, *cells, "--save", saved)
    assert code == SOMETHING_LOST
    drawn = rerun_recordings.chunks(saved)
    (good,) = GOOD
    reports = [path for path in drawn if path.startswith("/report/")]
    assert reports == [f"/report/{good}"]
    text = rerun_recordings.rows(rerun_recordings.static_columns(saved, reports[0]), ":text")
    assert f"{BAD}: its " in text[0][0].replace("\\", "")
    assert "ZeroDivisionError: planted" in text[0][0]
    assert not [path for path in drawn if BAD in path and "/rssi/" not in path]


def test_its_answer_in_an_export(run, tmp_path, capsys, monkeypatch):
    fail_in(monkeypatch, "postproc.interop.exporting.region_of")
    target = tmp_path / "cells.kml"
    code, out, err = outputs(capsys, "export", run, "--estimates", "-o", target)
    assert code == SOMETHING_LOST
    assert "2 cells" in out
    assert "ZeroDivisionError: planted" in err
    assert all(cell in target.read_text() for cell in (BAD, *GOOD))


@pytest.mark.parametrize(
    ("command", "step"),
    [
        ("plot", "postproc.pictures.plots.fit_of"),
        ("next", "postproc.guidance.next_walk.prepare"),
    ],
)
def test_commands_about_one_cell_end_in_one_line(command, step, run, capsys, monkeypatch):
    assert fail_in(monkeypatch, step) == []
    code, _, err = outputs(capsys, command, run, "--cell", BAD)
    assert code == 2
    assert err.splitlines()[-1].startswith(f"postproc: {BAD}: ")
    assert "ZeroDivisionError: planted" in err
    assert outputs(capsys, command, run, "--cell", GOOD[0])[0] == 0


def test_the_answer_without_a_run(run, another, capsys, monkeypatch):
    clean = rows(outputs(capsys, "smooth", run, another, "--json")[1])
    fail_in(monkeypatch, "postproc.smoothing.locate_cell")
    code, out, _ = outputs(capsys, "smooth", run, another, "--json")
    assert code == SOMETHING_LOST
    planted = rows(out)
    assert [planted[cell] for cell in GOOD] == [clean[cell] for cell in GOOD]
    assert "planted" in planted[BAD]["error"]


# --- which exceptions ---


class OwnError(Exception):
    pass


@pytest.mark.parametrize(
    "error",
    [
        *(ValueError("a\nb"), IndexError(), AssertionError(), MemoryError("1 TiB")),
        *(RecursionError("deep"), OSError(5, "io"), StopIteration(), OwnError("own")),
        *(UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"), RuntimeWarning("w")),
    ],
)
def test_any_exception_of_the_work_is_a_row(error, run, capsys, monkeypatch):
    fail_in(monkeypatch, "postproc.estimators.least_squares.fit", error)
    code, out, _ = outputs(capsys, "smooth", run, "--json")
    row = rows(out)[BAD]
    assert code == SOMETHING_LOST
    assert row["error"].startswith(type(error).__name__)
    assert "\n" not in row["error"]
    assert "(least_squares.py:" in row["error"] or "smoothing.py:" in row["error"]


def test_readings_without_the_answer_are_no_error(run, capsys, monkeypatch):
    fail_in(monkeypatch, "postproc.estimators.least_squares.fit", EstimationError("too flat"))
    code, out, err = outputs(capsys, "smooth", run, "--json")
    row = rows(out)[BAD]
    assert (code, row["warnings"][0], row["verdict"]) == (0, "too flat", "cannot tell")
    assert "error" not in row
    assert err == ""


def test_ctrl_c_and_errors_of_the_command_end_it(run, capsys, monkeypatch):
    fail_in(monkeypatch, "postproc.estimators.least_squares.fit", KeyboardInterrupt())
    assert outputs(capsys, "smooth", run)[0] == 130
    monkeypatch.undo()
    for error in (ConfigError("no such option"), ModuleNotFoundError("no scipy", name="scipy")):
        fail_in(monkeypatch, "postproc.estimators.least_squares.fit", error)
        assert outputs(capsys, "smooth", run)[0] == 2
        monkeypatch.undo()


def test_the_reason_stays_in_a_stored_result(run, capsys, monkeypatch):
    fail_in(monkeypatch, "postproc.estimators.least_squares.fit")
    assert outputs(capsys, "smooth", run)[0] == SOMETHING_LOST
    monkeypatch.undo()
    code, _, err = outputs(capsys, "report", run)
    assert "estimates are those of" in err
    assert code == SOMETHING_LOST
    assert "ZeroDivisionError: planted" in run.with_suffix(".html").read_text()
    assert outputs(capsys, "smooth", run)[0] == 0


# --- a process that ends ---


def test_a_cell_that_ends_its_process_has_a_row(run):
    parts = {0: observe_run(read_run(run)).observations.cells[0]}
    row = smoothing._cell_without_result(parts)
    assert (row.cell, row.n, row.verdict) == (parts[0].cell, len(parts[0]), "cannot tell")
    assert "its process ended" in row.error
    assert row.error in row.warnings[0]


# --- the boundary ---


def test_what_is_returned():
    assert attempt("c", "it", lambda: 3) == 3
    with pytest.raises(EstimationError, match="^c: it failed, .*ValueError: .*v"):
        attempt_alone("c", "it", lambda: int("v"))
