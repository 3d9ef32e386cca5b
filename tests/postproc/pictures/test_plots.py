from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from logger.core.answer import Provenance, answer_of
from logger.core.errors import ConfigError, RunFileError
from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.pictures import colours
from postproc.pictures.plots import draw_run, figure_of, save_figure, strips_of
from postproc.pictures.survey import Clock, Levels
from postproc.smoothing import smooth_runs
from postproc.summary import estimator_table
from tests.kit import sample_results as kit
from tests.kit.runs import meta


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("plots") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run)


def with_progress(figure):
    """Every text of a figure."""
    figure.draw_without_rendering()
    return "\n".join(
        text.get_text() for text in figure.findobj(match=lambda a: hasattr(a, "get_text"))
    )


def with_verdict(result, verdict, *warnings):
    cells = tuple(replace(cell, verdict=verdict, warnings=warnings) for cell in result.cells)
    return replace(result, cells=cells)


@pytest.mark.parametrize(
    ("suffix", "magic"),
    [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("PNG", b"\x89PNG")],
)
def test_format_by_suffix(result, tmp_path, suffix, magic):
    draw_run(result, tmp_path / f"walk.{suffix}")
    assert (tmp_path / f"walk.{suffix}").read_bytes().startswith(magic)
    assert len(list(tmp_path.iterdir())) == 1


def test_every_format_that_is_offered_is_written(tmp_path):
    offered = set(FigureCanvasBase.filetypes) - {"pgf"}  # that wants LaTeX
    assert offered > {"gif", "jpg", "tiff", "webp"}
    for suffix in sorted(offered):
        save_figure(Figure((1.0, 1.0)), tmp_path / f"walk.{suffix}")
        assert (tmp_path / f"walk.{suffix}").stat().st_size > 100


def test_every_estimator_is_named(result):
    text = with_progress(figure_of(result))
    for part in (
        "95 % region",
        "50 % region",
        "EKF",
        "least squares",
        "reference EKF (wrong)",
        "truth (simulated)",
    ):
        assert part in text
    assert "SIMULATED" in text
    assert "located: most likely within 14 m, surely within 29 m" in text


def test_the_title_states_why_there_is_no_position(result):
    text = with_progress(figure_of(with_verdict(result, "cannot tell", "the walk spans only 3 m")))
    assert "cannot tell: the walk spans only 3 m" in text
    assert "most likely within 14 m, surely within 29 m of the best position" in text


def test_the_title_says_what_the_radii_suppose(result):
    first, *others = with_verdict(result, "cannot tell", "far away").cells
    distant = replace(result, cells=(kit.as_if_distant(first), *others))
    assert "of the best position, if it is no distant mast" in with_progress(figure_of(distant))


def test_a_run_that_is_not_simulated_does_not_say_so(tmp_path):
    run = kit.write_run(tmp_path / "x.journal", seconds=60, cells=2, truth=False, utc=False)
    text = with_progress(figure_of(kit.sample_result(run)))
    assert "imulated" not in text
    assert "SIMULATED" not in text
    assert "date unknown" in text


def test_modes_have_a_label_only_where_there_are_several(result):
    run = result.runs[0].run
    several = kit.sample_result(run, places=2, verdict="ambiguous")
    assert with_progress(figure_of(several)).splitlines().count("50 %") == 2
    assert "> 99 %" not in with_progress(figure_of(result))


def test_a_place_that_the_answer_does_not_list_is_in_no_picture_and_no_table(result):
    """As `relevant_modes` says: a sharp peak with less than 1 % of the probability."""
    several = kit.sample_result(result.runs[0].run, places=2, verdict="ambiguous")
    one, other = several.cells[0].posterior.modes
    modes = (replace(one, probability=0.994), replace(other, probability=0.006, peak=0.4))
    posterior = replace(several.cells[0].posterior, modes=modes)
    cell = replace(several.cells[0], posterior=posterior)
    text = with_progress(figure_of(replace(several, cells=(cell,))))
    assert "most likely position" in text
    assert "< 1 %" not in text
    rows = estimator_table(answer_of("a", "located", (), Provenance(9), posterior)).rows
    assert not [row for row in rows if "position" in str(row[0])]


