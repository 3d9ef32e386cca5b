"""Which new name of a cell is a known one that was damaged, and which is a cell of its own."""

import pytest

from logger.core.cell_names import Identities
from logger.core.types import CellReading, Scan
from logger.drivers.reading.recognition import NumberHistory, mark_doubtful, mark_doubtful_replies
from logger.drivers.registry import FAMILIES

LTE = "+CPSI: LTE,Online,{plmn},0x{tac},{cid},{pci},EUTRAN-BAND3,{earfcn},5,5,-96,-911,-602,12"
CENG = '+CENG: {n},"{arfcn:04},21,{bsic:02},{cid},262,01,{lac}"'
CREG = '+CREG: 2,1,"{lac}","{cid}",0\n+COPS: 0,2,"26201",0'
DAMAGED = (
    {"cid": 7654331},
    {"cid": 7653421},
    {"cid": 7564321},
    {"cid": 765321},
    {"cid": 76654321},
    {"cid": 7654821},
    {"cid": 765432, "pci": 121},
    {"tac": "1583"},
    {"tac": "5138"},
    {"plmn": "262-20"},
    {"plmn": "226-02"},
    {"plmn": "266-02"},
)


def lte(cid=7654321, *, plmn="262-02", tac="1538", pci=211, earfcn=1300):
    return LTE.format(cid=cid, plmn=plmn, tac=tac, pci=pci, earfcn=earfcn)


class Session:
    """Replies of one modem, and the cells that exist by them."""

    def __init__(self, family):
        self.driver, self.known, self.identities = FAMILIES[family], NumberHistory(), Identities()

    def read(self, *lines):
        """Whether each reading of a reply is unsure."""
        rows, self.known = mark_doubtful(self.driver.read(lines), self.known)
        cells = tuple(row for row in rows if isinstance(row, CellReading))
        self.identities.add(Scan(0, cells))
        return [cell.identity_unsure for cell in cells]


@pytest.mark.parametrize("parts", DAMAGED, ids=str)
def test_a_damaged_name_is_never_believed_however_often_it_comes(parts):
    session = Session("sim7600")
    session.read(lte())
    for _ in range(30):
        for _ in range(4):
            assert session.read(lte()) == [False]
        assert session.read(lte(**parts)) == [True]
    (name,) = {
        row.cell for row in session.driver.read([lte(**parts)]) if isinstance(row, CellReading)
    }
    assert name is not None
    assert name not in session.identities
    assert "262-02-5432-7654321" in session.identities


@pytest.mark.parametrize("parts", DAMAGED, ids=str)
def test_a_damaged_name_that_comes_before_the_true_one_is_not_believed_either(parts):
    session = Session("sim7600")
    session.read(lte(31415926, pci=7))
    session.read(lte(**parts))
    for _ in range(4):
        session.read(lte())
    assert session.read(lte(**parts)) == [True]
    assert session.read(lte()) == [False]


@pytest.mark.parametrize(
    ("row", "damaged"),
    [
        ("^MONSC: LTE,460,00,10713,D975244,8,24C8", "^MONSC: LTE,460,001,0713,D975244,8,24C8"),
        ("^MONSC: LTE,460,00,38400,D975244,8,24C8", "^MONSC: LTE,460,003,8400,D975244,8,24C8"),
        ("^MONSC: NR,262,01,632448,1,4A5B6C7D8,1C2", "^MONSC: NR,262,016,32448,1,4A5B6C7D8,1C2"),
    ],
)
def test_a_digit_that_is_exchanged_with_a_comma_names_no_cell(row, damaged):
    session = Session("huawei")
    rest = ",2A4C31,-82,-11,17" if " NR," in row else ",-85,-10,-54"
    session.read(row + rest)
    for _ in range(20):
        session.read(row + rest)
        assert session.read(damaged + rest) == [True]


def test_sectors_of_a_mast_are_sure_at_once_where_their_codes_differ():
    session = Session("sim7600")
    session.read(lte(31415926, pci=7))
    for _ in range(3):
        for sector in (1, 2, 3):
            for _ in range(2):
                assert session.read(lte(7654320 + sector, pci=210 + sector)) == [False]


@pytest.mark.parametrize("cids", [(7654231, 7654321), (7654321, 7654231)], ids=["damaged", "true"])
def test_a_second_naming_that_is_not_at_once_makes_no_cell(cids):
    first, other = cids
    session = Session("sim7600")
    session.read(lte(31415926, pci=7))
    assert session.read(lte(first)) == [False]
    session.read(lte(31415926, pci=7))
    assert session.read(lte(first)) == [True]
    assert f"262-02-5432-{first}" not in session.identities
    session.read(lte(31415926, pci=7))
    session.read(lte(other))
    assert session.read(lte(first)) == [True]


def test_a_third_naming_makes_a_cell_whose_first_one_was_doubtful():
    session = Session("sim7600")
    unsure = []
    for _ in range(3):
        unsure += session.read(lte())
        session.read(lte(31415926, pci=7))
    assert unsure == [True, False, False]
    assert "262-02-5432-7654321" in session.identities


@pytest.mark.parametrize("rest", [1, 5, 40])
def test_a_third_naming_makes_a_cell_however_late(rest):
    session = Session("sim7600")
    session.read(lte(31415926, pci=7))
    unsure = []
    for _ in range(4):
        unsure += session.read(lte())
        for _ in range(rest):
            session.read(lte(31415926, pci=7))
    assert unsure == [False, True, False, False]
    assert "262-02-5432-7654321" in session.identities


