from logger.drivers.reading.row_language import Registration
from logger.drivers.registry import FAMILIES
from logger.drivers.transcript import replies_of, rows_of

ROW = '+CENG: {n},"0128,15,30,{cid},310,411,178d"'
SERVING = '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"'


def replies(lines, driver="sim800"):
    return list(replies_of(FAMILIES[driver], lines))


def test_commands_and_final_codes_divide_replies():
    lines = ["AT+CENG?", SERVING, "OK", "", "AT+CENG?", SERVING, "+CME ERROR: 3", "RING"]
    assert replies(lines) == [lines[:3], lines[3:4], lines[4:7], lines[7:]]


def test_serving_cells_divide_unsolicited_rows():
    neighbour = ROW.format(n=1, cid="a53f")
    assert replies([SERVING, neighbour, SERVING, neighbour]) == [[SERVING, neighbour]] * 2


def test_rows_come_in_the_order_of_the_driver_and_none_is_lost():
    lines = [SERVING, "OK", '+CREG: 2,1,"178D","A53F"', SERVING, ROW.format(n=1, cid="a53f"), "OK"]
    driver = FAMILIES["sim800"]
    assert rows_of(driver, lines) == driver.read(lines)
    assert isinstance(rows_of(driver, lines)[-1], Registration)


def test_another_reply_shows_what_one_alone_does_not():
    short = ROW.format(n=1, cid="a5f")
    driver = FAMILIES["sim800"]
    assert rows_of(driver, [short, "OK"])[0].identity_unsure
    once_more = rows_of(driver, [short, "OK", short, "OK"])
    assert not any(row.identity_unsure for row in once_more)
    damaged = rows_of(driver, [short, "OK", *[ROW.format(n=1, cid="a53f"), "OK"] * 9])
    assert [row.identity_unsure for row in damaged] == [True, *[False] * 9]


def test_a_registration_can_be_unsure_too():
    (row,) = rows_of(FAMILIES["generic"], ['+CREG: 2,1,"78D","A53F"'])
    assert (row.lac, row.identity_unsure) == (0x78D, True)