def test_plan_is_to_scale(result):
    plan = figure_of(result).axes[0]
    assert plan.get_aspect() == 1.0
    west, east = plan.get_xlim()
    south, north = plan.get_ylim()
    assert west < 0.0 < east
    assert south < 0.0 < north


def test_the_legend_names_positions_outside_the_plan(result):
    cell = result.cells[0]
    state = cell.batch.state + np.array([6000.0, 0.0, 0.0, 0.0])
    away = replace(result, cells=(replace(cell, batch=replace(cell.batch, state=state)),))
    assert "least squares, 5." in with_progress(figure_of(away))


@pytest.mark.parametrize(
    "records",
    [
        [],
        [("scan", 0, "c"), ("scan", 1, "c")],
        [("fix", 0)],
        [("fix", 0), ("scan", 0, "$a_{b}$ é")],
        [("fix", 0), *(("scan", i, "same place") for i in range(4))],
    ],
    ids=["nothing", "no fix", "only a fix", "one reading", "standing still"],
)
def test_runs_with_few_records(records, tmp_path):
    writer = RunWriter(tmp_path / "x.journal", meta())
    for kind, at_s, *label in records:
        cells = tuple(CellReading("scan", label=name, rssi_dbm=-70.0) for name in label)
        value = Fix(True, None, 52.0, 13.0) if kind == "fix" else Scan(at_s, cells, None)
        writer.append(Record(at_s * 10**9 // 4, "test", value))
    writer.close(0, "test")
    draw_run(smooth_runs([read_run(tmp_path / "x.journal")]), tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 1000


def test_unknown_format_is_one_line(result, tmp_path):
    with pytest.raises(ConfigError, match=r"x\.walk: a picture ends in .*\.png"):
        draw_run(result, tmp_path / "x.walk")


def test_missing_folder_is_one_line(result, tmp_path):
    with pytest.raises(RunFileError, match="no such folder"):
        draw_run(result, tmp_path / "absent" / "x.png")


def test_a_folder_of_the_same_name_is_one_line(result, tmp_path):
    (tmp_path / "x.png").mkdir()
    with pytest.raises(RunFileError, match="cannot write"):
        draw_run(result, tmp_path / "x.png")


def test_colours_of_levels():
    rgb = colours.level_colours(np.array([-110.0, -80.0, -50.0, -40.0, np.nan]), -110.0, -50.0)
    assert rgb.shape == (5, 3)
    assert rgb[0].tolist() == [88, 78, 168]
    assert rgb[2].tolist() == rgb[3].tolist() == [238, 202, 44]
    assert rgb[1].tolist() == [50, 170, 159]
    assert rgb[4].tolist() == list(colours.QUIET)


def test_no_level_has_the_colour_of_a_suspicious_cell():
    scale = colours.level_scale(256).astype(int)
    assert np.abs(scale - colours.word_colour("suspicious")).max(axis=1).min() > 60


CLOCK = Clock(np.array([10**9]), (None,))


def levels(name, seconds, level_dbm):
    return Levels(
        name, 10**9 + (np.array(seconds) * 1e9).astype(np.int64), np.array(level_dbm, float)
    )


def test_levels_are_in_their_intervals():
    often = levels("a", np.arange(0, 241), np.linspace(-50, -60, 241))
    strips = strips_of([often, None, levels("b", [121, 121.5, 239], [-70, -90, -75])], CLOCK)
    assert strips.minutes == pytest.approx(4.0)
    assert strips.level_dbm.shape == (3, 120)
    has_reading = np.isfinite(strips.level_dbm)
    assert has_reading.sum(axis=1).tolist() == [120, 0, 2]
    assert strips.level_dbm[0, [0, -1]] == pytest.approx([-50.0, -60.0], abs=0.1)
    assert np.flatnonzero(has_reading[2]).tolist() == [60, 119]
    assert strips.level_dbm[2, [60, 119]].tolist() == [-80.0, -75.0]


def test_intervals_are_no_finer_than_the_scans():
    """A cell that is read every ten seconds has no gap."""
    strips = strips_of([levels("a", np.arange(0, 600, 10), np.full(60, -70.0))], CLOCK)
    assert np.all(np.isfinite(strips.level_dbm))


def test_without_a_level_there_are_no_strips():
    assert strips_of([], CLOCK) is None
    assert strips_of([None], CLOCK) is None
    assert strips_of([levels("a", [], [])], CLOCK) is None
