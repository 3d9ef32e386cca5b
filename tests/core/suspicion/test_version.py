"""The version of the rules is a digest: it follows every rule, and nothing that is only text."""

import ast
from dataclasses import replace

import pytest

from logger.core.suspicion.rules import RULES, rules_note, rules_version, shape_of_code

CODE = """
def rise(levels: list[float], most: float = 20.0) -> str | None:
    match levels:
        case [first, *_, last] if last - first >= most:
            return f"{last - first:.1f} dB {'more'!r}"
    return None
"""
SHAPE = (
    "(Module body=[(FunctionDef name='rise' args=(arguments args=[(arg arg='levels' "
    "annotation=(Subscript value=(Name id='list' ctx=(Load )) slice=(Name id='float' ctx=(Load )) "
    "ctx=(Load ))) (arg arg='most' annotation=(Name id='float' ctx=(Load )))] "
    "defaults=[(Constant value=20.0)]) body=[(Match subject=(Name id='levels' ctx=(Load )) "
    "cases=[(match_case pattern=(MatchSequence patterns=[(MatchAs name='first') (MatchStar ) "
    "(MatchAs name='last')]) guard=(Compare left=(BinOp left=(Name id='last' ctx=(Load )) op=(Sub )"
    " right=(Name id='first' ctx=(Load ))) ops=[(GtE )] comparators=[(Name id='most' "
    "ctx=(Load ))]) body=[(Return value=(JoinedStr values=[(FormattedValue value=(BinOp left="
    "(Name id='last' ctx=(Load )) op=(Sub ) right=(Name id='first' ctx=(Load ))) conversion=-1 "
    "format_spec=(JoinedStr values=[(Constant value='.1f')])) (Constant value=' dB ') "
    "(FormattedValue value=(Constant value='more') conversion=114)]))])]) (Return value=(Constant "
    "))] returns=(BinOp left=(Name id='str' ctx=(Load )) op=(BitOr ) right=(Constant )))])"
)


def _shape(code):
    return shape_of_code(ast.parse(code))


def test_it_is_the_same_in_every_version_of_python():
    """3.11 to 3.13 give this; a version that does not would make each run one of other rules."""
    assert _shape(CODE) == SHAPE


def test_comments_docstrings_and_whitespace_do_not_count():
    edited = CODE.replace(
        "    match", '    """Rise of a level."""\n    # from the first to the last\n\n    match'
    ).replace("- first >= most", "-  first>=most")
    assert edited != CODE
    assert _shape(edited) == SHAPE


@pytest.mark.parametrize(
    ("old", "new"), [("20.0", "21.0"), (">=", ">"), ("dB", "decibel"), ("None\n", "''\n")]
)
def test_code_counts(old, new):
    assert _shape(CODE.replace(old, new)) != SHAPE


def test_a_rule_that_is_added_changes_it_and_nothing_else_is_needed(monkeypatch):
    before = rules_version()
    assert rules_version() == before
    monkeypatch.setitem(RULES, "X1", replace(RULES["S2"], id="X1"))
    assert rules_version() != before
    assert rules_note().text.endswith(" X1")


@pytest.mark.parametrize(
    "changed",
    [
        {"measured": {}},
        {"detection": 0.5},
        {"sentence": "the level rose"},
        {"strength": "suffices"},
        {"check": RULES["S8"].check},
    ],
    ids=lambda changed: next(iter(changed)),
)
def test_what_a_rule_declares_changes_it(changed, monkeypatch):
    before = rules_version()
    monkeypatch.setitem(RULES, "S2", replace(RULES["S2"], **changed))
    assert rules_version() != before
