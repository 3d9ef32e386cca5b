"""A measured walk with a surveyed transmitter, through the commands a user types."""

import csv
import json

import pytest
import shapely

from logger.core.geo import Utm
from postproc.cli import main


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
