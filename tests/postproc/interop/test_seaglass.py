import json

import pytest

from logger.core.types import Broadcast, CellReading
from postproc.interop.formats import recognise
from postproc.interop.sighting import BadRow, NoCell, Remark

BCCH = {
    "bsic": 10, "ber": 0.0, "mcc": 262, "mnc": 1, "lac": 4711, "cell_id": 17,
    "cell_status": "CELL_SUITABLE", "num_arfcn": 1, "arfcns": [62], "num_channels": 2,
    "channels": [62, 70], "croffset": 30, "penaltyt": 0, "t3212": 10,
}  # fmt: skip


def _scan(**gsm):
    measured = [
        {"arfcn": 62, "rx_lev": -71, "measurement_blob": "arfcn: 62", "bcch": BCCH},
        {"arfcn": {"$numberInt": "80"}, "rx_lev": -95, "measurement_blob": "arfcn: 80"},
        {"arfcn": 81, "measurement_blob": ""},
    ]
    place = {"mode": 3, "lon": 13.5, "alt": 34.0, "epx": 3.0, "epy": 3.0}
    return {
        "_id": {"$oid": "5f"},
        "gsm": {"scan_blob": "#CSURV", "error": False, "measurements": measured} | gsm,
        "gps_before": place | {"lat": 52.5, "time": "2024-05-01T09:59:00.000Z"},
        "gps_after": place | {"lat": 52.501, "time": "2024-05-01T10:00:00.000Z"},
        "sensor_name": "s",
    }


@pytest.mark.parametrize("as_list", [True, False])
def test_channels_are_in_the_middle_of_the_way(tmp_path, as_list):
    scans = [_scan(), _scan(jammed=True, measurements=[]), {"gsm": 1}]
    text = json.dumps(scans) if as_list else "\n".join(map(json.dumps, scans)) + "\n{broken\n"
    (tmp_path / "scan.json").write_text(text)
    form = recognise(tmp_path / "scan.json")
    decoded, plain, *rest = form.read(tmp_path / "scan.json")
    assert (form.name, form.has_scans) == ("SeaGlass scans, JSON", True)
    assert (decoded.t_ns, decoded.lat_deg) == (1_714_557_600 * 10**9, pytest.approx(52.5005))
    # half of 111 m, spread evenly, and 3 m at 95 %
    assert decoded.fix.acc_m == pytest.approx(1.51 * 32.1, rel=0.01)
    assert decoded.reading == CellReading(
        "scan", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, bsic=10, rssi_dbm=-71.0,
        broadcast=Broadcast((62, 70), 60, 0, 10),
    )  # fmt: skip
    assert plain.reading == CellReading("scan", "GSM", arfcn=80, rssi_dbm=-95.0)
    assert [type(row) for row in rest] == [BadRow, NoCell, BadRow] + [BadRow] * (not as_list)


def test_jamming_is_a_remark(tmp_path):
    (tmp_path / "scan.json").write_text(json.dumps(_scan(jammed=True)))
    *_, remark = recognise(tmp_path / "scan.json").read(tmp_path / "scan.json")
    assert isinstance(remark, Remark)
    assert "jamming" in remark.text


def test_a_way_across_the_date_line(tmp_path):
    scan = _scan()
    scan["gps_before"] |= {"lat": -17.8, "lon": 179.9995}
    scan["gps_after"] |= {"lat": -17.8, "lon": -179.9995}
    (tmp_path / "scan.json").write_text(json.dumps([scan]))
    decoded, *_ = recognise(tmp_path / "scan.json").read(tmp_path / "scan.json")
    assert abs(decoded.lon_deg) == pytest.approx(180.0, abs=1e-6)
