"""What the framer tells a live session besides the events."""

import pytest

from logger.drivers.protocols.at import AtFramer, Reply, Unsolicited


@pytest.mark.parametrize("data", [b"AT+CSQ\r\r\n+CSQ: 20,0\r\n\r\nOK\r\n", b"at+csq\r\nAT+CSQ\r\n"])
def test_an_echo_is_reported(data):
    framer = AtFramer()
    framer.send("AT+CSQ")
    list(framer.feed(data))
    assert framer.echo_seen
    framer.send("AT+CSQ")
    assert not framer.echo_seen
    list(framer.feed(b"\r\n+CSQ: 20,0\r\n\r\nOK\r\n"))
    assert not framer.echo_seen


def test_a_reply_under_way_is_reported():
    framer = AtFramer()
    framer.send("AT+CSQ")
    assert framer.n_lines == 0
    list(framer.feed(b"\r\n*PSUTTZ: 1\r\n"))
    assert framer.n_lines == 0
    list(framer.feed(b"+CSQ: 20,0\r\n"))
    assert framer.n_lines == 1
    list(framer.feed(b"OK\r\n"))
    assert framer.n_lines == 0


def test_an_abandoned_command_owes_nothing():
    """After a time-out the bare OK would be taken for the old command's."""
    framer = AtFramer()
    framer.send("AT+CENG?")
    list(framer.feed(b"\r\n+CENG: 1,1\r\n"))
    assert framer.abandon() == Reply("AT+CENG?", ("+CENG: 1,1",), None)
    framer.send("AT+CREG?")
    assert list(framer.feed(b"\r\nOK\r\n")) == [Reply("AT+CREG?", (), "OK")]


def test_the_boot_line_of_cinterion_answers_nothing():
    framer = AtFramer()
    framer.send("AT")
    assert list(framer.feed(b"\r\n^SYSSTART\r\n")) == [Unsolicited("^SYSSTART")]
