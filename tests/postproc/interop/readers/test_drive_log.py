import json

import pytest

from logger.core.runfile import read_run
from logger.core.types import Scan
from postproc.cli import main

HEADER = "t_s,lat,lon,rat,mcc,mnc,lac_tac,cid,arfcn,pci_bsic,level_dbm,serving,ta\n"
ROWS = """\
100.0,51.9,-8.5,GSM,404,57,1681,34832,116,16,-57,1,2
100.0,51.9,-8.5,GSM,,,,,78,13,-76,0,
100.0,51.9,-8.5,GSM,,,,,78,13,-77,0,
101.0,51.9,-8.5,LTE,272,,40122,124546051,,,-79,1,
102.0,,,LTE,272,,40122,124546051,,,-79,1,
103.0,51.9,-8.5,5.5G,272,,40122,1,,,-79,1,
"""


def test_codes_of_a_table_of_floats(tmp_path, capsys):
    """A table with empty fields becomes one of floats; a spreadsheet drops leading zeros."""
    rows = """\
100.0,51.9,-8.5,LTE,334.0,020,40122.0,124546051.0,,,-79,1,
101.0,51.9,-8.5,LTE,272.0,1.0,40122.0,124546051.0,,,-79,1,
102.0,51.9,-8.5,LTE,eir,-5,40122,124546051,,,-79,1,
"""
    (tmp_path / "log.csv").write_text(HEADER + rows)
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    assert "line 4: mcc is no integer: 'eir'" in capsys.readouterr().err
    scans = [r.value for _, r in read_run(tmp_path / "run.h5").records("scans")]
    assert [scan.readings[0].cell for scan in scans] == [
        "334-020-40122-124546051",
        "272-01-40122-124546051",
    ]


def test_rows_of_one_time_are_one_scan(tmp_path, capsys):
    (tmp_path / "log.csv").write_text(HEADER + ROWS)
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    out, errors = capsys.readouterr()
    assert "drive test CSV" in out
    assert "line 6: lat is empty" in errors
    assert "no technology of 2G to 5G is called '5.5G'" in errors
    scans = [r.value for _, r in read_run(tmp_path / "run.h5").records("scans")]
    assert all(isinstance(scan, Scan) for scan in scans)
    gsm, lte = scans
    serving, neighbour = gsm.readings
    assert serving.cell == "404-57-1681-34832"
    assert (serving.role, serving.bsic, serving.arfcn, serving.ta) == ("serving", 16, 116, 2)
    assert (neighbour.cell, neighbour.arfcn, neighbour.rssi_dbm) == (None, 78, -77.0)
    assert lte.readings[0].cell == "272-?-40122-124546051"  # the network code is unknown
    assert (lte.readings[0].tac, lte.readings[0].rsrp_dbm) == (40122, -79.0)


def test_a_row_that_is_repeated_at_another_place_is_no_other_scan(tmp_path):
    """A telephone repeats its reading within a second where its position has moved on."""
    row = "LTE,272,,40122,10807297,,,-82,1,"
    places = [(100, 51.9), (100, 51.901), (101, 51.901)]
    rows = [f"{t_s}.0,{lat_deg},-8.5,{row}\n" for t_s, lat_deg in places]
    (tmp_path / "log.csv").write_text(HEADER + "".join(rows))
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    scans = [r.value for _, r in read_run(tmp_path / "run.h5").records("scans")]
    assert [len(scan.readings) for scan in scans] == [1, 1]


@pytest.mark.parametrize(("zero_s", "utc_ns"), [(0, None), (1_574_331_500, 1_574_331_600 * 10**9)])
def test_seconds_of_ten_digits_are_utc(tmp_path, zero_s, utc_ns):
    row = "272,01,40122,1,,,-79,1,"
    (tmp_path / "log.csv").write_text(f"{HEADER}{zero_s + 100}.0,51.9,-8.5,LTE,{row}\n")
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    (fix,) = [record.value for _, record in read_run(tmp_path / "run.h5").records("fixes")]
    assert fix.utc_ns == utc_ns


def test_broadcast_lists_let_the_rules_of_neighbours_speak(tmp_path, capsys):
    """Eight cells list each other; one lists nobody that is heard, and is listed by nobody."""
    header = HEADER.replace("ta\n", "ta,neighbour_arfcns\n")
    channels = range(10, 18)
    lists = {channel: " ".join(str(c) for c in channels if c != channel) for channel in channels}
    rows = [
        f"{k * 5},52.5{k:02d},13.4,GSM,262,01,801,{channel},{channel},16,-70,0,,{listed}"
        for k in range(6)
        for channel, listed in (lists | {99: "120 121 122"}).items()
    ]
    (tmp_path / "log.csv").write_text(header + "\n".join(rows) + "\n")
    run = tmp_path / "run.h5"
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(run)]) == 0
    capsys.readouterr()
    assert _rules_of("262-01-801-99", run, capsys) >= {"N2", "N3"}
    # what is exported is read with its lists
    assert main(["export", str(run), "-o", str(tmp_path / "out.csv")]) == 0
    again = tmp_path / "again.h5"
    assert main(["import", str(tmp_path / "out.csv"), "-o", str(again)]) == 0
    capsys.readouterr()
    assert _rules_of("262-01-801-99", again, capsys) >= {"N2", "N3"}


def _rules_of(cell, run, capsys):
    assert main(["suspect", str(run), "--json"]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    return {finding["rule"] for one in cells if one["cell"] == cell for finding in one["findings"]}


def test_a_list_that_is_none_is_an_error_of_its_line(tmp_path, capsys):
    row = "1,52.5,13.4,GSM,262,01,801,1,20,16,-70,0,"
    header = HEADER.replace("ta\n", "ta,neighbour_arfcns\n")
    (tmp_path / "log.csv").write_text(f"{header}{row},12;13\n{row},none\n")
    assert main(["import", str(tmp_path / "log.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    assert "line 2: neighbour_arfcns is no list of GSM channels" in capsys.readouterr().err
