import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.core.types import Broadcast, CellReading, Fix
from postproc.cli import main
from postproc.interop.importing import import_walk
from postproc.interop.sighting import BadRow, Sighting
from postproc.interop.writers import csv as write_csv
from tests.postproc.interop.walks import export_of, read_walk

WHOLE = st.one_of(st.none(), st.integers(0, 2**31 - 2))
FLOAT = st.one_of(st.none(), st.floats(-150.0, 0.0))
READINGS = st.builds(
    CellReading,
    role=st.sampled_from(["serving", "neighbour", "scan"]),
    rat=st.sampled_from([None, "GSM", "WCDMA", "LTE", "LTE-M", "NB-IoT", "NR"]),
    mcc=st.just("001"),
    mnc=st.sampled_from(["10", "01", "001"]),
    lac=WHOLE,
    tac=WHOLE,
    # of 2**31 - 1 Android makes its mark of none
    cid=st.integers(0, 2**36 - 1).filter(lambda cid: cid != 2**31 - 1),
    arfcn=WHOLE,
    bsic=WHOLE,
    psc=WHOLE,
    pci=WHOLE,
    ta=WHOLE,
    rxlev_raw=WHOLE,
    c1=st.one_of(st.none(), st.integers(-99, 99)),
    rssi_dbm=st.floats(-150.0, 0.0),
    rscp_dbm=FLOAT,
    rsrp_dbm=FLOAT,
    rsrq_db=FLOAT,
    label=st.just("Straße, 1"),
    broadcast=st.one_of(
        st.none(),
        st.builds(
            Broadcast,
            st.one_of(st.none(), st.lists(st.integers(0, 1023), max_size=64).map(tuple)),
            cro_db=st.integers(0, 126),
            t3212_raw=WHOLE,
        ),
    ),
)
FIXES = st.builds(
    Fix,
    valid=st.just(True),
    utc_ns=st.one_of(st.none(), st.integers(0, 4 * 10**15).map(lambda us: us * 1000)),
    lat_deg=st.floats(-84.0, 84.0),
    lon_deg=st.floats(-180.0, 180.0),
    alt_m=st.one_of(st.none(), st.floats(-400.0, 9000.0)),
    acc_m=st.one_of(st.none(), st.floats(0.0, 1000.0)),
).filter(lambda fix: fix.lat_deg != 0.0 or fix.lon_deg != 0.0)


@given(
    st.lists(
        st.builds(Sighting, st.just(0), st.integers(-(10**15), 10**15), FIXES, READINGS),
        min_size=1,
        max_size=4,
    )
)
@settings(max_examples=60, deadline=None)
def test_what_is_written_is_read_back_equal(heard):
    with tempfile.TemporaryDirectory() as folder:
        write_csv.write(export_of(heard), Path(folder) / "walk.csv")
        good, bad = read_walk(Path(folder) / "walk.csv")
    assert bad == []
    assert [(h.t_ns, h.fix, h.reading) for h in good] == [(h.t_ns, h.fix, h.reading) for h in heard]


@pytest.mark.parametrize("level", ["-85", ""])
def test_zeros_for_a_position_are_none(tmp_path, level):
    """Written before the receiver had a fix; they would put the walk into another zone of UTM."""
    (tmp_path / "walk.csv").write_text(
        f"t_s,lat,lon,rssi_dbm,cell\n0,0,0.0,{level},a\n1,48,11,-85,a\n"
    )
    (good,), (bad,) = read_walk(tmp_path / "walk.csv")
    assert (good.lat_deg, bad.line) == (48.0, 2)
    assert "there was no fix" in bad.why


def _scans_of(text, tmp_path):
    """Cells of each scan of a table that is imported."""
    (tmp_path / "walk.csv").write_text(text)
    import_walk(tmp_path / "walk.csv", tmp_path / "walk.h5")
    readings = read_run(tmp_path / "walk.h5").tables["readings"]
    return [
        [cell.decode() for cell in readings["cell"][readings["seq"] == seq]]
        for seq in np.unique(readings["seq"])
    ]