def test_two_pairs_of_one_damage_make_no_cell_but_three_in_succession_do():
    session = Session("sim7600")
    for _ in range(20):
        session.read(lte())
    damaged = lte(plmn="226-02")
    for pair in ([True, False], [True, True], [True, True]):
        assert [session.read(damaged)[0] for _ in range(2)] == pair
        assert session.read(lte()) == [False]
    assert [session.read(damaged)[0] for _ in range(3)] == [True, True, False]


def test_a_damaged_digit_between_the_zeros_of_a_padded_number_is_damage():
    session = Session("sim800")
    for cid in ("000f", "000f", "040f", "000f", "040f"):
        row = CENG.format(n=1, arfcn=30, bsic=20, cid=cid, lac="3c4d")
        assert session.read(row) == [cid == "040f"]


def test_a_cell_on_many_channels_is_that_of_each():
    session = Session("sim7600")
    for _ in range(6):
        for channel in range(6):
            session.read(lte(earfcn=1300 + channel, pci=211 + channel))
    for _ in range(3):
        assert session.read(lte(7654231, earfcn=1303, pci=214)) == [True]
        session.read(lte())


def test_a_network_code_of_one_digit_that_takes_one_of_the_next_row_is_damage():
    session = Session("ublox")
    rest = "0,5265,11,d5bd,00,36,-1,30,30,1,1"
    for _ in range(3):
        assert session.read("+UCGED: 2", "2,222,1", f"1009,{rest}") == [False]
    for _ in range(3):
        assert session.read("+UCGED: 2", "2,222,11", f"009,{rest}") == [True]
        session.read("+UCGED: 2", "2,222,1", f"1009,{rest}")


def test_neighbours_whose_names_differ_in_one_digit_are_sure_at_once():
    rows = [
        CENG.format(n=n, arfcn=30 + n, bsic=20 + n, cid=f"5e6{n}", lac="3c4d") for n in (1, 2, 3, 4)
    ]
    session = Session("sim800")
    assert session.read(*rows) == [False] * 4
    assert session.read(*rows) == [False] * 4


@pytest.mark.parametrize("parts", [*DAMAGED[:3], DAMAGED[5], *DAMAGED[7:]], ids=str)
def test_a_station_that_copies_a_cell_but_one_digit_waits_for_one_scan(parts):
    session = Session("sim7600")
    for _ in range(50):
        session.read(lte())
    copied = [session.read(lte(**parts)) for _ in range(4)]
    assert copied == [[True], [False], [False], [False]]
    assert session.read(lte()) == [False]
    assert session.read(lte(**parts)) == [False]  # two replies have named it for certain


def test_a_station_that_copies_a_cell_on_another_channel_waits_for_nothing():
    session = Session("sim7600")
    for _ in range(50):
        session.read(lte())
    assert session.read(lte(7654331, earfcn=2850)) == [False]
    assert session.read(lte(7654331, earfcn=2850)) == [False]


def test_without_channel_and_code_a_sector_waits_for_nothing_but_must_stay():
    session = Session("generic")
    rows = {sector: CREG.format(lac="4E5F", cid=f"2D3C4B{sector}") for sector in (1, 2, 3)}

    def unsure(sector):
        rows_read, session.known = mark_doubtful(
            session.driver.read(rows[sector].split("\n")), session.known
        )
        return rows_read[0].identity_unsure

    assert [unsure(1) for _ in range(20)] == [False] * 20
    assert [unsure(2) for _ in range(3)] == [False] * 3
    assert [unsure(sector) for sector in (3, 1, 3, 1, 3)] == [False, False, True, False, True]


def test_a_channel_that_changes_before_the_name_does_not_make_it_that_of_the_cell():
    session = Session("sim7600")
    for _ in range(20):
        session.read(lte())
    session.read(lte(earfcn=2850, pci=33))  # the channel of the next cell beside the old name
    assert session.read(lte(7654322, earfcn=2850, pci=33)) == [False]


def test_a_full_scan_between_polls_leaves_them_successive():
    session = Session("sim800")
    scan = 'Operator:"Example",MCC:262,MNC:02,Rxlev:38,Cellid:1A2B,Arfcn:99,Lac:2D3E,Bsic:25'
    serving, copied = (
        CENG.format(n=1, arfcn=30, bsic=20, cid=cid, lac="3c4d") for cid in ("5e6f", "5e7f")
    )
    for _ in range(10):
        session.read(serving)
    assert session.read(copied) == [True]
    assert session.read(scan) == [False]
    assert session.read(copied) == [False]


def test_replies_of_a_transcript_are_compared_with_later_ones_too():
    driver = FAMILIES["sim7600"]
    cids = (7654331, *[7654321] * 3, 7654331, 7654321)
    found, _ = mark_doubtful_replies([driver.read([lte(cid)]) for cid in cids], NumberHistory())
    assert [row.identity_unsure for rows in found for row in rows] == [
        cid == 7654331 for cid in cids
    ]


def test_what_is_remembered_is_bounded(monkeypatch):
    monkeypatch.setattr("logger.drivers.reading.recognition._MOST_CELLS", 50)
    session = Session("sim7600")
    for number in range(60):
        session.read(lte(10_000_000 + 7919 * number, tac=f"{1 + number:04X}", pci=number))
    named = session.known.cells.cells
    assert len(named) == 50
    assert {who.area for who in named} == set(range(11, 61))
