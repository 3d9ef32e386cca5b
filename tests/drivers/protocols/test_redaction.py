import json
import random
import time

import pytest

from logger.drivers.family import Family
from logger.drivers.protocols.gpsd import GpsdFramer
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, Sentence
from logger.drivers.protocols.redaction import Redactor, redact
from logger.drivers.registry import FAMILIES, IDENTITY, family_of, reader_of
from logger.drivers.telit import Telit
from logger.sim.devices import frame_text
from tests.drivers.test_claims import answers_of
from tests.kit.corpus import entries
from tests.kit.dialects import DIALECTS
from tests.kit.drivers import cells_of, own_replies
from tests.kit.redacted_replies import REPLIES, redact_in_pieces
from tests.kit.secrets import FORMS, leaked_secrets

REPLY = (
    b'\r\n+CENG: 1,1\r\n\r\n+CENG: 0,"0017,45,00,262,01,09,3039,05,05,1267,255"\r\n'
    b'+CENG: 1,"0021,30,12,303a,262,01,1267"\r\n\r\nOK\r\n'
)
HARMLESS = [
    b'+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\r\n',
    b"+CGNSINF: 1,1,20161124025208.000,31.222014,121.354368,114.600,0.28,0.0,1,,1.9\r\n",
    b'+QENG: "NR5G-SA","TDD",310,260,170C2C5F0,684,7D3C00,520110,41,12,-90,-11,20,1,50\r\n',
    b'+CREG: 2,1,"00C8","00005449",7\r\n+C5GREG: 2,1,"000001","000000001",11\r\n',
    b'+C5GREG: 2,1,"000001","0012345678",11\r\n+C5GREG: 1,"000001","0000000123456789"\r\n',
    b"+C5GREG: 2,5,000001,0000000123456789,12,0,15\r\n",
    b"+creg: 1\r\n+CPSI: NR5G_SA,Online,262-01,0x2A4C31,19088743210,412,NR5G_BAND78,632448,-8\r\n",
    b"+CPSI: NR5G_SA, Online, 262-01, 0x2A4C31, 19088743210 , 412, NR5G_BAND78, 632448, -8\r\n",
    b"+CGNSINF: 1, 1, 20161124025208.000, 31.222014, 121.354368, 114.600, 0.28, 0.0\r\n",
    (
        b'+COPS: (2,"Telekom.de","TMO","26201",7),(1,"Vodafone.de",'
        b'"Voda","26202",2),,(0,1,2,3,4),(0,1,2)\r\n'
    ),
    (
        b'{"class":"TPV","device":"/dev/ttyACM0","mode":3,"time":"2026-11-21T12:00:00.000Z",'
        b'"lat":52.516666666666667,"lon":13.400000000000000123,'
        b'"eph":9.5,"epc":0.012345678901234567}\r\n'
    ),
    b"$GPGGA,120000.00,5231.0000000,N,01324.0000000,E,1,09,0.9,34.0,M,40.0,M,,0000*5A\r\n",
    (
        b"$GPZDA,120000.00,21,11,2026,00,00*60\r\n"
        b"$PUBX,00,120000.00,5231.00000,N,01324.00000,E,34.0,G3*00\r\n"
    ),
    b'\r\nRDY\r\n+CFUN: 1\r\n+CPIN: READY\r\nCall Ready\r\n+CSQ: 19,99\r\n+QIND: "csq",20,99\r\n',
    b"^MODE: 5,4\r\n*ATREADY: 1\r\n^SYSSTART\r\nNORMAL POWER DOWN\r\n+CME ERROR: no network\r\n",
    b"UNDER-VOLTAGE WARNNING\r\nRING\r\n+CIEV: 2,1\r\nNO CARRIER\r\nDST: 1\r\nPB DONE\r\n0\r\n",
]


@pytest.mark.parametrize("form", FORMS)
def test_personal_numbers_are_redacted_whatever_the_chunks(form):
    """Alone, at the end of what came, and between the rows of a reply, which stays as it was."""
    secret = form.encode("latin-1")
    assert leaked_secrets(secret) or "+CRSM" in form
    for seed, data in enumerate(
        [secret, secret + b"\r\n", b"\r\n" + secret + b"\r\n" + REPLY] * 10
    ):
        out = redact_in_pieces(data, random.Random(seed), "AT+CENG?")
        assert not leaked_secrets(out), out
        assert len(out) == len(data)
        if data.endswith(REPLY):
            assert out.endswith(REPLY)


