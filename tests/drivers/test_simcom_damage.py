"""Damaged replies of SIM7000 and SIM7600: nothing is raised, and no identity is read that is not printed."""

import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.sim7000 import Sim7000
from logger.drivers.sim7600 import Sim7600

SAMPLES = {
    "ceng_lte": [
        "+CENG: 1,1,2,LTE CAT-M1",
        '+CENG: 0,"1550,339,-73,-47,-12,17,102,303617,284,05,255"',
        '+CENG: 1,"1550,414,-88,-51,-20,17"',
    ],
    "ceng_gsm": [
        "+CENG: 1,1,6,GSM",
        '+CENG: 0,"0665,35,02,4b2c,404,95,c1c0"',
        '+CENG: 1,"0662,31,08,48aa,404,95,c1c0"',
    ],
    "cpsi": [
        "+CPSI: GSM,Online,502-12,0x1054,62168,512 DCS 1800,-71,0,32-30",
        "+CPSI: WCDMA,Online,505-01,0x0152,14302219,WCDMA 850,214,4436,0,12.5,83,23,36,500",
        "+CPSI: LTE,Online,310-260,0x2D18,50896642,236,EUTRAN-BAND4,2300,5,5,-125,-987,-663,10",
        "+CPSI: NR5G_SA,Online,460-01,0x6F4700,29869309958,95,NR5G_BAND78,627264,-800,-110,14",
        "+CPSI: NO SERVICE,Online",
    ],
    "ccinfo": [
        "+CCINFO:[SCELL],ARFCN:34,MCC:240,MNC:24,LAC:10001,ID:31,BSIC:18,RXLev:-78dbm,C1:33,C2:33,TA:0,TXPWR:0",
        "+CCINFO:[NCell1],UARFCN:4436,PSC:230,SSC:0,RSCP:97,ECIO:15.5,RXLev:-97dbm",
        "+CCINFO:[SCELL],UARFCN:4436,MCC:505,MNC:01,LAC:338,ID:14302219,PSC:214,SSC:0,RSCP:88,ECIO:8.0,RXLev:-88dbm",
    ],
    "cmgrmi": [
        "+CMGRMI: Serving_Cell,1725,250,02,3832,2,22060,3,3,3,19,58,-107,-890,-625,0",
        "+CMGRMI: LTE_Intra,1,1725,58,1",
        "+CMGRMI: LTE_Intra_Cell1,77,-107,-890,-625,0",
        "+CMGRMI: LTE_Inter,1,Freq1,38100,2,0,0,0",
        "+CMGRMI: LTE_InterFreq1_Cell1,455,-120,-991,-781,0",
    ],
    "gnss": [
        "+CGNSINF: 1,1,20150327014838.000,31.221783,121.354528,114.600,0.28,0.0,1,,1.9,2.2,1.0,,8,4,,,42,,",
        "+CGPSINFO: 4429.967842,N,01124.141582,E,250325,160319.0,57.7,0.0,",
    ],
}
MODEMS = [Sim7000(), Sim7600()]
MUTATIONS = 700  # of each sample


def who(reading):
    return reading.mcc, reading.mnc, reading.lac, reading.tac, reading.cid


def cells(lines):
    return [row for modem in MODEMS for row in modem.read(lines) if isinstance(row, CellReading)]


def assert_printed(readings, text):
    tokens = set(re.split(r"[^0-9A-Za-z]", text))
    numbers = {int(t) for t in tokens if re.fullmatch("[0-9]{1,12}", t)}
    numbers |= {int(t, 16) for t in tokens if re.fullmatch("(0[xX])?[0-9A-Fa-f]{1,9}", t)}
    for reading in readings:
        assert {reading.mcc, reading.mnc} <= tokens | {None}, text
        assert {reading.lac, reading.tac, reading.cid} <= numbers | {None}, text
        assert reading.mcc is not None or who(reading) == (None,) * 5, text


def mutated(text, chance):
    """Text with one to four bits turned, characters lost or inserted, or pieces of it moved."""
    damaged = list(text)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(damaged))
        kind = chance.randrange(5)
        if kind == 0:
            damaged[at] = chr(ord(damaged[at]) % 256 ^ 1 << chance.randrange(8))
        elif kind == 1:
            del damaged[at : at + chance.randint(1, 20)]
        elif kind == 2:
            damaged.insert(at, chance.choice('0123456789abcdefxX,:"-+. \n\r\x00\xff²'))
        elif kind == 3:
            start = chance.randrange(len(damaged))
            damaged[at:at] = damaged[start : start + chance.randint(1, 40)]
        else:
            damaged = [c for i, c in enumerate(damaged) if c != "\n" or i != at] + damaged[at:]
        damaged = damaged or ["\n"]
    return "".join(damaged)


@pytest.mark.parametrize("name", SAMPLES)
def test_mutations(name):
    chance = random.Random(name)
    text = "\n".join(SAMPLES[name])
    for _ in range(MUTATIONS):
        damaged = mutated(text, chance)
        assert_printed(cells(damaged.split("\n")), damaged)


@pytest.mark.parametrize("name", SAMPLES)
def test_cut_reply_has_no_other_cell(name):
    lines = SAMPLES[name]
    known = {who(reading) for reading in cells(lines)} | {(None,) * 5}
    text = "\n".join(lines)
    for end in range(len(text)):
        assert {who(reading) for reading in cells(text[:end].split("\n"))} <= known, text[:end]


@pytest.mark.parametrize("name", SAMPLES)
def test_lost_mark_makes_no_other_cell(name):
    text = "\n".join(SAMPLES[name])
    known = {who(reading) for reading in cells(SAMPLES[name])} | {(None,) * 5}
    for at, mark in enumerate(text):
        if not mark.isalnum():  # a digit lost inside a number cannot be seen
            damaged = text[:at] + text[at + 1 :]
            assert {who(reading) for reading in cells(damaged.split("\n"))} <= known, damaged


@pytest.mark.parametrize("name", SAMPLES)
def test_added_comma_makes_no_other_cell(name):
    text = "\n".join(SAMPLES[name])
    known = {who(reading) for reading in cells(SAMPLES[name])} | {(None,) * 5}
    for at in range(len(text)):
        damaged = f"{text[:at]},{text[at:]}"
        assert {who(reading) for reading in cells(damaged.split("\n"))} <= known, damaged


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_without_damage_is_read(name):
    rows = [row for modem in MODEMS for row in modem.read(SAMPLES[name])]
    assert len(rows) >= 2


def test_recorded_replies_of_all_modems_raise_nothing(corpus):
    for path in sorted((corpus / "modem").glob("*.txt")):
        text = path.read_text("latin-1")
        cells(text.splitlines())
        cells([text])
