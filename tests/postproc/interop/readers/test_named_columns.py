import pytest

from logger.core.errors import ConfigError, RunFileError
from logger.core.runfile import read_run
from logger.core.types import CellReading
from postproc.cli import main
from postproc.interop.importing import recognise
from postproc.interop.readers import named_columns
from postproc.interop.sighting import NoCell, Sighting

TIME = "2024-05-01 12:00:07"


def _rows(tmp_path, *lines):
    source = tmp_path / "table.csv"
    source.write_text("\n".join(lines) + "\n")
    form = recognise(source)
    assert form.name == "CSV by column names"
    return list(form.read(source))


def test_a_drive_test_with_a_column_for_each_technology(tmp_path):
    """As Nemo Analyze and QualiPoc write them: units in brackets, the technology in the name."""
    gsm, lte, none = _rows(
        tmp_path,
        "Time;Longitude;Latitude;Serving MCC;Serving MNC;Serving LAC;GSM Cell ID;GSM BSIC;"
        "BCCH ARFCN;RxLev sub (dBm);LTE TAC;LTE Cell identity;LTE EARFCN;"
        "LTE Physical cell identity;LTE Serving cell RSRP [dBm]",
        f"{TIME};13,5;52,5;262;1;4711;17;10;62;-71;;;;;",
        f"{TIME};13,5;52,5;262;1;;;;;n/a;70;256259;1300;5;-99,5",
        f"{TIME};13,5;52,5;262;1;;;;;;;;;;",
    )
    assert gsm.reading == CellReading(
        "scan", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, bsic=10, rssi_dbm=-71.0
    )
    assert lte.reading == CellReading(
        "scan", "LTE", "262", "01", tac=70, cid=256259, arfcn=1300, pci=5, rsrp_dbm=-99.5
    )
    assert (none.is_position, none.t_ns, none.fix) == (True, gsm.t_ns, gsm.fix)
    assert (gsm.lat_deg, gsm.lon_deg, gsm.fix.utc_ns) == (52.5, 13.5, None)


@pytest.mark.parametrize("row", ["0,0,", ",,"])
def test_a_row_without_level_and_position_is_no_position(tmp_path, row):
    first, second = _rows(tmp_path, "t_s,latitude,longitude,rsrp", "1,52,13,-90", f"2,{row}")
    assert first.reading.rsrp_dbm == -90.0
    assert not isinstance(second, Sighting)


def test_a_position_in_a_table_without_times_says_nothing(tmp_path):
    first, second = _rows(tmp_path, "latitude,longitude,rsrp", "52,13,-90", "52,13.1,")
    assert (first.reading.rsrp_dbm, second) == (-90.0, NoCell(3, "no level"))


@pytest.mark.parametrize(
    ("names", "codes"),
    [
        ("TAC,ECI,EARFCN,PCI", "0x1267,0x12D687,0X514,0x5"),
        ("TAC (hex),ECI [hex],EARFCN,PCI_hex", "1267,12d687,1300,5"),
        ("tac_hex,eci_hex,earfcn,pci", "0x1267,12D687,1300,5"),
    ],
)
def test_codes_may_be_hexadecimal(tmp_path, names, codes):
    header = f"time,lat,lon,rsrp,mcc,mnc,{names}"
    (row,) = _rows(tmp_path, header, f"{TIME},52,13,-90,262,01,{codes}")
    assert row.reading.cell == "262-01-4711-1234567"
    assert (row.reading.arfcn, row.reading.pci) == (1300, 5)


@pytest.mark.parametrize("level", ["-90,5 dBm", "-90.5dBm", "-90.5\u00a0dBm", "\u221290,5"])
def test_a_level_may_have_its_unit(tmp_path, level):
    header = "time;lat;lon;accuracy;altitude;rsrp;cell"
    (row,) = _rows(tmp_path, header, f"{TIME};52;13;5 m;34,5 m;{level};3 m")
    assert (row.reading.rsrp_dbm, row.reading.label) == (-90.5, "3 m")
    assert (row.fix.acc_m, row.fix.alt_m) == (5.0, 34.5)


def test_a_table_with_one_technology_column(tmp_path):
    """As NetMonster's users export their measurements."""
    lte, umts = _rows(
        tmp_path,
        "time,lat,lon,cell_id,tac,pci,rsrp,rscp,rat,mcc,mnc",
        f"{TIME},41.0,28.9,12345.0,1001,10,-85,,LTE,286,1",
        f"{TIME},41.0,28.9,70000,7,,,-91,UMTS,286,1",
    )
    assert lte.reading == CellReading(
        "scan", "LTE", "286", "01", tac=1001, cid=12345, pci=10, rsrp_dbm=-85.0
    )
    assert umts.reading == CellReading("scan", "WCDMA", "286", "01", lac=7, cid=70000, rscp_dbm=-91)


