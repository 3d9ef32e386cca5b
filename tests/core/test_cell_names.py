"""Names by channel and code: the same both ways, and one clear line for what is none."""

from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from logger.core.cell_names import (
    CODES,
    HIGHEST,
    channel_name,
    each_once,
    is_by_channel,
    why_no_name,
)
from logger.core.types import CellReading


@st.composite
def readings(draw):
    rat = draw(st.sampled_from(sorted(CODES)))
    channel, code = (draw(st.integers(0, highest)) for highest in HIGHEST[rat])
    return CellReading("neighbour", rat, arfcn=channel, **{CODES[rat]: code})


@given(readings())
def test_a_name_says_technology_channel_and_code(reading):
    name = channel_name(reading)
    assert is_by_channel(name)
    assert not why_no_name(name)
    rat, channel, code = name.rsplit("-", 2)
    assert rat == reading.rat
    assert (int(channel), int(code)) == (reading.arfcn, getattr(reading, CODES[rat]))


def test_the_names_of_the_manual():
    assert channel_name(CellReading("neighbour", "LTE", arfcn=5780, pci=210)) == "LTE-5780-210"
    assert channel_name(CellReading("neighbour", "GSM", arfcn=62, bsic=37)) == "GSM-62-37"
    assert channel_name(CellReading("neighbour", "LTE-M", arfcn=5780, pci=210)) == "LTE-5780-210"


@pytest.mark.parametrize(
    "reading",
    [
        CellReading("neighbour", "LTE", arfcn=5780),
        CellReading("neighbour", "LTE", pci=210),
        CellReading("neighbour", None, arfcn=5780, pci=210),
        CellReading("neighbour", "LTE", arfcn=5780, pci=504),
        CellReading("neighbour", "GSM", arfcn=1024, bsic=3),
        CellReading("neighbour", "LTE", arfcn=5780, bsic=3),
    ],
)
def test_what_has_no_name(reading):
    assert channel_name(reading) is None


@given(st.text(max_size=20) | st.from_regex(r"(LTE|GSM|NB-IoT)-[0-9]{1,7}-[0-9]{1,4}"))
@example("LTE-05780-210")
@example("LTE-5780-210\n")
@example("LTE-٥-1")
def test_a_name_is_written_in_one_way(text):
    if is_by_channel(text):
        rat, channel, code = text.rsplit("-", 2)
        again = CellReading("scan", rat, arfcn=int(channel), **{CODES[rat]: int(code)})
        assert channel_name(again) == text


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("LTE-5780-504", "the channel is at most 262143, the PCI at most 503"),
        ("GSM-1024-3", "the channel is at most 1023, the BSIC at most 63"),
        ("LTE-5780", "write LTE-5780-210"),
        ("lte-5780-210", "write LTE-5780-210"),
        ("UMTS-10737-25", "WCDMA-10737-25"),
        ("LTE-5780-0210", "write LTE-5780-210"),
    ],
)
def test_a_wrong_name_is_explained(name, why):
    assert why in why_no_name(name)


@pytest.mark.parametrize("name", ["262-01-4711-1", "strongest", "my tower", "", "LTE-5780-210"])
def test_other_names_are_not_judged(name):
    assert not why_no_name(name)


def test_a_neighbour_without_identity_that_repeats_a_cell_counts_once():
    """An EC25 lists the serving cell among the cells of its channel, an M66 all channels again."""
    serving = CellReading("serving", "LTE", "262", "02", cid=7, tac=9, arfcn=1300, pci=135)
    serving = replace(serving, rsrp_dbm=-98.0)
    again = CellReading("neighbour", "LTE", arfcn=1300, pci=135, rsrp_dbm=-97.0)
    other = CellReading("neighbour", "LTE", arfcn=1300, pci=136, rsrp_dbm=-108.0)
    unnamed = CellReading("neighbour", "LTE", arfcn=1300, rsrp_dbm=-110.0)
    named = replace(other, mcc="262", mnc="02", cid=8, tac=9)
    assert each_once([serving, again, other, other, unnamed]) == (serving, other, unnamed)
    assert each_once([other, serving, named]) == (serving, named)
    assert each_once([replace(serving, rsrp_dbm=None), again]) == (
        replace(serving, rsrp_dbm=None),
        again,
    )
    assert each_once([named, replace(named, cid=10)]) == (named, replace(named, cid=10))
    scanned = replace(again, role="scan")
    assert each_once([serving, scanned]) == (serving, scanned)
