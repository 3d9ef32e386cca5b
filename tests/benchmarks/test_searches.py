"""The small twin of `benchmarks/guidance.py --searches`: one city with a rogue."""

from benchmarks.guided.searches import search

LATER_S = 360.0


def test_the_arrow_leads_to_the_rogue_once_it_is_named_and_the_target_stays():
    one = search(2, has_rogue=True, longest_s=LATER_S)
    assert one.named_s is not None
    assert one.changes == 1  # from the strongest cell to the rogue
    assert one.led_s <= one.named_s


def test_nobody_is_led_about_in_a_clean_city():
    one = search(1, has_rogue=False, longest_s=120.0)
    assert one.changes == 0
    assert one.named_s is None
