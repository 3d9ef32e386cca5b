"""What a notebook shows of runs, results and cells."""

import re
import sys
from dataclasses import replace
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import postproc
from logger.core import answer
from logger.core.errors import ConfigError
from postproc.notebook_plan import OnPlan, round_step, svg
from postproc.report.rendering import select_cells
from tests.kit import sample_results as kit

MOST_BYTES = 60_000
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("plan") / "w.journal", seconds=400, cells=20)
    found = kit.sample_result(run, verdict="ambiguous", places=2)
    first, *rest = found.cells
    words = {first.cell: answer.Word("suspicious", 9.0, (), first.cell)}
    return replace(found, cells=(first, *rest), words=words)


def picture_in(html):
    return ET.fromstring(html[html.index("<svg") : html.index("</svg>") + 6])


def opacities(picture):
    return [
        path.get("fill-opacity") for path in picture.iter(f"{SVG}path") if path.get("fill-opacity")
    ]


def test_texts_are_short(result):
    run = result.runs[0].run
    observed = postproc.observations(run)
    suspicions = postproc.suspect(run)
    for shown in (run, result, *result.cells, observed, *observed.cells, observed.track,
                  result.cells[0].posterior, suspicions):  # fmt: skip
        lines = repr(shown).splitlines()
        assert len(lines) <= 10, shown
        assert max(map(len, lines)) <= 250, shown
    assert "20 cells, 1 suspicious, 0 located" in repr(result)
    assert "and 13 more" in repr(result)
    assert kit.cell_name(0) in repr(result.cells[0])


def test_a_result_shows_its_walk_and_both_regions(result):
    html = result._repr_html_()
    assert len(html.encode()) < MOST_BYTES
    picture = picture_in(html)
    assert opacities(picture) == ["0.15", "0.35"]
    assert next(picture.iter(f"{SVG}text")).text == "✕ 1"  # never by colour alone
    assert len(list(picture.iter(f"{SVG}circle"))) == 2  # both places
    assert "suspicious</span>" in html
    assert "and 8 more" in html
    assert "style" not in {element.tag.split("}")[-1] for element in picture.iter()}  # no page's


def test_cells_are_numbered_as_in_the_report(result):
    """The conspicuous, then the located, then by readings, whatever their order in the result."""
    first, *others, last = result.cells
    located = replace(last, verdict="located", n=1)
    mixed = replace(result, cells=(*others, located, first))
    names = [cell.cell for cell in select_cells(mixed.cells, 3, [first.cell])]
    assert names[:2] == [first.cell, last.cell]
    shown = re.findall("|".join(map(re.escape, names)), mixed._repr_html_())
    assert list(dict.fromkeys(shown)) == names


def test_a_cell_shows_where_it_was_heard(result):
    html = result.cells[0]._repr_html_()
    assert "readings: suspicious; " in html
    assert len(html.encode()) < MOST_BYTES
    assert opacities(picture_in(html)) == ["0.15", "0.35"]
    without = replace(result.cells[0], posterior=None, obs=None, verdict="cannot tell")
    assert "<svg" not in without._repr_html_()


def test_text_of_a_run_is_no_markup(result):
    named = replace(result.cells[0], cell="<script>alert(1)</script>")
    for html in (named._repr_html_(), replace(result, cells=(named,))._repr_html_()):
        assert "<script" not in html


def test_a_long_walk_stays_small():
    rng = np.random.default_rng(1)
    walks = [np.cumsum(rng.normal(0.0, 30.0, (20_000, 2)), axis=0) for _ in range(3)]
    cell = OnPlan("1", "", np.zeros((1, 2)), {95: [walks[0][:5000]]})
    text = svg(walks, np.vstack(walks), [cell])
    assert len(text.encode()) <= 40_000
    ET.fromstring(text)
    assert svg([], np.empty((0, 2)), []) == ""


def test_a_plot_is_to_scale_in_metres(result, monkeypatch):
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    axes = result.plot()
    assert axes.get_aspect() == 1.0
    track = result.runs[0].observations.track
    assert np.allclose(axes.lines[0].get_xydata()[0], track.xy_m[:, 0])
    assert any("suspicious" in text.get_text() for text in axes.get_legend().get_texts())
    own = plt.figure().subplots()
    assert result.cells[0].plot(own) is own
    assert result.plot(kit.cell_name(1), own) is own
    with pytest.raises(ConfigError, match="not in this result"):
        result.plot("nobody")
    plt.close("all")


def test_a_frame_has_a_row_a_cell(result, monkeypatch):
    pytest.importorskip("pandas", reason="pandas comes with `survey`")
    frame = replace(
        result, cells=(replace(result.cells[0], heard_utc_ns=(0, 10**9)), *result.cells[1:])
    ).to_frame()
    assert len(frame) == 20
    assert (frame["word"][0], frame["verdict"][0]) == ("suspicious", "ambiguous")
    assert frame["r50_m"][0] < frame["r95_m"][0]
    assert str(frame["last_utc"][0]) == "1970-01-01 00:00:01+00:00"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigError, match="pip install pandas"):
        result.to_frame()


@pytest.mark.parametrize(
    ("span", "most", "step"), [(950, 12, 100), (120, 12, 10), (0, 5, 1), (2401, 12, 500)]
)
def test_steps_are_round(span, most, step):
    assert round_step(span, most) == step


def test_a_plot_of_nothing_has_no_legend(result):
    axes = replace(result, runs=(replace(result.runs[0], observations=None),), cells=()).plot()
    assert axes.get_legend() is None
    plt.close(axes.figure)