def test_rows_of_one_time_and_place_are_one_scan(tmp_path):
    header = "t_s,lat,lon,rssi_dbm,cell\n"
    rows = ["0,52,13,-70,a", "0,52,13,-71,b", "1,52,13.0001,-70,a", "1,52,13.0002,-75,b"]
    assert _scans_of(header + "\n".join(rows), tmp_path) == [["a", "b"], ["a"], ["b"]]


def test_no_level_of_one_time_is_lost(tmp_path):
    rows = ["0,52,13,-70,a", "0,52,13,-71,a", "0,52,13,-72,b", "1,52,13,-70,a"]
    text = "t_s,lat,lon,rssi_dbm,cell\n" + "\n".join(rows)
    assert _scans_of(text, tmp_path) == [["a"], ["a", "b"], ["a"]]


def test_a_bad_value_of_a_cell_is_a_bad_row(tmp_path):
    header = "t_s,lat,lon,rssi_dbm,mcc,mnc,lac,cid\n"
    rows = [
        "0,52,13,-70,262,01,1,2",
        "1,52,13,-70,262,01,1,x",
        "2,52,13,-70,26201,01,1,2",
        "3,52,13,-70,262,01,-1,2",
    ]
    (tmp_path / "walk.csv").write_text(header + "\n".join(rows))
    good, bad = read_walk(tmp_path / "walk.csv")
    # -1 is unknown: the identity is not whole
    assert [h.reading.cell for h in good] == ["262-01-1-2", "262-01-?-2"]
    assert bad == [BadRow(3, "cid is no integer: 'x'"), BadRow(4, "mcc is too long: '26201'")]


def test_comments_before_the_header(tmp_path):
    (tmp_path / "walk.csv").write_text("# by hand\nt_s;lat;lon;rssi_dbm\n0;52;13;-70\n1;52;13;\n")
    good, bad = read_walk(tmp_path / "walk.csv")
    assert ([(h.line, h.is_position) for h in good], bad) == ([(3, False), (4, True)], [])


def test_rows_with_a_position_alone_are_the_walkers_track(tmp_path, capsys):
    """A logger that has a position each second and a level every fourth."""
    rows = [f"{i},52,{13 + i / 1e4},{'' if i % 4 else -70 - i % 9},a" for i in range(40)]
    rows += ["40,,,,a", "41,52,13,loud,a"]
    (tmp_path / "walk.csv").write_text("t_s,lat,lon,rssi_dbm,cell\n" + "\n".join(rows))
    assert main(["import", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "walk.h5")]) == 0
    said = capsys.readouterr()
    assert "walk.h5: 10 readings, 30 rows with a position alone, 2 bad rows (CSV)" in said.out
    assert [line.partition(": line ")[2] for line in said.err.splitlines()] == [
        "42: lat is empty",
        "43: rssi_dbm is no number: 'loud'",
    ]
    run = read_run(tmp_path / "walk.h5")
    assert run.tables["fixes"]["t_ns"].tolist() == [i * 10**9 for i in range(40)]
    assert run.tables["scans"]["t_ns"].tolist() == [i * 10**9 for i in range(0, 40, 4)]
    assert len(run.tables["readings"]) == 10


def test_positions_alone_are_no_walk(tmp_path):
    (tmp_path / "walk.csv").write_text("t_s,lat,lon,rssi_dbm\n0,52,13,\n1,52,13.1,\n")
    with pytest.raises(RunFileError, match="no usable row; 2 rows with a position alone"):
        import_walk(tmp_path / "walk.csv", tmp_path / "walk.h5")


@pytest.mark.parametrize(
    ("header", "cell"), [("mcc,mnc,lac,cid", "722,7,1201,9"), ("cell", "722-7-1201-9")]
)
def test_a_network_code_has_its_zeros_whatever_the_columns(tmp_path, header, cell):
    (tmp_path / "log.csv").write_text(f"t_s,lat,lon,rssi_dbm,{header}\n0,-34.6,-58.4,-60,{cell}\n")
    (row,), _ = read_walk(tmp_path / "log.csv")
    assert row.reading.cell == "722-07-1201-9"
