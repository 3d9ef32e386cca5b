from logger.core.types import CellReading
from logger.drivers.cinterion import Cinterion
from logger.drivers.reading.row_language import NoCell
from tests.kit.drivers import identity_of

MODEM = Cinterion()

# SMONC, SMOND and SMONI are rows of the corpus, the tables have values of our own in the layouts of
# firmware_notes/cinterion.md.
SMONC = "^SMONC: 232,03,3010,4EAF,32,82,38,30,30,232,03,3010,0000,36,88,26,18,18"

SMOND = (
    "^SMOND:250,01,00EA,0AE1,23,756,47,,,0,,,0,250,01,00EA,0ADE,40,1022,47,"
    "250,01,00DD,0A5E,23,783,78,250,01,00EA,0AE2,43,795,78,250,01,00EA,0AE0,26,791,78,"
    "250,01,00EA,4EA7,20,748,86,250,01,00EA,,20,669,87,1,31,99"
)


def one(*lines):
    found = MODEM.rows_in(lines)
    assert len(found) == 1
    return found[0]


def test_smonc():
    serving, neighbour = MODEM.rows_in([SMONC])
    assert serving == CellReading(
        role="serving",
        rat="GSM",
        mcc="232",
        mnc="03",
        lac=0x3010,
        cid=0x4EAF,
        arfcn=82,
        bsic=32,
        rxlev_raw=38,
        c1=30,
        c2=30,
    )
    assert (neighbour.role, identity_of(neighbour), neighbour.arfcn) == (
        "neighbour",
        ("232", "03", 0x3010, None),
        88,
    )


def test_smonc_where_cells_are_missing():
    empty = "000,000,0000,0000,00,0,0,-,-"
    assert MODEM.rows_in([f"^SMONC: {empty},{empty}"]) == (NoCell("GSM"),)
    assert [row.role for row in MODEM.rows_in([f"{SMONC},{empty},{empty}"])] == [
        "serving",
        "neighbour",
    ]
    undecoded = one("^SMONC: 000,000,0000,0000,00,88,26,-,-")
    assert (identity_of(undecoded), undecoded.arfcn, undecoded.bsic, undecoded.rxlev_raw) == (
        (None,) * 4,
        88,
        None,
        26,
    )
    assert undecoded.c1 is None


def test_smond():
    serving, *neighbours = MODEM.rows_in([SMOND])
    assert (identity_of(serving), serving.arfcn, serving.rssi_dbm, serving.ta) == (
        ("250", "01", 0xEA, 0xAE1),
        756,
        -47.0,
        1,
    )
    assert (serving.bsic, serving.more) == (None, {"bsic_raw": "23"})
    assert [cell.arfcn for cell in neighbours] == [1022, 783, 795, 791, 748, 669]
    assert identity_of(neighbours[-1]) == ("250", "01", 0xEA, None)
    assert one(SMOND[: SMOND.index(",250,01,00EA,0ADE")]).rssi_dbm == -47.0
    assert MODEM.rows_in([SMOND.replace("756,47", "756,-47")])[0] == serving


def test_smond_where_cells_are_missing():
    nobody = ",,,,,,0,,,0,,,0"
    assert MODEM.rows_in([f"^SMOND:{nobody}" + ",,,,,,,0" * 6 + ",,99,99"]) == (NoCell("GSM"),)
    assert [
        row.role
        for row in MODEM.rows_in([SMOND.replace("250,01,00EA,0AE1,23,756,47,,,0,,,0", nobody)])
    ] == ["neighbour"] * 6