def test_without_an_identity_the_table_is_about_one_cell(tmp_path):
    (row,) = _rows(tmp_path, "time,lat,lon,power", f"{TIME},41.0,28.9,-85")
    assert (row.reading.cell, row.reading.rat, row.rssi_dbm) == ("target", None, -85.0)


HEAD = "time,lat,lon,power"
WALK = "t_s,lat,lon,rssi_dbm"


def _table(head, *more, names):
    """Rows of two transmitters in turn."""
    return "\n".join(
        [
            ",".join([head, *more]),
            *(
                f"{f'12:00:{i:02d}' if head == HEAD else i},41.0,{28.9 + i * 1e-5},-8{i},{name}"
                for i, name in enumerate(names)
            ),
        ]
    )


@pytest.mark.parametrize("head", [HEAD, WALK])
@pytest.mark.parametrize(
    "column", ["bssid", "BSSID", "gateway", "Gateway ID", "gw_eui", "MAC", "tx_id", "cell"]
)
def test_a_column_that_names_transmitters_is_the_identity(tmp_path, head, column):
    source = tmp_path / "x.csv"
    source.write_text(_table(head, column, names=["aa:01", "aa:02", "", "aa:01"]))
    names = [row.reading.cell for row in recognise(source).read(source)]
    unnamed = "target" if head == WALK and column == "cell" else None
    assert names == ["aa:01", "aa:02", unnamed, "aa:01"]


@pytest.mark.parametrize("head", [HEAD, WALK])
@pytest.mark.parametrize(
    "column", ["device", "Device ID", "node", "sensor", "id", "eNB", "sector", "ssid"]
)
def test_a_column_that_may_name_transmitters_is_asked_for(tmp_path, capsys, head, column):
    source, run = tmp_path / "x.csv", str(tmp_path / "run.h5")
    source.write_text(_table(head, column, names=["a", "b"] * 4))
    assert main(["import", str(source), "-o", run]) == 2
    said = capsys.readouterr().err
    assert "has 2 values ('a', 'b')" in said
    assert f"--columns cell={column.lower()}" in said
    assert main(["import", str(source), "--columns", f"cell={column}", "-o", run]) == 0
    assert "8 readings" in capsys.readouterr().out
    assert set(read_run(run).tables["readings"]["cell"]) == {b"a", b"b"}


@pytest.mark.parametrize("head", [HEAD, WALK])
@pytest.mark.parametrize("names", [["a"] * 8, list("abcdefgh"), [""] * 8])
def test_one_device_and_a_number_of_each_row_name_nobody(tmp_path, head, names):
    source = tmp_path / "x.csv"
    source.write_text(_table(head, "id", names=names))
    assert {row.reading.cell for row in recognise(source).read(source)} == {"target"}


@pytest.mark.parametrize("head", [HEAD, WALK])
def test_without_an_identity_channel_and_code_name_the_cell(tmp_path, head):
    source = tmp_path / "x.csv"
    source.write_text(_table(head, "arfcn", "pci", names=["1300,7", "1300,8", ",", "1300,7"]))
    names = [row.reading.cell for row in recognise(source).read(source)]
    assert names == ["channel 1300 PCI 7", "channel 1300 PCI 8", None, "channel 1300 PCI 7"]


def test_with_its_technology_it_has_the_name_of_any_other_walk(tmp_path):
    """As in docs/guide/desktop.md."""
    source = tmp_path / "x.csv"
    source.write_text(_table(WALK, "rat", "arfcn", "bsic", names=["GSM,62,37"] * 8))
    assert {row.reading.cell for row in recognise(source).read(source)} == {"GSM-62-37"}


def test_an_identity_without_its_network_is_a_name(tmp_path):
    rows = _rows(tmp_path, "time,lat,lon,lac,cid,rat,rxlev",
                 f"{TIME},41.0,28.9,7,99,GSM,-80", f"{TIME},41.0,28.9,7,98,GSM,-80",
                 f"{TIME},41.0,28.9,0,0,GSM,-80", f"{TIME},41.0,28.9,0,99,GSM,-80")  # fmt: skip
    assert [row.reading.cell for row in rows] == ["?-?-7-99", "?-?-7-98", None, "?-?-?-99"]


def test_columns_that_the_user_names(tmp_path, capsys):
    source = tmp_path / "x.csv"
    source.write_text(
        "wann,x,y,pegel,level\n"
        + "".join(f"2024-05-01 12:00:{i:02d},13.5,{52.5 + i * 1e-5},-7{i},0\n" for i in range(9))
    )
    run = str(tmp_path / "run.h5")
    columns = "time=wann,lat=y,lon=x,level=pegel"
    assert main(["import", str(source), "--columns", columns, "-o", run]) == 0
    assert "9 readings, 0 bad rows (CSV by column names)" in capsys.readouterr().out
    assert main(["import", str(source), "-o", run]) == 2
    assert "I read a table with the columns wann, x, y, pegel, level" in capsys.readouterr().err


