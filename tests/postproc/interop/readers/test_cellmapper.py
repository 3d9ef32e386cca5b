import pytest

from logger.core.runfile import read_run
from logger.core.types import CellReading
from postproc.interop.importing import import_walk, recognise
from postproc.interop.sighting import BadRow, NoCell
from postproc.walk import observe_run

HEAD = "latitude,longitude,altitude,MCC,MNC,LAC,CID,signal,type,subtype,ARFCN,PSC\n"
ROWS = (
    "52.5,13.5,34,262,1,4711,17,-71,GSM,EDGE,62,\n"
    "52.5,13.5001,34,262,1,70,256259,-99,LTE,LTE-A,1300,5\n"
    "52.5,13.5001,34,262,1,7,5,-99,CDMA,EVDO,,\n"
    "52.5,13.5001,34,262,1,7,5,,UMTS,HSPA,,\n"
)


@pytest.mark.parametrize("head", [HEAD, ""])
def test_rows_with_and_without_the_header(tmp_path, head):
    (tmp_path / "c.csv").write_text(head + ROWS)
    form = recognise(tmp_path / "c.csv")
    gsm, lte, cdma, empty = form.read(tmp_path / "c.csv")
    assert form.name == "CellMapper CSV"
    assert gsm.reading == CellReading(
        "scan", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, rssi_dbm=-71.0
    )
    assert lte.reading == CellReading(
        "scan", "LTE", "262", "01", tac=70, cid=256259, arfcn=1300, pci=5, rsrp_dbm=-99.0
    )
    assert [type(cdma), type(empty)] == [NoCell, BadRow]


def test_only_the_order_of_the_rows_counts(tmp_path):
    (tmp_path / "c.csv").write_text(HEAD + ROWS)
    imported = import_walk(tmp_path / "c.csv", tmp_path / "run.h5")
    assert (imported.n_rows, imported.has_times) == (2, False)
    assert "without times" in observe_run(read_run(tmp_path / "run.h5")).warnings[0]
