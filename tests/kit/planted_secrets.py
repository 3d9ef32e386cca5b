"""Lines of modems and receivers with secrets in them, in forms of many makers.

In a form, what stands between « and » is secret; `{imei}` and its like stand for numbers that are
drawn anew for each line. `Planted` knows each secret byte, so that a test can look at what became
of it, wherever the line was planted and whatever the line has done to it.
"""

import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

WORDS = ("Treffpunkt", "Bahnhof", "Miller", "geheim", "Hunter")

FORMS: tuple[str, ...] = (
    # identities of the device and the card
    "«{imei}»",
    "«{imei14}»",
    "«{imsi}»",
    "«{sim}»",
    '+CGSN: "«{imei}»"',
    "+GSN: «{imei}»",
    "+CGSN: «{imei}»",
    "#CGSN: «{imei}»",
    "+GTSN: «{imei14}»",
    "+CFSN: «{serial}»",
    "+GTSN: «{serial}»",
    "+SIMEI: «{imei}»",
    "+EGMR: «{imei}»",
    '+EGMR: 1,7,"«{imei}»"',
    "IMEI: «{imei}»",
    "imei: «{imei}»",
    "IMEI SV: «{imei14}»  «78»",
    "IMEI: «{imei:2-6-6-1}»",
    "IMEI: «{imei:2 6 6 1}»",
    "«{imei:2 6 6 1}»",
    "«{imei:3 3 3 3 3}»",
    "«{imei:5 5 5}»",
    "«{imei:2 2 2 2 2 2 2 1}»",
    "«{imei:2.6.6.1}»",
    "«{imei:8 7}»",
    "MEID: «{imei14}»",
    "ESN: «{serial}»",
    "FSN: «LF{imei14}»",
    "SN: «{serial}»",
    "S/N «{serial}»",
    "Serial Number «{serial}»",
    "SVN: «{national}»",
    "+CIMI: «{imsi}»",
    "+cimi: «{imsi}»",
    "*CIMI: «{imsi}»",
    "#CIMI: «{imsi}»",
    "$QCCIMI: «{imsi}»",
    "$QCIMSI:«{imsi}»",
    "%IMSI: «{imsi}»",
    '#RFSTS: "310 260",66786,-101,-68,-13,2D18,255,,640,1,0,3089F02,"«{imsi}»","T",3,66',
    '^SIMS: "«{imsi}»"',
    "IMSI «{imsi:5 5 5}»",
    "«{imsi:3 2 10}»",
    "+CCID: «{sim}»",
    "+ccid: «{sim}»F",
    "+QCCID: «{sim}»F",
    "+ICCID: «{sim}»",
    "^ICCID: «{sim}»",
    "%CCID: «{sim}»",
    "#CCID: «{sim}»",
    "!ICCID: «{sim}»",
    "^SCID: «{sim}»",
    "^CARDID: «{sim}»",
    "^CARDMODE: «{sim}»",
    "ICCID: «{sim:4 4 4 4 3}»",
    "«{sim:4 4 4 4 3}»",
    "«89490A{imei14}»",
    '+CRSM: 144,0,"«{imsi_swapped}»"',
    "+CRSM: 144,0,«{sim_swapped}»",
    '+CSIM: 22,"«{imsi_swapped}»9000"',
    "+CGLA: 36,«{imsi_swapped}»",
    "^EUI: «{mac}»",
    "EID: «{sim}{imei}»",
    "+QEUI: «00124B0001A2B3C4»",
    # telephone numbers
    '+CNUM: "«Miller»","«{national}»",129,7,4',
    '+CNUM: ,"+«{abroad}»",145',
    '+cnum: "","«{national}»",129',
    '+CLIP: "«{national}»",129,"",0,"«Miller»",0',
    '+clip: "«{national}»",129',
    "+CLIP: «{national}»,129",
    '^CLIP: "«{home}»",129',
    '+CRING: VOICE,"«{national}»"',
    '+CCWA: "«{national}»",129,1,"«Miller»"',
    '+CCWV: "«{national}»"',
    '+COLP: "«{national}»",129',
    '+CDIP: "«{national}»",129',
    '+CNAP: "«Miller»",0',
    '+CLCC: 1,1,4,0,0,"«{national}»",129,"«Miller»"',
    '^CLCC: 1,1,4,0,0,"«{national}»",129',
    "^DSCI: 1,1,4,0,«{national}»,129",
    "^ORIG: 1,0\r\n^CONF: «{national}»",
    '*ECAV: 1,6,1,,,"«{national}»",129',
    '^SLCC: 1,1,4,0,0,0,"«{national}»",129,"«Miller»"',
    '#ECAM: 0,1,1,,,"«{national}»",129',
    "MISSED_CALL: «10:12AM {national}»",
    "MISSED_CALL: «{national}»",
    "NMBR = «{national}»",
    "NAME = «Miller»",
    "NMBR=«{national}»",
    "DATE = «1127»",
    "DDN_NMBR = «{national}»",
    "MESG = «{hex}»",
    "«{national}»",
    "«{national:3 3 4}»",
    "«{national:3-3-4}»",
    "«{national:3.3.4}»",
    "(«{national:3) 3-4}»",
    "«{national:2 2 2 2 2}»",
    "«{national:3\x003\x004}»",
    "«{home}»",
    "«{home:4 8}»",
    "+«{abroad:2 3 4 4}»",
    "00«{abroad}»",
    "tel:«{national}»",
    "Own Number «{national}»",
    'subscriber "«{national}»" «Miller»',
    "ATD«{national}»;",
    "atdt«{national}»;",
    'ATD>"«Miller»";',
    '+CSCA: "+«{abroad}»",145',
    '#CSCA: "«{national}»"',
    '+CCFC: 1,1,"«{national}»",129',
    '+CCFCU: 1,1,2,129,"«{national}»"',
    '+CPBR: 1,"«{national}»",129,"«Miller»"',
    '+cpbr: 1,"«{national}»",129,"«Miller»"',
    '^CPBR: 1,"«{national}»",129,"«Miller»"',
    '+CPBF: 2,"«{national}»",129,"«Miller»"',
    '*EPBR: 1,"«{national}»",129,"«Miller»"',
    '^SPBG: 1,"«{national}»",129,"«Miller»"',
    '^SPBC: "«Miller»"',
    '+SPBR: 1,"«{national}»"',
    '#MBN: "«{national}»",129,"«Miller»"',
    '+CSVM: 1,"«{national}»",129',
    '+CPOL: 1,2,"«{imsi}»"',
    "+CRSL: «{national}»",
    # messages
    '+CMT: "«{national}»",,"«26/11/21,12:00:00+04»"\r\n«Treffpunkt Bahnhof {pin}»',
    '+CMT: "«{national}»",,"«26/11/21,12:00:00+04»"\r\nOK\r\n«Treffpunkt {pin} Bahnhof»',
    '+CMT: "«{national}»",,""\r\nERROR\r\n«Treffpunkt {pin} Bahnhof»\r\n«Miller {national}»',
    '+CMT: "«{national}»",,""\r\nRDY\r\n«Treffpunkt {national}»',
    '+cmt: "«{national}»",,""\r\n«treffpunkt {national}»',
    '+CMT: "«{ucs2}»",,""\r\n«{ucs2}»',
    "+CMT: ,44\r\n«{pdu}»",
    '^HCMT: "«{national}»",2026,11,21,12,0,0,1,0\r\n«Treffpunkt {pin}»',
    '^HCMGR: "«{national}»",2026,11,21,12\r\n«Treffpunkt {pin}»\r\n«Bahnhof»',
    '^HCMGL: 1,"«{national}»"\r\n«Treffpunkt {pin}»',
    "+CDS: 25\r\n«0006{pdu}»",
    '+CDS: 6,1,"«{national}»",129,"«26/11/21,12:00:00+04»"',
    "+CBM: 1,2,3,1,1\r\n«Treffpunkt {pin}»",
    '+CMGR: "REC READ","«{national}»",,""\r\n«Treffpunkt»\r\n\r\n«Bahnhof {pin}»\r\n\r\nOK',
    "+CMGR: 0,,44\r\n«{pdu}»\r\nOK",
    '+CMGL: 1,"REC READ","«{national}»",,""\r\n«Treffpunkt»\r\n+CMGL: 2,"R","«{home}»"\r\n«{pin}»',
    '+QCMGR: "REC READ","«{national}»"\r\n«Treffpunkt»',
    "^SMGR: 0,,44\r\n«{pdu}»",
    'AT+CMGS="«{national}»"\r> «Treffpunkt Bahnhof {pin}»\x1a\r\n+CMGS: «12»',
    "at+cmgs=«{national}»\r\n> «Treffpunkt Bahnhof»\r\n«zweite Zeile {pin}»\x1a",
    'AT+CMGW="«{national}»"',
    '+CUSD: 0,"«Treffpunkt {national}»",15',
    '+CUSD: 0,"«Treffpunkt:»\r\n«{national}»\r\n«Bahnhof»",15',
    '+CUSD: 0,"«{ucs2}»",72',
    "#STN: 33,«81030121800282028183»\r\n«{hex}»",
    '#STN: 254,"«Treffpunkt {national}»"',
    '+STGI: 0,"«Miller {national}»"',
    '+CUSATP: "«{hex}»"',
    '+QSTK: 33,"«Treffpunkt»"',
    '+MMGR: "«{national}»","«Treffpunkt»"',
    '+QEMAILFETCH: "«Miller»","«Treffpunkt»"',
    # accounts, keys and addresses
    '+QICSGP: 1,1,"apn","«Hunter»","«geheim{pin}»",1',
    'AT+QICSGP=1,1,"apn","«Hunter»","«geheim{pin}»",1',
    'AT+CGAUTH=1,1,"«Hunter»","«geheim{pin}»"',
    '+CGAUTH: 1,1,"«Hunter»","«geheim{pin}»"',
    '+UAUTHREQ: 1,1,"«Hunter»","«geheim»"',
    'AT^AUTHDATA=1,1,"«Hunter»","«geheim»"',
    '^AUTHDATA: 1,1,"«Hunter»","«geheim»"',
    '$QCPDPP: 1,1,"«Hunter»","«geheim»"',
    '+CGDCONT: 1,"IP","«hunter.geheim»","«10.27.31.99»"',
    '+CGPADDR: 1,"«10.27.31.99»"',
    "+CGPADDR: 1,«32.1.13.184.172.16.254.1.0.0.0.0.0.0.9.1»",
    '+CGCONTRDP: 1,5,"«hunter.geheim»","«10.27.31.99.255.255.255.0»"',
    "+IPADDR: «10.27.31.99»",
    "^DHCP: «631F1B0A»,00FFFFFF,«011F1B0A»",
    "«10.27.31.99»",
    "«2001:db8:ac10:fe01::9»",
    '+CWLAP: (3,"«Miller»",-63,"«{mac}»",6)',
    '+QWIFISCAN: (-,-,-63,"«{mac}»",6)',
    "«{mac}»",
    'AT+CPIN="«{pin}»"',
    "AT+CPIN=«{pin}»",
    "AT^CPIN=«{pin}»",
    'at^cpin="«{pin}»"',
    'AT+CLCK="SC",1,"«{pin}»"',
    'AT+CPWD="SC","«{pin}»","«{pin}»"',
    'AT+CSQ;+CPIN="«{pin}»"',
    "AT#QSS=«{pin}»",
    'AT+UPSV="«geheim»"',
    "+CPIN: SIM PUK,«{national}»",
    '+QLTS: "«2026/11/21,12:00:00+04,0»"',
    "+CTZV: «+04,26/11/21,12:00:00»",
    '*PSUTTZ: «2026,11,21,12,0,0»,"+4",1',
)
"""Of manuals and logs: 27.007, 27.005, SIMCom, Quectel, Huawei, Cinterion, Telit, u-blox, Sierra,
Fibocom, Ericsson, Qualcomm, voice modems.
"""