def test_without_a_column_of_times_the_order_counts(tmp_path):
    source = tmp_path / "x.csv"
    source.write_text("lat,lon,rsrp\n52.5,13.5,-80\n52.6,13.5,-81\n")
    assert recognise(source).times == ""


@pytest.mark.parametrize("head", ["time", "Timestamp", "Time (s)", "t", "seconds", "t_s"])
def test_a_column_of_times_may_count_seconds_from_the_start(tmp_path, head):
    rows = _rows(tmp_path, f"{head},lat,lon,level", "0,52.5,13.5,-80", "1.5,52.5001,13.5,-81")
    assert [row.t_ns for row in rows] == [0, 1_500_000_000]
    assert rows[0].fix.utc_ns is None


def test_without_times_nothing_in_their_column_matters(tmp_path):
    source = tmp_path / "x.csv"
    source.write_text("time,lat,lon,level\n,52.5,13.5,-80\nnoon,52.6,13.5,-81\n")
    form = recognise(source, times=False)
    assert form.times == ""
    assert [row.line for row in form.read(source)] == [2, 3]


def test_a_time_beyond_all_walks_is_a_bad_row(tmp_path, capsys):
    source = tmp_path / "x.csv"
    source.write_text("time,lat,lon,level\n9999999999,52.5,13.5,-80\n")
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 2
    assert "line 2: time is no time of a walk: '9999999999'" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["pegel", "pegel=x", "lat=", "level=x,,"])
