"""Secrets in some 200 forms, wherever a modem may print them: none is readable."""

import random

import pytest

from logger.drivers.protocols.redaction import redact
from logger.drivers.registry import FAMILIES
from tests.kit.planted_secrets import Planted, plain, plant
from tests.kit.redacted_replies import REPLIES, redact_in_pieces
from tests.kit.secret_lines import FORMS, IN_ROWS

LINES = (*FORMS, *IN_ROWS)


def _in_reply(command: str, line: Planted) -> Planted:
    before, after = REPLIES[command].split(b"@")
    return plain(before) + line + plain(b"\r\n" + after)


def test_the_planted_lines_are_many_and_their_secrets_can_be_read():
    lines = [plant(form, random.Random(0)) for form in LINES]
    assert len(LINES) > 190
    assert sum(max(line.marks) for line in lines) > 250
    assert all(line.readable(line.data) for line in lines)


@pytest.mark.parametrize("form", LINES)
def test_no_planted_secret_is_readable_wherever_it_comes(form):
    """At the start, between polls of each family, cut off at the end, and in chunks of any size."""
    rng = random.Random(form)
    line = plain(b"\r\n") + plant(form, rng)
    whole = line + plain(b"\r\n")
    assert not line.readable(redact_in_pieces(line.data, rng))
    assert not whole.readable(redact(whole.data))
    for family in FAMILIES.values():
        assert not whole.readable(redact_in_pieces(whole.data, rng, *family.sends()))
        assert not line.readable(redact_in_pieces(line.data, rng, *family.sends()))


@pytest.mark.parametrize("command", REPLIES)
def test_no_planted_secret_is_readable_in_a_reply_or_after_it(command):
    rng = random.Random(command)
    for form in LINES:
        line = plant(form, rng)
        inside = _in_reply(command, line)
        before, after = REPLIES[command].split(b"@")
        out = redact_in_pieces(inside.data, rng, "AT", command)
        assert not inside.readable(out), form
        assert out.startswith(before), form
        late = plain(before + after) + line + plain(b"\r\n")
        assert not late.readable(redact_in_pieces(late.data, rng, command, "AT+CSQ")), form


@pytest.mark.parametrize("command", REPLIES)
def test_no_planted_secret_is_readable_on_a_noisy_line(command):
    """A line end within a number may leave some of its digits alone, too few to tell it."""
    rng = random.Random(command)
    for form in FORMS:
        for _ in range(3):
            noisy = _in_reply(command, plant(form, rng)).with_noise(rng, rng.randint(1, 6))
            assert not noisy.readable(redact_in_pieces(noisy.data, rng, command), most=5), form