IN_ROWS: tuple[str, ...] = (
    '+CENG: 1,"0128,15,30+CLIP: "«{national}»",129,"«Miller»"',
    '+CSQ: 19,99+CMT: "«{national}»",,"«26/11/21»"',
    '+CREG: 1,"«{national}»"',
    "+CSQ: «{imei}»",
    '+COPS: 0,0,"«{national}»"',
    '+COPS: 0,0,"«{national:3 3 4}»"',
    '+CENG: 6,"1698,06,62,4f2f,310,260,0113"«NAME = Miller {national}»',
    '+CENG: 6,"1698,06,62,4f2f,310,260,0113"«Treffpunkt am Bahnhof {national}»',
    "+CPSI: GSM,Online,310-260,0x113,1,2 DCS 1800,-71,0,32-3«{national}»",
    "+CME ERROR: «{national}»",
)
"""Rows that a driver reads, in which something else stands, as after a lost line end."""

_FIELD = re.compile(r"\{(\w+)(?::([^}]*))?\}")


@dataclass
class Planted:
    """Bytes, and which of them are secret: 0 for none, else the number of the secret."""

    data: bytes = b""
    marks: tuple[int, ...] = ()

    def __add__(self, other: Self) -> "Planted":
        first = max(self.marks, default=0)
        marks = tuple(mark and mark + first for mark in other.marks)
        return Planted(self.data + other.data, self.marks + marks)

    def secrets(self) -> Iterator[bytes]:
        """The secrets themselves, of those that cannot be there by chance."""
        for n in range(1, max(self.marks, default=0) + 1):
            text = bytes(b for b, mark in zip(self.data, self.marks, strict=True) if mark == n)
            if len(text) > 6 or text.decode("latin-1") in WORDS:
                yield text

    def damaged(self, rng: random.Random, n: int) -> "Planted":
        """The same after noise has come in between, has replaced bytes, or bytes were lost."""
        data, marks = bytearray(self.data), list(self.marks)
        for _ in range(n):
            at = rng.randrange(len(data))
            way = rng.randrange(3)
            if way == 0:
                data.insert(at, rng.randrange(256))
                marks.insert(at, 0)
            elif way == 1:
                data[at], marks[at] = rng.randrange(256), 0
            else:
                del data[at], marks[at]
        return Planted(bytes(data), tuple(marks))

    def readable(self, out: bytes, most: int = 0) -> list[bytes]:
        """Secrets of which more than `most` letters and digits are left in the redacted bytes."""
        assert len(out) == len(self.data)
        left: dict[int, bytes] = {}
        for before, mark, after in zip(self.data, self.marks, out, strict=True):
            if mark and after == before and chr(after).isalnum() and after not in b"xX\xff":
                left[mark] = left.get(mark, b"") + bytes((after,))
        return [text for text in left.values() if len(text) > most]