def test_a_wrong_option_lists_the_names(text):
    with pytest.raises(ConfigError, match="NAME=COLUMN with one of the names time, lat, lon"):
        named_columns.columns_of(text)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"level": "pegel"}, "no column 'pegel' for level"),
        ({"lat": "a"}, "known to be lon, level: name it with --columns"),
    ],
)
def test_a_column_that_is_not_there_is_named(tmp_path, columns, says):
    (tmp_path / "x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(RunFileError, match=says):
        recognise(tmp_path / "x.csv", columns)


@pytest.mark.parametrize("head", ["serving", "is_serving", "isServing", "Registered"])
def test_which_cell_serves(tmp_path, head):
    values = {
        "1": "serving",
        "yes": "serving",
        "false": "neighbour",
        "345": "scan",
    }
    lines = [f"{i},52.5,13.4,-85,LTE,{value}" for i, value in enumerate(values)]
    rows = _rows(tmp_path, f"t_s,lat,lon,level,rat,{head}", *lines)
    assert [row.reading.role for row in rows] == list(values.values())


@pytest.mark.parametrize(
    ("times", "minutes"),
    [
        (("05/06/2024 11:59 PM", "05/14/2024 12:01 AM"), 8 * 1440 - 1438),
        (("05/06/2024 11:59:00", "14/06/2024 00:01:00"), 9 * 1440 - 718),
        (("05-06-2024 11:59", "14-06-2024 00:01"), 9 * 1440 - 718),
        (("5.6.2024 23:59", "6.6.2024 0:01"), 2),
        (("2024-06-05 11:59 a.m.", "2024-06-05 12:01 p.m."), 2),
    ],
)
def test_dates_are_read_by_all_times_of_a_file(tmp_path, times, minutes):
    """Only a day beyond 12 shows which number is the month."""
    head = "Date Time;Latitude;Longitude;RSSI;Cell ID"
    first, second = _rows(tmp_path, head, *(f"{time};52.5;13.4;-70;7" for time in times))
    assert (second.t_ns - first.t_ns) / 60e9 == minutes
    assert first.fix.utc_ns is None


@pytest.mark.parametrize(
    ("times", "minutes"),
    [
        (("23:58:00", "23:59:00", "00:01:00", "00:02:00"), (0, 1, 3, 4)),
        (
            ("12:02:00 AM", "12:01:00 AM", "11:59:00 PM", "11:58:00 PM"),
            (4, 3, 1, 0),
        ),  # the newest first
        (("", "23:58:00", "00:02:00"), (0, 4)),
        (("08:00:00", "09:00:00", "08:30:00"), (0, 60, 30)),
        # in the order of cells and not of time
        (
            tuple(f"{hour}:00:00" for hour in (6, 13, 20, 6, 13, 20, 6)),
            (0, 420, 840, 0, 420, 840, 0),
        ),
    ],
)
def test_times_of_day_may_pass_midnight(tmp_path, times, minutes):
    rows = _rows(tmp_path, "Time,Lat,Lon,RSSI,CID", *(f"{time},52.5,13.4,-70,7" for time in times))
    t_ns = [row.t_ns for row in rows if isinstance(row, Sighting)]
    assert [(one - min(t_ns)) / 60e9 for one in t_ns] == list(minutes)


@pytest.mark.parametrize(
    ("bsic", "number"),
    [("3-2", 26), ("7/7", 63), ("10", 10), ("5.0", 5), ("10.0", 10), ("-", None)],
)
def test_a_bsic_may_be_in_two_parts(tmp_path, bsic, number):
    (row,) = _rows(tmp_path, "t_s,Lat,Lon,RxLev,CID,BSIC", f"1,52.5,13.4,-70,7,{bsic}")
    assert row.reading.bsic == number


@pytest.mark.parametrize(
    ("time", "said"),
    [
        ("05/06/2024 09:00 AM", "column 'date time': of dates such as '05/06/2024 09:00 AM'"),
        ("2024-06-05 13:00 PM", "an hour with AM or PM is 1 to 12"),
    ],
)
def test_times_with_two_meanings_are_not_read(tmp_path, capsys, time, said):
    source = tmp_path / "table.csv"
    source.write_text(f"Date Time,Latitude,Longitude,RSSI,Cell ID\n{time},52.5,13.4,-70,7\n")
    assert main(["import", str(source), "-o", str(tmp_path / "a.h5")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


@pytest.mark.parametrize(
    ("date", "hours"),
    [("2024-05-14", 476577), ("5/14/2024", 476577), ("05/06/2024", 9), ("Tuesday", 9)],
)
def test_a_date_of_its_own_column_belongs_to_the_time(tmp_path, date, hours):
    """Where it cannot be read the time of day counts alone."""
    head = "Date,Time,Latitude,Longitude,RSSI,Cell ID"
    (row,) = _rows(tmp_path, head, f"{date},09:00:00,52.5,13.4,-70,7")
    assert row.t_ns == hours * 3600 * 10**9


def test_a_table_whose_times_have_an_unknown_name_says_that_none_are_read(tmp_path, capsys):
    rows = [f"14/05/2024;09:00:{i:02d};52,5;{13.4 + i / 1e4};-90;17" for i in range(20)]
    (tmp_path / "a.csv").write_text("Date;Instant;Lat;Lon;RSRP;CID\n" + "\n".join(rows))
    assert main(["import", str(tmp_path / "a.csv"), "-o", str(tmp_path / "run.h5")]) == 0
    assert "a.csv: without times, only the order of the rows counts" in capsys.readouterr().err
    named = ["--columns", "time=instant"]
    assert main(["import", str(tmp_path / "a.csv"), "-o", str(tmp_path / "run.h5"), *named]) == 0
    assert "without times" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rat", "level"), [("LTE", "rsrp_dbm"), ("UMTS", "rscp_dbm"), ("GSM", "rssi_dbm")]
)
@pytest.mark.parametrize("name", ["RSSI/RSRP", "rxlev_rscp_rsrp", "RSSI/RSCP/RSRP [dBm]"])
def test_one_column_of_levels_of_all_technologies(tmp_path, name, rat, level):
    """As monitors on telephones name it."""
    header = f"Date;Time;Tech;MCC;MNC;LAC/TAC;CID;{name};Latitude;Longitude"
    (row,) = _rows(tmp_path, header, f"2024-05-01;12:00:07;{rat};262;01;4711;17;-91;52;13")
    assert getattr(row.reading, level) == -91.0
    assert row.reading.cell == "262-01-4711-17"


def test_of_two_columns_of_one_name_the_first_counts(tmp_path):
    (row,) = _rows(tmp_path, "time,lat,lon,rsrp,pci,rsrp,pci", f"{TIME},52,13,-70,1,-90,2")
    assert (row.reading.rsrp_dbm, row.reading.pci) == (-70.0, 1)


@pytest.mark.parametrize(
    ("header", "separator"),
    [
        ("Zeit;Breite;Länge;RSRP;Zellen-ID", ";"),
        ("Heure;Latitude;Longitude;RSRP;ID Cellule", ";"),
        ("Hora,Latitud,Longitud,RSRP (dBm),ID celda", ","),
        ("Czas;Szerokość;Długość;RSRP;CI", ";"),
        ("Время;Широта;Долгота;RSRP;CID", ";"),
        ("时间,纬度,经度,RSRP(dBm),小区ID", ","),
        ("日時,緯度,経度,RSRP,CI", ","),
        ("Ora;Latitudine;Longitudine;RSRP;ID cella", ";"),
        ("Data/Hora;Latitude;Longitude;RSRP;CI", ";"),
        ("Tijd;Breedtegraad;Lengtegraad;RSRP;CI", ";"),
        ("Zaman;Enlem;Boylam;RSRP;CI", ";"),
    ],
)
def test_headers_in_other_languages(tmp_path, header, separator):
    comma = "," if separator == ";" else "."
    values = [TIME, "48.5", "-11.5", "-99.5", "17"]
    row = separator.join([TIME, *(value.replace(".", comma) for value in values[1:])])
    (one,) = _rows(tmp_path, header, row)
    assert (one.lat_deg, one.lon_deg, one.reading.rsrp_dbm, one.reading.cid) == (
        48.5,
        -11.5,
        -99.5,
        17,
    )


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        ("48.5N", "11.25W"),
        ("N 48,5", "W 11,25"),
        ("N48 30.000", "W011 15.000"),
        ('48°30\'00.0""N', "11°15'W"),
        ("48° 30′", "-11° 15′ 0″"),
        ("48:30:00N", "11:15:00w"),
        ("48.5", "\u221211.25"),
    ],
)
def test_coordinates_with_letters_and_minutes(tmp_path, lat, lon):
    (row,) = _rows(tmp_path, "time,lat,lon,rsrp,cid", f'{TIME},"{lat}","{lon}",-85,17')
    assert (row.lat_deg, row.lon_deg) == (48.5, -11.25)


