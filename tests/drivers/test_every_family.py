"""What all drivers have in common, whatever their modems print."""

import re

import pytest

from logger.drivers.registry import FAMILIES
from tests.kit.drivers import check_cuts, own_replies, run_dialogue

TRANSMITS_OR_IDENTIFIES = re.compile(
    r"ATD|COPS=[0124]|CGATT|CFUN|CIMI|CGSN|CCID|CNUM|GTACT|GTRAT|ENTERCND"
)
REPEATS_WITHOUT_END = re.compile(r"\^MON[IP]=|\^SMON[IP]=(?!255)")
NEEDS_A_SETTING = {"sim800"}
"""Families whose modems print no cell before a setting is accepted."""


@pytest.mark.parametrize("name", FAMILIES)
def test_commands_listen_only(name):
    family = FAMILIES[name]
    for command in (*family.setup_commands, *family.poll_commands, *family.survey_commands):
        assert not TRANSMITS_OR_IDENTIFIES.search(command.text)
        assert not REPEATS_WITHOUT_END.search(command.text)


@pytest.mark.parametrize("name", FAMILIES)
def test_setup_of_a_modem_that_accepts_all_commands_one_or_none(name):
    """An old modem knows neither AT+CEREG nor AT+COPS=3,2."""
    family = FAMILIES[name]
    assert run_dialogue(family.setup(), {}, ((), "OK"))[0] is True
    only_at = run_dialogue(family.setup(), {"AT": ((), "OK")})[0]
    assert only_at is (name not in NEEDS_A_SETTING)
    assert run_dialogue(family.setup(), {}, ((), None))[0] is False


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("final", [None, "ERROR", "+CME ERROR: 100"])
def test_poll_without_an_answer(name, final):
    assert run_dialogue(FAMILIES[name].poll(), {}, ((), final))[0] is None


@pytest.mark.parametrize("name", FAMILIES)
def test_a_reply_that_is_cut_names_no_other_cell(name):
    for reply in own_replies(name):
        check_cuts(FAMILIES[name], reply)
