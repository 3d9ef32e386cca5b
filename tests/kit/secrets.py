"""Personal numbers and messages in the forms in which devices print them, and a search for them."""

import re
from collections.abc import Iterator

IMEI, IMSI, SIM = "358917264935716", "262017654321098", "8949029876543210987"
ABROAD, AT_HOME, SERVICE = "4917698765432", "017698765432", "0612345678"
WORDS = ("Treffpunkt", "Bahnhof", "Miller")
PIN = "2468"
SECRETS = (IMEI, IMSI, SIM, ABROAD, AT_HOME, SERVICE)


def _ucs2(text: str) -> str:
    return text.encode("utf-16-be").hex().upper()


def _swap_nibbles(digits: str) -> str:
    """Semi-octets, as in a PDU and on a SIM."""
    digits += "F" * (len(digits) % 2)
    return "".join(digits[i + 1] + digits[i] for i in range(0, len(digits), 2))


_PDU = f"0791{_swap_nibbles(ABROAD)}F040D91{_swap_nibbles(ABROAD)}000062117121000080" + _ucs2(
    WORDS[0]
)

FORMS: tuple[str, ...] = (
    f'+CLIP: "+{ABROAD}",145,"",0,"{WORDS[2]}",0',
    f'+CLIP: "{AT_HOME}",129',
    f'+CLIP: "{SERVICE}",161,,,"",0',
    f'+CLIP:"+{ABROAD}",145',
    f'^CLIP: "{AT_HOME}",129',
    f'+CCWA: "{AT_HOME}",129,1',
    f'+CNUM: "{WORDS[2]}","{AT_HOME}",129,7,4',
    f'+CNUM: "","+{ABROAD}",145',
    f'+COLP: "{AT_HOME}",129',
    f'+CLCC: 1,1,4,0,0,"{AT_HOME}",129,"{WORDS[2]}"',
    f"^DSCI: 1,1,4,0,{AT_HOME},129",
    f'+CSCA: "+{ABROAD}",145',
    f'+CMT: "+{ABROAD}","","26/11/21,12:00:00+04"\r\n{WORDS[0]} {WORDS[1]} {PIN}',
    (
        f'+CMT: "{AT_HOME}","{WORDS[2]}","26/11/21,12:00:00+04",129,4,0,0,"+{ABROAD}",145,22'
        f"\r\n{WORDS[0]}\n{AT_HOME}\r\n"
    ),
    (
        f'+CMT: "+{ABROAD}",,"26/11/21,12:00:00+04"\r\n'
        f"{WORDS[0]}\r\n{WORDS[1]} {AT_HOME[:4]} {AT_HOME[4:]}\r\n"
    ),
    f'+CMT: "{_ucs2("+" + ABROAD)}",,"26/11/21,12:00:00+04"\r\n{_ucs2(WORDS[0] + AT_HOME)}',
    f"+CMT: ,44\r\n{_PDU}",
    f'+CMT: "{WORDS[2]}",44\r\n{_PDU}',
    f"+CDS: 25\r\n0006{_PDU}",
    f'+CDS: 6,1,"+{ABROAD}",145,"26/11/21,12:00:00+04","26/11/21,12:00:01+04",0',
    (
        f'+CMGR: "REC UNREAD","+{ABROAD}",,"26/11/21,12:00:00+04"\r\n'
        f"{WORDS[0]}\r\n\r\n{WORDS[1]} {AT_HOME}\r\n"
    ),
    f"+CMGR: 0,,44\r\n{_PDU}",
    (
        f'+CMGL: 1,"REC READ","{AT_HOME}",,"26/11/21,12:00:00+04"\r\n{WORDS[0]}\r\n'
        f'+CMGL: 2,"REC READ","{AT_HOME}",,"26/11/21,12:00:00+04"\r\n{WORDS[1]}'
    ),
    f'+CUSD: 0,"{WORDS[0]} {AT_HOME}",15',
    f'+CUSD: 0,"{WORDS[0]}:\r\n{AT_HOME}\r\n{WORDS[1]}",15',
    f'+CUSD: 0,"{_ucs2(AT_HOME)}",72',
    f'+CPBR: 1,"{AT_HOME}",129,"{WORDS[2]}"',
    f'+CPBR: 2,"+{ABROAD}",145,"{_ucs2(WORDS[2])}"',
    f'+CPBF: 2,"{SERVICE}",129,"{WORDS[2]}"',
    f'+CCFC: 1,1,"+{ABROAD}",145',
    f'+CRSM: 144,0,"{_swap_nibbles(SIM)}"',
    f"+CIMI: {IMSI}",
    f"{IMSI}",
    f"{IMSI[:3]} {IMSI[3:5]} {IMSI[5:]}",
    f"IMSI: {IMSI[:5]} {IMSI[5:10]} {IMSI[10:]}",
    f'+CGSN: "{IMEI}"',
    f"{IMEI}",
    f"IMEI: {IMEI[:2]} {IMEI[2:8]} {IMEI[8:14]} {IMEI[14]}",
    f"{IMEI[:2]}-{IMEI[2:8]}-{IMEI[8:14]}-{IMEI[14]}",
    f"{IMEI[:6]}/{IMEI[6:8]}/{IMEI[8:14]}/{IMEI[14]}",
    f"{IMEI[:8]}-{IMEI[8:14]}-{IMEI[14]}",
    f"{IMEI[:8]} {IMEI[8:]}",
    f"{IMEI[:3]}-{IMEI[3:6]}-{IMEI[6:9]}-{IMEI[9:12]}-{IMEI[12:]}",
    f"{IMSI[:5]} {IMSI[5:]}",
    f"^SMGR: 0,,44\r\n{_PDU}",
    f'*ECAV: 1,6,1,,,"{AT_HOME}",129',
    f'+XURC: "{_ucs2("+" + ABROAD)}",145',
    f"Own Number 1: {SERVICE}",
    f"IMEI SV: {IMEI[:14]}  78",
    f"Serial Number: {IMEI[:14]}",
    f"{SIM}",
    f"+CCID: {SIM}F",
    f"+ICCID: {SIM[:4]} {SIM[4:8]} {SIM[8:12]} {SIM[12:16]} {SIM[16:]}",
    f"{SIM[:4]} {SIM[4:8]} {SIM[8:12]} {SIM[12:16]} {SIM[16:]}",
    f"{SIM[:4]}-{SIM[4:8]}-{SIM[8:12]}-{SIM[12:16]}-{SIM[16:]}",
    f"^SCID: {SIM}",
    f"89490A{SIM[6:]}",
    f"+{ABROAD[:2]} {ABROAD[2:5]} {ABROAD[5:]}",
    f"+{ABROAD[:2]}-{ABROAD[2:5]}-{ABROAD[5:9]}-{ABROAD[9:]}",
    f"+{ABROAD[:2]} ({ABROAD[2:5]}) {ABROAD[5:8]} {ABROAD[8:]}",
    f"00{ABROAD}",
    f"{AT_HOME}",
    f"{AT_HOME[:4]}-{AT_HOME[4:8]}-{AT_HOME[8:]}",
    f"({AT_HOME[:4]})/{AT_HOME[4:]}",
    f'+XNEW: "{AT_HOME}",129',
    f'+XNEW: 7,"{SERVICE}",129',
    f"MSISDN={SERVICE}",
    f'AT+CMGS="{AT_HOME}"',
    f'AT+CPIN="{PIN}"',
    f"ATD{AT_HOME};",
    f'\xff\xfe\x00+CLIP: "{AT_HOME[:9]}",129',
    f'+CENG: 1,"0128,15,30+CLIP: "{AT_HOME}",129',
    f"number ({AT_HOME[:4]}) {AT_HOME[4:7]}-{AT_HOME[7:]}",
    f"number {AT_HOME[:4]}.{AT_HOME[4:7]}.{AT_HOME[7:]}",
)

_BETWEEN = re.compile(rb"[ ./()\"-]")
_PIN = re.compile(rb"(?<![0-9A-Fa-f.])" + PIN.encode() + rb"(?![0-9A-Fa-f.])")
"""By itself: four digits are in many a time, coordinate or digest."""


def leaked_secrets(data: bytes) -> list[str]:
    """Secrets of which seven digits in a row, the PIN, or a word are left in any form."""
    plain = _BETWEEN.sub(b"", data)
    leaks = [piece for piece in _pieces() if piece.encode() in data or piece.encode() in plain]
    return [*leaks, PIN] if _PIN.search(data) else leaks


def _pieces() -> Iterator[str]:
    for secret in SECRETS:
        for i in range(len(secret) - 6):
            yield from (secret[i : i + 7], _ucs2(secret[i : i + 7]))
        swapped = _swap_nibbles(secret)
        yield from (swapped[i : i + 8] for i in range(0, len(swapped) - 7, 2))
    for word in WORDS:
        yield from (word, _ucs2(word))