@pytest.mark.parametrize(
    ("lat", "lon"),
    [("11.5E", "48.5N"), ("48.5O", "11.5"), ("-48.5S", "11.5"), ("48 99.5N", "11.5"),
     ("48 30", "11.5"), ("48.5 30N", "11.5"), ("48.5NS", "11.5")],
)  # fmt: skip
def test_coordinates_that_may_mean_another_place_are_not_read(tmp_path, lat, lon):
    (row,) = _rows(tmp_path, "time,lat,lon,rsrp,cid", f"{TIME},{lat},{lon},-85,17")
    assert row.line == 2
    assert lat in row.why


def test_a_column_beside_tells_the_hemisphere(tmp_path):
    head = "time,Latitude,N/S,Longitude,E/W,rsrp,cid"
    first, second = _rows(tmp_path, head, f"{TIME},33.5,S,70.5,W,-85,17", f"{TIME},33.5,S,70.5,W,,")
    assert (first.lat_deg, first.lon_deg) == (second.lat_deg, second.lon_deg) == (-33.5, -70.5)


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("Location", "48.5, 11.25"),
        ("lat/lon", "(48.5,11.25)"),
        ("LatLng", "48,5; 11,25"),
        ("position", "48.5N 11.25E"),
        ("WKT", "POINT(11.25 48.5)"),
        ("geometry", "SRID=4326;POINT Z (11.25 48.5 310)"),
    ],
)
def test_both_coordinates_in_one_column(tmp_path, name, place):
    (row,) = _rows(tmp_path, f"time,{name},rsrp,cid", f'{TIME},"{place}",-85,17')
    assert (row.lat_deg, row.lon_deg) == (48.5, 11.25)


@pytest.mark.parametrize("place", ["[11.25, 48.5]", "11.25E, 48.5N", "48.5", "4808220N 01134500E"])
def test_one_column_that_may_mean_another_place_is_not_read(tmp_path, place):
    (row,) = _rows(tmp_path, "time,location,rsrp,cid", f'{TIME},"{place}",-85,17')
    assert not isinstance(row, Sighting)


def test_the_place_of_the_station_is_none_of_the_receiver(tmp_path, capsys):
    site = "time,Cell Latitude,Cell Longitude"
    (row,) = _rows(tmp_path, f"{site},Latitude,Longitude,rsrp,cid", f"{TIME},1,2,48,11,-85,17")
    assert (row.lat_deg, row.lon_deg) == (48.0, 11.0)
    (row,) = _rows(tmp_path, f"{site},rsrp,cid", f"{TIME},1,2,-85,17")
    assert not row.fix.valid


@pytest.mark.parametrize(
    ("header", "values", "rat", "level_dbm"),
    [
        ("rat,rsrp,rxlev", "GSM,-95,-65", "GSM", -65.0),
        ("rat,rssi,rsrp", "LTE,-65,-95", "LTE", -95.0),
        ("rat,rssi,rsrp", "LTE,-65,", None, None),
        ("rat,rssi,rsrp", "LTE-M,-65,-95", "LTE-M", -95.0),
        ("LTE RSSI,RSRP", "-65,-95", "LTE", -95.0),
        ("earfcn,rssi,rsrp", "1300,-65,", None, None),
        ("level,dBm", "3,-85", None, -85.0),
        ("rssi,rsrp", "-65,", None, None),
        ("SS-RSRP", "-95", "NR", -95.0),
        ("rsrp,nrarfcn", "-95,632448", "NR", -95.0),
        ("LTE RSRP,NR RSRP,tech", "-95,-85,NR", "NR", -85.0),
        ("rsrp,rat", "-95,4G (LTE)", "LTE", -95.0),
        ("rsrp,rat,earfcn,nrarfcn", "-95,5G NSA,1300,", "LTE", -95.0),
        ("rsrp,networktype", "-95,20", None, -95.0),
        ("rsrp,net", "-95,NR", "NR", -95.0),
        ("rsrp,type", "-95,Cell", "LTE", -95.0),
        ("rsrp,Cell Type", "-95,macro", "LTE", -95.0),
        ("rsrp,bsic,uarfcn", "-95,0,-1", "LTE", -95.0),
    ],
)
def test_the_level_is_that_of_the_technology_of_its_row(tmp_path, header, values, rat, level_dbm):
    row, _ = _rows(
        tmp_path,
        f"time,lat,lon,cid,{header}",
        f"{TIME},48,11,17,{values}",
        f"{TIME},48,11,17,{values}",
    )
    assert (row.reading.rat, row.reading.level_dbm) == (rat, level_dbm)
    assert row.is_position == (level_dbm is None)