def plain(data: bytes) -> Planted:
    """Bytes without a secret."""
    return Planted(data, (0,) * len(data))


def plant(form: str, rng: random.Random) -> Planted:
    """A line of the form with numbers of its own."""
    text = _FIELD.sub(lambda field: _grouped(_NUMBERS[field[1]](rng), field[2]), form)
    data, marks, n, is_secret = bytearray(), [], 0, False
    for char in text:
        if char in "«»":
            is_secret = char == "«"
            n += is_secret
        else:
            data += char.encode("latin-1")
            marks.append(n if is_secret else 0)
    return Planted(bytes(data), tuple(marks))


def _digits(rng: random.Random, n: int, first: str = "123456789") -> str:
    return rng.choice(first) + "".join(rng.choices("0123456789", k=n - 1))


_NUMBERS: dict[str, Callable[[random.Random], str]] = {
    "imei": lambda rng: "35" + _digits(rng, 13),
    "imei14": lambda rng: "35" + _digits(rng, 12),
    "imsi": lambda rng: "26201" + _digits(rng, 10),
    "sim": lambda rng: "8949" + _digits(rng, 15),
    "national": lambda rng: _digits(rng, 3, "23456789") + _digits(rng, 7, "23456789"),
    "home": lambda rng: "0176" + _digits(rng, 8),
    "abroad": lambda rng: "49176" + _digits(rng, 8),
    "pin": lambda rng: _digits(rng, 4, "3456789"),
    "serial": lambda rng: rng.choice("KLMNP") + rng.choice("HJKLM") + _digits(rng, 9),
    "mac": lambda rng: ":".join(f"{rng.randrange(16, 256):02x}" for _ in range(6)),
    "hex": lambda rng: rng.randbytes(12).hex().upper(),
    "ucs2": lambda rng: _digits(rng, 10).encode("utf-16-be").hex().upper(),
    "imsi_swapped": lambda rng: "0829" + _swapped("26201" + _digits(rng, 10)),
    "sim_swapped": lambda rng: _swapped("8949" + _digits(rng, 15)),
    "pdu": lambda rng: (
        f"0791{_swapped('49176' + _digits(rng, 8))}040D91{rng.randbytes(20).hex().upper()}"
    ),
}


def _swapped(digits: str) -> str:
    """Semi-octets, as in a PDU and on a SIM."""
    digits += "F" * (len(digits) % 2)
    return "".join(digits[i + 1] + digits[i] for i in range(0, len(digits), 2))


def _grouped(digits: str, groups: str | None) -> str:
    """The digits in groups: `3 3 4` gives `415 555 1234`."""
    if groups is None:
        return digits
    out = ""
    for part in re.findall(r"\d+|\D+", groups):
        if part.isdecimal():
            out, digits = out + digits[: int(part)], digits[int(part) :]
        else:
            out += part
    return out + digits
