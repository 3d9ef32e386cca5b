import random
from pathlib import Path

import pytest

from logger.drivers.privacy.redaction import Redactor, redact
from logger.drivers.telit.telit import Telit
from tests.kit.drivers import cells_of
from tests.kit.secrets import FORMS, leaked_secrets

DATA = Path(__file__).parents[1] / "data"
REPLY = (
    b'\r\n+CENG: 1,1\r\n\r\n+CENG: 0,"0017,45,00,262,01,09,3039,05,05,1267,255"\r\n'
    b'+CENG: 1,"0021,30,12,303a,262,01,1267"\r\n\r\nOK\r\n'
)
HARMLESS = [
    b'+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\r\n',
    b"+CGNSINF: 1,1,20161124025208.000,31.222014,121.354368,114.600,0.28,0.0,1,,1.9\r\n",
    b"+CNWINFO: LTE,20820130336514,0x7C4C7,0,0,UNKOWN,UNKOWN,0,0,-99\r\n",
    b'+QENG: "NR5G-SA","TDD",310,260,170C2C5F0,684,7D3C00,520110,41,12,-90,-11,20,1,50\r\n',
    b'+CREG: 2,1,"00C8","00005449",7\r\n+C5GREG: 2,1,"000001","000000001",11\r\n',
    (
        b'+COPS: (2,"Telekom.de","TMO","26201",7),(1,"Vodafone.de",'
        b'"Voda","26202",2),,(0,1,2,3,4),(0,1,2)\r\n'
    ),
    (
        b'+CCLK: "26/11/21,12:00:00+04"\r\n+QLTS: "2026/11/21,'
        b'12:00:00+04,0"\r\n*PSUTTZ: "20261121120000","+04",0\r\n'
    ),
    (
        b"arfcn: 15 bsic: 20 rxLev: -71 ber: 0.00 mcc: 262 mnc: 01 lac:"
        b" 21014 cellId: 12345 cellStatus: CELL_SUITABLE\r\n"
    ),
    b"Cc:262 Nc:01 BSIC:20 RxQual:0 LAC:4E8A Id:2F3A ARFCN:123 PWR:-71dbm TA:1\r\n",
    b"  15  20  63  262  01  4711  0310 12345   0   0  I  5\r\n",
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
    b"0000012500 [app] INFO: +CSQ: 19,99\r\n",
    b"2026-11-21 12:00:00.123456 AT\r\n20261121-120000 started\r\n2026-11-21-12-00-00-000 AT\r\n",
    b"\xb5b\x01\x07\x5c\x00" + b"3" * 43 + b"\x00\x01\x02+1234567\xff\r\n",
    b'+CPIN: READY\r\n+CMTI: "SM",3\r\n+CSQ: 19,99\r\nOK\r\n',
]


def _cut(data, rng):
    redactor, out = Redactor(), b""
    while data:
        n = rng.choice((1, rng.randint(1, 8), rng.randint(1, 200)))
        out, data = out + redactor.feed(data[:n]), data[n:]
    return out + redactor.flush()


@pytest.mark.parametrize("form", FORMS)
def test_personal_numbers_are_redacted_whatever_the_chunks(form):
    """Alone, at the end of what came, and between the rows of a reply, which stays as it was."""
    secret = form.encode("latin-1")
    assert leaked_secrets(secret) or "+CRSM" in form
    for seed, data in enumerate(
        [secret, secret + b"\r\n", b"\r\n" + secret + b"\r\n" + REPLY] * 30
    ):
        out = _cut(data, random.Random(seed))
        assert not leaked_secrets(out), out
        assert len(out) == len(data)
        if data.endswith(REPLY):
            assert out.endswith(REPLY)


@pytest.mark.parametrize("line", HARMLESS)
def test_data_of_cells_positions_and_times_are_not_redacted(line):
    assert redact(line) == line
    for seed in range(30):
        assert _cut(line, random.Random(seed)) == line


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
        assert redact(line) == line
        assert _cut(line, random.Random(seed)) == line


def test_a_personal_number_in_a_list_is_redacted_and_no_neighbour():
    modem = Telit()
    row = (
        "arfcn: 48 bsic: 24 rxLev: -52 ber: 0.00 mcc: 262 mnc: 1 lac: 33281 cellId: 3648"
        " cellStatus: CELL_SUITABLE numArfcn: 1 arfcn: 48 numChannels: {} array: {}\n"
    )
    for form in ("262011234567890", "49 015420 323751 8", "8949 0200 0013 4567 8901"):
        data = row.format(len(form.split()), form).encode()
        assert not leaked_secrets(redact(data))
        for text in (data, redact(data)):
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
        out = _cut(b"".join(b"\r\n" + form + b"\r\n" + REPLY for form in forms), rng)
        assert not leaked_secrets(out)
        assert out.count(REPLY) == len(forms)


def _has_changed(data):
    return [a for a, b in zip(data.split(b"\n"), redact(data).split(b"\n"), strict=True) if a != b]


def test_no_row_and_no_sentence_of_the_recordings_is_touched(corpus):
    """Replies and logs of real devices; what differs is one IMSI of zeros, and the rest of an IMEI
    among stars.
    """
    found = [
        line
        for path in sorted(corpus.glob("modem/*.txt"))
        for line in _has_changed(path.read_bytes())
    ]
    assert [line[:6] for line in found] == [b"IMEI: ", b"#RFSTS"]
    for path in sorted(corpus.glob("nmea/*.nmea")):
        assert not _has_changed(path.read_bytes())


@pytest.mark.parametrize("path", sorted(DATA.rglob("*.*")), ids=lambda path: path.name)
def test_nothing_of_our_own_recordings_is_touched(path):
    assert not _has_changed(path.read_bytes())


def test_a_message_does_not_swallow_the_rows_after_it():
    rows = (
        b"arfcn: 15 bsic: 20 rxLev: -71 ber: 0.00 mcc: 262 mnc:"
        b" 01\r\n  15  20  63  262  01  4711  0310 12345\r\n"
    )
    data = b'+CMT: "+4917698765432",,"26/11/21,12:00:00+04"\r\nTreffpunkt\r\n' + rows
    assert redact(data).endswith(rows)


def test_memory_is_bounded_in_an_endless_line():
    for endless in (b"71234560", b"abcdefgh", b'+CUSD: 1,"', b"+CMT: ,24\r"):
        redactor = Redactor()
        output = b"".join(redactor.feed(endless * 12 + b"1234567890123456") for _ in range(200))
        n_fed = len(endless * 12 + b"1234567890123456") * 200
        assert n_fed - 4096 <= len(output) <= n_fed
        assert b"1234567890123456" not in output