@pytest.mark.parametrize(
    ("rat", "why"),
    [("CDMA", "no technology of 2G to 5G is called 'CDMA'"), ("4.5G", "is called '4.5G'"),
     ("5G NSA", "its technology may be LTE or NR"), ("LTE+NR", "may be LTE or NR")],
)  # fmt: skip
def test_the_level_of_no_or_two_technologies_is_not_read(tmp_path, rat, why):
    (row,) = _rows(tmp_path, "time,lat,lon,cid,rsrp,rat", f"{TIME},48,11,17,-95,{rat}")
    assert isinstance(row, NoCell)
    assert why in row.why


@pytest.mark.parametrize("name", ["RSSI (ASU)", "Signal [%]", "Level (mW)", "power (dBµV/m)"])
def test_a_level_in_another_unit_is_none(tmp_path, name):
    source = tmp_path / "a.csv"
    source.write_text(f"time,lat,lon,{name},cid\n{TIME},48,11,25,17\n")
    with pytest.raises(RunFileError, match="unknown format"):
        recognise(source)


def test_a_positive_level_of_an_unknown_technology_is_none(tmp_path):
    bad, good = _rows(tmp_path, "time,lat,lon,rssi", f"{TIME},48,11,85", f"{TIME},48,11,-85")
    assert "level is 85, and dBm of a receiver are negative" in bad.why
    assert good.rssi_dbm == -85.0


@pytest.mark.parametrize(
    ("header", "values", "cell"),
    [
        ("rat,tac,enb,cid", "LTE,55,80123,3", "?-?-55-20511491"),
        ("rat,tac,eNB ID,Sector ID", "LTE,55,80123,3", "?-?-55-20511491"),
        ("rat,tac,enb,cid", "LTE,55,80123,20511491", "?-?-55-20511491"),
        ("rat,tac,enb,cid", "LTE,55,Munich,20511491", "?-?-55-20511491"),
        ("rat,tac,gnb,cid", "NR,55,80123,3", None),
        ("mcc,mnc,tac,cid", "0,0,55,17", "?-?-55-17"),
        ("rat,tac,gnb,cid", "NR,55,80123,328183811", "?-?-55-328183811"),
        ("rat,earfcn,pci,sector", "LTE,1300,33,A", "LTE-1300-33"),
        ("rat,lac,RNC,cid", "WCDMA,55,12,34", "?-?-55-786466"),
        ("rat,tac,cid,eci", "LTE,55,3,20511491", "?-?-55-20511491"),
        ("rat,lac,tac,cid", "LTE,,55,17", "?-?-55-17"),
        ("rat,lac,tac,cid", "GSM,7,55,17", "?-?-7-17"),
        ("rat,lac,cid", "LTE,55,17", "?-?-55-17"),
        ("plmn,tac,cid", "26202,55,17", "262-02-55-17"),
        ("MCC-MNC,tac,cid", "262-02,55,17", "262-02-55-17"),
        ("net,mcc,mnc,tac,cid", "LTE,262,2,55,17", "262-02-55-17"),
        ("ecgi", "262-02-20511491", "262-02-20511491"),
    ],
)
def test_an_identity_in_parts_is_whole(tmp_path, header, values, cell):
    (row,) = _rows(tmp_path, f"time,lat,lon,level,rsrp,{header}", f"{TIME},48,11,,-95,{values}")
    if "LTE" not in values:
        (row,) = _rows(tmp_path, f"time,lat,lon,level,{header}", f"{TIME},48,11,-95,{values}")
    assert row.reading.cell == cell


@pytest.mark.parametrize(
    ("rat", "psc", "pci"), [("UMTS", 33, None), ("LTE", None, 33), ("NR", None, 33)]
)
@pytest.mark.parametrize("name", ["PSC/PCI", "psc_pci", "PSC"])
def test_one_column_of_codes_of_all_technologies(tmp_path, name, rat, psc, pci):
    (row,) = _rows(tmp_path, f"time,lat,lon,level,rat,cid,{name}", f"{TIME},48,11,-95,{rat},1,33")
    assert (row.reading.psc, row.reading.pci) == (psc, pci)