def test_of_an_unknown_line_its_length_and_its_name_remain():
    for line, left in (
        (b'+CLIP: "4155551234",129', b'+CLIP: "xxxxxxxxxx",xxx'),
        (b"NMBR = 4155551234", b"NMBR = xxxxxxxxxx"),
        (b"MISSED_CALL: 10:12AM 4155551234", b"MISSED_CALL: xx:xxxx xxxxxxxxxx"),
        (b'+C5GREG: 2,1,"000001","0012345678",129', b'+C5GREG: 2,1,"000001","xxxxxxxxxx",129'),
        (b'+C5GREG: 2,1,"000001","1234567890",11', b'+C5GREG: 2,1,"000001","xxxxxxxxxx",11'),
        (b'AT+CMGS="4155551234"', b'AT+CMGS="xxxxxxxxxx"'),
        (b"ATD4155551234;", b"ATDxxxxxxxxxx;"),
        (b"Jos\xc3\xa9 kommt", b"xxx\xff\xff xxxxx"),
    ):
        assert redact(line) == left


@pytest.mark.parametrize("line", HARMLESS)
def test_data_of_cells_positions_and_times_are_not_redacted(line):
    assert redact(line) == line
    for seed in range(30):
        assert redact_in_pieces(line, random.Random(seed)) == line


@pytest.mark.parametrize("command", REPLIES)
@pytest.mark.parametrize("end", [b"\r\n", b"\r", b"\n", b"\n\r"])
def test_the_reply_to_a_command_passes_with_and_without_echo(command, end):
    reply = REPLIES[command].replace(b"@", b"").replace(b"\r\n", end)
    for echo in (b"", command.encode() + b"\r", command.lower().encode() + b"\r"):
        assert redact_in_pieces(echo + reply, random.Random(1), command) == echo + reply


def test_rows_without_a_name_pass_for_the_command_that_they_answer_and_some_commands_more():
    row = b"MCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594, RXLEV:017\r\n"
    for later in ((), ("AT+CSQ",) * 7, ("AT",) * 100):  # AT is a sign of life in a long scan
        assert redact(row, "AT+COPS=5", *later) == row
    assert b"310" not in redact(row, "AT+COPS=5", *["AT+CSQ"] * 8)
    assert b"310" not in redact(row)


def _replies(folder):
    """Texts of the corpus and of our own, with the driver that reads them."""
    for entry in entries(folder, ""):
        data = (folder / "modem" / entry["file"]).read_bytes()
        yield entry["file"], reader_of(data.decode("latin-1").splitlines()), data
    for name, family in FAMILIES.items():
        yield from ((name, family, reply.encode("latin-1")) for reply in own_replies(name))


def _commands(family: Family):
    """The commands of the driver whose rows have no name, as in a session."""
    unnamed = [f"AT{name}" for name in family.unnamed_rows]
    return [*unnamed, "AT+COPS=?"][-4:]


def test_a_driver_reads_the_same_in_all_recordings(corpus):
    """Nothing that a driver reads is masked in replies and logs of real devices."""
    n_lines = 0
    for name, family, data in _replies(corpus):
        lines, left = (
            text.decode("latin-1").splitlines()
            for text in (data, redact_in_pieces(data, random.Random(name), *_commands(family)))
        )
        n_lines += len(lines)
        assert family.read(left) == family.read(lines), name
        assert [family.role_of(line) for line in left] == [family.role_of(line) for line in lines]
    assert n_lines > 500


def test_what_is_masked_in_the_recordings_is_no_row_and_no_model(corpus):
    """Names of the masked lines: none is one that a driver asks for."""
    names = set()
    for _, family, data in _replies(corpus):
        left = redact(data, *_commands(family), "ATI")
        for before, after in zip(data.split(b"\n"), left.split(b"\n"), strict=True):
            if before != after and before[:1] in b"+^#!" and b": " in before:
                names.add(before.partition(b":")[0])
    assert names <= {
        *(b"+CNWINFO", b"+QNWINFO", b"+QSPN", b"+CGDCONT", b"+CSMINS", b"#RFSTS"),
        b"+CMGRMI",  # a mask of 18 digits in a row of the settings of antennas
    }


def test_no_list_of_neighbours_is_taken_for_a_number():
    """Lists of any channels, with labels and without, in pieces of any size."""
    rng = random.Random(5)
    for seed in range(400):
        channels = rng.sample(range(1024), rng.randint(0, 32))
        text = " ".join(map(str, channels)).encode()
        n = len(channels)
        labelled = b"cellId: 12345 cellStatus: CELL_SUITABLE numArfcn: 1 arfcn: 15 numChannels: "
        line = b"%s%d array: %s croffset: 30 t3212: 10\r\n" % (
            labelled,
            n,
            text,
        ) + b"15,20,-71,0,262,01,21014,12345,0,1,15,%d,%s,0,5,8,30,31,10,4\r\n" % (n, text)
        assert redact(line, "AT#CSURV=0,62") == line
        assert redact_in_pieces(line, random.Random(seed), "AT#CSURV=0,62") == line


