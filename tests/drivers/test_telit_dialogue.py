import pytest

from logger.core.types import CellReading
from logger.drivers.protocols.redaction import redact
from logger.drivers.reading.standard_replies import is_serving
from logger.drivers.telit import Telit
from tests.kit.drivers import run_dialogue

MODEM = Telit()

SERVING = "#MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net"
NEIGHBOUR = "#MONI: N1 46 3F6B 2C8D 962 -86dbm 17 15"


def test_setup_of_a_modem_that_has_few_commands():
    assert run_dialogue(MODEM.setup(), {"AT": ((), "OK")})[0] is True
    assert run_dialogue(MODEM.setup(), {})[0] is False


def test_poll_names_the_serving_cell():
    answers = {
        "AT#MONI": ([SERVING, NEIGHBOUR], "OK"),
        "AT#SERVINFO": (['#SERVINFO: 688,-79,"Example Net","26201",52,3F6A,01,1'], "OK"),
        "AT+CREG?": (['+CREG: 2,1,"3F6A","1B7C"'], "OK"),
    }
    rows = run_dialogue(MODEM.poll(), answers)[0]
    readings = [row for row in rows if isinstance(row, CellReading)]
    assert [(row.role, row.cell) for row in readings] == [
        ("serving", "262-01-16234-7036"),
        ("neighbour", None),
    ]
    assert readings[0].c1 == 22


def test_poll_on_lte_takes_the_cell_from_the_registration():
    line = '#SERVINFO: 6300,-55,"Example Net","26203",00000B2,4E5F,32,3,-84'
    answers = {
        "AT#SERVINFO": ([line], "OK"),
        "AT+CEREG?": (['+CEREG: 2,1,"4E5F","0A1B2C3",7'], "OK"),
    }
    rows = run_dialogue(MODEM.poll(), answers)[0]
    assert rows[0].cell == f"262-03-{0x4E5F}-{0x0A1B2C3}"
    for other in (
        '2,1,"4E60","0A1B2C3",7',
        '2,2,"4E5F","0A1B2C3",7',
    ):  # its last one, while it searches
        answers["AT+CEREG?"] = ([f"+CEREG: {other}"], "OK")
        assert run_dialogue(MODEM.poll(), answers)[0][0].cid is None


PCI_OF_SERVINFO = (
    '#SERVINFO: 1600,-55,"Example Net","26203",178,4E5F,32,3,-84'  # of both UMTS and LTE
)


@pytest.mark.parametrize(
    ("command", "registration", "rat"),
    [
        ("AT+CEREG?", '+CEREG: 2,1,"4E5F","0A1B2C3",7', "LTE"),
        ("AT+CEREG?", '+CEREG: 2,1,"4E5F","0A1B2C3",8', "LTE"),
        ("AT+CREG?", '+CREG: 2,1,"4E5F","0A1B2C3",2', "WCDMA"),
    ],
)
def test_the_registration_shows_whether_a_row_is_of_lte(command, registration, rat):
    answers = {"AT#SERVINFO": ([PCI_OF_SERVINFO], "OK"), command: ([registration], "OK")}
    cell = run_dialogue(MODEM.poll(), answers)[0][0]
    assert (cell.rat, cell.cell) == (rat, f"262-03-{0x4E5F}-{0x0A1B2C3}")
    codes = (cell.pci, cell.rsrp_dbm, cell.psc, cell.rscp_dbm)
    assert codes == ((178, -84.0, None, None) if rat == "LTE" else (None, None, 178, -84.0))


def test_the_serving_cell_that_moni_lists_without_its_name_is_no_neighbour():
    row = "#MONI: RSRP:{} RSRQ:-13 Id:{:07X} EARFCN:6300 PWR:{}dbm".format
    servinfo = '#SERVINFO: 6300,-68,"Example Net","26203",0A1B2C3,4E5F,32,3,-101'
    for level, n_others in ((-101, 1), (-103, 2)):
        answers = {
            "AT#MONI": ([row(level, 236, -68), row(-107, 322, -79)], "OK"),
            "AT#SERVINFO": ([servinfo], "OK"),
        }
        serving, *others = run_dialogue(MODEM.poll(), answers)[0]
        assert serving.cell == f"262-03-{0x4E5F}-{0x0A1B2C3}"
        assert (serving.pci, serving.rsrq_db) == ((236, -13.0) if n_others == 1 else (None, None))
        assert [one.pci for one in others] == [236, 322][-n_others:]


def test_the_network_of_servinfo_joins_the_cell_of_moni():
    moni = "#MONI: Example Net RSRP:-84 RSRQ:-9 TAC:4E5F Id:0A1B2C3 EARFCN:1600 PWR:-55dBm DRX:32"
    answers = {
        "AT#MONI": ([f"{moni} pci:178 QRxLevMin:-122"], "OK"),
        "AT#SERVINFO": ([PCI_OF_SERVINFO], "OK"),
        "AT+CEREG?": (['+CEREG: 2,1,"4E5F","0A1B2C3",7'], "OK"),
    }
    serving = [row for row in run_dialogue(MODEM.poll(), answers)[0] if is_serving(row)]
    assert [(row.cell, row.pci) for row in serving] == [(f"262-03-{0x4E5F}-{0x0A1B2C3}", 178)]


def test_the_receiver_of_a_telit_has_fixes():
    for printed in (
        "141320.000,3324.6600S,07031.3800W,1.1,560.0,3,0.00,36.0,19.4,210926,09",
        "141320.000,3324.6600S,07031.3800W,1.1,560.0,3,0.00,36.0,19.4,210926,09,04",
    ):
        line = redact(f"$GPSACP: {printed}\r\n".encode(), "AT$GPSACP").decode()
        (fix,) = MODEM.read([line])
        assert (fix.valid, fix.sats_used) == (True, 9)
        assert (fix.lat_deg, fix.lon_deg) == (pytest.approx(-33.411), pytest.approx(-70.523))
    (nothing,) = MODEM.read(["$GPSACP: 141320.000,,,,,0,,,,210926,"])
    assert not nothing.valid


def test_poll_without_an_answer():
    assert run_dialogue(MODEM.poll(), {})[0] is None
    assert (
        run_dialogue(MODEM.poll(), dict.fromkeys(["AT#MONI", "AT#SERVINFO"], ((), None)))[0] is None
    )
    assert run_dialogue(MODEM.poll(), {"AT#MONI": ((), "OK")})[0] == ()
    assert run_dialogue(MODEM.poll(), {"AT#MONI": ([NEIGHBOUR], None)})[0] == MODEM.read(
        [NEIGHBOUR]
    )


def test_survey_covers_all_channels_of_gsm_in_parts():
    spans = [
        tuple(map(int, command.text.removeprefix("AT#CSURV=").split(",")))
        for command in MODEM.survey_commands
    ]
    channels = [channel for low, high in spans for channel in range(low, high + 1)]
    assert channels == [*range(125), *range(128, 252), *range(512, 886), *range(975, 1024)]
    assert all(command.timeout_s >= 120 for command in MODEM.survey_commands)
