"""What is printed and written about the rules is what the rules declare."""

import json
import re
from pathlib import Path

import pytest

from logger.core.suspicion.rules import RULES
from postproc.cli import main
from postproc.suspicion import run_assessment

PAGE = Path(__file__).parents[3] / "docs" / "guide" / "suspicion.md"
ALL_RULES = {rule.id: rule for rule in run_assessment.ALL_RULES}


def test_no_two_rules_have_one_name():
    assert len(ALL_RULES) == len(run_assessment.ALL_RULES) > len(RULES)


def test_the_table_of_all_rules(capsys):
    assert main(["suspect", "--rules"]) == 0
    text = capsys.readouterr().out
    printed = dict(re.findall(r"^  - (\w+) \(([\w ]+)\): ", text, re.MULTILINE))
    assert printed == {rule.id: rule.family for rule in ALL_RULES.values()}
    plain = " ".join(text.split())
    for rule in ALL_RULES.values():
        assert f"{rule.sentence}. Only where: {rule.gate}." in plain
        assert f"Also seen with: {rule.harmless}." in plain
    assert "GSM 1 of 23 cells in 2.7 h (0.01 to 2.06 an hour)" in plain


@pytest.mark.parametrize("words", [["--rules", "--json"], ["--json", "--rules", "no.h5"]])
def test_the_rules_as_json(words, capsys):
    assert main(["suspect", *words]) == 0
    rules = {row["rule"]: row for row in json.loads(capsys.readouterr().out)}
    assert {name: row["family"] for name, row in rules.items()} == {
        rule.id: rule.family for rule in ALL_RULES.values()
    }
    assert all(row["text"] == ALL_RULES[name].text for name, row in rules.items())


def test_the_page_names_no_rule_that_there_is_not_and_no_other_family():
    rows = re.findall(r"^\| ([\w ]+) \| ((?:[A-Z]\d+ ).*) \|$", PAGE.read_text(), re.MULTILINE)
    named = {name: family for family, text in rows for name in re.findall(r"\b[A-Z]\d+\b", text)}
    assert len(named) > 20
    assert {name: ALL_RULES[name].family for name in named} == named