def test_a_personal_number_in_a_list_is_redacted_and_no_neighbour():
    modem = Telit()
    row = (
        "arfcn: 48 bsic: 24 rxLev: -52 ber: 0.00 mcc: 262 mnc: 1 lac: 33281 cellId: 3648"
        " cellStatus: CELL_SUITABLE numArfcn: 1 arfcn: 48 numChannels: {} array: {}\n"
    )
    for form in ("262011234567890", "49 015420 323751 8", "8949 0200 0013 4567 8901"):
        data = row.format(len(form.split()), form).encode()
        left = redact(data, "AT#CSURV=0,62")
        assert not leaked_secrets(left)
        for text in (data, left):
            (reading,) = cells_of(modem, text.decode().splitlines())
            assert reading.broadcast is None


def test_all_forms_between_all_rows_in_any_order():
    """An hour of a busy telephone in the middle of polls: no number is left, and no row is
    damaged.
    """
    rng = random.Random(3)
    for _ in range(20):
        forms = [form.encode("latin-1") for form in FORMS if "CENG" not in form]
        rng.shuffle(forms)
        out = redact_in_pieces(
            b"".join(b"\r\n" + form + b"\r\n" + REPLY for form in forms), rng, "AT+CENG?"
        )
        assert not leaked_secrets(out)
        assert out.count(REPLY) == len(forms)


def test_a_message_does_not_swallow_the_rows_after_it():
    rows = (
        b"arfcn: 15 bsic: 20 rxLev: -71 ber: 0.00 mcc: 262 mnc:"
        b" 01\r\n15,20,-71,0,262,01,21014,12345,0\r\n"
    )
    data = b'+CMT: "+4917698765432",,"26/11/21,12:00:00+04"\r\nTreffpunkt\r\n' + rows
    assert redact(data, "AT#CSURV=0,62").endswith(rows)


