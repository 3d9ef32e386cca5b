"""A measured walk with a surveyed transmitter, through the commands a user types."""

import csv
import json

import pytest
import shapely

from logger.core.model.prior import Prior
from logger.core.places import Utm
from logger.core.runfile import read_run
from postproc.cli import main
from postproc.interop.importing import import_walk
from postproc.smoothing import locate_cell
from postproc.walk import observe_run


@pytest.mark.parametrize("trace", ["campus_1105_125358_n124", "campus_1031_113551_n351"])
def test_a_leuven_walk_from_csv_to_an_honest_answer(traces, tmp_path, capsys, trace):
    folder = traces / "kuleuven_lora_p2p"
    truth = json.loads((folder / "truth.json").read_text())["transmitters"]["campus"]
    with (folder / f"{trace}.csv").open() as file:
        rows = sum(1 for _ in csv.DictReader(file))
    run = tmp_path / "run.h5"
    assert main(["import", str(folder / f"{trace}.csv"), "-o", str(run)]) == 0
    capsys.readouterr()
    assert main(["smooth", str(run), "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert (cell["cell"], cell["n"]) == ("target", rows)
    # 10 m are allowed for the surveyed place and the receiver
    utm = Utm.at(truth["lat"], truth["lon"])
    region = shapely.transform(
        shapely.geometry.shape(cell["region95"]["geojson"]),
        lambda lonlat: [utm.to_xy(lat, lon) for lon, lat in lonlat],
    )
    assert region.distance(shapely.Point(utm.to_xy(truth["lat"], truth["lon"]))) <= 10.0
    assert cell["region95"]["area_m2"] == pytest.approx(region.area, rel=0.05)
    assert cell["verdict"] != "located" or cell["best"]["r95_m"] < 200.0


def _walks(traces, campaign):
    truth = json.loads((traces / campaign / "truth.json").read_text())
    return [traces / campaign / one["file"] for one in truth["traces"].values()]


def test_a_walk_of_each_campaign_is_imported_without_options(traces, tmp_path):
    """Only a true clock is believed; `t_s` of five campaigns counts the rows or was made up."""
    campaigns = sorted(folder.name for folder in traces.iterdir() if folder.is_dir())
    has_times = {
        campaign: import_walk(_walks(traces, campaign)[0], tmp_path / "run.h5").has_times
        for campaign in campaigns
    }
    no_clock = {
        *("covenant_gsm1800", "lebanon_lorawan", "recife_gsm1800"),
        *("recife_ufpe_gsm1800", "recife_wcnc_gsm1800", "szu_lora"),
    }
    assert has_times == {name: name not in no_clock for name in campaigns}


@pytest.mark.parametrize("campaign", ["belgium_lte_walks", "southbend_cbrs_raw"])
def test_a_telephone_that_repeats_its_reports_is_never_located(traces, tmp_path, campaign):
    for source in _walks(traces, campaign):
        import_walk(source, tmp_path / "run.h5")
        (obs,) = observe_run(read_run(tmp_path / "run.h5")).observations.cells
        repeats = obs.repeats
        assert len(repeats) > (0.8 if campaign.startswith("belgium") else 0.35) * len(obs)
        found = locate_cell(obs, Prior())
        assert found.verdict != "located", source.name
        assert f"{len(repeats)} of {len(obs)} readings repeat" in " / ".join(found.warnings)


@pytest.mark.slow
def test_hardly_a_measured_walk_loses_readings_as_repeats(traces, tmp_path):
    """Of all walks with honest levels none; one device reported its last level between packets."""
    with (traces / "reference.csv").open(newline="") as file:
        walks = [(row["dataset"], row["trace"]) for row in csv.DictReader(file)]
    losers = []
    for campaign, trace in walks:
        import_walk(traces / campaign / f"{trace}.csv", tmp_path / "run.h5")
        (obs,) = observe_run(read_run(tmp_path / "run.h5")).observations.cells
        losers += [(campaign, trace)] if obs.repeats else []
    assert losers == [("ufjf_lora", "car_ed")]
