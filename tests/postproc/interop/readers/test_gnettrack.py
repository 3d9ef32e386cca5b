import pytest

from logger.core.cell_names import channel_name
from logger.core.types import CellReading, Fix
from postproc.interop.importing import recognise
from postproc.interop.sighting import BadRow, NoCell

HEAD = (
    "Timestamp\tLongitude\tLatitude\tSpeed\tOperatorname\tOperator\tCGI\tCellname\tNode\tCellID\t"
    "LAC\tNetworkTech\tNetworkMode\tLevel\tQual\tSNR\tCQI\tLTERSSI\tARFCN\tPSC\tAltitude\t"
    "Accuracy\t"
    "NLAC1\tNCell1\tNARFCN1\tNRxLev1\tIMEI\n"
)
PLACE = "2024.05.01_12.00.07\t13.5\t52.5\t3.6\tOp\t26201\t"
T_NS = 1_714_564_807 * 10**9


def _rows(tmp_path, text):
    source = tmp_path / "log.txt"
    source.write_text(text)
    form = recognise(source)
    return form.name, list(form.read(source))


def test_a_gsm_cell_and_its_neighbour(tmp_path):
    row = PLACE + "x\t\t\t17\t4711\t2G\tEDGE\t-71\t\t\t\t\t62\t10\t34\t5\t4711\t18\t70\t-83\t\n"
    name, (serving, neighbour) = _rows(tmp_path, HEAD + row)
    assert name == "G-NetTrack text"
    assert (serving.t_ns, serving.line) == (T_NS, 2)
    assert serving.fix == Fix(
        True, None, 52.5, 13.5, alt_m=34.0, acc_m=5.0, speed_mps=pytest.approx(1.0)
    )
    assert serving.reading == CellReading(
        "serving", "GSM", "262", "01", lac=4711, cid=17, arfcn=62, bsic=10, rssi_dbm=-71.0
    )
    assert neighbour.reading == CellReading(
        "neighbour", "GSM", "262", "01", lac=4711, cid=18, arfcn=70, rssi_dbm=-83.0
    )


def test_node_and_cell_make_the_identity_of_lte_and_umts(tmp_path):
    lte = PLACE + "x\t\t1001\t3\t70\t4G\tLTE\t-99\t-11\t12\t\t\t1300\t5\t34\t5\t\t6\t1300\t-104\t\n"
    umts = PLACE + "x\t\t12\t70\t71\t3G\tHSPA+\t-91\t-8\t\t\t\t10700\t7\t34\t5\t\t\t\t\t\n"
    _, (serving, neighbour, third) = _rows(tmp_path, HEAD + lte + umts)
    assert serving.reading == CellReading(
        "serving",
        "LTE",
        "262",
        "01",
        tac=70,
        cid=1001 * 256 + 3,
        arfcn=1300,
        pci=5,
        rsrp_dbm=-99.0,
        rsrq_db=-11.0,
        sinr_db=12.0,
    )
    assert neighbour.reading == CellReading("neighbour", "LTE", arfcn=1300, pci=6, rsrp_dbm=-104.0)
    assert (third.reading.cid, third.reading.psc) == (12 << 16 | 70, 7)


def test_the_table_with_commas_and_rsrp(tmp_path):
    """The columns of the data sets of University College Cork."""
    head = (
        "Timestamp,Longitude,Latitude,Speed,Operatorname,CellID,NetworkMode,RSRP,RSRQ,SNR,State\n"
    )
    _, (row, off) = _rows(
        tmp_path,
        head
        + "2019.12.14_10.16.30,-8.4,51.8,0,B,11,LTE,-95,-14,-,D\n"
        + "2019.12.14_10.16.31,-8.4,51.8,0,B,-,-,-,-,-,D\n",
    )
    assert (row.reading.cid, row.reading.rsrp_dbm, row.reading.sinr_db) == (11, -95.0, None)
    assert off == NoCell(3, "no service")


def test_without_a_level_or_a_fix_it_is_a_bad_row(tmp_path):
    text = HEAD + PLACE + "x\t\t\t17\t4711\t2G\tEDGE\t-\n"
    text += PLACE.replace("52.5", "") + "x\t\t\t17\t4711\t2G\tEDGE\t-70\n"
    _, rows = _rows(tmp_path, text)
    assert [type(row) for row in rows] == [BadRow] * 2


