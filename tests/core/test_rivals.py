"""Words for what is plausible beside the best."""

import pytest

from logger.core.certainty import area_text
from logger.core.locator.alternatives import ANTENNA, HEIGHT, REACH, Alternative, alternatives_text

NEAR = Alternative(REACH, "near", 0.62, 350_000.0, 0.05)
FAR = Alternative(REACH, "far", 0.38, 4_130_000.0, 0.12)
OMNI = Alternative(ANTENNA, "omni", 0.999, 400_000.0, 0.05)
SECTOR = Alternative(ANTENNA, "sector", 0.001, 90_000.0, 0.7)
LOW = Alternative(HEIGHT, "2 m", 0.4, 350_000.0, 0.05)
HIGH = Alternative(HEIGHT, "30 m", 0.6, 350_000.0, 0.05)


@pytest.mark.parametrize(
    ("some", "text"),
    [
        ([NEAR, FAR], "reach: near 62 %, far 38 % (alone: 4.1 km²)"),
        ([NEAR], "reach: near (fixed)"),
        ([OMNI, SECTOR], "antenna: omni > 99 %, sector < 1 % (alone: 90 000 m², elsewhere)"),
        (
            [OMNI, Alternative(ANTENNA, "sector", 0.0, None, None)],
            "antenna: omni > 99 %, sector < 1 %",
        ),
        ([LOW, HIGH], "height: 30 m 60 %"),
        ([LOW, Alternative(HEIGHT, "30 m", 0.45, 1.0, 0.05)], "height: unknown"),
        ([HIGH], "height: 30 m (fixed)"),
        ([FAR, SECTOR, HIGH], "reach: far (fixed); antenna: sector (fixed); height: 30 m (fixed)"),
        ([], ""),
    ],
)
def test_what_the_answer_took_and_what_the_others_would_say(some, text):
    assert alternatives_text(some).replace("\N{NARROW NO-BREAK SPACE}", " ") == text


@pytest.mark.parametrize(
    ("area_m2", "text"),
    [
        (681.0, "680 m²"),
        (11_328.0, "11\u202f000 m²"),
        (1_240_000.0, "1.2 km²"),
        (153_000_000.0, "150 km²"),
    ],
)
def test_areas_have_two_digits(area_m2, text):
    assert area_text(area_m2) == text
