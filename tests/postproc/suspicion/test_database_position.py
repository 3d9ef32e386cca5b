"""Rule S10: the levels of a walk against the position that a database has."""

import json

import pytest

from postproc.cli import main
from tests.kit.sample_results import LAT, LON, TRANSMITTER_M, UTM, cell_name, write_run

ROW = "GSM,{mcc},{net},{area},{cid},0,{lon},{lat},50,7,1,1282569574,1300155341,0\n"
AWAY_M = (3600.0, 2800.0)
"""A walk around a block cannot rule out half of it, as long as its noise may not be stationary."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("database")
    write_run(folder / "run.journal", seconds=300, cells=1)
    return folder


def _findings(folder, capsys, place_m, *options, run="run.journal"):
    x_m, y_m = UTM.to_xy(LAT, LON)
    lat_deg, lon_deg = UTM.to_latlon(x_m + place_m[0], y_m + place_m[1])
    mcc, net, area, cid = cell_name(0).split("-")
    export, database = folder / "cells.csv", folder / f"{place_m[0]:.0f}.db"
    export.write_text(ROW.format(mcc=mcc, net=net, area=area, cid=cid, lon=lon_deg, lat=lat_deg))
    assert main(["celldb", "import", str(export), "-o", str(database)]) == 0
    capsys.readouterr()
    command = ["suspect", str(folder / run), "--celldb", str(database), *options]
    assert main([*command, "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert main(command) == 0
    return cell, capsys.readouterr().out


def test_a_false_position_is_a_finding_about_the_whole_run(folder, capsys):
    cell, text = _findings(folder, capsys, AWAY_M)
    (finding,) = [one for one in cell["findings"] if one["rule"] == "S10"]
    assert finding["t_s"] is finding["lat"] is finding["lon"] is None
    assert finding["evidence"]["p"] <= 0.01
    assert 4000.0 < finding["evidence"]["apart_m"] < 5000.0
    assert cell["word"] == "nothing unusual"  # a database alone is often wrong
    assert "1 cell: nothing unusual" in text


def test_the_true_position_is_none(folder, capsys):
    cell, _ = _findings(folder, capsys, TRANSMITTER_M)
    assert "S10" not in {one["rule"] for one in cell["findings"]}


def test_a_stored_truth_changes_nothing(folder, capsys):
    write_run(folder / "without.journal", seconds=300, cells=1, truth=False)
    one, _ = _findings(folder, capsys, AWAY_M)
    other, _ = _findings(folder, capsys, AWAY_M, run="without.journal")
    assert one["findings"] == other["findings"]


def test_a_trusted_cell_has_no_finding(folder, capsys):
    baseline = folder / "baseline.db"
    assert main(["baseline", "add", str(folder / "run.journal"), "-b", str(baseline)]) == 0
    assert main(["baseline", "trust", cell_name(0), "moved last year", "-b", str(baseline)]) == 0
    cell, _ = _findings(folder, capsys, AWAY_M, "--baseline", str(baseline))
    assert cell["findings"] == []
