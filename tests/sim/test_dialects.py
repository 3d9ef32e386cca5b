"""The replies of simulated modems have the shape of real ones, and hold what the modem heard."""

import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from logger.core.types import Broadcast
from logger.drivers.registry import FAMILIES
from logger.sim.world import Air, ModemFix, ReceivedCell, Transmitter
from tests.kit.dialects import DIALECTS
from tests.kit.drivers import cells_of


def cell(cid, arfcn, bsic, lac=0x1FD5):
    return Transmitter(0.0, 0.0, -30.0, 3.0, "460", "01", lac, cid, arfcn, bsic)


PLACE = ModemFix(46.9487, -7.4475, 540.0, datetime(2024, 5, 14, 9, 0, 12, 500_000, UTC), 1.3, 90.25)
HEARD = [
    ReceivedCell(cell(0xC0DE, 37, 25), -64.0, is_decoded=True),
    *(ReceivedCell(cell(0xA530 + n, 80 + n, 50 + n), -80.0 - n, is_decoded=True) for n in range(6)),
]
UNREAD = ReceivedCell(cell(0x7E72, 12, 60), -70.0, is_decoded=False)
AIR = Air.of(HEARD, lambda: PLACE)
NOWHERE = Air.of([UNREAD])


def reply_to(name, command, air=AIR, **settings):
    """Lines of the reply to a command, with settings in the form CENG="1,1"."""
    dialect = DIALECTS[name]
    values = {key: kind.default for key, kind in dialect.settings.items()} | {"=": ""}
    values |= {
        f"{prefix}{key}": value
        for key, value in settings.items()
        for prefix in "+#"
        if prefix + key in values
    }
    answer = dialect.replies[command](air, values)
    return answer if isinstance(answer, int) else "\r\n".join(answer).splitlines()


def shape(line):
    """The line with one mark for each number or unknown value, and without blanks and names."""
    line = re.sub(
        r'(?<=Operator: )"[^"]*"|DCS|EGSM', "NAME", re.sub(r":\s*", ": ", f" {line.strip()}")
    )
    line = re.sub(
        r'(?<=[,:\s"\]#(-])-?[0-9A-Fa-fx]*\d[0-9A-Fa-f.]*(?=dbm|[^\w:]|\Z)|(?<=,)[-x]?(?=,|\Z)',
        "#",
        line,
    )
    return re.sub(r"\s+", " ", line)


CAPTURES = [  # and how many kinds of lines they share
    ("sim800", "+CENG?", "001.txt", {"CENG": "1,1"}, 2),
    ("sim800", "+CENG?", "012.txt", {"CENG": "3,0"}, 2),
    ("sim800", "+CNETSCAN", "007.txt", {}, 1),
    ("sim7000", "+CENG?", "022.txt", {"CENG": "1,1"}, 2),
    ("sim7000", "+CPSI?", "029.txt", {}, 1),
    ("sim7600", "+CCINFO", "049.txt", {}, 2),
    ("ec25", '+QENG="SERVINGCELL"', "069.txt", {}, 1),
    ("m95", "+QENG?", "092.txt", {"QENG": "1,0"}, 2),
    ("ge864", "#MONI", "099.txt", {"MONI": "7"}, 6),
    ("ge864", "#CSURVC", "105.txt", {}, 3),
    ("bgs2", "^SMONI", "126.txt", {}, 1),
    ("bgs2", "^MONP", "125.txt", {}, 2),
    ("mc55", "^SMONC", "121.txt", {}, 1),
    ("tc63", "^SMOND", "120.txt", {}, 1),
    ("mc7455", "!LTEINFO?", "131.txt", {}, 7),
    ("mc7455", "!GSTATUS?", "129.txt", {}, 10),
    ("me909s", "^MONSC", "135.txt", {}, 1),
    ("l850", "+GTCCINFO?", "139.txt", {}, 5),
]


@pytest.mark.parametrize(("name", "command", "file", "settings", "shared"), CAPTURES)
def test_shapes_are_those_of_a_capture(corpus, name, command, file, settings, shared):
    lines = (corpus / "modem" / file).read_text("latin-1").replace(";", "").splitlines()
    real = {shape(line) for line in lines}
    ours = {shape(line) for line in reply_to(name, command, **settings)}
    assert len(ours & real) == shared, (sorted(ours), sorted(real))


