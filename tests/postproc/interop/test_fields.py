import pytest

from postproc.interop.sighting import Moment, moment_of

NOON_NS = 1_714_564_807 * 10**9


@pytest.mark.parametrize(
    ("text", "t_ns", "is_utc"),
    [
        ("1714564807", NOON_NS, True),
        ("1714564807.25", NOON_NS + 250_000_000, True),
        ("1714564807123", NOON_NS + 123_000_000, True),
        ("2024-05-01T12:00:07Z", NOON_NS, True),
        ("2024-05-01T14:00:07+02:00", NOON_NS, True),
        ("2024.05.01_12.00.07", NOON_NS, False),
        ("2024-05-01 12:00:07.5", NOON_NS + 500_000_000, False),
        ("01.05.2024 12:00:07,5", NOON_NS + 500_000_000, False),
        ("12:00:07", 43_207 * 10**9, False),
        ("1714564807123456", NOON_NS + 123_456_000, True),
        ("1714564807123456789", NOON_NS + 123_456_789, True),
        ("2024-05-01  12:00:07", NOON_NS, False),
        ("2024-05-01\u00a012:00:07", NOON_NS, False),
        ("2024-05-01 12:00:07 UTC", NOON_NS, True),
        ("01.05.24 12:00:07", NOON_NS, False),
        ("20240501120007", NOON_NS, False),
        ("1 May 2024 12:00:07", NOON_NS, False),
        ("01-May-2024 12:00:07", NOON_NS, False),
        ("May 1, 2024 12:00:07 PM", NOON_NS, False),
    ],
)
def test_each_form_and_whether_it_is_utc(text, t_ns, is_utc):
    assert moment_of(text, "time") == Moment(t_ns, is_utc)
    assert moment_of(text, "time").utc_ns == (t_ns if is_utc else None)


@pytest.mark.parametrize(
    "text",
    ["", "05/01/2024 12:00", "2024-13-01 12:00:07", "noon", "7", "1 Foo 2024 12:00:07", " UTC"],
)
def test_what_is_no_time_is_named(text):
    with pytest.raises(ValueError, match="time"):
        moment_of(text, "time")
