"""Reports of runs with few records, of ambiguous cells and of several runs; figures as files."""

from dataclasses import replace

import numpy as np
import pytest

from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from postproc.report.rendering import make_report, select_cells
from postproc.result import ObservedRun, Result, RunShare
from postproc.smoothing import smooth_runs
from tests.kit import sample_results as kit
from tests.kit.html_page import Page
from tests.kit.runs import write_journal


def write(path, records, **changes):
    write_journal(path, records, **changes)
    return read_run(path)


def scan(t_ns, name):
    cells = (CellReading("scan", label=name, rssi_dbm=-60.0),)
    return Record(t_ns, "modem", Scan(t_ns, cells, None))


@pytest.mark.parametrize(
    "records",
    [
        [],
        [Record(0, "logger", Note("info", "start", "only a note"))],
        [scan(0, "a"), scan(10**9, "b")],
        [Record(0, "gnss", Fix(True, None, 52.0, 13.0))],
        [Record(0, "gnss", Fix(True, None, 52.0, 13.0)), scan(10, "a")],
        [
            Record(0, "gnss", Fix(True, None, 52.0, 13.0)),
            *(scan(i * 10**8, "a") for i in range(9)),
        ],
        [Record(0, "gnss", Fix(False)), scan(10, "漢")],
    ],
    ids=[
        "nothing",
        "a note",
        "no fix",
        "only a fix",
        "one reading",
        "standing still",
        "invalid fix",
    ],
)
def test_runs_with_few_records(records, tmp_path):
    page = Page(make_report(smooth_runs([write(tmp_path / "x.journal", records)])).html)
    assert page.all("h1")[0].text
    assert "date unknown" in page.text


def test_an_ambiguous_cell_has_advice(tmp_path):
    """A straight walk past a transmitter: both sides fit, and the page advises where to walk."""
    rng = np.random.default_rng(1)
    x0, y0 = kit.UTM.to_xy(kit.LAT, kit.LON)
    records = []
    for i in range(160):
        lat, lon = kit.UTM.to_latlon(x0 + 3.0 * i, y0)
        level = -35.0 - 30.0 * np.log10(np.hypot(3.0 * i - 240.0, 80.0)) + rng.normal(0.0, 1.0)
        readings = (CellReading("scan", "GSM", "262", "01", 1, 7, rssi_dbm=float(level)),)
        records += [
            Record(i * 10**9, "gnss", Fix(True, None, lat, lon, hdop=0.9)),
            Record(i * 10**9 + 1, "modem", Scan(i * 10**9, readings, None)),
        ]
    result = smooth_runs([write(tmp_path / "straight.journal", records)])
    (cell,) = result.cells
    assert cell.verdict == "ambiguous"
    page = Page(make_report(result).html)
    assert page.all("h1")[0].text == "0 of 1 cell located, 1 ambiguous"
    article = page.all("article")[0].text
    assert "Ambiguous: the levels fit several places: " in article
    (advice,) = [one.text for one in page.all("p") if one.get("class") == "advice"]
    best = kit.json_of(result)["cells"][0]["modes"]
    assert any(f"walk past {mode['lat']:.5f} {mode['lon']:.5f}" in advice for mode in best)
    assert "position 2:" in page.text


def test_cells_in_detail_are_located_ones_first_then_by_readings(result):
    a, b, c = result.cells
    cells = [
        replace(a, verdict="cannot tell", n=9),
        replace(b, verdict="ambiguous", n=1),
        replace(c, verdict="located"),
    ]
    assert [cell.cell for cell in select_cells(cells, 2)] == [c.cell, b.cell]
    assert select_cells([replace(a, obs=None)], 2) == []
    assert [cell.cell for cell in select_cells(cells, 2, [a.cell])] == [a.cell, c.cell]
    assert [cell.cell for cell in select_cells(cells, 3, [b.cell, c.cell])][:2] == [b.cell, c.cell]


def test_a_suspicious_cell_without_a_position_leads_the_page(result):
    nowhere = replace(result.cells[1], obs=None, posterior=None, warnings=("no position",))
    odd = kit.with_word(replace(result, cells=(result.cells[0], nowhere)), 1)
    top = Page(make_report(odd, first=(nowhere.cell,)).html).all("article")[0]
    assert nowhere.cell in top.text
    assert "Cannot tell: no position." in top.text


def test_the_overview_is_written_as_well(report, result, tmp_path):
    alone = replace(report, figures=())
    assert [path.name for path in alone.write_figures(tmp_path)] == [
        "map.png",
        "map.svg",
        "overview.png",
        "overview.svg",
    ]
    assert (tmp_path / "overview.png").read_bytes().startswith(b"\x89PNG")
    assert make_report(replace(result, cells=result.cells[:1]), most=0).overview is None


def test_several_runs_on_one_page(result, tmp_path):
    other = kit.write_run(tmp_path / "second.journal", seconds=120, cells=3)
    cell = result.cells[0]
    short = replace(cell, posterior=None)
    shares = (RunShare(0, 60, 0.0, 0.0), RunShare(1, 60, 2.5, 1.0))
    merged = replace(cell, shares=shares, without={0: short, 1: cell})
    walks = (replace(result.runs[0], warnings=()), ObservedRun(other, None, ("of two",)))
    together = Result(walks, (merged,), ("about both",))
    page = Page(make_report(together).html)
    assert len(page.all("svg")) == 3  # the map, plan and distance: each run has its clock
    assert "second.journal" in page.text
    assert {"2.5", "1.0"} <= {one.get("value") for one in page.all("data")}
    assert "about both" in page.text
    assert "of two" in page.text