def test_kml(tmp_path):
    values = {
        "TIME": "2024.05.01_12.00.07",
        "TECHNOLOGY": "4G",
        "MODE": "LTE",
        "CGI": "262-01-70-256259",
        "TAC": "70",
        "eNB": "1001",
        "CELLID": "3",
        "ARFCN": "1300",
        "PC": "5",
        "RSRP": "-99 dBm",
        "SNR": "12 dB",
        "SPEED": "3.6 km/h",
    }
    data = "".join(f'<Data name="{k}"><value>{v}</value></Data>' for k, v in values.items())
    name, rows = _rows(
        tmp_path,
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        "<Placemark><name>route</name></Placemark>"
        f"<Placemark><ExtendedData>{data}</ExtendedData>"
        "<Point><coordinates>13.5,52.5,0</coordinates></Point></Placemark></Document></kml>",
    )
    assert (name, rows[0]) == ("G-NetTrack KML", NoCell(1, "a point without a time"))
    assert (rows[1].t_ns, rows[1].lat_deg, rows[1].lon_deg) == (T_NS, 52.5, 13.5)
    assert rows[1].reading == CellReading(
        "serving",
        "LTE",
        "262",
        "01",
        tac=70,
        cid=256259,
        arfcn=1300,
        pci=5,
        rsrp_dbm=-99.0,
        sinr_db=12.0,
    )


RAW = (
    "Timestamp,Longitude,Latitude,Speed,Operatorname,CellID,NetworkMode,RSRP,CELLHEX,NODEHEX,"
    "LACHEX,RAWCELLID,State\n2019.12.14_10.16.30,-8.4,51.8,0,B,"
)


@pytest.mark.parametrize(
    ("row", "cell", "level_dbm"),
    [
        ("11,LTE,-95,B,A7C1F,9D,-,D", f"?-?-157-{0xA7C1F << 8 | 11}", -95.0),
        ("-,LTE,-95,B,A7C1F,9D,-,D", f"?-?-157-{0xA7C1F << 8 | 11}", -95.0),
        ("11,LTE,-95,B,-,9D,175906571,D", "?-?-157-175906571", -95.0),
        ("70,HSPA+,-81,46,1F,9D,-,D", f"?-?-157-{0x1F << 16 | 70}", -81.0),
        ("70,EDGE,-81,46,-,9D,-,D", "?-?-157-70", -81.0),
        ("11,LTE,-95,-,-,-,-,D", "?-?-?-11", -95.0),
    ],
)
def test_identities_in_hexadecimal_columns(tmp_path, row, cell, level_dbm):
    _, (read,) = _rows(tmp_path, RAW + row)
    assert (read.reading.cell, read.reading.level_dbm) == (cell, level_dbm)


def test_a_damaged_hexadecimal_number_is_a_bad_row(tmp_path):
    _, (row,) = _rows(tmp_path, RAW + "11,LTE,-95,B,xyz,9D,-,D")
    assert row == BadRow(2, "nodehex is no hexadecimal number: 'xyz'")


def test_the_timing_advance_of_gsm_is_read(tmp_path):
    head = HEAD.replace("\tIMEI", "\tTA")
    gsm = PLACE + "x\t\t\t17\t4711\t2G\tEDGE\t-71\t\t\t\t\t62\t10\t34\t5\t\t\t\t\t3\n"
    lte = gsm.replace("2G\tEDGE", "4G\tLTE")  # in other steps
    _, (first, second) = _rows(tmp_path, head + gsm + lte)
    assert (first.reading.ta, second.reading.ta) == (3, None)


def test_a_part_of_an_identity_of_nr_is_none(tmp_path):
    """How many bits it has only the network knows; as it is, cells of all nodes would be one."""
    head = "Timestamp\tLongitude\tLatitude\tOperator\tNode\tCellID\tLAC\tNetworkTech\tLevel"
    head += "\tARFCN\tPSC"
    place = "2024.05.14_09.00.00\t11.5\t48.1\t26201"
    text = f"{head}\n{place}\t80123\t3\t55\t5G\t-95\t632448\t33\n"
    (tmp_path / "log.txt").write_text(text)
    (row,) = recognise(tmp_path / "log.txt").read(tmp_path / "log.txt")
    assert (row.reading.cid, row.reading.cell) == (None, None)
    assert channel_name(row.reading) == "NR-632448-33"
