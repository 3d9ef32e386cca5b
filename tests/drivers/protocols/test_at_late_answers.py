from logger.drivers.protocols.at import AtFramer, Reply, Unsolicited
from tests.kit.at_framers import CENG_LINES, CENG_REPLY, check, framer_after, framer_after_expiry


def test_line_begun_before_the_command_does_not_answer_it():
    framer = AtFramer()
    assert list(framer.feed(b"\r\nO")) == []
    framer.send("AT")
    assert list(framer.feed(b"K\r\n\r\nERROR\r\n")) == [Unsolicited("OK"), Reply("AT", (), "ERROR")]


def test_late_final_code_while_nothing_is_pending_changes_nothing():
    framer = framer_after("AT+CENG?")()
    framer.expire()
    assert list(framer.feed(CENG_REPLY)) == [*map(Unsolicited, CENG_LINES), Unsolicited("OK")]
    framer.send("AT+CSQ")
    assert list(framer.feed(b"OK\r\n")) == [Reply("AT+CSQ", (), "OK")]


def test_late_answer_of_another_command_does_not_close_the_reply():
    expected = [*map(Unsolicited, CENG_LINES), Unsolicited("OK"), Reply("AT", (), "OK")]
    check(framer_after_expiry("AT+CENG?", then="AT"), CENG_REPLY + b"\r\nOK\r\n", expected)


def test_late_bare_ok_does_not_close_a_question():
    check(
        framer_after_expiry("AT", then="AT+CENG?"),
        b"OK\r\n" + CENG_REPLY,
        [Unsolicited("OK"), Reply("AT+CENG?", CENG_LINES, "OK")],
    )
    check(
        framer_after_expiry("AT", then="AT+CSQ"),
        b"OK\n+CSQ: 1,0\nOK\n",
        [Unsolicited("OK"), Reply("AT+CSQ", ("+CSQ: 1,0",), "OK")],
    )


def test_late_answer_that_never_comes_costs_one_time_out_at_most():
    framer = framer_after_expiry("AT", then="AT+CENG?")()
    assert list(framer.feed(b"OK\r\n")) == [Unsolicited("OK")]
    framer.expire()
    framer.send("AT+CENG?")
    assert list(framer.feed(b"OK\r\n")) == [Reply("AT+CENG?", (), "OK")]


def test_answer_of_its_own_settles_the_account():
    framer = framer_after_expiry("AT", then="AT+CENG?")()
    assert list(framer.feed(CENG_REPLY)) == [Reply("AT+CENG?", CENG_LINES, "OK")]
    framer.send("AT+CSQ")
    assert list(framer.feed(b"OK\r\n")) == [Reply("AT+CSQ", (), "OK")]
