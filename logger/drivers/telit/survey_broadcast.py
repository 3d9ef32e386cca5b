"""What a Telit survey prints of a GSM cell behind its status: channels, neighbours, reselection.

    ... cellStatus: CELL_SUITABLE numArfcn: 2 arfcn: 30 48 numChannels: 5 array: 14 19 22 48 82
    ... pbcch: 0 mstxpwr: 5 rxaccmin: 8 croffset: 30 penaltyt: 0 t3212: 10 CRH: 4
    48,24,-52,0.00,610,1,33281,3648,0,2,30 48,5,14 19 22 48 82          the same by #CSURVC

The channels of the cell itself (Cell Channel Description) come first, those of its neighbours (BA
list) second; firmware prints more values behind them or not. A tail is read completely or not at
all: each list has the printed number of channels, and what follows stands in its order. Formats:
GM862 AT reference 80000ST10025a p376-386, LE910 V2 80446ST10707A p287-289.
"""

import re
from collections.abc import Iterator, Sequence

from logger.core.types import HIGHEST_ARFCN, MOST_NEIGHBOURS, Broadcast
from logger.drivers.reading.fields import decimal

_OWN, _NEIGHBOURS = ("numarfcn", "arfcn"), ("numchannels", "array")
_PACKET = (  # of a cell with GPRS; without it `pbcch` stands alone
    *("pbcch", "nom", "rac", "spgc", "pat", "nco", "t3168", "t3192", "drxmax", "ctrlack"),
    *("bscvmax", "alpha", "pcmeasch"),
)
_RESELECTION = ("mstxpwr", "rxaccmin", "croffset", "penaltyt", "t3212", "crh")
_ENDS = tuple(
    (*packet, *reselection)
    for packet in ((), _PACKET[:1], _PACKET)
    for reselection in ((), _RESELECTION)
)
"""What follows the neighbours in #CSURVC: each has another number of values."""

WORDS = " ".join((*_OWN, *_NEIGHBOURS, *_PACKET, *_RESELECTION))
"""Words in front of the values."""

_LABEL = re.compile(r" ?([A-Z]\w*) ?:([^:]*?)(?= [A-Z]\w* ?:|\Z)", re.ASCII | re.IGNORECASE)
_NUMBER = r"(?:0|[1-9]\d{0,3})"
_CHANNELS = re.compile(rf"{_NUMBER}(?: {_NUMBER})*", re.ASCII)
_VALUE = re.compile(r"-?\d{1,5}", re.ASCII)
_DB_OF_STEP = 2
"""Of the cell reselection offset, which is printed as its code 0 to 63 (3GPP TS 45.008 9.1)."""

_Pairs = Sequence[tuple[str, str]]


def labelled_broadcast(tail: str) -> Broadcast | None:
    """What stands behind the status in a line of #CSURV; None where it is not in the form."""
    text = " ".join(tail.split())
    pairs, end = [], 0
    while pair := _LABEL.match(text, end):
        pairs.append((pair[1].lower(), pair[2].strip()))
        end = pair.end()
    return None if text[end:] else _broadcast(pairs)


def listed_broadcast(tail: str) -> Broadcast | None:
    """The same for the values of #CSURVC."""
    before, *values = [" ".join(value.split()) for value in tail.split(",")]
    if before or not values:
        return None
    found = (_broadcast(pairs) for pairs in _namings(values))
    return next((broadcast for broadcast in found if broadcast is not None), None)


def _namings(values: Sequence[str]) -> Iterator[_Pairs]:
    """The values with names, in each of the forms that has so many."""
    own = _OWN if values[0] != "0" else _OWN[:1]
    forms = [(), _RESELECTION]
    forms += [(*lists, *end) for lists in (_NEIGHBOURS, _NEIGHBOURS[:1]) for end in _ENDS]
    for names in ((*own, *form) for form in forms):
        if len(names) == len(values):
            yield list(zip(names, values, strict=True))


def _broadcast(pairs: _Pairs) -> Broadcast | None:
    """What named values contain; None where one is damaged, missing or too much."""
    names, named = tuple(name for name, _ in pairs), dict(pairs)
    own, rest = _take_list(names, named, _OWN)
    neighbours, end = _take_list(rest, named, _NEIGHBOURS)
    in_order = iter((*_PACKET, *_RESELECTION))
    if own is None or (neighbours is None and rest != end):
        return None
    if not all(name in in_order and _VALUE.fullmatch(named[name]) for name in end):
        return None
    offset = decimal(named.get("croffset", ""), 0, 63)
    found = Broadcast(
        neighbour_arfcns=neighbours,
        cro_db=None if offset is None else _DB_OF_STEP * offset,
        penalty_time=decimal(named.get("penaltyt", ""), 0, 31),
        t3212_raw=decimal(named.get("t3212", ""), 0, 255),
    )
    return None if found == Broadcast() else found


def _take_list(
    names: tuple[str, ...], named: dict[str, str], labels: tuple[str, str]
) -> tuple[tuple[int, ...] | None, tuple[str, ...]]:
    """The channels behind their number, and the names that follow.

    None instead of the channels where the list is damaged, and the same names where there is none.
    """
    count, channels = labels
    if names[:1] != (count,):
        return None, names
    n_taken = 2 if names[1:2] == (channels,) else 1
    return _channels(named[count], named.get(channels, "")), names[n_taken:]


def _channels(count: str, text: str) -> tuple[int, ...] | None:
    """Exactly `count` different channels; each stands once in the list of a cell."""
    number = decimal(count, 0, MOST_NEIGHBOURS)
    words = text.split() if _CHANNELS.fullmatch(text) else []
    found = tuple(map(int, words))
    if number is None or (text and not words) or len(set(found)) != number:
        return None
    return found if len(found) == number and max(found, default=0) <= HIGHEST_ARFCN else None
