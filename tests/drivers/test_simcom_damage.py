"""Replies of SIM7000 and SIM7600 that lack a mark or an end name no other cell; for other damage
see test_damage.
"""

import pytest

from logger.drivers.sim7000 import Sim7000
from logger.drivers.sim7600 import Sim7600
from tests.kit.drivers import NO_IDENTITY, cells_of, identity_of, own_replies

MODEMS = [Sim7000(), Sim7600()]
REPLIES = [reply for modem in MODEMS for reply in own_replies(modem.name)]


def identities_of(lines):
    return {identity_of(row) for modem in MODEMS for row in cells_of(modem, lines)}


@pytest.mark.parametrize("text", REPLIES)
def test_cut_reply_has_no_other_cell(text):
    known = identities_of(text.split("\n")) | {NO_IDENTITY}
    for end in range(len(text)):
        assert identities_of(text[:end].split("\n")) <= known, text[:end]


@pytest.mark.parametrize("text", REPLIES)
def test_lost_mark_makes_no_other_cell(text):
    known = identities_of(text.split("\n")) | {NO_IDENTITY}
    for at, mark in enumerate(text):
        if not mark.isalnum():  # a digit lost inside a number cannot be seen
            damaged = text[:at] + text[at + 1 :]
            assert identities_of(damaged.split("\n")) <= known, damaged


@pytest.mark.parametrize("text", REPLIES)
def test_added_comma_makes_no_other_cell(text):
    known = identities_of(text.split("\n")) | {NO_IDENTITY}
    for at in range(len(text)):
        damaged = f"{text[:at]},{text[at:]}"
        assert identities_of(damaged.split("\n")) <= known, damaged
