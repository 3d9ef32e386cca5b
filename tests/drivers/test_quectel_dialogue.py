from logger.drivers.family import AUTOBAUD_TRIES
from logger.drivers.quectel import Quectel
from logger.drivers.reading.row_language import NoCell
from tests.kit.drivers import only_cell_of, run_exchange

MODEM = Quectel()

# Values of our own in the layouts of the EC2x manual 6.17; WCDMA, SA, EN_DC and SHORT_SCAN are in
# the corpus.
GSM = (
    '+QENG: "servingcell","NOCONN","GSM",262,01,1A2B,3C4D,21,57,'
    '-,-66,255,255,0,39,41,1,-,-,-,-,-,-,-,-,-,"-"'
)

QOPS = ['+QOPS: "EXAMPLE NET","EXNET","26203"', '1,"2G",21,1A2D,3C50,14,25,22,0,1']

GSM_ON_GSM = '+QENG: "neighbourcell","GSM",262,01,1A2C,3C4F,27,61,-79,24,25,0,0'


def one(*lines):
    return only_cell_of(MODEM, lines)


AWAKE = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]


def test_setup_needs_a_modem_that_answers():
    assert run_exchange(MODEM.setup(), AWAKE) is True
    assert run_exchange(MODEM.setup(), [("AT", [], None)] * AUTOBAUD_TRIES) is False


def test_poll():
    serving, neighbours = 'AT+QENG="servingcell"', 'AT+QENG="neighbourcell"'
    assert run_exchange(
        MODEM.poll(), [(serving, [GSM], "OK"), (neighbours, [GSM_ON_GSM], "OK")]
    ) == (
        one(GSM),
        one(GSM_ON_GSM),
    )
    assert run_exchange(MODEM.poll(), [(serving, [GSM], "OK"), (neighbours, [], None)]) == (
        one(GSM),
    )
    assert run_exchange(MODEM.poll(), [(serving, [], "OK"), (neighbours, [], "OK")]) == ()
    assert (
        run_exchange(MODEM.poll(), [(serving, [], "ERROR"), (neighbours, [], "+CME ERROR: 100")])
        is None
    )
    assert run_exchange(MODEM.poll(), [(serving, [], None), (neighbours, [], None)]) is None
    searching = ['+QENG: "servingcell","SEARCH"']
    assert run_exchange(MODEM.poll(), [(serving, searching, "OK"), (neighbours, [], "ERROR")]) == (
        NoCell(state="SEARCH"),
    )


def test_survey():
    (cell,) = run_exchange(
        MODEM.ask(MODEM.survey_commands[:1]), [(MODEM.survey_commands[0].text, QOPS, "OK")]
    )
    assert (cell.lac, cell.cid) == (0x1A2D, 0x3C50)
