"""The answer in a sentence, which is the same on the walk and at the desk."""

from dataclasses import replace

import msgspec
import pytest

from logger.core.answer import Answer, Mode, Place, Provenance, StrongestReading, Word
from logger.core.certainty import Ellipse

MODE = Mode(lat=52.5, lon=13.4, probability=1.0, percent=100, ellipse95=Ellipse(46.0, 30.0, 0.0))
PLACE = Place(
    lat=52.5, lon=13.4, r50_m=20.4, r95_m=45.6, drms_m=25.0, area_m2=6000.0, modes=(MODE,),
    strongest=StrongestReading(lat=52.5, lon=13.4, level_dbm=-60.0),
)  # fmt: skip
LOCATED = Answer("262-01-1-1", "located", ("one position holds > 99 %",), Provenance(20), PLACE)
RADII = "most likely within 20 m, surely within 46 m"


def test_a_located_cell():
    assert LOCATED.sentence == f"located at 52.50000 13.40000, {RADII}"


@pytest.mark.parametrize("verdict", ["ambiguous", "cannot tell"])
def test_the_reason_stands_with_every_other_verdict(verdict):
    answer = replace(LOCATED, verdict=verdict, reasons=("why", "more"))
    assert answer.sentence == f"{verdict}: why; likeliest at 52.50000 13.40000, {RADII}"
    assert replace(answer, place=None).sentence == f"{verdict}: why"


def test_what_the_radii_suppose_stands_after_them():
    place = msgspec.structs.replace(PLACE, may_be_distant=True)
    answer = replace(LOCATED, verdict="cannot tell", place=place)
    assert answer.sentence.endswith(f"{RADII}, if it is no distant mast")
    within = msgspec.structs.replace(PLACE, area="within 100 m of the walk")
    answer = replace(LOCATED, verdict="cannot tell", place=within)
    assert answer.sentence.endswith(f"{RADII}, if it is within 100 m of the walk")


@pytest.mark.parametrize(
    ("r50_m", "where"),
    [(20.0, "52.5000 13.4000"), (450.0, "52.500 13.400"), (1000.0, "52.50 13.40")],
)
def test_a_wide_region_is_rounded_by_less_than_what_most_likely_holds_it(r50_m, where):
    place = msgspec.structs.replace(PLACE, r50_m=r50_m, r95_m=1001.0)
    wide = replace(LOCATED, verdict="cannot tell", place=place)
    assert f"; likeliest at about {where}, most likely within " in wide.sentence


@pytest.mark.parametrize(
    ("r95_m", "where"), [(150.0, "52.50000 13.40000"), (990.0, "52.5000 13.4000")]
)
def test_a_place_has_the_decimals_of_its_radius(r95_m, where):
    place = msgspec.structs.replace(PLACE, r50_m=40.0, r95_m=r95_m)
    assert f"likeliest at {where}, " in replace(LOCATED, verdict="ambiguous", place=place).sentence


@pytest.mark.parametrize("word", ["unusual", "suspicious"])
def test_the_word_of_a_conspicuous_cell_comes_first(word):
    odd, plain = (
        replace(LOCATED, word=Word(one, 6.0, (), LOCATED.cell)) for one in (word, "nothing unusual")
    )
    assert odd.sentence == f"{word}; {LOCATED.sentence}"
    assert plain.sentence == LOCATED.sentence