@pytest.mark.parametrize("command", ["ATI", "AT+CENG?", "AT#CSURV=0,62", "AT+COPS=?", "AT^MONI"])
def test_no_line_takes_long(command):
    """Lines as long as any is held, in which a form is almost there to the end."""
    for begin in (b"", b"+CENG: ", b"+COPS: (", b"#MONI: ", b"$GPGSV", b'{"class":"', b"Model: "):
        for piece in (
            b",12",
            b"12 ",
            b"a",
            b"A1 ",
            b'"',
            b"1.",
            b"$GP",
            b":",
            b"x y=",
            b"(1,",
            b"\\",
        ):
            line = begin + piece * (4000 // len(piece)) + b"!g*\r\n"
            begun_s = time.process_time()
            assert len(redact(line, command)) == len(line)
            assert time.process_time() - begun_s < 1.0, (begin, piece)


def test_memory_is_bounded_in_an_endless_line():
    for endless in (b"71234560", b"abcdefgh", b'+CUSD: 1,"', b"+CMT: ,24\r", b'{"class":"'):
        redactor = Redactor()
        output = b"".join(redactor.feed(endless * 12 + b"1234567890123456") for _ in range(400))
        n_fed = len(endless * 12 + b"1234567890123456") * 400
        assert n_fed - 16_500 <= len(output) <= n_fed
        assert b"1234567890123456" not in output
        assert len(output + redactor.flush()) == n_fed


@pytest.mark.parametrize("name", FAMILIES)
def test_a_modem_is_identified_by_what_is_left_of_its_answers(name):
    for answer in answers_of(name):
        for command in IDENTITY:
            left = redact(f"\r\n{answer}\r\n\r\nOK\r\n".encode(), command).decode()
            assert family_of(left).name == name, left


@pytest.mark.parametrize("before", [b"", b"\r\n+XNEW: 1\r\n", b"\r\nStarting the stack\r\n"])
@pytest.mark.parametrize("name", DIALECTS)
def test_a_simulated_modem_is_identified_also_after_a_line_that_nobody_knows(name, before):
    whole, left = "", ""
    for command, blocks in DIALECTS[name].identity.items():
        reply = before + frame_text(*blocks, "OK")
        whole += reply.decode()
        left += redact(reply, f"AT{command}").decode()
    assert family_of(left) == family_of(whole)
    assert (DIALECTS[name].identity["+CGMM"][0] in left) or before


def test_what_a_modem_prints_of_itself_loses_its_serial_numbers_alone():
    ati = (
        b"\r\nManufacturer: Sierra Wireless, Incorporated\r\nModel: MC7455\r\n"
        b"Revision: SWI9X30C_02.24.05.06 r7040 CARMD-EV-FRMWR2 2017/05/19 06:23:09\r\n"
        b"MEID: 35907206022883\r\nIMEI: 359072060228832\r\nIMEI SV: 17\r\nFSN: LF728387390410\r\n"
        b"+GCAP: +CGSM\r\n\r\nOK\r\n"
    )
    left = (
        ati.replace(b"35907206022883", b"x" * 14)
        .replace(b"x2\r", b"xx\r")
        .replace(b"SV: 17", b"SV: xx")
        .replace(b"LF728387390410", b"x" * 14)
    )
    out = redact(ati, "ATI")
    assert out.replace(b"+xxxx", b"+CGSM") == left
    unknown = b"\r\nACME 2000\r\n\r\nOK\r\n\r\nVersion 1.0.3 build A7\r\n\r\nOK\r\n"
    assert redact(unknown, "ATI") == unknown
    assert redact(b"Example\r\n", "AT+CGMI") == b"Example\r\n"


def _fixes(data):
    framer, assembler, fixes, n_noise = NmeaFramer(), FixAssembler(), [], 0
    for event in framer.feed(data):
        if isinstance(event, Sentence):
            fixes += assembler.feed(event, 0)
        else:
            n_noise += len(event.data)
    return [*fixes, *assembler.flush()], n_noise


def test_fixes_and_noise_of_all_recorded_receivers_are_the_same(corpus):
    """A text in a sentence is masked, and its checksum is that of what is left."""
    paths = sorted(corpus.glob("nmea/*.nmea"))
    assert paths
    for path in paths:
        data = path.read_bytes()
        assert _fixes(redact(data)) == _fixes(data)


def test_a_receiver_keeps_its_numbers_and_loses_its_serial_number():
    data = b"$PDTINFO,UM621-02,G1B1L1E1,V1.2,R6.0.0.0Build2810,2310414000033,PC12B4231700429*73\r\n"
    out = redact(data)
    assert out.startswith(b"$PDTINFO,xxxxx-xx,")
    assert b"2310414" not in out
    assert b"4231700429" not in out
    assert all(isinstance(event, Sentence) for event in NmeaFramer().feed(out))


def test_gpsd_keeps_what_is_read_of_its_reports():
    device = {
        "class": "DEVICE",
        "path": "/dev/serial/by-id/usb-u-blox_7-if00",
        "driver": "u-blox",
        "sernum": "LF728387390410",
        "subtype": 'SW 1.0, 2310414000033, \u00e9"\\',
        "activated": "2026-11-21T12:00:00.000Z",
        "bps": 9600,
        "id": 355789041234567,
    }
    text = json.dumps(device).encode().replace(b'": ', b'":').replace(b", ", b",")
    out = redact(text + b"\r\n")
    left = json.loads(out)
    assert {key for key in device if left[key] != device[key]} == {"sernum", "subtype", "id"}
    assert b"2310414" not in out
    assert list(GpsdFramer().feed(out)) == list(GpsdFramer().feed(text + b"\r\n"))


NR_ROW = b"1,9,460,11,590A1C,%s,176190,524,505,75,6,57,57,73\r\n"


@pytest.mark.parametrize("cell", [b"5AB620605", b"05AB620605", b"0123456789", b"FFFFFFFFF"])
def test_an_nr_cell_of_36_bits_passes_at_its_place_in_a_row_of_fibocom(cell):
    """Nine hexadecimal digits, or ten with a zero before, as numbers of five bytes have them."""
    rows = b"+GTCCINFO:\r\nNR service cell:\r\n" + NR_ROW % cell
    assert redact(rows, "AT+GTCCINFO?") == rows
    (reading,) = cells_of(FAMILIES["fibocom"], rows.decode().splitlines())
    assert reading.cid == int(cell, 16) or cell == b"FFFFFFFFF"


@pytest.mark.parametrize(
    "row",
    [
        NR_ROW % b"15AB620605",
        NR_ROW % b"005AB620605",
        NR_ROW % b"460110123456789",
        NR_ROW.replace(b",9,", b",4,") % b"0301234567",
        NR_ROW.replace(b"590A1C", b"0301234567") % b"5AB620605",
        b"0301234567,145,1,2,3\r\n",
        b"1,9,0301234567,145,1,2,3\r\n",
    ],
)
def test_a_number_of_ten_digits_elsewhere_does_not(row):
    kept = redact(b"+GTCCINFO:\r\n" + row, "AT+GTCCINFO?").splitlines()[1]
    assert not any(len(part) >= 10 for part in kept.replace(b"x", b"").split(b","))
    assert b"xxxxxxxxxx" in kept
