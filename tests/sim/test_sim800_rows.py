from logger.drivers.sim800 import Sim800
from logger.sim.dialects import _rxl as rxl
from logger.sim.dialects import ceng_rows as rows
from logger.sim.world import Air, ReceivedCell, Transmitter


def cell(cid, arfcn=666, bsic=8, lac=0x113):
    return Transmitter(0.0, 0.0, -30.0, 3.0, "310", "260", lac, cid, arfcn, bsic)


UNREAD = ReceivedCell(cell(0x00FD, arfcn=233, bsic=61), -87.0, is_decoded=False)
HEARD = Air.of(
    [
        ReceivedCell(cell(0xA53F, arfcn=25, bsic=25), -97.0, is_decoded=True),
        ReceivedCell(cell(0x4E72), -92.0, is_decoded=True),
        UNREAD,
    ]
)


def test_mode_1_with_cell_identities():
    assert rows(1, 1, HEARD) == [
        '+CENG: 0,"0666,21,00,310,260,08,4e72,05,05,0113,255"',
        '+CENG: 1,"0233,26,00,ffff,,,0000"',
        '+CENG: 2,"0025,16,25,a53f,310,260,0113"',
    ]


def test_mode_1_without_cell_identities():
    assert rows(1, 0, HEARD) == [
        '+CENG: 0,"0666,21,00,310,260,08,4e72,05,05,0113,255"',
        '+CENG: 1,"0233,26,00,,,0000"',
        '+CENG: 2,"0025,16,25,310,260,0113"',
    ]


def test_mode_2_prints_as_mode_1():
    assert rows(1, 1, HEARD) == rows(2, 1, HEARD)


def test_mode_3_has_all_slots():
    assert rows(3, 1, HEARD) == [
        '+CENG: 0,"310,260,0113,4e72,08,21"',
        '+CENG: 1,"310,260,0113,a53f,25,16"',
        '+CENG: 2,",,0000,0000,00,00"',
        '+CENG: 3,",,0000,0000,00,00"',
        '+CENG: 4,",,0000,0000,00,00"',
        '+CENG: 5,",,0000,0000,00,00"',
        '+CENG: 6,",,0000,0000,00,00"',
    ]


def test_mode_4_adds_the_criteria():
    assert rows(4, 1, HEARD) == [
        '+CENG: 0,"0666,21,00,310,260,08,4e72,05,05,0113,255,-92,13,13,x,x,x,x,x,x,x"',
        '+CENG: 1,"0025,16,25,a53f,310,260,0113,8,8"',
    ]
    assert rows(4, 0, HEARD)[1] == '+CENG: 1,"0025,16,25,310,260,0113,8,8"'


def test_mode_0_prints_no_cell():
    assert rows(0, 0, HEARD) == []


def test_no_row_without_a_serving_cell():
    assert rows(1, 1, Air.of([UNREAD])) == []


def test_six_neighbours_sorted_by_level():
    heard = Air.of(
        [ReceivedCell(cell(0x100 + n, arfcn=n), -100.0 + n, is_decoded=True) for n in range(9)]
    )

    assert [row[10:14] for row in rows(1, 1, heard)] == [
        "0008",
        "0007",
        "0006",
        "0005",
        "0004",
        "0003",
        "0002",
    ]


def test_level_stays_within_what_modems_print():
    levels = [
        rxl(ReceivedCell(cell(1), level_dbm, is_decoded=True))
        for level_dbm in (-120.0, -113.0, -110.0, -50.0, -20.0)
    ]

    assert levels == [0, 0, 3, 63, 64]


def test_the_driver_reads_what_was_meant():
    readings = Sim800().read(["+CENG: 1,1", *rows(1, 1, HEARD)])

    assert [(reading.role, reading.cid, reading.rssi_dbm) for reading in readings] == [
        ("serving", 0x4E72, -92.0),
        ("neighbour", None, -87.0),
        ("neighbour", 0xA53F, -97.0),
    ]
