"""Each modem has one driver, and each driver is reached, whatever the order of the drivers."""

import pkgutil
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

import pytest

from logger import drivers
from logger.drivers import sim7600
from logger.drivers.family import Claim, Family
from logger.drivers.registry import FAMILIES, claimants, family_of
from tests.kit.dialects import DIALECTS

ANSWERS = Path(__file__).parent / "data" / "ati"
"""Answers to ATI, AT+CGMI, AT+CGMM and AT+CGMR by driver, from manuals and public logs."""


def answers_of(name: str) -> list[str]:
    return (ANSWERS / f"{name}.txt").read_text().splitlines()


def conflicts(identities: Iterable[str], families: Iterable[Family]) -> dict[str, list[str]]:
    """Identities that several drivers claim alike, with the names of these drivers."""
    families = list(families)
    found = {text: [family.name for family in claimants(text, families)] for text in identities}
    return {text: names for text, names in found.items() if len(names) > 1}


def unreachable_answers(
    answers: Iterable[str], family: Family, families: Iterable[Family]
) -> list[str]:
    """Answers of a driver's own modems with which it is not chosen."""
    families = list(families)
    return [text for text in answers if claimants(text, families)[:1] != [family]]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_driver_is_reached_by_the_answers_of_its_modems(name):
    answers = answers_of(name)
    assert answers
    assert {family_of(text).name for text in answers} == {name}


def test_no_two_drivers_claim_one_answer():
    answers = [text for name in FAMILIES for text in answers_of(name)]
    simulated = [
        " ".join(text for lines in dialect.identity.values() for text in lines)
        for dialect in DIALECTS.values()
    ]
    assert conflicts([*answers, *simulated], FAMILIES.values()) == {}


def test_no_two_drivers_claim_one_reply_of_the_corpus(corpus):
    replies = [path.read_text("latin-1") for path in sorted((corpus / "modem").glob("*.txt"))]
    assert len(replies) > 100
    assert conflicts(replies, FAMILIES.values()) == {}


def test_every_driver_is_installed():
    for module in pkgutil.walk_packages(drivers.__path__, f"{drivers.__name__}."):
        for value in vars(import_module(module.name)).values():
            if isinstance(value, type) and issubclass(value, Family) and value is not Family:
                assert value.name in FAMILIES, f"{value}: not found by the registry"
                assert type(FAMILIES[value.name]) is value


class A7999(sim7600.Sim7600):
    """A driver for one model (an invented one) of a series that another driver serves."""

    name = "a7999"
    claim = Claim(series=r"A7999")


ANSWER = "Model: A7999E-H Revision: A7999M7_V1.0"


def test_a_driver_that_claims_what_another_one_has_is_found_out():
    families = [*FAMILIES.values(), A7999()]
    assert conflicts([ANSWER], families) == {ANSWER: ["sim7600", "a7999"]}
    assert unreachable_answers([ANSWER], families[-1], families) == [ANSWER]


@pytest.mark.parametrize("first", [True, False])
def test_the_driver_of_a_model_comes_before_that_of_its_series(monkeypatch, first):
    monkeypatch.setattr(A7999, "claim", Claim(model=r"A7999"))
    driver = A7999()
    families = [driver, *FAMILIES.values()] if first else [*FAMILIES.values(), driver]
    assert conflicts([ANSWER], families) == {}
    assert unreachable_answers([ANSWER], driver, families) == []
    other = "Model: A7670E-LASE"
    assert [family.name for family in claimants(other, families)] == ["sim7600"]


@pytest.mark.parametrize(
    ("claim", "rank"),
    [
        (Claim(), 0),
        (Claim(maker="acme"), 1),
        (Claim(maker="acme", series=r"X\d\d"), 2),
        (Claim(model="X20", maker="acme"), 3),
        (Claim(model="X21"), 0),
    ],
)
def test_the_most_specific_pattern_gives_the_rank(claim, rank):
    assert claim.rank("ACME Ltd X20 1.0") == rank