def test_hexadecimal_numbers_without_a_word_of_it_are_asked_for(tmp_path, capsys):
    """Those without a letter would become another area."""
    source = tmp_path / "a.csv"
    rows = "".join(f"{TIME},48,11,-85,{lac},17\n" for lac in ("1234", "12AB"))
    source.write_text(f"time,lat,lon,rsrp,lac,cid\n{rows}")
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 2
    assert "a.csv: column 'lac' has hexadecimal numbers (12AB)" in capsys.readouterr().err


@pytest.mark.parametrize("head", ["Time (ms)", "elapsed_time_ms", "t [ms]", "timestamp_ms"])
def test_times_may_count_milliseconds(tmp_path, head):
    rows = _rows(tmp_path, f"{head},lat,lon,level", "0,52.5,13.5,-80", "1500,52.5,13.5,-81")
    assert [row.t_ns for row in rows] == [0, 1_500_000_000]


@pytest.mark.parametrize("time", ["240514090000", "123456789", "123456789012345"])
def test_numbers_that_would_be_of_before_2001_are_no_times(tmp_path, time):
    (row,) = _rows(tmp_path, "time,lat,lon,level", f"{time},52.5,13.5,-80")
    assert "time is no ISO 8601 time" in row.why


def test_feet_are_no_metres(tmp_path):
    head = "time,lat,lon,Altitude (ft),Accuracy [ft],rsrp,TA (m),cid"
    (row,) = _rows(tmp_path, head, f"{TIME},48,11,1000,10,-85,550,17")
    assert row.fix.alt_m == pytest.approx(304.8)
    assert row.fix.acc_m == pytest.approx(3.048)
    assert row.reading.ta is None


_FEATURE = (
    '{"type": "Feature", "geometry": {"type": "Point", "coordinates": [11.25, 48.5, 310]}, '
    '"properties": {"time": "2024-05-01T12:00:07Z", "RSRP": -95.5, "ci": 17, "serving": true}}'
)
_OBJECT = (
    '{"time": "2024-05-01T12:00:07Z", "serving": true, "gps": {"lat": 48.5, "lon": 11.25}, '
    '"cell": {"RSRP": -95.5, "ci": 17, "lat": 1.0, "lon": 2.0, "name": null}}'
)


@pytest.mark.parametrize(
    "lines",
    [
        (f'{{"type": "FeatureCollection", "features": [{_FEATURE},', f"{_FEATURE}]}}"),
        ("{", '"type": "FeatureCollection",', '"features": [', f"{_FEATURE},", _FEATURE, "]", "}"),
        (_FEATURE, _FEATURE),
        (_OBJECT, _OBJECT),
        (f"[{_OBJECT}, {_OBJECT}]",),
    ],
)
def test_json_is_a_table_as_well(tmp_path, lines):
    """Of QGIS, of a program that writes one object a line, and of pandas."""
    first, second = _rows(tmp_path, *lines)
    assert first.reading == second.reading
    assert first.reading == CellReading("serving", "LTE", cid=17, rsrp_dbm=-95.5, label="?-?-?-17")
    assert (first.lat_deg, first.lon_deg) == (48.5, 11.25)
    assert first.fix.utc_ns == 1_714_564_807 * 10**9


def test_json_that_has_no_positions_says_what_it_has(tmp_path):
    (tmp_path / "a.json").write_text('{"time": 1, "lat": 2, "lon": 3, "cells": [{"rsrp": -90}]}\n')
    with pytest.raises(RunFileError, match="level: name it with --columns; it has .*'cells'"):
        list(recognise(tmp_path / "a.json").read(tmp_path / "a.json"))


def test_columns_of_json_may_be_named(tmp_path):
    (tmp_path / "a.json").write_text('{"wann": 1714564807, "y": 48, "x": 11, "p": -90}\n' * 2)
    columns = "time=wann,lat=y,lon=x,level=p"
    target = str(tmp_path / "run.h5")
    assert main(["import", str(tmp_path / "a.json"), "-o", target, "--columns", columns]) == 0
    assert len(read_run(target).tables["readings"]) == 1  # the second row repeats the first


