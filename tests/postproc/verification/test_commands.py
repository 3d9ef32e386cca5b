import json
import re

import numpy as np
import pytest

from logger.core.certainty import OnMap
from logger.core.errors import GeoError
from logger.core.types import Fix
from postproc.cli import main
from postproc.verification import run_claims
from postproc.verification.claims import parse_claim, swap_hint
from tests.kit import runs
from tests.kit.sample_results import LAT, LON, TRANSMITTER_M, UTM, cell_name, write_run
from tests.postproc.baseline.walks import cell, name, write_walk

BASE = "GSM,{mcc},1,4711,{cid},0,{lon},{lat},200,7,1,1282569574,1300155341,0\n"


def tell(capsys, *argv):
    assert main([str(a) for a in argv]) == 0
    return capsys.readouterr().out


def fails(capsys, *argv):
    assert main([str(a) for a in argv]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1, errors
    return errors[0]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.journal"
    write_run(path, seconds=300, cells=2)
    return path


def place(east, north):
    x, y = UTM.to_xy(LAT, LON)
    return UTM.to_latlon(x + east, y + north)


def test_verify_tells_a_true_claim_from_a_false_one(run, tmp_path, capsys):
    (true, far), cell = (place(*TRANSMITTER_M), place(900.0, 700.0)), cell_name(0)
    file = tmp_path / "claims.csv"
    file.write_text("cell,lat,lon\n" + "".join(f"{cell},{lat},{lon}\n" for lat, lon in (true, far)))
    output = json.loads(tell(capsys, "verify", run, "--claims", file, "--json"))
    good, bad = output["cells"]
    assert (good["verdict"], bad["verdict"]) == ("consistent", "rejected")
    assert good["q"] >= good["p"] > 0.05 >= bad["q"] >= bad["p"]
    assert good["followed"] == "indirect"
    assert len(good["detectable_m"]) == len(good["power"]) == 8
    assert output["without_claim"] == [cell_name(1)]
    assert "Benjamini" in output["false_discovery_control"]
    south = json.loads(
        tell(capsys, "verify", run, "--claim", "-33.5,-70.5", "--cell", cell, "--json")
    )["cells"]
    assert (south[0]["verdict"], south[0]["claim"]["lat_deg"]) == ("rejected", -33.5)
    text = tell(
        capsys, "verify", run, "--claim", f"{far[0]},{far[1]},20", "--cell", cell, "--pfa", "0.01"
    )
    assert "rejected" in text
    assert "no alarm by itself" not in text  # only this cell was asked about
    assert "over 1 claim " in text
    text = tell(capsys, "verify", run, "--claims", file)
    assert "1 cell observed without a claim" in text
    assert "over 2 claims" in text


def test_only_the_cells_asked_about_are_counted(run, tmp_path, capsys):
    file = tmp_path / "claims.csv"
    file.write_text("cell,lat,lon\n" + "".join(f"{cell_name(i)},{LAT},{LON}\n" for i in range(2)))
    for only, claimed, without in (
        ((), [cell_name(0), cell_name(1)], []),
        (("--cell", cell_name(0)), [cell_name(0)], []),
        (("--cell", cell_name(1)), [cell_name(1)], []),
    ):
        output = json.loads(tell(capsys, "verify", run, "--claims", file, *only, "--json"))
        assert ([cell["cell"] for cell in output["cells"]], output["without_claim"]) == (
            claimed,
            without,
        )
    file.write_text(f"cell,lat,lon\n{cell_name(0)},{LAT},{LON}\n")
    output = json.loads(
        tell(capsys, "verify", run, "--claims", file, "--cell", cell_name(1), "--json")
    )
    assert (output["cells"], output["without_claim"]) == ([], [cell_name(1)])


def test_claims_of_one_cell_share_its_estimate_and_its_power(run, tmp_path, capsys, monkeypatch):
    made = []
    for owner, work in ((run_claims, "locate"), (run_claims.ClaimTest, "power")):
        monkeypatch.setattr(owner, work, _with_notes(made, getattr(owner, work)))
    rows = [(k % 2, *place(50.0 * k, 0.0), 30.0 * (k // 10)) for k in range(20)]
    file = tmp_path / "claims.csv"
    lines = [f"{cell_name(i)},{lat},{lon},{sigma_m}" for i, lat, lon, sigma_m in rows]
    file.write_text("\n".join(["cell,lat,lon,sigma_m", *lines, ""]))
    together = json.loads(tell(capsys, "verify", run, "--claims", file, "--json"))["cells"]
    assert sorted(made) == ["locate"] * 2 + ["power"] * 4  # two cells, two sigmas
    file.write_text("\n".join(["cell,lat,lon,sigma_m", lines[15], ""]))
    (alone,) = json.loads(tell(capsys, "verify", run, "--claims", file, "--json"))["cells"]
    same = ("p", "level", "notices_m", "power", "best_deg")
    assert {key: together[15][key] for key in same} == {key: alone[key] for key in same}


def _with_notes(made, work):
    def with_note(*args):
        made.append(work.__name__)
        return work(*args)

    return with_note


def test_claims_about_cells_that_were_not_observed_are_named(run, tmp_path, capsys):
    file = tmp_path / "claims.csv"
    rows = [f"{cell},{LAT},{LON}" for cell in (cell_name(0), "262-1-1-1", "262-1-1-1", "other")]
    file.write_text("\n".join(["cell,lat,lon", *rows, ""]))
    says = "claimed but not observed, so not tested: 262-1-1-1, other\n"
    for only in ((), ("--cell", cell_name(0)), ("--cell", cell_name(1))):
        assert says in tell(capsys, "verify", run, "--claims", file, *only)
    output = json.loads(tell(capsys, "verify", run, "--claims", file, "--json"))
    assert output["not_observed"] == ["262-1-1-1", "other"]
    file.write_text("cell,lat,lon\n" + "".join(f"{k},1,2\n" for k in range(20)))
    assert "0, 1, 2, 3, 4, 5, 6, 7 and 12 more\n" in tell(capsys, "verify", run, "--claims", file)
    page = tmp_path / "page.html"
    tell(capsys, "report", run, "--claims", file, "-o", page)
    assert "Claimed but not observed, so not tested: 0, 1" in page.read_text()


def test_a_cell_written_with_other_zeros_is_asked_about(run, tmp_path, capsys):
    other = cell_name(0).replace("-01-", "-1-")
    assert other != cell_name(0)
    (tmp_path / "claims.csv").write_text(f"cell,lat,lon\n{other},{LAT},{LON}\n")
    hint = f"{other} (did you mean {cell_name(0)}?)"
    said = tell(capsys, "verify", run, "--claims", tmp_path / "claims.csv")
    assert f"claimed but not observed, so not tested: {hint}\n" in said
    assert main(["verify", str(run), "--claim", f"{LAT},{LON}", "--cell", other]) == 2
    assert f"cell {hint} was not observed" in capsys.readouterr().err


def test_a_swapped_claim_is_asked_about(run, capsys):
    lat, lon = place(*TRANSMITTER_M)
    output = json.loads(
        tell(capsys, "verify", run, "--claim", f"{lon},{lat}", "--cell", cell_name(0), "--json")
    )
    (cell,) = output["cells"]
    meant = f"did you mean {round(lat, 7)},{round(lon, 7)}? It is near the walk; "
    assert any(reason.startswith(meant) for reason in cell["reasons"])
    text = tell(capsys, "verify", run, "--claim", f"{lon},{lat}", "--cell", cell_name(0))
    assert meant in text
    told_km, asked_km = (
        int(re.search(rf"(\d+) km{end}", text)[1]) for end in (" from the walk\n", "\n")
    )
    assert told_km == asked_km


def test_each_of_several_claims_is_tested(run, capsys):
    claims = [",".join(map(str, place(*at_m))) for at_m in (TRANSMITTER_M, (900.0, 700.0))]
    asked = [word for claim in claims for word in ("--claim", claim)]
    output = tell(capsys, "verify", run, *asked, "--cell", cell_name(0), "--json")
    words = [cell["verdict"] for cell in json.loads(output)["cells"]]
    assert words == ["consistent", "rejected"]
    said = fails(capsys, "verify", run, "--claim", ",".join(claims))
    assert said.endswith("; each position has an option of its own")


def test_claims_are_tested_with_runs_of_several_places(run, tmp_path, capsys):
    """As `smooth`, which has an answer for each place."""
    log, far = tmp_path / "far.csv", tmp_path / "far.h5"
    rows = [f"{k},{48.1 + k * 1e-5:.5f},11.5,{-60 - k % 9},{cell_name(0)}" for k in range(60)]
    log.write_text("\n".join(["t_s,lat,lon,rssi_dbm,cell", *rows, ""]))
    tell(capsys, "import", log, "-o", far)
    claim = ",".join(map(str, place(*TRANSMITTER_M)))
    asked = ("verify", run, far, "--claim", claim, "--cell", cell_name(0), "--json")
    here, there = json.loads(tell(capsys, *asked))["groups"]
    assert (here["cells"][0]["verdict"], there["cells"][0]["verdict"]) == ("consistent", "rejected")
    assert here["place"] != there["place"]


def test_a_claim_is_tested_where_it_is_heard(tmp_path, capsys):
    """One log with an identity in two towns: that of the other town says nothing about it."""
    log, path, cell = tmp_path / "tour.csv", tmp_path / "tour.h5", "262-01-4711-1"
    rows = []
    for n, lat in ((200, 52.5), (150, 48.1)):
        for k in range(n):
            east_m, north_m = min(6.0 * k, 600.0), max(6.0 * k - 600.0, 0.0)
            level_dbm = -20.0 - 30.0 * np.log10(np.hypot(east_m - 300.0, north_m - 100.0))
            at = f"{lat + north_m / 111200.0:.6f},{13.0 + east_m / 72000.0:.6f}"
            rows.append(f"{len(rows) * 5 + (lat < 50.0) * 36000},{at},{level_dbm:.0f},{cell}")
    log.write_text("\n".join(["t_s,lat,lon,rssi_dbm,cell", *rows, ""]))
    tell(capsys, "import", log, "-o", path)
    for is_stored in (False, True):
        if is_stored:
            tell(capsys, "smooth", path)
        claims = ("--claim", "52.5009,13.0042", "--claim", "48.1009,13.0042")
        found = json.loads(tell(capsys, "verify", path, *claims, "--json"))["cells"]
        assert [one["n"] for one in found] == [200, 150]
        assert [one["distance_m"] < 300.0 for one in found] == [True, True]


@pytest.mark.parametrize(
    ("claim", "walk", "asked"),
    [
        ((13.4, 52.5), (52.5, 13.4), True),
        ((151.2, -33.8), (-33.8, 151.2), None),  # no position on Earth: the error says it
        ((52.5, 13.4), (52.5, 13.4), False),
        ((52.9, 13.4), (52.5, 13.4), False),  # 45 km away: near enough
        ((48.1, 11.6), (52.5, 13.4), False),  # far away either way
        ((45.2, 45.1), (45.1, 45.2), False),  # both are near
    ],
)
def test_who_is_asked_whether_a_claim_is_swapped(claim, walk, asked):
    if asked is None:
        with pytest.raises(GeoError, match="swapped"):
            parse_claim(",".join(map(str, claim)), None)
        return
    walk_at = OnMap(lat=walk[0], lon=walk[1])
    assert bool(swap_hint(parse_claim(",".join(map(str, claim)), None), walk_at)) == asked


def test_database_from_import_to_verify(run, tmp_path, capsys):
    lat, lon = place(*TRANSMITTER_M)
    export, db = tmp_path / "262.csv", tmp_path / "cells.db"
    export.write_text(
        BASE.format(mcc=262, cid=100, lat=lat, lon=lon) + BASE.format(mcc="x", cid=5, lat=1, lon=1)
    )
    assert main(["celldb", "import", str(export), "-o", str(db), "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["n_bad"] == 1
    assert "row 2" in output.err
    assert "1 cell; " in tell(capsys, "celldb", "import", export, "-o", db)
    (cell,) = json.loads(tell(capsys, "celldb", "lookup", db, "--cell", cell_name(0), "--json"))[
        "cells"
    ]
    assert cell["lat"] == pytest.approx(lat)
    assert "262-1-4711-100" in tell(capsys, "celldb", "lookup", db, "--near", f"{lat},{lon},50")
    assert "262-1-4711-100" in tell(capsys, "celldb", "lookup", db, "--near", f"{lat} {lon}")
    assert "no alarm by itself" in tell(capsys, "celldb", "lookup", db, "--near", "1,2")
    (checked,) = json.loads(tell(capsys, "verify", run, "--claims", db, "--json"))["cells"]
    assert (checked["cell"], checked["claim"]["sigma_m"]) == (cell_name(0), 100.0)
    assert checked["verdict"] != "rejected"


def test_sites(run, tmp_path, capsys):
    (found,) = json.loads(tell(capsys, "verify", run, "--sites", "--cell", cell_name(0), "--json"))[
        "cells"
    ]
    assert found["verdict"] == "no sign of two places"
    assert "are the same run" in fails(capsys, "verify", run, "--sites", "--against", run)
    write_run(
        tmp_path / "b.journal", seconds=200, cells=1, run_id="b" * 32, utc0_ns=runs.UTC0_NS + 10**15
    )
    both = json.loads(
        tell(capsys, "verify", run, "--sites", "--against", tmp_path / "b.journal", "--json")
    )["cells"]
    assert [(one["cell"], one["verdict"]) for one in both] == [
        (cell_name(0), "no sign of two places")
    ]
    said = tell(capsys, "verify", run, "--sites", "--against", tmp_path / "b.journal")
    assert "log factor" in said
    assert "share of 0 walks" not in said


def test_sites_of_two_cities(tmp_path, capsys):
    """44 km apart, where the places around one walk do not hold those of the other, and 500 km."""
    files = [
        write_walk(tmp_path, n, lambda k: (cell(1, -55.0 - abs(k - 30) // 2),), n=60, lat_deg=lat)
        for n, lat in enumerate((52.5, 52.9, 48.0))
    ]
    tell_sites = ("verify", files[0], "--sites", "--cell", name(1), "--against")
    (near,) = json.loads(tell(capsys, *tell_sites, files[1], "--json"))["cells"]
    assert near["verdict"] == "two places"
    assert sorted(round(lat, 2) for lat, _ in near["places"]) == [52.50, 52.90]
    assert "501 km apart, farther than any cell reaches" in fails(capsys, *tell_sites, files[2])


def test_mistakes_are_one_line(run, tmp_path, capsys):
    assert "is no position" in fails(capsys, "verify", run, "--claim", "here")
    assert "was not observed" in fails(
        capsys, "verify", run, "--claim", "52,13", "--cell", "nobody"
    )
    assert "at most 0.5" in fails(capsys, "verify", run, "--claim", "52,13", "--pfa", "7")
    assert "--against" in fails(capsys, "verify", run, "--claim", "52,13", "--against", run)
    assert "No such file" in fails(capsys, "verify", run, "--claims", tmp_path / "none")
    assert "no such file" in fails(
        capsys, "celldb", "lookup", tmp_path / "none", "--cell", "1-2-3-4"
    )
    assert "No such file" in fails(
        capsys, "celldb", "import", tmp_path / "none", "-o", tmp_path / "c.db"
    )
    assert "no such folder" in fails(capsys, "celldb", "import", run, "-o", tmp_path / "x" / "c.db")


def test_a_run_without_places_has_no_verdict(tmp_path, capsys):
    runs.write_journal(
        tmp_path / "a.journal", [record for record in runs.records(20) if record.source != "gnss"]
    )
    output = json.loads(
        tell(capsys, "verify", tmp_path / "a.journal", "--claim", "52,13", "--json")
    )
    assert {cell["verdict"] for cell in output["cells"]} == {"cannot tell"}
    assert output["warnings"]


def test_a_run_without_a_cell_says_that_nothing_is_tested(tmp_path, capsys):
    fixes = [record for record in runs.records(30) if isinstance(record.value, Fix)]
    runs.write_journal(tmp_path / "walk.journal", fixes)
    assert main(["verify", str(tmp_path / "walk.journal"), "--claim", "52,13"]) == 0
    assert capsys.readouterr().out == "no cell was observed: no claim is tested\n"
