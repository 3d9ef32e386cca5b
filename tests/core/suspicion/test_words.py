import pytest

from logger.core.suspicion.rule import Finding
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import (
    SUSPICIOUS_NATS,
    assess,
    by_word,
    false_alarms_per_hour,
    sentences,
    unnoticed_text,
    word_rate_text,
)


def _finding(rule, nats, text=""):
    return Finding(RULES[rule], "c", 0, None, None, text, {}, nats)


def test_a_family_counts_once():
    one = assess("c", [_finding("L1", 4.0), _finding("L2", 4.5)])
    assert (one.word, one.score_nats) == ("unusual", 4.5)


def test_two_families_are_needed_and_one_of_them_confirms():
    area, plan = _finding("L1", 4.0), _finding("P1", 5.0)
    assert assess("c", [area, plan]).word == "suspicious"
    timing = _finding("T1", 4.0)
    assert assess("c", [plan, timing]).word == "unusual"  # neither says more than the other
    weak = _finding("N1", 0.4)
    assert assess("c", [_finding("L1", 4.0), weak]).word == "unusual"


def test_a_cell_that_neither_earlier_walks_nor_the_plan_know_is_suspicious():
    new = _finding("B1", 4.0)
    assert assess("c", [new]).word == "unusual"
    assert assess("c", [new, _finding("P5", 2.0)]).word == "suspicious"


def test_levels_that_no_place_explains_are_enough():
    assert assess("c", [_finding("S5", 6.0)]).word == "suspicious"


def test_an_area_code_of_no_other_cell_is_enough_where_its_rate_is_known():
    assert RULES["L1"].nats("LTE") > 6.0 > SUSPICIOUS_NATS > RULES["L1"].nats("GSM")
    assert assess("c", [_finding("L1", RULES["L1"].nats("LTE"))]).word == "suspicious"
    assert assess("c", [_finding("L1", RULES["L1"].nats("GSM"))]).word == "unusual"


def test_less_evidence_for_two_places_needs_a_second_family():
    perhaps = _finding("S9", 6.0)
    assert assess("c", [perhaps]).word == "unusual"
    assert assess("c", [perhaps, _finding("S8", 3.4)]).word == "suspicious"


def test_one_sentence_is_printed_once():
    weaker, stronger = _finding("S9", 2.9, "two"), _finding("S5", 6.6, "two")
    area = _finding("L1", 4.0, "one")
    assert sentences([weaker, area, stronger]) == [area, stronger]


def test_the_most_suspicious_comes_first():
    words = [assess("quiet", []), assess("worst", [_finding("S5", 6.0)])]
    assert [one.cell for one in by_word(words)] == ["worst", "quiet"]


def test_the_rate_of_an_alarm_is_a_bound_where_there_was_none():
    assert 0.0 < false_alarms_per_hour("suspicious") <= 0.1
    assert false_alarms_per_hour("nothing unusual") == 0.0


def test_a_rate_is_printed_with_its_interval_and_hours():
    text = "legitimate cells earned this word 0.03 times an hour (0.00 to 0.14, 95 %) in 38.5 h of "
    assert word_rate_text("suspicious").startswith(text)
    assert "1 of 924 cells, so more often where a modem names many" in word_rate_text("suspicious")


@pytest.mark.parametrize(("missing", "helps"), [(("earlier walks",), True), (("identity",), False)])
def test_more_walks_are_promised_to_help_only_where_they_would(missing, helps):
    assert ("from 7 on" in unnoticed_text({"B1": missing}, 600.0, 0)) == helps
    assert ("plausible identity" in unnoticed_text({"B1": missing}, 600.0, 7)) != helps


def test_earlier_walks_cannot_show_what_they_heard_too_nor_what_they_could_not_hear():
    assert "earlier walks heard" not in unnoticed_text({}, 600.0, 6)
    said = unnoticed_text({}, 600.0, 7)
    assert "one that earlier walks heard too" in said
    assert "one of a network or technology that they did not hear" in said


def test_a_station_that_is_on_the_air_for_a_minute_is_not_said_to_be_noticed():
    """L1 waits for the second cell of a border: on foot 80 s."""
    assert "one on the air for a minute or two" in unnoticed_text({}, 600.0, 0)
    of_a_new_station = dict.fromkeys(("P1", "L1", "L2", "L4"), ())
    assert "no station would certainly" in unnoticed_text(of_a_new_station, 600.0, 0)


def test_what_would_have_been_noticed_is_said_of_networks_and_areas_apart():
    for hidden, what in (("P1", "L4"), "network"), (("L1", "L2"), "area"):
        said = unnoticed_text(dict.fromkeys(hidden, ()), 600.0, 0)
        assert "a strong new station would most likely" in said
        assert f"one of an invented {what}" in said
    assert "invented" not in unnoticed_text({"L1": ()}, 600.0, 0)


def test_a_walk_of_seconds_promises_nothing():
    assert "even a strong new station may be missed" in unnoticed_text({}, 119.0, 30)


def test_what_no_scan_told_stands_in_a_sentence():
    not_asked = {
        "P1": ("country code", "position"),
        "N1": ("neighbour lists",),
        "R1": ("cell of GSM",),
        "B1": ("earlier walks",),
    }
    said = unnoticed_text(not_asked, 600.0, 0)
    assert "one that only country codes, positions or neighbour lists would betray" in said
