import re

import pytest

from logger.sim.faults import FAULTS, Misbehaving
from logger.sim.scenario import scenario


class Stopwatch:
    t_s = 0.0

    def __call__(self):
        return self.t_s


@pytest.fixture
def now():
    return Stopwatch()


def misbehaving(fault, now, seed=0):
    modem = scenario("clear").modem(now)
    modem.feed(b"ATE0\rAT+CENG=1,1\r")
    return Misbehaving(modem, fault, 10.0, 20.0, now, seed)


def through(modem, now, times, command=b"AT+CSQ\r"):
    """What is said in answer to a command at each of the times."""
    output_of = []
    for t_s in times:
        now.t_s = t_s
        output_of.append(modem.feed(command) + modem.unsolicited())
    return output_of


CSQ = re.compile(rb"\r\n\+CSQ: \d+,0\r\n\r\nOK\r\n")


@pytest.mark.parametrize("fault", FAULTS)
def test_is_well_before_and_afterwards(now, fault):
    modem = misbehaving(fault, now)
    before = through(modem, now, [0.0, 9.9])
    through(modem, now, [10.0 + n / 10 for n in range(100)])
    through(modem, now, [20.0], b"ATE0\r")
    assert all(map(CSQ.fullmatch, before + through(modem, now, [20.1, 30.0])))


@pytest.mark.parametrize("fault", FAULTS)
def test_the_same_seed_gives_the_same_bytes(fault):
    def output_of(seed):
        now = Stopwatch()
        return b"".join(through(misbehaving(fault, now, seed), now, [n / 4 for n in range(100)]))

    assert output_of(1) == output_of(1)
    assert (output_of(1) != output_of(2)) == (fault in {"garbage", "brown-out", "urc-storm"})


def test_garbage_is_between_the_bytes_of_the_answers(now):
    output_of = b"".join(
        through(misbehaving("garbage", now), now, [10.0 + n / 10 for n in range(50)])
    )
    assert len(output_of) > 50 * len(b"\r\n+CSQ: 27,0\r\n\r\nOK\r\n") + 15 * 24 - 1
    assert len(CSQ.findall(output_of)) < 50


def test_a_hang_loses_what_it_is_sent(now):
    modem = misbehaving("hang", now)
    assert through(modem, now, [10.0, 15.0, 19.9]) == [b"", b"", b""]
    now.t_s = 20.0
    assert modem.unsolicited() == b""


def test_a_stall_answers_everything_at_its_end(now):
    modem = misbehaving("stall", now)
    assert through(modem, now, [10.0, 15.0, 19.9]) == [b"", b"", b""]
    now.t_s = 20.0
    assert len(CSQ.findall(modem.unsolicited())) == 3


def test_a_brown_out_ends_with_the_settings_of_the_factory(now):
    modem = misbehaving("brown-out", now)
    noise, *silence = through(modem, now, [10.0, 15.0, 19.9])
    assert len(noise) == 24
    assert not any(silence)
    now.t_s = 20.0
    assert b"\r\nRDY\r\n" in modem.unsolicited()
    assert modem.feed(b"AT+CENG?\r") == b"AT+CENG?\r\r\n+CENG: 0,0\r\n\r\nOK\r\n"


def test_a_silent_reset_prints_nothing(now):
    modem = misbehaving("silent-reset", now)
    assert through(modem, now, [10.0], b"AT+CENG?\r") == [b"AT+CENG?\r\r\n+CENG: 0,0\r\n\r\nOK\r\n"]


def test_the_echo_stays_on_for_its_time(now):
    modem = misbehaving("echo", now)
    through(modem, now, [10.0], b"ATE0\r")
    assert through(modem, now, [11.0, 19.9], b"AT\r") == [b"AT\r\r\nOK\r\n"] * 2
    through(modem, now, [20.0], b"ATE0\r")
    assert through(modem, now, [20.1], b"AT\r") == [b"\r\nOK\r\n"]


def test_slow_bytes_come_at_their_rate_and_none_is_lost(now):
    modem = misbehaving("slow", now)
    now.t_s = 10.0
    out = modem.feed(b"AT+CSQ\rAT+CSQ\r")
    assert out == b""
    for n in range(60):
        now.t_s = 10.0 + 0.03 * (n + 1) + 1e-6
        more = modem.unsolicited()
        assert len(more) <= 1
        out += more
    assert len(CSQ.findall(out)) == 2


def test_each_line_comes_twice(now):
    output_of = through(misbehaving("duplicated", now), now, [12.0], b"AT+CENG?\r")[0].split(
        b"\r\n"
    )
    texts = [line for line in output_of if line]
    assert texts[::2] == texts[1::2]
    assert len(texts) > 6


def test_an_answer_comes_again_before_the_next(now):
    modem = misbehaving("repeated", now)
    now.t_s = 12.0
    first = modem.feed(b"AT+CSQ\r")
    assert CSQ.fullmatch(first)
    assert modem.feed(b"AT\r") == first + b"\r\nOK\r\n"
    assert modem.unsolicited() == b"\r\nOK\r\n"
    assert modem.unsolicited() == b""


def test_a_storm_is_of_complete_lines(now):
    output_of = b"".join(
        through(misbehaving("urc-storm", now), now, [10.0 + n / 10 for n in range(50)])
    )
    assert len(CSQ.findall(output_of)) == 50
    assert len(output_of.split(b"\r\n")) > 900