@pytest.mark.parametrize(
    ("name", "command", "line"),
    [
        (
            "sim800",
            "+CNETSCAN",
            'Operator:"Test PLMN 1-1",MCC:460,MNC:01,Rxlev:47,Cellid:C0DE,Arfcn:37',
        ),
        ("ec25", "+QOPS", '1,"2G",37,1FD5,C0DE,25,47,41,0,1'),
        (
            "ec25",
            '+QENG="NEIGHBOURCELL"',
            '+QENG: "neighbourcell","GSM",460,01,1FD5,A530,50,80,-80,25,25,0,0',
        ),
        ("ec25", "+QCSQ", '+QCSQ: "GSM",-64'),
        (
            "ge864",
            "#MONI",
            "#MONI: Test PLMN 1-1 BSIC:31 RxQual:0 LAC:1FD5 Id:C0DE ARFCN:37 PWR:-64dbm TA:0",
        ),
        ("ge864", "#SERVINFO", '#SERVINFO: 37,-64,"Test PLMN 1-1","46001",31,1FD5,0,1'),
        (
            "sara-g350",
            "+COPS=5",
            "MCC:460, MNC:  1, LAC:1fd5, CI:c0de, BSIC:19, Arfcn:00037, RXLEV:047",
        ),
        ("sara-g350", "+CGED=3", '+CGED: RAT:"GSM",'),
        (
            "sara-g350",
            "+UCELLINFO?",
            "+UCELLINFO:       0,     0,  460,    1, 1fd5, c0de,  47, 255",
        ),
        ("bgs2", "^SMONI", "^SMONI: 2G,37,-64,460,01,1FD5,C0DE,41,41,3,1,G,5,-107,LIMSRV"),
        ("me909s", "^MONNC", "^MONNC: GSM,1,80,50,A530,1FD5,-80"),
        ("me909s", "^HCSQ?", '^HCSQ: "GSM",57,255'),
        ("plain", "+CESQ", "+CESQ: 47,99,255,255,255,255"),
    ],
)
def test_a_line_holds_what_was_received(name, command, line):
    assert line in reply_to(name, command)


def test_a_survey_of_some_channels():
    carriers = [
        line
        for line in reply_to("ge864", "#CSURV=", Air.of([*HEARD, UNREAD]))
        if line.startswith("arfcn")
    ]
    assert len(carriers) == 8
    assert carriers[-1] == "arfcn: 12 rxLev: -70"
    values = {key: kind.default for key, kind in DIALECTS["ge864"].settings.items()} | {
        "=": "81,83"
    }
    some = "\n".join(DIALECTS["ge864"].replies["#CSURV="](AIR, values))
    assert re.findall(r"(?m)^arfcn: (\d+)", some) == ["81", "82", "83"]
    assert "bsic: 63 " not in some
    octal = "\n".join(DIALECTS["ge864"].replies["#CSURV="](AIR, values | {"#CSURVF": "2"}))
    assert "bsic: 63 rxLev: -81 ber: 0.00 mcc: 460 mnc: 01 lac: 1FD5 cellId: A531 " in octal


BROADCASTS = (
    Broadcast((14, 19, 982), cro_db=60, penalty_time=31, t3212_raw=10),
    Broadcast((), cro_db=0, penalty_time=0, t3212_raw=255),
)


@pytest.mark.parametrize("command", ["#CSURV", "#CSURVC"])
@pytest.mark.parametrize("extent", ["0", "1", "3"])
def test_a_survey_prints_what_cells_broadcast(command, extent):
    heard = [
        replace(one, cell=replace(one.cell, broadcast=broadcast))
        for one, broadcast in zip(HEARD, BROADCASTS, strict=False)
    ]
    lines = reply_to("ge864", command, Air.of(heard), CSURVEXT=extent)
    lists = [Broadcast(broadcast.neighbour_arfcns) for broadcast in BROADCASTS]
    expected = {"0": [lists[0], None], "1": lists, "3": list(BROADCASTS)}[extent]
    assert [row.broadcast for row in cells_of(FAMILIES["telit"], lines)] == expected


def test_the_offset_of_a_cell_raises_or_lowers_c2():
    one = HEARD[0]
    offsets = {None: 0, Broadcast(cro_db=60): 60, BROADCASTS[0]: -60}
    for broadcast, offset_db in offsets.items():
        changed = replace(one, cell=replace(one.cell, broadcast=broadcast))
        assert changed.c2 - changed.c1 == offset_db


@pytest.mark.parametrize(
    ("name", "command", "on", "line"),
    [
        ("sim808", "+CGNSINF", {"CGNSPWR": "1"},
         (
             "+CGNSINF: 1,1,20240514090012.500,46.948700,-7.447500,"
             "540.000,4.68,90.2,1,,0.9,1.7,1.4,,12,9,,,42,,"
         )),
        ("sim7600", "+CGPSINFO", {"CGPS": "1"},
         "+CGPSINFO: 4656.922000,N,00726.850000,W,140524,090012.5,540.0,2.5,90.2"),
        ("ec25", "+QGPSLOC=2", {"QGPS": "1"},
         "+QGPSLOC: 090012.5,46.94870,-7.44750,0.9,540.0,3,90.15,4.7,2.5,140524,09"),
    ],
)  # fmt: skip
def test_the_receiver_reports_where_it_is_once_it_is_on(name, command, on, line):
    assert reply_to(name, command, **on) == [line]
    assert reply_to(name, command) != [line]
    without_fix = reply_to(name, command, NOWHERE, **on)
    assert without_fix == 516 or not re.search(r"\d\d\d\d\.\d\d\d\d,", without_fix[0])


@pytest.mark.parametrize("name", DIALECTS)
def test_without_a_serving_cell_none_is_named(name):
    for command in DIALECTS[name].replies:
        answer = reply_to(name, command, NOWHERE)
        text = str(answer) if isinstance(answer, int) else " ".join(answer)
        assert not re.search(r"7e72|32370|1fd5|8149|\b460\b", text, re.IGNORECASE), (command, text)
