from logger.core.latest import SampleHold

S = 10**9


def test_a_value_holds_until_the_next_one_or_its_age():
    held = SampleHold[str](max_age_s=3.0)
    assert held.at(0) is None
    assert held.last is None
    held.add(1 * S, "a")
    held.add(5 * S, "b")
    assert [held.at(t * S) for t in (0, 1, 3, 4, 5, 8, 9)] == [None, "a", "a", "a", "b", "b", None]
    held.add(6 * S, None)
    assert [held.at(t * S) for t in (5, 6)] == ["b", None]
    assert held.last is None


def test_only_the_latest_are_kept():
    held = SampleHold[int](max_age_s=1e6)
    for t in range(10_000):
        held.add(t, t)
    assert held.at(9_999) == 9_999
    assert held.at(10) is None