def test_columns_of_drive_test_programs(tmp_path):
    """XCAL has both technologies in a row, TEMS and Nemo have words of their own."""
    lte, nr = _rows(
        tmp_path,
        "TIME_STAMP,Lon,Lat,LTE KPI PCell Serving RSRP[dBm],LTE KPI PCell Serving PCI,"
        "LTE KPI PCell Serving EARFCN(DL),5G KPI PCell RF Serving SS-RSRP [dBm],"
        "5G KPI PCell RF Serving PCI,5G KPI PCell RF NR-ARFCN",
        f"{TIME},11.5,48.1,-95.5,33,1300,-85.5,44,632448",
        f"{TIME},11.5,48.1,,,,-85.5,44,632448",
    )
    assert (lte.reading.cell, lte.rssi_dbm) == ("LTE-1300-33", -95.5)
    assert (nr.reading.cell, nr.rssi_dbm) == ("NR-632448-44", -85.5)
    (row,) = _rows(
        tmp_path,
        "Time\tAll-Latitude Decimal Degree\tAll-Longitude Decimal Degree\tServing Cell RSRP (dBm)\t"
        "E-CellID",
        f"{TIME}\t48.1\t11.5\t-85\t20511491",
    )
    assert (row.lat_deg, row.reading.cell) == (48.1, "?-?-?-20511491")


@pytest.mark.parametrize("time", ["1714564807", "2024-05-01T12:00:07Z", "1714564807000"])
def test_ts_may_be_a_timestamp(tmp_path, time):
    (row,) = _rows(tmp_path, "ts,lat,lon,rsrp,cid", f"{time},48,11,-85,17")
    assert row.fix.utc_ns == 1_714_564_807 * 10**9


def test_a_walk_that_is_not_ours_may_call_its_level_rssi_dbm(tmp_path):
    (row,) = _rows(tmp_path, "timestamp,latitude,longitude,rssi_dbm", f"{TIME},48,11,-85")
    assert row.rssi_dbm == -85.0


def test_a_cell_of_lte_is_none_of_nr(tmp_path):
    """A telephone in 5G NSA knows the identity of the anchor alone."""
    head = "time,lat,lon,RSRP,SS-RSRP,TAC,PCI,CID,NR PCI"
    lte, nr = _rows(tmp_path, head, f"{TIME},48,11,-95,-85,7,3,17,5", f"{TIME},48,11,,-85,7,3,17,5")
    assert (lte.reading.rat, lte.reading.pci, lte.reading.cell) == ("LTE", 3, "?-?-7-17")
    assert (nr.reading.rat, nr.reading.pci, nr.reading.cell) == ("NR", 5, None)


def test_a_length_beside_a_longitude_is_none(tmp_path):
    (row,) = _rows(tmp_path, "time,lat,Länge,lon,rsrp", f"{TIME},48,3,11,-85")
    assert row.lon_deg == 11.0


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        (("081459.00", "081500.00", "081501.50"), (0, 1, 2.5)),  # as a receiver prints them
        (tuple(f"{95955 + k + 4040 * (k > 4)}" for k in range(10)), tuple(range(10))),
        (("235959", "000001"), (0, 2)),
        (tuple(str(1000 * k) for k in range(10, 20)), tuple(1000 * k for k in range(10))),
        (("81500", "81501"), (0, 1)),  # may count seconds
        (("081500", "081560"), (0, 60)),
    ],
)
def test_times_of_day_may_lack_their_colons(tmp_path, times, seconds):
    rows = _rows(tmp_path, "Time,Lat,Lon,RSSI", *(f"{time},52.5,13.4,-70" for time in times))
    assert [(row.t_ns - rows[0].t_ns) / 1e9 for row in rows] == list(seconds)


def test_their_date_is_that_of_its_column(tmp_path):
    rows = [f"14/05/2024,09000{k},52.5,13.4,-70" for k in range(3)]
    first, *_ = _rows(tmp_path, "Date,Time,Lat,Lon,RSSI", *rows)
    assert first.t_ns == 476577 * 3600 * 10**9


@pytest.mark.parametrize(
    ("head", "cells", "names"),
    [
        ("mcc,mnc,lac,cell", ("7", "8"), ("262-01-2-7", "262-01-2-8")),
        ("mcc,net,area,cell", ("7.0", ""), ("262-01-2-7", None)),
        ("mcc,mnc,lac,cell", ("7", "Main St"), ("7", "Main St")),
    ],
)
def test_numbers_of_cells_beside_their_area_are_identities(tmp_path, head, cells, names):
    lines = [f"{k},52.5,13.4,GSM,262,01,2,{cell},-70" for k, cell in enumerate(cells)]
    rows = _rows(tmp_path, f"t_s,lat,lon,radio,{head},rssi", *lines)
    assert [row.reading.cell for row in rows] == list(names)
    assert {row.reading.rat for row in rows} == {"GSM"}


@pytest.mark.parametrize(
    ("name", "rat"),
    [("CAT-M1", "LTE-M"), ("eMTC", "LTE-M"), ("NBIoT", "NB-IoT"), ("CAT-NB1", "NB-IoT")],
)
def test_modems_of_things_have_names_of_their_own(tmp_path, name, rat):
    (row,) = _rows(tmp_path, "t_s,lat,lon,tech,cid,rsrp", f"1,52.5,13.4,{name},7,-90")
    assert (row.reading.rat, row.reading.rsrp_dbm) == (rat, -90.0)
