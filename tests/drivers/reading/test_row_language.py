import pytest

from logger.drivers.reading.row_language import (
    area,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    network,
    rsrq_db,
    values,
)


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("a, b ,,c", ["a", "b", "", "c"]),
        ("", [""]),
        ('"a, b",c', ["a, b", "c"]),
        ('1,"unclosed', ["1", "unclosed"]),
        ('"x" y,2', ["x", "2"]),
        ("a,", ["a", ""]),
    ],
)
def test_values_between_commas(text, fields):
    assert values(text) == fields


def test_numbers_are_numbers_or_unknown():
    assert [decimal(t) for t in (" 12", "-3", "+4", "1x", "", "0x1", "٣", "9" * 13)] == [
        12, None, 4, None, None, None, None, None,
    ]  # fmt: skip
    assert decimal("-3", -5, 5) == -3
    assert [hexadecimal(t) for t in ("fF", "0x1a", "g", "", "1 2")] == [255, 26, None, None, None]
    assert [level(t, -120, 0) for t in ("-98.7", "-987", "nan", "1e1", "-5")] == [
        -98.7,
        None,
        None,
        None,
        -5.0,
    ]
    assert level("-987", -120, 0, 0.1) == pytest.approx(-98.7)
    assert [rsrq_db(t) for t in ("-10", "0")] == [-10.0, None]


def test_parts_of_an_identity_that_state_unknown():
    assert [area(t) for t in ("178d", "0000", "FFFE", "ffff", "10000", "")] == [
        0x178D,
        None,
        None,
        None,
        None,
        None,
    ]
    assert area("65535", base=10) is None
    assert area("7D3C00", bits=24) == 0x7D3C00
    assert [cell_identity(t, 16) for t in ("a53e", "ffff", "0")] == [0xA53E, None, None]
    assert [cell_identity(t, 28) for t in ("243800E", "fffffff", "ffff")] == [0x243800E, None, None]
    assert network("310", "26") == ("310", "26")
    for wrong in (("000", "00"), ("31", "26"), ("310", ""), ("FFF", "FF")):
        assert network(*wrong) == (None, None)
