"""The row language of all drivers: which values a row has, and the cell that they describe.

    form("GSM", "mcc mnc lac cid16 bsic! arfcn! _ rxlev! c1 [c2 ta]")

A form names the values of a row in their order; `_` is one that is not read, and `_name` a number
that is not read. From `[` on a row may end, and behind `...` others may follow. A name with `!`
must fit (be readable, or a mark for unknown), one with `*` must be known: they prove the order,
since a comma lost or added moves another value there. In a strict form every value must look like
one of its kind. Rows with labels or columns are searched for in a line (`listed_row`,
`labelled_row`).

What a name means stands in `values_like`; a family adds what only its modems print. An identity is
read completely or not at all.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    decimal,
    hexadecimal,
    level,
    network,
    rscp_dbm,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)
from logger.drivers.reading.number_text import NumberForm, NumberText

_FLAGS = re.ASCII | re.IGNORECASE
_SIGNED = r"[-+]?\d{1,4}(?:\.\d{1,2})?"
_SHORT = r"[-+]?\d{1,3}(?:\.\d{1,2})?"
_WIDEST = 4
_BESIDE = "more."
_UNKNOWN = frozenset({"", "-", "x", "255", "65535", "-32768", "-1920"})
_NO_VALUE = re.compile(r"-*")


class Value(NamedTuple):
    """A value that rows contain: an attribute of a reading, its reader, the texts of its kind.

    An attribute that begins with `more.` is a key of `CellReading.more`; an empty one is not kept.
    An index keeps its number there too: `raw` are its key and reader.
    """

    attribute: str
    read: Callable[[str], Any]
    pattern: str = _SIGNED
    raw: tuple[str, Callable[[str], Any]] | None = None


Kinds = Mapping[str, Value]


def between(low: int, high: int) -> Callable[[str], int | None]:
    """Reader of a decimal integer in [low, high]."""
    return partial(decimal, low=low, high=high)


def number(attribute: str, low: int, high: int) -> Value:
    """A decimal integer in [low, high]."""
    width = max(len(str(abs(bound))) for bound in (low, high))
    return Value(attribute, between(low, high), rf"{'-?' if low < 0 else ''}\d{{1,{width}}}")


def padded_number(attribute: str, high: int, width: int, pattern: str | None = None) -> Value:
    """A decimal integer from 0 that some firmware pads to a width, which shows a lost digit."""
    full = NumberForm(10, frozenset({width}))

    def read(text: str) -> int | None:
        found = decimal(text, 0, high) if len(text) <= _WIDEST else None
        return None if found is None else NumberText(found, text, full)

    return Value(attribute, read, pattern or rf"\d{{1,{width}}}")


def _network_code(text: str) -> str | None:
    return network("001", text)[1]


def values_like(levels: str = _SIGNED, padding: str = "(?:0x)?0*") -> Kinds:
    """All values by the names that forms use; `_10` are decimal identities.

    The patterns of levels, and of what may stand before a hexadecimal number, are a firmware's.
    """

    def code(attribute: str, bits: int, base: int = 16) -> Value:
        read = cell_identity if attribute == "cid" else area
        digits = rf"{padding}[0-9A-F]{{1,{bits // 4}}}" if base == 16 else r"\d{1,11}"
        return Value(attribute, partial(read, bits=bits, base=base), digits)

    def ratio(low: float, high: float) -> Callable[[str], float | None]:
        return partial(level, low=low, high=high)

    return {
        "mcc": Value("mcc", between(0, 999), r"\d{3}"),
        "mnc": Value("mnc", _network_code, r"\d{2,3}"),
        "lac": code("lac", 16),
        "tac": code("tac", 16),
        "tac24": code("tac", 24),
        "cid16": code("cid", 16),
        "cid28": code("cid", 28),
        "cid36": code("cid", 36),
        "lac_10": code("lac", 16, 10),
        "tac_10": code("tac", 16, 10),
        "cid16_10": code("cid", 16, 10),
        "cid28_10": code("cid", 28, 10),
        "arfcn": number("arfcn", 0, 1023),  # 3GPP TS 45.005 2
        "uarfcn": number("arfcn", 0, 16383),  # 25.101 5.4.3
        "earfcn": number("arfcn", 0, 262143),  # 36.101 5.7.3
        "nrarfcn": number("arfcn", 0, 3279165),  # 38.104 5.4.2.1
        "band": number("band", 1, 255),
        "bsic": number("bsic", 0, 63),
        "psc": number("psc", 0, 511),
        "pci": number("pci", 0, 503),
        "pci_nr": number("pci", 0, 1007),
        "pci_hex": Value("pci", partial(hexadecimal, low=0, high=1007), r"[0-9A-F]{1,3}"),
        "rssi": Value("rssi_dbm", rssi_dbm, levels),
        "rxq": number("rxq", 0, 7),  # 45.008 8.2.4
        "ta": number("ta", 0, 63),  # 45.010 5.4
        "c1": number("c1", -255, 255),
        "c2": number("c2", -255, 255),
        "rscp": Value("rscp_dbm", rscp_dbm, levels),
        "ecn0": Value("ecio_db", ratio(-32.0, 0.0), levels),
        "ecio": Value("ecio_db", ratio(-40.0, 0.0), levels),
        "rsrp": Value("rsrp_dbm", rsrp_dbm, levels),
        "rsrq": Value("rsrq_db", rsrq_db, levels),
        "sinr": Value("sinr_db", ratio(-23.0, 40.0), levels),  # 38.133 10.1.16
        "snr": Value("sinr_db", ratio(-30.0, 50.0), levels),  # as modems print it
    }


VALUES = values_like()
_NETWORK = frozenset({"mcc", "mnc"})
_AREA_AND_CELL = frozenset({"lac", "tac", "cid"})


@dataclass(frozen=True, slots=True)
class Form:
    """Values of a row by name. `least` is how many a row has that is not cut."""

    rat: Rat | None
    names: tuple[str, ...]
    kinds: Kinds
    fitting: frozenset[str]
    known: frozenset[str]
    least: int
    is_open: bool
    unknown: re.Pattern[str] | None

    def texts_by_name(self, texts: Sequence[str]) -> dict[str, str] | None:
        """Values of a row by their names, None for a row of another form."""
        if self._is_cut(texts):
            texts = texts[:-1]  # the last one may have lost its end
        named = dict(zip(self.names, texts, strict=False))
        if not (self.fitting | self.known) <= named.keys():
            return None
        if self.unknown and not self._is_well_formed(texts, named):
            return None
        fits = all(named[name] in _UNKNOWN or self._is_known(name, named) for name in self.fitting)
        return named if fits and all(self._is_known(name, named) for name in self.known) else None

    def cell(
        self,
        role: Role,
        texts: Sequence[str],
        more: Mapping[str, Any] | None = None,
        **values: Any,
    ) -> CellReading | None:
        """The cell of a row, with more `values`; None for a row of another form or without any."""
        named = self.texts_by_name(texts)
        if named is None:
            return None
        is_identified = not self._is_cut(texts) or _identity_of(self.names, self.kinds) <= {*named}
        if not is_identified:
            named = {name: text for name, text in named.items() if not _names(name, self.kinds)}
        return cell(role, self.rat, named, self.kinds, more, **values)

    def _is_cut(self, texts: Sequence[str]) -> bool:
        is_short = len(texts) == self.least and not texts[-1] and not self.unknown
        return is_short or len(texts) < self.least

    def _is_well_formed(self, texts: Sequence[str], named: Mapping[str, str]) -> bool:
        is_long = len(texts) > len(self.names) and not self.is_open
        return len(texts) >= self.least and not is_long and self.looks_right(named)

    def looks_right(self, named: Mapping[str, str]) -> bool:
        """True where each value looks like one of its kind, or is unknown."""
        unknown = self.unknown or _NO_VALUE
        return all(
            unknown.fullmatch(text) or re.fullmatch(_pattern(name, self.kinds), text, _FLAGS)
            for name, text in named.items()
        )

    def _is_known(self, name: str, named: Mapping[str, str]) -> bool:
        return self.kinds[name].read(named[name]) is not None


def form(rat: Rat | None, names: str, kinds: Kinds = VALUES, unknown: str | None = None) -> Form:
    """The form of rows of one technology whose values have these names.

    With `unknown`, the pattern of a value that is not known, the form is strict.
    """
    required, _, spare = names.replace("]", "").partition("[")
    is_open = "..." in names
    marked = [word for word in f"{required} {spare}".split() if word != "..."]
    return Form(
        rat=rat,
        names=tuple(name.rstrip("!*") for name in marked),
        kinds=kinds,
        fitting=frozenset(name[:-1] for name in marked if name.endswith("!")),
        known=frozenset(name[:-1] for name in marked if name.endswith("*")),
        least=len(required.replace("...", "").split()),
        is_open=is_open,
        unknown=None if unknown is None else re.compile(unknown),
    )


def first_cell(
    forms: Sequence[Form],
    role: Role,
    texts: Sequence[str],
    more: Mapping[str, Any] | None = None,
) -> CellReading | None:
    """The cell of a row in the first form that it has."""
    fitting = (shape for shape in forms if shape.texts_by_name(texts))
    shape = next(fitting, None)
    return shape.cell(role, texts, more) if shape else None


def split(body: str) -> list[str]:
    """Values of a row; no value contains a comma, so a lost quotation mark does no harm."""
    return [text.strip(" \t\"'") for text in body.split(",")]


def _pattern(name: str, kinds: Kinds) -> str:
    return r".*" if name == "_" else _SHORT if name.startswith("_") else kinds[name].pattern


def read_values(named: Mapping[str, str], kinds: Kinds = VALUES) -> dict[str, Any]:
    """Values by attribute of a reading; names of no kind are left out."""
    values: dict[str, Any] = {}
    more: dict[str, Any] = {}
    for name, text in named.items():
        attribute = kinds[name].attribute if name in kinds else ""
        if attribute.startswith(_BESIDE):
            more[attribute.removeprefix(_BESIDE)] = kinds[name].read(text)
        elif attribute:
            values[attribute] = kinds[name].read(text)
        if name in kinds and (raw := kinds[name].raw):
            more[raw[0]] = raw[1](text)
    return values | ({"more": more} if more else {})


def identity(named: Mapping[str, str], kinds: Kinds = VALUES) -> dict[str, Any]:
    """Network, area and cell, or nothing: an area or a cell may be unknown but not damaged."""
    codes = {}
    if "mcc" in named:
        mcc, mnc = network(named["mcc"], named.get("mnc", ""))
        if mcc is None:
            return {}
        codes = {"mcc": mcc, "mnc": mnc}
    parts = {
        name: text for name, text in named.items() if name not in _NETWORK and _names(name, kinds)
    }
    return codes | read_values(parts, kinds) if _are_whole(parts, kinds) else {}


def _are_whole(parts: Mapping[str, str], kinds: Kinds) -> bool:
    return all(
        _NO_VALUE.fullmatch(text) or re.fullmatch(kinds[name].pattern, text, _FLAGS)
        for name, text in parts.items()
    )


def cell(
    role: Role,
    rat: Rat | None,
    named: Mapping[str, str],
    kinds: Kinds = VALUES,
    more: Mapping[str, Any] | None = None,
    **values: Any,
) -> CellReading | None:
    """The cell that texts by name describe, with more `values`; None where none is known."""
    others = {name: text for name, text in named.items() if not _names(name, kinds)}
    found = identity(named, kinds) | read_values(others, kinds)
    beside = found.pop("more", {})
    if all(value is None for value in (*found.values(), *beside.values(), *values.values())):
        return None
    return CellReading(role, rat, **found | values, more={**(more or {}), **beside})


def _names(name: str, kinds: Kinds) -> bool:
    """True for a part of the name of a cell."""
    return name in kinds and kinds[name].attribute in _NETWORK | _AREA_AND_CELL


def _identity_of(names: Sequence[str], kinds: Kinds) -> set[str]:
    return {name for name in names if name not in _NETWORK and _names(name, kinds)}


def area_values(rat: Rat | None, code: int | None) -> dict[str, Any]:
    """The area of a cell as `lac` of GSM and WCDMA, or as `tac` of later technologies."""
    return {"lac" if rat in {"GSM", "WCDMA"} else "tac": code}


def listed_row(names: str, kinds: Kinds, between: str = r"\s*,\s*") -> re.Pattern[str]:
    """Pattern of values in the order of words `name` or `label=name`; a group has the name.

    Here `_` is a hexadecimal number that is not read, and `_name` a decimal one.
    """
    words = (word.rpartition("=")[2] for word in names.split())
    return _row((_group(name, kinds) for name in words), between)


def labelled_row(labels: str, kinds: Kinds, between: str = r"\s*,\s*") -> re.Pattern[str]:
    """Pattern of `label: value` in the order of words `label=name`; `_` in a label is a blank."""
    words = (word.rpartition("=") for word in labels.split())
    parts = (
        rf"{re.escape((label or name).replace('_', ' '))}\s?:\s*{_group(name, kinds)}"
        for label, _, name in words
    )
    return _row(parts, between)


def _group(name: str, kinds: Kinds) -> str:
    if name.startswith("_"):
        return "[0-9A-F]{1,8}" if name == "_" else r"\d{1,5}"
    return rf"(?P<{name}>{kinds[name].pattern})"


def _row(parts: Any, between: str) -> re.Pattern[str]:
    return re.compile(r"(?<![\w.,-])" + between.join(parts) + r"(?![\w.])", _FLAGS)
