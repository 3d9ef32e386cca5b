import json

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix
from postproc.interop.formats import recognise
from postproc.interop.importing import Reading, import_walk
from postproc.interop.sighting import NoCell
from postproc.interop.track_file import read_track

SCAN = {
    "scan_program": "gsm_modem",
    "band": "ALL_BAND",
    "scan_finish": "2017-05-16T02:21:23.5",
    "scanner_public_ip": "192.0.2.1",
    "scan_results": [
        {"cell": "0", "arfcn": "0154", "rxl": "33", "rxq": "00", "mcc": "310", "mnc": "411",
         "bsic": "12", "cellid": "000f", "rla": "00", "txp": "05", "lac": "178d", "ta": "255"},
        {"cell": "4", "arfcn": "0237", "rxl": "31", "bsic": "00", "cellid": "ffff", "mcc": "",
         "mnc": "", "lac": "0000"},
    ],
}  # fmt: skip
CHANNEL = {
    "cgi_str": "310:260:275:20082", "bsic": "16", "mcc": "310", "mnc": "260", "lac": "275",
    "cellid": "20082", "scan_finish": "2017-05-16T02:21:24.0", "rxl": 24.0, "cell": 1, "arfcn": 684,
    "ta": 3,
}  # fmt: skip


def _place(second, lat):
    time = f"2017-05-16T02:21:{second:02d}.000Z"
    geometry = {"type": "Point", "coordinates": [-122.0, lat]}
    return {"scan_program": "gpsd", "sat_time": time, "geometry": geometry, "type": "Feature"}


def _write(path, *documents):
    path.write_text("".join(json.dumps(one) + "\n" for one in documents))
    return path


def test_hexadecimal_and_decimal_identities(tmp_path):
    source = _write(tmp_path / "cells.log", SCAN, {"scan_program": "heartbeat"}, CHANNEL)
    form = recognise(source)
    serving, nobody, beat, channel = form.read(source)
    assert form.name == "SITCH log, JSON"
    assert serving.fix == Fix(False, utc_ns=1_494_901_283_500_000_000)
    assert serving.reading == CellReading(
        "serving", "GSM", "310", "411", lac=0x178D, cid=15, arfcn=154, bsic=12, rxlev_raw=33
    )
    assert serving.rssi_dbm == -77.0
    assert nobody.reading == CellReading("neighbour", "GSM", arfcn=237, bsic=0, rxlev_raw=31)
    assert beat == NoCell(2, "heartbeat event")
    assert channel.reading == CellReading(
        "neighbour", "GSM", "310", "260", lac=275, cid=20082, arfcn=684, bsic=16, rxlev_raw=24, ta=3
    )


def test_the_sensors_own_positions_are_a_track(tmp_path):
    source = _write(tmp_path / "cells.log", SCAN)
    track = _write(tmp_path / "gps.log", _place(20, 37.0), _place(27, 37.0007))
    with pytest.raises(RunFileError, match="--track"):
        import_walk(source, tmp_path / "run.h5")
    reading = Reading(track=read_track(track))
    assert import_walk(source, tmp_path / "run.h5", reading=reading).n_rows == 2
    (fix,) = [record.value for _, record in read_run(tmp_path / "run.h5").records("fixes")]
    assert fix.lat_deg == pytest.approx(37.00035)
